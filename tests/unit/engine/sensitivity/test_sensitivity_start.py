"""The derivatives of a consistent initial state."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.tangent import lower_tangent
from lagcli.engine.sensitivity.start import (
    ContradictingStart,
    StartDerivatives,
    start_derivatives,
)
from lagcli.simulations.directions import Directions
from lagcli.simulations.simulation import prepare

TEXT = """
coordinates: [x, y]
parameters: {m: 2, l: 5}
T: m*(x'^2 + y'^2)/2
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: 3, y: Y, x': 1, y': {guess: 0}}
"""


def start_of(text: str) -> StartDerivatives:
    simulation = prepare(lagcli.load_text(text))
    directions = Directions(simulation.model, ("l",))
    tangent = lower_tangent(simulation.equations, [{"l": directions.rates[0]["l"] / 5}])
    given = StartDerivatives(np.zeros((1, 2)), np.zeros((1, 2)))
    evaluator = Evaluator(simulation.system, simulation.start.state.p)
    return start_derivatives(evaluator, tangent, simulation.start.state, given, *directions.fixed)


def test_free_values_follow_by_the_implicit_function_theorem() -> None:
    found = start_of(TEXT.replace("Y", "{guess: 4}"))
    # y = √(l² − x²) and y' = −x x'/y: dy/dl = l/y, dy'/dl = x x' l/y³
    np.testing.assert_allclose(found.q, [[0, 5 / 4]], rtol=1e-14)
    np.testing.assert_allclose(found.v, [[0, 3 * 5 / 4**3]], rtol=1e-14)


def test_fixed_values_that_meet_a_constraint_for_one_length_alone_contradict() -> None:
    with pytest.raises(ContradictingStart) as caught:
        start_of(TEXT.replace("Y", "4"))
    found = caught.value
    assert (found.direction, found.constraint, found.level) == (0, 0, "position")
