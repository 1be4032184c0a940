"""Ends of runs at contacts, in words: from the core's statuses and contact problems."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli.engine.contract import Stop
from lagcli.engine.core.contact_problem import ContactLaw, ContactProblem, ContactSolution
from lagcli.engine.core.status import Status
from lagcli.engine.event_entries import CHANGES, EventEntries, Occurrence
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.switching.switching import EventRule, RowMode, SwitchedRow
from lagcli.engine.system import System

if TYPE_CHECKING:
    from lagcli.engine.constraints.initial import NoConsistentState


#: Times closer than this, relative, belong to one instant.
_SAME = 1e-9
#: Laws of impacts by their setting: names, what gains energy, and another law.
_LAWS = {
    "newton": ("Newton's law", " with friction", "use `impacts: poisson`"),
    "poisson": ("Poisson's law", "", "use `impacts: sequential`"),
    "sequential": ("one contact at a time", "", "use `impacts: poisson`"),
}


def gains_energy(
    t: float,
    contacts: Sequence[str],
    energy: float,
    law: str,
    friction: bool,
    equal_restitution: bool,
) -> Stop:
    """Return the end of a run at an impact whose law gains energy.

    Parameters
    ----------
    t : float
        s.
    contacts : sequence of str
        Names of the participating constraints; at least one.
    energy : float
        J.
    law : str
    friction : bool
        Whether the impact involves friction.
    equal_restitution : bool
        Whether all contacts have one coefficient of restitution.
    """
    name, why, remedy = _LAWS[law]
    why = why if friction else ""
    if not equal_restitution:
        why = " with different coefficients of restitution"
        remedy = "give its contacts the same `restitution`"
    return Stop(
        f"an impact at {_listed(contacts)} would gain {energy:.4g} J ({name}{why})"
        f" at t = {t:.9g} s: {remedy}"
    )


def no_impact(t: float, contacts: Sequence[str]) -> Stop:
    """Return the end of a run at an impact that has no solution."""
    return Stop(
        f"no velocities after the impact at t = {t:.9g} s satisfy the law of impacts at"
        f" {_listed(contacts)}; choose another one with `impacts`"
    )


def nonlinear_impulse(t: float, at: Sequence[str], constraints: Sequence[str]) -> Stop:
    """Return the end of a run at an impulse on constraints that are nonlinear in the velocities.

    The direction of their reaction changes with the velocities, during the impulse.

    Parameters
    ----------
    t : float
        s.
    at : sequence of str
        The event, or the contacts.
    constraints : sequence of str
    """
    return Stop(
        f"the reaction of {_listed(constraints)} to the impulse at {_listed(at)} at t = {t:.9g} s"
        " is not determined, since it is nonlinear in the velocities; let a force act for a short"
        " time in `Q`, or `set` velocities that satisfy it"
    )


def _listed(names: Sequence[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def no_motion(
    t: float, names: Sequence[str], problem: ContactProblem, motions: Sequence[ContactSolution]
) -> Stop:
    """Return the end of a run at a state without a motion that satisfies the laws of contact."""
    row = bearing(problem)
    return Stop(
        f"no motion is possible at `{names[row]}` at t = {t:.9g} s{_bound(problem, row)};"
        " reduce the friction, or give the bodies some compliance"
    )


def two_motions(
    t: float, names: Sequence[str], problem: ContactProblem, motions: Sequence[ContactSolution]
) -> Stop:
    """Return the end of a run at a state with two motions that satisfy the laws of contact."""
    row = bearing(problem)
    undetermined = _dependent(problem)
    if undetermined:
        distribution = ", or ".join(
            ", ".join(f"lambda.{names[j]} = {x.force[j]:.6g}" for j in undetermined)
            for x in motions[:2]
        )
        return Stop(
            f"the friction at {_listed([names[j] for j in undetermined])} is not determined at"
            f" t = {t:.9g} s: these constraints are redundant, and friction depends on how they"
            f" share the force ({distribution}); remove redundant constraints, or their friction"
        )
    if problem.laws[row] == ContactLaw.FREE:
        forces = ", ".join(f"lambda = {x.force[row]:.6g}" for x in motions)
        return Stop(
            f"{len(motions)} solutions for the friction at `{names[row]}` at t = {t:.9g} s: jamming"
            f" ({forces}){_bound(problem, row)}; reduce the friction"
        )
    ways = ", or ".join(_way(problem, names, row, x) for x in motions[:2])
    return Stop(
        f"two motions are possible at `{names[row]}` at t = {t:.9g} s: {ways}"
        f"{_bound(problem, row)}; reduce the friction, or give the bodies some compliance"
    )


def jammed(slipping: Sequence[SwitchedRow]) -> int:
    """Return the constraint whose force grows without bound while rows slip."""
    first = slipping[0]
    return first.row if first.normal is None else first.normal


def jams(t: float, system: System, slipping: Sequence[SwitchedRow]) -> Stop:
    """Return the end of a run in which a contact force grows without bound while rows slip."""
    name = system.constraints[jammed(slipping)]
    return Stop(
        f"lambda.{name} grows without bound while it slides (dynamic jam) at t = {t:.9g} s; the"
        " motion beyond is not determined"
    )


def bearing(problem: ContactProblem) -> int:
    """Return the row whose friction is closest to its bound."""
    carriers = np.flatnonzero((problem.kinetic_slopes != 0).any(axis=0))
    if not len(carriers):
        return 0
    return int(max(carriers, key=lambda j: _excess(problem, int(j))))


def _dependent(problem: ContactProblem) -> list[int]:
    """Return the rows that limit friction and whose forces are not unique without it."""
    carriers = np.flatnonzero((problem.kinetic_slopes != 0).any(axis=0))
    own = problem.matrix[np.ix_(carriers, carriers)]
    scale = np.sqrt(np.maximum(np.diag(own), 0.0))
    scaled = own / np.outer(np.where(scale > 0, scale, 1.0), np.where(scale > 0, scale, 1.0))
    values, vectors = np.linalg.eigh(scaled) if len(own) else (np.empty(0), np.empty((0, 0)))
    free = vectors[:, values < _SAME]
    return [int(j) for j, part in zip(carriers, np.abs(free), strict=True) if (part > _SAME).any()]


def _friction(problem: ContactProblem, row: int) -> tuple[int, float]:
    """Return the row that a force limits most, and the coefficient."""
    k = int(np.argmax(problem.kinetic_slopes[:, row]))
    return k, float(problem.kinetic_slopes[k, row])


def _excess(problem: ContactProblem, row: int) -> float:
    k, mu = _friction(problem, row)
    own = problem.matrix[row, row]
    return float(mu * abs(problem.matrix[row, k]) / own) if own else 0.0


def _bound(problem: ContactProblem, row: int) -> str:
    """Return a sentence that compares the friction with Painlevé's bound, if it is exceeded."""
    if not (problem.kinetic_slopes[:, row] != 0).any():
        return ""
    excess, (_, mu) = _excess(problem, row), _friction(problem, row)
    if excess <= 1:
        return ""
    return f"; mu = {mu:.6g} is beyond the bound {mu / excess:.4g} here (Painlevé)"


