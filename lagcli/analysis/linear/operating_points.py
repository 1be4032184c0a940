"""Operating points: the initial state, a state of a run, an equilibrium, a steady motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lagcli.analysis.local.gradients import Point
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.operating_point import OperatingPoint
from lagcli.analysis.local.steady_states import nearest_steady_state
from lagcli.engine.state import State
from lagcli.errors import NumericalError, UsageError
from lagcli.settings.settings import SettingsOverrides

#: Accelerations below this part of the largest, compared by coordinate, are rounding errors.
_CONSTANT = 1e-9


def find_operating_point(
    local: LocalEquations,
    *,
    at: float | None = None,
    equilibrium: bool = False,
    steady: Mapping[str, float] | None = None,
) -> OperatingPoint:
    """Return the requested operating point, by default the initial state; see `linearize`.

    Raises
    ------
    UsageError
        Two points are requested, or a velocity cannot be prescribed.
    ModelError, NumericalError
        There is no consistent initial state, no equilibrium, or the run does not reach the time.
    """
    if at is not None and (equilibrium or steady):
        raise UsageError(
            "--at takes the state of a run, --equilibrium and --steady take another one; choose one"
        )
    if equilibrium or steady:
        return nearest_steady_state(local, steady or {}).operating_point
    if at is not None:
        state, rank = _run_to(local, at)
        name = f"the state at t = {at:.6g} s"
    else:
        state, rank = local.start.state, local.start.rank
        name = "the start"
    point = local.moving(state, rank)
    tangent = local.tangent(point, _constant_velocities(local, point))
    return OperatingPoint(name, point, tangent, local.is_steady(point, tangent))


def _constant_velocities(local: LocalEquations, point: Point) -> tuple[int, ...]:
    """Return the coordinates with constant velocities.

    A motion may be steady only in some: a disk that rolls in a circle.
    """
    size = np.abs(point.a / local.lengths)
    jerk, bound = local.jerk(point, local.tangent(point), local.force_scale(point))
    constant = (size <= _CONSTANT * size.max(initial=0.0)) & (np.abs(jerk) <= bound)
    return tuple(np.flatnonzero(constant).tolist())


def _run_to(local: LocalEquations, at: float) -> tuple[State, int]:
    """Return the state of a run at a time, and the rank of B at its initial state."""
    from lagcli.simulations.simulation import prepare
    from lagcli.trajectory.samples import Samples

    model = local.model
    began = local.t
    if not np.isfinite(at) or at < began:
        raise UsageError(f"--at {at:g}: the run starts at t = {began:g} s; give a later time")
    given = SettingsOverrides(t_start=began, t_end=at, samples=2)
    if at == began:
        return local.start.state, local.start.rank
    simulation = prepare(model, given)
    blocks: list[Samples] = []
    record = simulation.run(blocks.append)
    last = blocks[-1]
    if record.status != "completed" or not len(last.time) or last.time[-1] != at:
        raise NumericalError(
            f"the run does not reach t = {at:g} s: {record.message or record.status}"
        )
    return State(at, last.q[-1], last.v[-1], local.p), simulation.start.rank
