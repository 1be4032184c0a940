"""The binding of a run: what it gives to the core, and what it returns."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from core_parts import restore, save
from core_runs import pendulum

from lagcli.engine.core import run
from lagcli.engine.core.run import METHODS, Integrator
from lagcli.engine.core.status import Status


def test_methods_are_named_by_the_core() -> None:
    assert METHODS[0] == "DOP853"
    assert len(set(METHODS)) == len(METHODS) > 2


def test_a_run_goes_to_its_end_in_slices() -> None:
    core = pendulum().core
    status, slices = core.start(), 0
    assert (core.t, core.times_next) == (0.0, 1)
    while status == Status.RUNNING:
        before = core.counts[0]
        status, slices = core.advance(7), slices + 1
        assert core.counts[0] - before <= 7
    assert (status, core.t, core.times_next) == (Status.DONE, 5.0, 51)
    assert slices > 3
    rows = core.take()
    np.testing.assert_array_equal(rows[:, 0], np.linspace(0.0, 5.0, 51))
    np.testing.assert_array_equal(rows[-1, 1:5], core.state[:4])
    t_old, t = core.step
    assert t_old < t == 5.0
    np.testing.assert_allclose(core.dense(t), core.state, rtol=1e-12)
    assert core.absolute_tolerances.shape == (5,)
    assert core.lengths.shape == (1,)


def test_a_run_goes_on_from_another_state() -> None:
    core = pendulum().core
    core.start()
    core.move(2.0, [1.0, 0.0, 0.0, 0.5, 0.0], 20)
    assert core.start() == Status.RUNNING
    assert core.t == 2.0
    np.testing.assert_array_equal(core.state, [1.0, 0.0, 0.0, 0.5, 0.0])


def test_a_state_without_values_is_reported_with_its_time() -> None:
    core = pendulum().core
    core.move(1.0, [np.nan, 0.0, 0.0, 0.0, 0.0], 0)
    assert core.start() == Status.UNDEFINED
    assert core.t_bad == 1.0
    assert np.isnan(core.y_bad[0])


def test_a_run_goes_back_to_where_it_was_saved() -> None:
    core = pendulum().core
    core.start()
    core.advance(40)
    saved, t, state, counts = save(core), core.t, core.state, core.counts
    assert core.advance(20) == Status.RUNNING
    after = core.t, core.state, core.counts
    assert restore(core, saved)
    assert (core.t, core.counts) == (t, counts)
    np.testing.assert_array_equal(core.state, state)
    core.advance(20)
    assert (core.t, core.counts) == (after[0], after[2])
    np.testing.assert_array_equal(core.state, after[1])


def test_a_run_of_other_equations_does_not_go_back() -> None:
    integration = pendulum()
    core = integration.core
    core.start()
    saved = save(core)
    core.use_dense(integration.in_use.dynamics)
    assert not restore(core, saved)
    other = pendulum().core
    assert not restore(other, saved + bytes(len(save(other))))


def parts_of(monkeypatch: pytest.MonkeyPatch) -> tuple[Any, dict[str, Any], Any]:
    """Return what a run is made from: the model, the problem, the breaks."""
    made: list[Any] = []
    original = Integrator.__init__

    def kept(self: Integrator, *arguments: Any) -> None:
        made.append(arguments)
        original(self, *arguments)

    monkeypatch.setattr(Integrator, "__init__", kept)
    pendulum()
    monkeypatch.undo()
    return made[0]


def test_a_problem_has_the_fields_of_the_core_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    model, problem, breaks = parts_of(monkeypatch)
    without = {name: x for name, x in problem.items() if name != "rank"}
    with pytest.raises(KeyError, match="rank"):
        Integrator(model, without, breaks)
    with pytest.raises(TypeError, match="lag_problem has no rang"):
        Integrator(model, {**problem, "rang": 1}, breaks)


def test_a_problem_that_the_core_refuses_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    model, problem, breaks = parts_of(monkeypatch)
    with pytest.raises(ValueError, match="refuses the problem"):
        Integrator(model, problem | {"atol": -problem["atol"]}, breaks)


def test_without_memory_python_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    made = parts_of(monkeypatch)
    monkeypatch.setattr(run.core, "lag_make_simulation", lambda *_: run._NO_MEMORY)
    with pytest.raises(MemoryError):
        Integrator(*made)


def test_every_run_is_destroyed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    core, destroyed = pendulum().core, []
    handle = core._simulation
    assert handle
    core.__del__(destroyed.append)
    assert destroyed == [handle]
    nothing = Integrator.__new__(Integrator)  # whose creation has failed
    nothing.__del__(destroyed.append)
    assert destroyed == [handle]