def _way(problem: ContactProblem, names: Sequence[str], row: int, motion: ContactSolution) -> str:
    if motion.modes[row] == RowMode.OPEN:
        return f"it opens ({names[row]}'' = {abs(motion.motion[row]):.6g})"
    k, _ = _friction(problem, row)
    how = {
        int(RowMode.FORWARD): "slides forwards",
        int(RowMode.BACKWARD): "slides backwards",
    }.get(int(motion.modes[k]), "sticks")
    return f"it {how} (lambda = {motion.force[row]:.6g})"


def check_engagement(t: float, name: str, gap: float, row: SwitchedRow, none: float) -> None:
    """Stop a run whose event engages a violated holonomic constraint.

    Parameters
    ----------
    t : float
        s.
    name : str
    gap : float
        φ.
    row : SwitchedRow
        Whether a contact is engaged, which may be open.
    none : float
        The tolerance of the gap: ``closed`` times the largest size of φ so far.

    Raises
    ------
    Stop
    """
    if (-row.sign * gap if row.sign else abs(gap)) <= none:
        return
    raise Stop(
        f"`{name}` cannot be engaged at t = {t:.9g} s, phi = {row.amount(gap)}: engage it where"
        " phi = 0, or set the coordinates in the same event"
    )


def unresolved(before: float, after: float, what: str) -> Stop:
    """Return the end of a run in a step in which the sign of a function cannot be determined.

    Parameters
    ----------
    before, after : float
        The ends of the step, s.
    what : str
        A phrase for the function.
    """
    return Stop(
        f"the sign of {what} cannot be determined between t = {before:.9g} and {after:.9g} s: it"
        " stays within rounding errors of zero there, or changes too often"
    )


