"""Constraints with `atan2` whose motion passes the branch cut."""

from __future__ import annotations

import math

import numpy as np
import pytest

import lagcli
from lagcli.engine.constraints.branch_cuts import passes_branch_cut
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.lower import lower

#: A point whose angle about the origin is 3 t: it is pi at t = pi/3.
DRIVEN = """
coordinates: {x: m, y: m}
T: (x'^2 + y'^2)/2
constraints:
  ring: x^2 + y^2 = 1
  angle: CONSTRAINT
initial: {x: 1, y: {guess: 0}, x': {guess: 0}, y': {guess: 3}}
simulation: {t_end: 1.5, samples: 4}
"""
#: A point whose angle is a coordinate, with the inertia of a wheel.
WHEEL = """
coordinates: {x: m, y: m, phi: rad}
T: (x'^2 + y'^2 + phi'^2)/2
constraints: {angle: "atan2(y, x) = phi"}
initial:
  {x: -1, y: {guess: 0.12}, phi: {guess: 3}, x': {guess: 0}, y': {guess: -1}, phi': {guess: 1}}
simulation: {t_end: 1, samples: 3}
"""
JUMPS = "the constraint `angle` jumps at t = {}"


@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Rodas5P", "Radau", "auto"])
def test_a_constraint_that_passes_the_cut_is_named(method: str) -> None:
    text = DRIVEN.replace("CONSTRAINT", "atan2(y, x) = 3*t")
    run = lagcli.simulate(lagcli.load_text(text), method=method)
    assert run.status == "failed"
    assert JUMPS.format("1.") in run.message
    assert "an `atan2` in it changes by 2 pi" in run.message
    assert run.time[-1] < math.pi / 3


def test_a_coordinate_that_would_jump_is_not_the_cause() -> None:
    run = lagcli.simulate(lagcli.load_text(WHEEL))
    assert run.status == "failed"
    assert JUMPS.format("0.") in run.message


def test_the_form_that_the_message_gives_does_not_jump() -> None:
    text = DRIVEN.replace("CONSTRAINT", "x*sin(3*t) = y*cos(3*t)")
    run = lagcli.simulate(lagcli.load_text(text))
    assert run.status == "completed"
    assert run.q[-1] == pytest.approx([math.cos(4.5), math.sin(4.5)], abs=1e-9)


def test_steps_on_one_side_of_the_cut() -> None:
    """Or across the positive half of the axis, where the angle is 0; or of other constraints."""
    system = lower(lagcli.derive(lagcli.load_text(WHEEL)))
    evaluator, still = Evaluator(system, ()), np.zeros(3)

    def step(one: tuple[float, float], other: tuple[float, float]) -> object:
        states = [(0.1 * k, np.array([*xy, 0.0]), still) for k, xy in enumerate((one, other))]
        return passes_branch_cut(evaluator, *states)

    assert step((-1.0, 0.1), (-1.1, 0.2)) is None
    assert step((1.0, 0.1), (1.1, -0.2)) is None
    assert step((-1.0, 0.1), (-1.1, -0.2)) is not None
    assert step((-1.0, -0.1), (-1.1, 0.2)) is not None
    other = lower(lagcli.derive(lagcli.load_text(WHEEL.replace("atan2(y, x) = phi", "x = phi"))))
    nothing = (0.0, np.array([-1.0, 0.1, 0.0]), still), (0.1, np.array([-1.0, -0.1, 0.0]), still)
    assert passes_branch_cut(Evaluator(other, ()), *nothing) is None
