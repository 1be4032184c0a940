"""Checks before a run with switching: contacts at the initial state, coefficients, clocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.scales import least_scales
from lagcli.engine.switching.switching import SwitchedRow, Switching, clocks_of
from lagcli.engine.system import State, System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.degrees_of_freedom import RedundantSet
from lagcli.equations.derivation.lagrange import Equations
from lagcli.errors import Diagnostic, ModelError, UsageError
from lagcli.model.locations import ExpressionLocations
from lagcli.model.model import Model, multiplier
from lagcli.model.yaml.source import Scalar
from lagcli.settings.settings import DEFAULTS, Settings

#: Of the largest product: changes of forces that are rounding errors.
_ROUNDING = 1e-9
#: Of the duration of a run: how long velocities and accelerations act in the scale of a gap.
_HORIZON = 1e-3


def ambiguous_forces(
    system: System, state: State, redundant: Sequence[RedundantSet]
) -> tuple[str, ...]:
    """Return a warning if forces depend on multipliers that are not unique.

    Parameters
    ----------
    system : System
        With ``switching``.
    state : State
        On the constraints.
    redundant : sequence of RedundantSet
    """
    assert system.switching is not None
    forces, pattern = system.switching.forces, system.switching.force_pattern
    used = {system.constraints[constraint] for _, constraint in pattern}
    sets = [x for x in redundant if used.intersection(x.constraints)]
    if forces is None or not sets:
        return ()
    # the dependence at velocities and forces that are not zero
    random = np.random.default_rng(8)
    others = random.normal(size=2 * len(state.q) + len(system.constraints))
    inputs = (state.t, *state.q, *others, *state.p)
    values = np.array(ScalarTape(forces)(inputs)[len(system.switching.force_coordinates) :])
    slopes = np.zeros((len(system.switching.force_coordinates), len(system.constraints)))
    slopes[tuple(np.transpose(pattern))] = values
    jacobian = Evaluator(system, state.p).constraints(state.t, state.q, state.v).jacobian
    for found in sets:
        rows = [system.constraints.index(name) for name in found.constraints]
        lengths = np.linalg.norm(jacobian[rows], axis=1)
        lengths[lengths == 0.0] = 1.0
        left, _, _ = np.linalg.svd(jacobian[rows] / lengths[:, None])
        free = left[:, len(rows) - found.surplus :] / lengths[:, None]
        largest = np.abs(slopes[:, rows]) @ np.abs(free)
        if (np.abs(slopes[:, rows] @ free) > _ROUNDING * largest).any():
            names = [f"`lambda.{name}`" for name in found.constraints if name in used]
            listed = ", ".join(f"`{name}`" for name in found.constraints)
            return (
                f"`Q` depends on {', '.join(names)}, which {'is' if len(names) == 1 else 'are'} not"
                f" unique, because {listed} are redundant: the motion follows from multipliers of"
                " least norm; remove redundant constraints",
            )
    return ()


def check_contacts(model: Model, system: System, state: State, closed: float) -> None:
    """Check the contacts of a System at the initial state.

    Parameters
    ----------
    model : Model
    system : System
        With ``switching``.
    state : State
    closed : float
        Gap below which a contact counts as closed, relative to the scale of its φ: of its terms, or
        of the motion, if the terms vanish.

    Raises
    ------
    ModelError
        A contact is violated, or a coefficient or a limit is negative.
    """
    assert system.switching is not None
    if not system.switching.rows:
        return
    evaluator = Evaluator(system, state.p)
    constraints = evaluator.constraints(state.t, state.q, state.v)
    errors = []
    places = {row: n for n, row in enumerate(system.holonomic)}
    for row in system.switching.rows:
        if not row.sign or not row.active:
            continue
        place = places[row.row]
        gap = row.sign * constraints.position[place]
        if gap < -closed * constraints.position_scale[place] and gap < -closed * _scale(
            model, evaluator, state, row.row
        ):
            slopes = row.sign * constraints.jacobian[row.row]
            errors.append(_violated(model, row, gap, slopes))
    errors += _bad_coefficients(model, system.switching, state)
    if errors:
        errors.sort(key=lambda d: (d.location.line, d.location.column) if d.location else (0, 0))
        raise ModelError(errors)


def _scale(model: Model, evaluator: Evaluator, state: State, row: int) -> float:
    """Return the scale of a gap by the size of the system and by how far the gap moves.

    In a state that a run has reached, all terms of a gap may be rounding errors.
    """
    c = evaluator.constraints(state.t, state.q, state.v)
    d = evaluator.dynamics(state.t, state.q, state.v)
    inertia, b = evaluator.system.inertia(np.diag(d.mass_matrix)), c.jacobian[row]
    own = float(least_scales(inertia, b[None], state.q)[0])
    end = model.settings.t_end or DEFAULTS.t_end or 0.0
    time = _HORIZON * abs(end - state.t)
    compliance = np.divide(1.0, inertia, out=np.zeros(len(inertia)), where=inertia > 0)
    fall = float(np.abs(b) @ (compliance * np.abs(d.forcing)))
    return max(own, c.velocity_scale[row] * time, fall * time**2 / 2)


def refuse_switching(equations: Equations, what: str, nonlinear: bool = False) -> None:
    """Reject models that switch, for functions defined only without switching.

    Parameters
    ----------
    equations : Equations
    what : str
        Description of the function, in the plural.
    nonlinear : bool
        Whether constraints that are nonlinear in the velocities are also rejected.

    Raises
    ------
    UsageError
        The model has contacts, limits or events, or forces that depend on multipliers.
    """
    model = equations.model
    curved = [c for c in model.constraints if c.kind == "nonlinear"] if nonlinear else []
    location = None
    if model.switches:
        leaving = [c for c in model.constraints if not c.lasting]
        if leaving:
            why = f"constraints that hold at all times, but `{leaving[0].name}` does not"
            location = leaving[0].location
        else:
            why = f"a model without events, but `{model.events[0].name}` is one"
            location = model.events[0].location
        help_ = "write contacts that stay closed with `=`, and remove friction and events"
    elif any(x != 0 for x in equations.reactive_forces):
        why = "forces that do not depend on multipliers, but those under `Q` do"
        places = ExpressionLocations(model)
        location = places.location(places.entry("Q"))
        help_ = "remove the forces with `lambda`"
    elif curved:
        why = f"constraints that are linear in the velocities, but `{curved[0].name}` is not"
        location = curved[0].location
        help_ = "use the first kind, which permits any constraint"
    else:
        return
    raise UsageError(Diagnostic("not-supported", f"{what} need {why}", location, help_))


def refuse_nonlinear_impulses(model: Model, what: str) -> None:
    """Reject models whose impulses may take velocities off a constraint nonlinear in them.

    A run ends at such an impulse; what has only the law of impulses, which is linear, would go on.

    Parameters
    ----------
    model : Model
    what : str
        What would go on, in the singular.

    Raises
    ------
    UsageError
    """
    curved = next((c for c in model.constraints if c.kind == "nonlinear"), None)
    strikes = [(f"the contact `{c.name}`", c.location) for c in model.constraints if c.sign]
    strikes += [
        (f"the event `{event.name}`", event.location)
        for event in model.events
        if event.action.impulse or event.action.engage
    ]
    if curved is None or not strikes:
        return
    source, location = strikes[0]
    raise UsageError(
        Diagnostic(
            "not-supported",
            f"{what} cannot have impulses, as of {source}, beside `{curved.name}`: its reaction to"
            " them is not determined, since it is nonlinear in the velocities",
            location,
            "let a force act for a short time in `Q`, or `simulate` the model, which ends at such"
            " an impulse",
        )
    )


def model_at_start(model: Model, held: tuple[str, ...]) -> Model:
    """Return a model whose constraints are those active at the initial state."""
    multipliers = {multiplier(name) for name in model.constraint_names}
    forces = {
        name: force
        for name, force in model.applied_forces.items()
        if multipliers.isdisjoint(force.free_symbols)
    }
    kept = (c for c in model.constraints if c.name in held)
    constraints = tuple(c._replace(relation="=", limit=None, active=True) for c in kept)
    return replace(
        model,
        constraints=constraints,
        applied_forces=forces,
        events=(),
        outputs={},
        closed=frozenset(),
    )


def true_at_start(system: System, state: State) -> tuple[str, ...]:
    """Return a note for each event whose condition is true initially, so that it does not trigger.

    Conditions on forces are not checked.

    Parameters
    ----------
    system : System
    state : State
        The initial state.
    """
    if system.switching is None or system.events is None:
        return ()
    values = ScalarTape(system.events)((state.t, *state.q.tolist(), *state.v.tolist(), *state.p))
    return tuple(
        f"the condition of event `{rule.name}` holds at the start: it happens when the condition"
        " becomes true again"
        for rule in system.switching.events
        if rule.condition is not None
        and rule.condition < len(values)
        and not rule.either
        and values[rule.condition] >= 0
    )


def held_at(system: System, start: ConsistentState, closed: float) -> tuple[list[int], int]:
    """Return the active constraints at the start, and the rank of their rows of B.

    These are the permanent ones, and closed contacts without normal velocity. Sticking of friction
    is not considered.

    Parameters
    ----------
    system : System
        With ``switching``.
    start : ConsistentState
    closed : float
        See `check_contacts`.
    """
    assert system.switching is not None
    state = start.state
    evaluator, q, v = Evaluator(system, state.p), state.q, state.v
    constraints = evaluator.constraints(state.t, q, v)
    rates, scales = constraints.velocity(v), constraints.velocity_scale
    rows = set(system.held_at_start)
    places = {row: n for n, row in enumerate(system.holonomic)}
    for row in system.switching.rows:
        if row.sign and row.active:
            place = places[row.row]
            gap = abs(constraints.position[place])
            touches = gap <= closed * constraints.position_scale[place]
            if touches and abs(rates[row.row]) <= closed * scales[row.row]:
                rows.add(row.row)
    held = sorted(rows)
    if held == list(system.held_at_start):
        return held, start.rank
    sizes = evaluator.sizes(state.t, q, v)
    lengths = evaluator.row_lengths(state.t, q, v, constraints, sizes)[held]
    return held, dense.count_rank(constraints.jacobian[held], scale=lengths, sizes=sizes)


def _violated(model: Model, row: SwitchedRow, gap: float, slopes: Array) -> Diagnostic:
    """Return the error for a contact that is violated."""
    constraint = model.constraints[row.row]
    name = constraint.name
    node = ExpressionLocations(model).entry("constraints", name)
    written = " ".join(node.value.split()) if isinstance(node, Scalar) else name
    j = int(np.argmax(np.abs(slopes)))
    coordinate = model.coordinate_names[j]
    move = "raise" if slopes[j] > 0 else "lower"
    entry = model.initial_positions[coordinate]
    return Diagnostic(
        "violated-contact",
        f"`{name}` is violated by {row.amount(-gap)} at the start ({written})",
        entry.location,
        f"{move} `{coordinate}`, or write `{coordinate}: {{guess: {entry.value:.6g}}}` and"
        f" `{name}: closed`",
        ((f"`{name}` is declared here", constraint.location),),
    )


def _bad_coefficients(model: Model, switching: Switching, state: State) -> list[Diagnostic]:
    """Return errors for coefficients and limits that are out of range at the initial state."""
    inputs = (state.t, *state.q.tolist(), *state.v.tolist())
    values = ScalarTape(switching.impact)((*inputs, *state.p))
    unilateral = [row.row for row in switching.rows if row.sign]
    limited = [row.row for row in switching.rows if row.limit is not None]
    checked = [("restitution", i, x, 1.0) for i, x in zip(unilateral, values, strict=False)]
    checked += [
        ("friction", i, x, np.inf) for i, x in zip(limited, values[len(unilateral) :], strict=True)
    ]
    nothing = (0.0,) * (len(state.q) + len(model.constraints))
    limits = ScalarTape(switching.limits)((*inputs, *nothing, *state.p))
    checked += [
        ("limit", limited[k % len(limited)], x, np.inf)
        for k, x in enumerate(limits[: 2 * len(limited)])
    ]
    errors = []
    for field, i, x, most in checked:
        if not 0 <= x <= most:
            constraint = model.constraints[i]
            bounds = "not be negative" if most == np.inf else f"lie between 0 and {most:g}"
            errors.append(
                Diagnostic(
                    "bad-value",
                    f"`{field}` of constraint `{constraint.name}` is {x:.6g} at the start, and must"
                    f" {bounds}",
                    constraint.location,
                    "change the expression, or the parameters that it depends on",
                )
            )
    return errors


def check_clocks(model: Model, system: System, settings: Settings) -> None:
    """Raise ModelError if a clock's period is not positive, or too short for the times of a run."""
    if system.switching is None or system.switching.clocks is None:
        return
    clocks = [event.clock for event in model.events if event.clock is not None]
    values = clocks_of(system.switching, tuple(model.parameter_values.values()))
    span = settings.t_start, settings.t_end
    faults = [
        Diagnostic("clock", fault, clock.location, "give a longer time, as in `every: 10 ms`")
        for clock, value in zip(clocks, values, strict=True)
        if (fault := value.fault(span))
    ]
    if faults:
        raise ModelError(faults)