def sets_violation(t: float, name: str, depth: float, row: SwitchedRow) -> Stop:
    """Return the end of a run whose event moves a contact beyond its surface."""
    return Stop(
        f"an event violates `{name}` by {row.amount(depth)} at t = {t:.9g} s: set coordinates that"
        " satisfy it"
    )


def contradicting_values(
    system: System,
    t: float,
    rule: EventRule,
    values: Sequence[float],
    error: NoConsistentState,
) -> Stop:
    """Return the end of a run whose event sets values that contradict the constraints.

    Parameters
    ----------
    system : System
    t : float
        s.
    rule : EventRule
    values : sequence of float
        Of ``rule.targets``.
    error : NoConsistentState
    """
    names = {"q": system.coordinates, "v": system.coordinates, "p": system.parameters}
    given = ", ".join(
        f"{names[what][index]}{chr(39) * (what == 'v')} = {value:.6g}"
        for (what, index), value in zip(rule.targets, values, strict=True)
    )
    own = {
        f"{system.coordinates[index]}{chr(39) * (what == 'v')}"
        for what, index in rule.targets
        if what != "p"
    }
    earlier = ", ".join(name for name in error.stuck if name not in own)
    violated = [x.constraint for x in error.violations]
    one = len(violated) == 1
    others = "other coordinates" if error.level == "position" else "other velocities"
    worst = max(error.violations, key=lambda x: x.relative)
    return Stop(
        f"event `{rule.name}` sets {given} at t = {t:.9g} s"
        + (f", where another event sets {earlier}" if earlier else "")
        + f", and no {others} nearby satisfy the constraint{'' if one else 's'}"
        f" {_listed(violated)} (`{worst.constraint}`: residual {worst.residual:.3g}); set values"
        f" that satisfy {'it' if one else 'them'}, or fewer values",
        constraints=tuple(violated),
    )


def endless(t: float, system: System, entries: EventEntries, unlogged: Sequence[str] = ()) -> Stop:
    """Return the end of a run with an infinite sequence of events at one time.

    Parameters
    ----------
    t : float
        s.
    system : System
    entries : EventEntries
        The log.
    unlogged : sequence of str
        What may repeat without an entry in the log.
    """
    assert system.switching is not None
    listed = []
    for k in np.flatnonzero(entries.part("time") >= t - _SAME * abs(t)).tolist():
        entry = entries[k]
        if entry.occurrence == "event":
            listed.append(f"`{system.switching.events[entry.which].name}`")
        else:
            change = CHANGES.get(entry.occurrence, entry.occurrence)
            listed.append(f"`{system.constraints[entry.which]} {change}`")
    listed = listed or list(unlogged)
    return Stop(f"events do not end at t = {t:.9g} s: {', '.join(dict.fromkeys(listed))}")


def at_surfaces(status: int, t: float, kinks: Sequence[Sequence[str]]) -> Stop:
    """Return the end of a run at surfaces where the motion does not continue uniquely.

    Parameters
    ----------
    status : Status
        SURFACES, FORKED, NO_SIDE or CORNER.
    t : float
        s.
    kinks : sequence of sequences of str
        Names on which the function of each kink depends.
    """
    each = dict.fromkeys(", ".join(f"`{name}`" for name in names) or "time" for names in kinks)
    where = " and ".join(each)
    if status == Status.SURFACES:
        return Stop(
            f"at t = {t:.9g} s forces jump at {len(kinks)} surfaces ({'; '.join(each)}) and push"
            " onto them from both sides: write each `sign` of a velocity as a constraint with"
            " `limit`, as in `friction: {expr: x' = 0, limit: F}`"
        )
    if status == Status.FORKED:
        return Stop(
            f"at t = {t:.9g} s two motions are possible: the forces jump at a surface of {where},"
            " and push away from it on both sides; start on one side"
        )
    if status == Status.NO_SIDE:
        return Stop(
            f"at t = {t:.9g} s a force in Q or a limit jumps with a multiplier, and with the force"
            " of either side the multiplier is on the other: there is no solution; smooth the jump,"
            " for instance with `tanh`"
        )
    return Stop(
        f"a constraint has a corner at t = {t:.9g} s, where a branch of {where} changes and the"
        " velocities jump; write it as two constraints, unilateral ones (`>=`) where it may leave"
    )


