"""Runs that start at their given values, found for many together."""

from __future__ import annotations

import numpy as np

import lagcli
from lagcli.engine.switching.free_starts import FreeStarts
from lagcli.simulations.variants import Variants

BALL = """
parameters: {m: 1, g: 9.81, e: 0.5, mu: 0.3, s: 1}
coordinates: [x, y]
T: m/2*(x'^2 + y'^2)
V: m*g*y
Q: {x: -sqrt(s)*x'}
constraints:
  floor: {expr: y >= 0, restitution: e, friction: mu, slip: x'}
initial: {x: 0, y: 1, x': 1, y': 0}
"""


def free(text, columns, table):
    """Return which rows start at their given values."""
    variants = Variants(lagcli.load_text(text))
    values = variants.values(columns, np.array(table, dtype=float))
    starts = FreeStarts(variants.system)
    return starts(0.0, values.parameters, values.q, values.v).tolist()


def test_coefficients_inertia_and_gaps_are_checked():
    columns = ["m", "e", "mu", "s", "y"]
    table = [
        [1, 0.5, 0.3, 1, 1],
        [1, 0.0, 0.0, 0, 0],
        [-1, 1.0, 9.0, 1, 1e-300],
        [0, 0.5, 0.3, 1, 1],
        [1, 1.1, 0.3, 1, 1],
        [1, -0.1, 0.3, 1, 1],
        [1, 0.5, -0.1, 1, 1],
        [1, 0.5, 0.3, -1, 1],
        [1, 0.5, 0.3, 1, -1e-12],
        [np.nan, 0.5, 0.3, 1, 1],
        [1, 0.5, 0.3, 1, np.inf],
    ]
    assert free(BALL, columns, table) == [True] * 3 + [False] * 8


def test_a_singular_inertia_is_no_start():
    text = BALL.replace("T: m/2*(x'^2 + y'^2)", "T: m/2*(x'^2 + y'^2) + mu*x'*y'")
    assert free(text, ["m", "mu"], [[1, 0.5], [1, 1.0], [2, 1.9]]) == [True, False, True]


def test_constraints_that_hold_need_a_search():
    assert free(BALL.replace("constraints:", "constraints:\n  wall: x = 0"), ["m"], [[1]]) == [
        False
    ]
