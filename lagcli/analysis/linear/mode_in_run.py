"""The state and the modes of contacts at a time of a run."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Indices
from lagcli.engine.contract import Block, Interrupted, Outcome
from lagcli.engine.state import State
from lagcli.errors import NumericalError, UsageError
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides


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
    from lagcli.engine.integrate.engines import engine_named
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
    engine = engine_named(simulation.settings.engine)
    run = engine(simulation.system, request, blocks.append, check)
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
    """Return the state after what happens at the start."""
    found = start
    for entry in run.events:
        if entry.time <= start.t:
            found = found._replace(q=entry.q, v=entry.after)
    return found


def _modes(run: Outcome, at: float) -> Indices:
    """Return the modes after what happens at a time."""
    found = np.array(run.modes, dtype=int)
    for entry in run.events:
        if entry.time <= at:
            found = entry.modes
    return found
