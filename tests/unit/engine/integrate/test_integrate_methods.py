"""The choice of a method, with a core that only records its calls."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from pendulum_by_hand import pendulum_system, request

from lagcli.engine.integrate.methods import Methods
from lagcli.engine.system import JacobianTapes, System
from lagcli.engine.tape.tape import Tape


class Core:
    """Stands for the core: its steps, its state, and the methods that it was switched to."""

    def __init__(self) -> None:
        self.steps = 0
        self.t_old, self.t = -1e-3, 0.0
        self.state = np.zeros(5)
        self.absolute_tolerances = np.full(5, 1e-9)
        self.switched: list[str] = []
        self.prepared = 0

    def switch(self, method: str) -> None:
        self.switched.append(method)

    def prepare(self, variation: JacobianTapes, pattern: object) -> None:
        self.prepared += 1

    def go(self, steps: int, size: float) -> None:
        """Take some steps of a size."""
        self.steps += steps
        self.t += steps * size
        self.t_old = self.t - size

    @property
    def report(self) -> Any:
        return self


def variation() -> JacobianTapes:
    return JacobianTapes((), (), (), (), (), (), Tape(0, (), (), ()))


def methods(
    core: Core,
    no_series: str = "",
    derivatives: bool = True,
    **changes: Any,
) -> Methods:
    system: System = pendulum_system()
    if derivatives:
        system = dataclasses.replace(system, variation=variation)
    changes = {"method": "auto", "t_end": 1e3, **changes}
    return Methods(core, system, request(**changes), no_series)


def test_explicit_methods_need_no_derivatives() -> None:
    core = Core()
    assert methods(core, derivatives=False, method="DOP853").running == "DOP853"
    assert methods(core, derivatives=False, method="Taylor").running == "Taylor"
    assert (core.switched, core.prepared) == (["Taylor"], 0)


@pytest.mark.parametrize("method", ["Rodas5P", "Radau"])
def test_implicit_methods_take_derivatives_once(method: str) -> None:
    core = Core()
    assert methods(core, method=method).running == method
    assert (core.switched, core.prepared) == ([method], 1)
    with pytest.raises(ValueError, match=f"no derivatives, which {method} needs"):
        methods(core, method=method, derivatives=False)


def test_taylor_gives_way_where_there_is_no_series() -> None:
    core = Core()
    found = methods(core, no_series="abs", method="Taylor")
    assert (found.running, core.switched) == ("DOP853", [])
    assert found.message() == "Taylor's method does not suit the equations (abs): used DOP853"


@pytest.mark.parametrize(("rtol", "implicit"), [(1e-3, "Rodas5P"), (1e-9, "Radau")])
def test_a_stiff_motion_continues_implicitly(rtol: float, implicit: str) -> None:
    core = Core()
    found = methods(core, rtol=rtol)
    assert found.may_help()
    core.go(100, 1e-3)
    found.count(core.steps)
    found.stiff()
    assert (found.running, core.prepared) == (implicit, 1)
    assert not found.may_help()
    assert found.most_steps(core.steps) == 30  # then it must have proved itself
    core.go(30, 1e-2)
    found.count(core.steps)
    found.review(core.report)
    assert found.running == implicit
    assert found.used == ("DOP853", implicit)
    assert found.steps == {"DOP853": 100, implicit: 30}
    assert found.message() == f"the motion is stiff: continued with {implicit} at t = 0.1 s"


def test_an_implicit_method_without_longer_steps_was_in_vain() -> None:
    core = Core()
    found = methods(core)
    core.go(100, 1e-3)
    found.count(core.steps)
    found.stiff()
    core.go(30, 1.2e-3)
    found.count(core.steps)
    found.review(core.report)
    assert found.running == "DOP853"
    assert found.used == ("DOP853",)
    assert found.message() == ""
    # and is not tried again soon
    core.go(100, 1e-3)
    found.count(core.steps)
    found.stiff()
    assert found.running == "DOP853"
    core.go(2000, 1e-3)
    found.stiff()
    assert found.running == "Radau"
    assert core.prepared == 1


@pytest.mark.parametrize(("rough", "expected"), [(0.0, "Radau"), (1e-3, "DOP853")])
def test_a_path_is_looked_at_before_dear_derivatives(rough: float, expected: str) -> None:
    core = Core()
    found = methods(core, t_end=10.0)
    core.go(100, 1e-3)
    found.count(core.steps)
    found.stiff()
    assert (found.running, core.prepared, found.most_steps(core.steps)) == ("DOP853", 0, 1)
    for k in range(3):
        t = core.t - 0.1
        core.state = np.array([t**3, 1.0, 3 * t * t, 0.0, 0.0])
        core.state[0] += rough if k == 1 else 0.0
        found.review(core.report)
        if k < 2:
            assert (found.running, found.most_steps(core.steps)) == ("DOP853", 3)
            core.go(3, 1e-3)
    assert (found.running, core.prepared) == (expected, int(not rough))
    if rough:  # and is not looked at again at once
        found.stiff()
        assert found.most_steps(core.steps) > 1000
        core.go(106, 1e-3)
        found.stiff()
        assert found.most_steps(core.steps) == 1


def test_derivatives_are_not_worth_it_for_a_few_steps() -> None:
    core = Core()
    found = methods(core, t_end=1.0)
    core.go(800, 1e-3)
    found.stiff()
    assert found.running == "DOP853"
    found.stiff(forced=True)  # where the step size fell to its minimum
    assert found.running == "Radau"
    assert found.most_steps(core.steps) == found.settings.max_steps


def test_auto_without_derivatives_has_no_choice() -> None:
    assert not methods(Core(), derivatives=False).may_help()
    assert not methods(Core(), method="DOP853").may_help()


@pytest.mark.parametrize(("rough", "expected"), [(0.0, "Radau"), (1e-3, "DOP853")])
def test_after_many_steps_a_smooth_path_is_tried_implicitly(rough: float, expected: str) -> None:
    core = Core()
    found = methods(core, rtol=1e-6)
    core.go(2000, 1e-3)
    for k in range(3):
        t = core.t - 2.0
        # a cubic in time, which three points of the path show to be smooth
        core.state = np.array([t**3, 1.0, 3 * t * t, 0.0, 0.0])
        core.state[0] += rough if k == 1 else 0.0
        found.review(core.report)
        assert found.running == (expected if k == 2 else "DOP853")
        if k < 2:
            assert found.most_steps(core.steps) == 3
            core.go(3, 1e-3)


def test_no_derivatives_where_they_cost_more_than_the_steps_left() -> None:
    core = Core()
    found = methods(core, t_end=5.0)  # 5000 steps, of a microsecond
    core.go(100, 1e-3)
    found.count(core.steps)
    found.stiff()
    assert (found.running, core.prepared) == ("DOP853", 0)
