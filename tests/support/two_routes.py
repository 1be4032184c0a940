"""Runs by `simulate` and by the core that pages and FMUs have, from the same start."""

from __future__ import annotations

from ctypes import byref, c_int, c_int64, c_void_p
from typing import Any, NamedTuple

import numpy as np
from core_parts import parts

from lagcli.engine.contract import Stop
from lagcli.engine.core.library import KERNEL
from lagcli.engine.core.run import core
from lagcli.engine.core.status import Status
from lagcli.engine.core.structures import Doubles, copied, lag_model, lag_report
from lagcli.engine.event_entries import OCCURRENCES
from lagcli.engine.integrate.engine import integrate
from lagcli.engine.integrate.model_data import model_data
from lagcli.simulations.simulation import Simulation

Numbers = np.ndarray[Any, np.dtype[np.float64]]


class Route(NamedTuple):
    """How a run has ended, and what it yields.

    Parameters
    ----------
    completed : bool
        Whether it has reached its end, or an event has ended it.
    event : int
        The event that has, or −1.
    counts : tuple of int
        Steps and rejected steps.
    samples, log : arrays
        Rows t, q, v, a, λ, W, and those of `lag_log_of`.
    why : str
        The status, or the message.
    """

    completed: bool
    event: int
    counts: tuple[int, int]
    samples: Numbers
    log: Numbers
    why: str


def by_simulate(simulation: Simulation) -> Route:
    """Run it as `lagcli simulate` does."""
    blocks: list[Numbers] = []
    outcome = integrate(
        simulation.system, simulation.request, lambda block: blocks.append(np.column_stack(block))
    )
    log = [
        np.concatenate(
            [
                [e.time, OCCURRENCES.index(e.occurrence), e.which, e.loss, e.supplied, e.work],
                *(e.modes, e.q, e.before, e.after, e.impulse),
            ]
        )
        for e in outcome.events or ()
    ]
    rules = simulation.system.switching.events if simulation.system.switching else ()
    stopped = [i for i, rule in enumerate(rules) if f"`{rule.name}` stopped" in outcome.message]
    return Route(
        outcome.status in ("completed", "stopped-by-event"),
        [*stopped, -1][0],
        (outcome.steps, outcome.rejected),
        np.concatenate(blocks) if blocks else np.empty((0, simulation.system.sample_layout.size)),
        np.array(log),
        outcome.message,
    )


def by_page(simulation: Simulation, method: str) -> Route:
    """Run it as a page or an FMU does, by a method."""
    try:
        data = model_data(simulation.system, simulation.request, (method,))
    except Stop as stop:
        nothing = np.empty((0, simulation.system.sample_layout.size))
        return Route(False, -1, (0, 0), nothing, np.array([]), str(stop))
    words, model = np.frombuffer(data, dtype=np.int64).copy(), lag_model()
    assert parts.lag_read_model(None, words.ctypes.data, len(data), byref(model)) == 0
    e, problem = model.equations, model.problem
    block = np.empty((problem.block_rows, 2 + 3 * e.nq + e.nc + problem.extra))
    problem.block, problem.kernel = Doubles(block.ctypes.data), KERNEL
    made = c_void_p()
    status = core.lag_make_simulation(None, byref(model), method.encode(), byref(made))
    assert status == 0, status
    try:
        return _go_on(made, block)
    finally:
        core.lag_destroy_simulation(made)
        parts.lag_release_model(byref(model))


def _go_on(made: c_void_p, block: Numbers) -> Route:
    run, rows = core.lag_run_of(made), []
    while True:
        status = Status(core.lag_simulate(made, 1000))
        rows.append(block[: core.lag_take(run)].copy())
        if status not in (Status.BLOCK_FULL, Status.RUNNING):
            break
    count, columns = c_int64(), c_int()
    at = parts.lag_log_of(made, byref(count), byref(columns))
    log = copied(at, count.value * columns.value).reshape(count.value, columns.value)
    report = lag_report()
    core.lag_report_of(run, byref(report))
    return Route(
        status == Status.DONE,
        parts.lag_stopped_by(made),
        (report.steps, report.rejected),
        np.concatenate(rows),
        log,
        status.name,
    )


def difference(one: Route, other: Route) -> str:
    """Return what differs, bit by bit; empty if nothing does."""
    found = [] if one[:2] == other[:2] else [f"ends ({one.why}; {other.why})"]
    if one.counts != other.counts:
        found.append(f"counts: {one.counts} and {other.counts}")
    for name in ("samples", "log"):
        a, b = (getattr(x, name) for x in (one, other))
        if a.size or b.size:
            if a.shape != b.shape:
                found.append(f"{name}: {len(a)} and {len(b)}")
            elif np.ascontiguousarray(a).tobytes() != np.ascontiguousarray(b).tobytes():
                found.append(f"{name}: {np.nanmax(np.abs(a - b)):.2g}")
    return ", ".join(found)
