"""Derivatives of the times of instants (events).

The root of a function g(q, v, t, p) of the motion has the derivative

    dt*/dθ = −(g_x S + g_θ) / (g_x f + g_t).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.integrate.phases import Phases
from lagcli.engine.sensitivity.changes import Change, PerturbedState
from lagcli.engine.sensitivity.linearized_constraints import velocity_changes
from lagcli.engine.sensitivity.modal_tangent import motion_change, sliding_change

#: Rates below this, relative to the function's size over the run, mean that it only touches zero.
_GRAZES = 1e-6
#: Relative difference of times that counts as equal; changes that count as zero, of the run's
#: length.
_ALIKE, _NONE = 1e-6, 1e-9


class InstantTime(NamedTuple):
    """Derivative of the time of an instant.

    Parameters
    ----------
    change : (n,) array
        Derivative, s; NaN in directions without one.
    of_events : dict of int to (n,) array
        The same for each model event whose condition has become true.
    reason : str
        Why there is no derivative; empty if there is one.
    """

    change: Array
    of_events: dict[int, Array]
    reason: str


def instant_time(
    at: PerturbedState, run: Phases, numbers: Sequence[int], span: float
) -> InstantTime:
    """Return the derivative of the time at which monitored functions vanish.

    Parameters
    ----------
    at : PerturbedState
        Its change at a fixed time.
    run : Phases
        The modes before the instant.
    numbers : sequence of int
        Numbers of the functions, as in ``Phases.values``.
    span : float
        Span of the run, s.
    """
    n, a = at.change.directions, run.motion.accelerations(at.t, at.q, at.v)[0]
    along = Change(np.ones(1), at.v[:, None], a[:, None], np.zeros((len(at.change.p), 1)))
    slopes = _slopes(at._replace(change=at.change.beside(along)), run, numbers)
    times, of_events = np.zeros((len(numbers), n)), dict[int, Array]()
    grazing, shared = list[int](), list[int]()
    decisive = [k for k, number in enumerate(numbers) if _decides(run, number)]
    for k, number in enumerate(numbers):
        rate, size = slopes[k, n], run.size_of(number)
        if _is_shared(run, number):
            times[k] = np.nan
            shared.append(k)
        elif abs(rate) * span <= _GRAZES * size:
            still = np.abs(slopes[k, :n]) <= _GRAZES * _NONE * size
            times[k] = np.where(still, 0.0, np.nan)
            if k in decisive and not still.all():
                grazing.append(k)
        else:
            times[k] = -slopes[k, :n] / rate
        if number >= len(run.watched):
            of_events[run.conditions.numbers[number - len(run.watched)]] = times[k]
    if not decisive:
        return InstantTime(times[0] if len(numbers) else np.zeros(n), of_events, "")
    found, reason = times[decisive[0]], ""
    names = list(dict.fromkeys(_name(run, numbers[k]) for k in decisive))
    if grazing:
        reason = f"{_name(run, numbers[grazing[0]])} is only touched, without a rate, and the time"
        reason += " has no derivative"
        found = np.where(np.isnan(times[decisive]).any(axis=0), np.nan, found)
    if shared:
        reason = f"{_name(run, numbers[shared[0]])} shares its force with others, so that the time"
        reason += " has no derivative"
        found = np.full(n, np.nan)
    apart = np.ptp(times[decisive], axis=0)
    apart = apart > _ALIKE * np.abs(times[decisive]).max(axis=0) + _NONE * span
    if apart.any():
        reason = f"{' and '.join(names)} occur simultaneously, and their order decides what follows"
        found = np.where(apart, np.nan, found)
    return InstantTime(found, of_events, reason)


def _decides(run: Phases, number: int) -> bool:
    """Return whether a function affects the motion."""
    if number < len(run.watched):
        return True
    rule = run.switching.events[run.conditions.numbers[number - len(run.watched)]]
    return bool(rule.targets or rule.impulses or rule.release or rule.engage or rule.stop)


def _is_shared(run: Phases, number: int) -> bool:
    """Return whether a mode ends by a multiplier that is not unique."""
    return (
        run.motion.redundant
        and number < len(run.watched)
        and run.watched[number].kind in ("force", "stick")
    )


def _name(run: Phases, number: int) -> str:
    """Return the name of a function in messages."""
    if number >= len(run.watched):
        rule = run.conditions.numbers[number - len(run.watched)]
        return f"`{run.switching.events[rule].name}`"
    kind, k = run.watched[number]
    if kind not in ("above", "below"):
        return f"`{run.system.constraints[run.rows[k].row]}`"
    assert run.branches is not None
    names = run.branches.kinks[k].names or ("t",)
    return "the kink of a function of " + ", ".join(f"`{name}`" for name in names)


def _slopes(at: PerturbedState, run: Phases, numbers: Sequence[int]) -> Array:
    """Return derivatives of event functions, (len(numbers), n)."""
    position, velocity = at.constraints().position, velocity_changes(at)
    reached = motion_change(at)
    inputs = run.motion.inputs(at.t, at.q, at.v, reached.a, reached.multipliers)
    changes = at.change.inputs([reached.da, reached.dmultipliers])
    kinks = at.along("kinks")
    force_conditions = at.system.along("force_conditions", inputs, changes)
    conditions = np.concatenate([at.along("conditions"), force_conditions])
    of_limits = at.system.along("limits", inputs, changes)
    found = np.zeros((len(numbers), at.change.directions))
    for i, number in enumerate(numbers):
        if number >= len(run.watched):
            found[i] = run.conditions.values(conditions)[number - len(run.watched)]
            continue
        kind, k = run.watched[number]
        if kind in ("above", "below"):
            slides = run.branches is not None and k == run.branches.slides
            found[i] = kinks[k] if not slides else sliding_change(at).dweight
            continue
        row = run.rows[k]
        if kind == "gap":
            found[i] = position[run.system.holonomic.index(row.row)]
        elif kind == "slip":
            found[i] = velocity[row.row]
        elif kind == "force":
            found[i] = reached.dmultipliers[row.row]
        elif kind == "stick":
            assert row.limit is not None
            side = np.sign(reached.multipliers[row.row])
            found[i] = of_limits[row.limit] - side * reached.dmultipliers[row.row]
    return found
