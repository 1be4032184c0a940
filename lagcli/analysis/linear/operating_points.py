"""Operating points: the initial state, a state of a run, an equilibrium, a steady motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from lagcli.analysis.local.contact_mode import SwitchedModel
from lagcli.analysis.local.contacts import Acting, acting, check_determinate
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.operating_point import OperatingPoint
from lagcli.analysis.local.steady_terms import Given, nearest_steady_state
from lagcli.arrays import Indices
from lagcli.engine.contract import Block, Interrupted, Outcome
from lagcli.engine.event_entries import EventEntry
from lagcli.engine.system import State
from lagcli.errors import Diagnostic, NumericalError, UsageError
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides

_LISTED = 8


class Located(NamedTuple):
    """An operating point, and the equations that hold near it."""

    local: LocalEquations
    operating_point: OperatingPoint


def find_operating_point(
    model: Model,
    *,
    at: float | None,
    equilibrium: bool,
    steady: Given | None,
) -> Located:
    """Return the requested operating point, by default the initial state; see `linearize`.

    Of a model with contacts, the equations are those of the mode at the point.

    Raises
    ------
    UsageError
        Two points are requested, or a velocity cannot be prescribed.
    ModelError, NumericalError
        There is no consistent initial state, no equilibrium, or the run does not reach the time;
        or a contact there has no certain mode, so that no linear model exists.
    """
    if at is not None and (equilibrium or steady):
        raise UsageError(
            "--at takes the state of a run, --equilibrium and --steady take another one; choose one"
        )
    if equilibrium or steady:
        nearest = nearest_steady_state(model, steady or {})
        located = Located(nearest.local, nearest.operating_point)
    elif model.switches:
        located = _in_run(SwitchedModel(model), at)
    else:
        local = LocalEquations(model)
        state, rank = local.start.state, local.start.rank
        if at is not None:
            state, rank = _run_to(local, at)
        located = _located(local, state, rank, at)
    point = located.operating_point
    check_determinate(model, point.contacts, f"linear model about {point.name}")
    _check_regular(located)
    return located


def _check_regular(located: Located) -> None:
    """Raise NumericalError at a singular configuration, where deviations form no linear space."""
    local, point = located
    names = local.dependent_only_here(point.point, point.tangent)
    if not names:
        return
    location = next(c.location for c in local.model.constraints if c.name == names[0])
    listed = ", ".join(f"`{name}`" for name in names[:_LISTED])
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    raise NumericalError(
        Diagnostic(
            "no-linear-model",
            f"{local.model.name} has no linear model about {point.name}: it is a singular"
            f" configuration, where {listed}{more} depend on each other, but not beside it",
            location,
            "choose another point (--set, --set-initial, --at)",
        )
    )


def equations_of(
    model: Model, state: State, contacts: Sequence[Mapping[str, Any]]
) -> LocalEquations:
    """Return the equations that hold at a state, in the mode of the contacts of a file."""
    if not model.switches:
        return LocalEquations(model)
    known = {contact["name"]: acting(contact) for contact in contacts}
    switched = SwitchedModel(model)
    return switched.local(tuple(known.get(name, Acting.OPEN) for name in switched.names), state)


def _located(local: LocalEquations, state: State, rank: int, at: float | None) -> Located:
    """Return the point of a state of a run, or of the start."""
    point = local.moving(state, rank)
    tangent = local.tangent(point, local.constant_velocities(point))
    name = "the start" if at is None else f"the state at t = {at:.6g} s"
    steady = local.is_steady(point, tangent)
    return Located(local, OperatingPoint(name, point, tangent, steady, local.contacts(point)))


def _in_run(switched: SwitchedModel, at: float | None) -> Located:
    """Return the point of a run of a model that switches, in its mode there."""
    state, modes = mode_in_run(switched.model, at)
    local = switched.local(tuple(map(Acting, modes)), state)
    return _located(local, state, local.start.rank, at)


def _run_to(local: LocalEquations, at: float) -> tuple[State, int]:
    """Return the state of a run at a time, and the rank of B at its initial state."""
    from lagcli.simulations.simulation import prepare

    model = local.model
    began = local.t
    check_time(at, began)
    given = SettingsOverrides(t_start=began, t_end=at, samples=2)
    if at == began:
        return local.start.state, local.start.rank
    simulation = prepare(model, given)
    run = simulation.trajectory()
    if run.status != "completed" or not len(run.time) or run.time[-1] != at:
        raise NumericalError(f"the run does not reach t = {at:g} s: {run.message or run.status}")
    return State(at, run.q[-1], run.v[-1], local.p), simulation.start.rank


def check_time(at: float, began: float) -> None:
    """Raise UsageError unless a run from a time on can reach another."""
    if not np.isfinite(at) or at < began:
        raise UsageError(f"--at {at:g}: the run starts at t = {began:g} s; give a later time")


def mode_in_run(model: Model, at: float | None) -> tuple[State, Indices]:
    """Return the state of a run at a time, or at the start, with its modes from there on.

    Parameters
    ----------
    model : Model
        One that switches.
    at : float or None
        s; None for the start, after what happens there.

    Returns
    -------
    state : State
        With the parameters that events have set.
    modes : (ns,) array of int
        `RowMode` of the switched rows.

    Raises
    ------
    UsageError
        The time is before the start.
    NumericalError
        The run does not reach it.
    """
    from lagcli.engine.integrate.engine import integrate
    from lagcli.simulations.simulation import prepare
    from lagcli.simulations.start import message_of

    began = model.settings.t_start or 0.0
    if at is not None:
        check_time(at, began)
    beginning = at is None or at == began
    given = SettingsOverrides(t_start=began)
    if not beginning:
        given = SettingsOverrides(t_start=began, t_end=at, samples=2)
    simulation = prepare(model, given)
    blocks: list[Block] = []
    parameters = [simulation.start.state.p]

    def check(t: float) -> None:
        if beginning:
            raise Interrupted

    request = simulation.request._replace(on_parameters=parameters.append)
    run = integrate(simulation.system, request, blocks.append, check)
    failed = run.status not in ("completed", "interrupted" if beginning else "completed")
    last = next((block for block in reversed(blocks) if len(block.time)), None)
    if failed or not (beginning or (last is not None and last.time[-1] == at)):
        when = f"t = {began if at is None else at:g} s"
        message = message_of(simulation.equations, run) or run.status
        raise NumericalError(f"the run does not reach {when}: {message}")
    if beginning:
        return _first(run, simulation.start.state), _modes(run, began)
    assert last is not None
    assert at is not None
    return State(at, last.q[-1], last.v[-1], parameters[-1]), _modes(run, at)


def _first(run: Outcome, start: State) -> State:
    """Return the state after the impacts and events at the start."""
    entry = _last(run, start.t)
    return start if entry is None else start._replace(q=entry.q, v=entry.after)


def _modes(run: Outcome, at: float) -> Indices:
    """Return the modes of the contacts after the changes at a time."""
    entry = _last(run, at)
    return np.array(run.modes, dtype=int) if entry is None else entry.modes


def _last(run: Outcome, at: float) -> EventEntry | None:
    """Return the last entry of the log up to a time."""
    if run.events is None:
        return None
    until = np.flatnonzero(run.events.part("time") <= at)
    return run.events[until[-1]] if len(until) else None
