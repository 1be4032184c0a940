"""Starts next to singular configurations."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.constraints.near_singular import (
    almost_dependent,
    coordinate_reach,
    next_to_singular,
)
from lagcli.engine.evaluator import Evaluator
from lagcli.simulations import simulation

#: Constraints that touch at x = 0, where both have the gradient of y.
TOUCHING = """
coordinates: [q0, q1, q2]
parameters: {l: 0.728, reach: 0.9}
definitions:
  x: l*(sin(q0) + sin(q1) + sin(q2))
  y: -l*(cos(q0) + cos(q1) + cos(q2))
T: (q0'^2 + q1'^2 + q2'^2)/2
V: 9.81*y
constraints: {low: y + q0^2*0.3 = -3*l*0.9, circle: x^2 + y^2 = (3*reach*l)^2}
initial: {q0: {guess: -0.573}, q1: {guess: 0.123}, q2: {guess: -0.415},
          q0': {guess: -0.559}, q1': {guess: -0.959}, q2': {guess: 0.212}}
simulation: {t_end: 1.0e-4, samples: 3}
"""


def test_a_start_next_to_a_singular_configuration_is_named() -> None:
    """Guesses converge slowly to the point where the constraints touch; λ is −5e13 there."""
    run = lagcli.simulate(lagcli.load_text(TOUCHING), max_steps=5)
    (warning,) = (x for x in run.warnings if "singular" in x)
    assert "next to a singular configuration" in warning
    assert "the constraints `low`, `circle` are dependent" in warning
    assert np.abs(run.multipliers[0]).max() > 1e6


@pytest.mark.parametrize("reach", [0.91, 0.95, 0.99])
def test_other_starts_are_not_named(reach: float) -> None:
    found = simulation.prepare(lagcli.load_text(TOUCHING, set={"reach": reach}))
    assert next_to_singular(found.system, found.start) == []
    assert lagcli.check(found.model).rank.near_singular == ()


def test_the_distance_decides() -> None:
    """Two rods in line, from x = −1 by y = 0 to x = 1: B falls with the height h of the joint."""
    text = """
coordinates: [x, y, u]
T: (x'^2 + y'^2 + u'^2)/2
V: 9.81*y
constraints: {left: (x + 1)^2 + y^2 = 1 + h^2, right: (u - x)^2 + y^2 = 1 + h^2, end: u = 1}
parameters: {h: 0.1}
initial: {x: {guess: 0}, y: {guess: h}, u: {guess: 1}, x': {guess: 0}, y': {guess: 0}, u': 0}
"""
    for height, names in ((1e-1, ()), (1e-2, ()), (1e-7, ("left", "right", "end"))):
        found = simulation.prepare(lagcli.load_text(text, set={"h": height}))
        start = found.start
        assert almost_dependent(found.system, start.state, start.rank) == names
    assert almost_dependent(found.system, start.state, 0) == ()


def test_the_reach_of_coordinates_is_theirs_or_that_of_the_largest() -> None:
    text = "coordinates: [x, y]\nT: x'^2/2 + 50*y'^2\nV: 0\ninitial: {x: 4, y: 0, x': 0, y': 0}\n"
    found = simulation.prepare(lagcli.load_text(text))
    reach = coordinate_reach(Evaluator(found.system, ()), found.start.state)
    assert reach == pytest.approx([4, 0.4])