def refusal(
    split: SplitSystem,
    status: int,
    core: Any,
    impacts: str,
    log: EventEntries,
    branches: Sequence[Sequence[str]] = (),
) -> Stop:
    """Return the end of a run at a contact.

    Parameters
    ----------
    split : SplitSystem
    status : Status
        Status of the core.
    core : SwitchingIntegrator
    impacts : str
        The law of impacts.
    log : EventEntries
    branches : sequence of sequences of str
        Names on which each branch depends that changes at the instant.
    """
    t, rows = core.t, split.switching.rows
    names = [split.system.constraints[k] for k in split.rows]
    if status == Status.ENDLESS:
        return endless(t, split.system, log, _unlogged(names, rows, core, branches))
    if status == Status.VIOLATED:
        depth = {i: -core.contacts[0][i] for i, row in enumerate(rows) if row.sign}
        deepest = max(depth, key=lambda i: depth[i])
        return sets_violation(t, names[deepest], depth[deepest], rows[deepest])
    if status in (Status.GAINS, Status.NO_IMPACT):
        struck = {i: i < len(rows) and rows[i].sign for i in core.struck if not _slips(rows, i)}
        contacts = [names[i] for i, unilateral in struck.items() if unilateral]
        contacts = contacts or [names[i] for i in struck]
        if status == Status.NO_IMPACT:
            return no_impact(t, contacts)
        return gains_energy(t, contacts, core.gain[0], impacts, *core.gain[1:])
    if status == Status.JAMMED:
        slipping = [row for row, mode in zip(rows, core.modes, strict=False) if RowMode(mode).slips]
        return jams(t, split.system, slipping)
    taking, problem, motions = core.problem
    failure = two_motions if motions else no_motion
    return failure(t, [names[i] for i in taking], problem, motions)


def ending(split: SplitSystem, status: int, core: Any) -> tuple[Occurrence, int] | None:
    """Return the log's last entry for a run that ends at a contact: its kind, and the constraint.

    None if the motion is unique, as where an impact would gain energy.
    """
    if status == Status.JAMMED:
        rows = zip(split.switching.rows, core.modes, strict=False)
        return "jams", jammed([row for row, mode in rows if RowMode(mode).slips])
    if status in (Status.NO_MODE, Status.TWO_MODES):
        taking, problem, motions = core.problem
        kind: Occurrence = "two motions" if motions else "no motion"
        return kind, split.rows[taking[bearing(problem)]]
    if status == Status.NO_IMPACT:
        return "no motion", split.rows[core.struck[0]]
    return None


def _slips(rows: Sequence[SwitchedRow], i: int) -> bool:
    """Return whether a row of the layer is one of friction, or another with a limit."""
    return i < len(rows) and rows[i].limit is not None


def _unlogged(
    names: Sequence[str],
    rows: Sequence[SwitchedRow],
    core: Any,
    branches: Sequence[Sequence[str]],
) -> list[str]:
    """Return the causes of repeated changes at an instant that have no entry in the log."""
    gaps, speeds, _ = core.contacts
    approaching = [
        f"`{name} impacts`"
        for i, name in enumerate(names)
        if not _slips(rows, i)
        and (speeds[i] < 0.0 if i < len(rows) and rows[i].sign else speeds[i] != 0.0)
        and gaps[i] <= core.no_gap(i)
    ]
    changes = (", ".join(f"`{name}`" for name in of) or "time" for of in branches)
    return approaching + [f"a branch of {of} changes" for of in dict.fromkeys(changes)]
