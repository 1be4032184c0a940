"""Minima of functions whose minima are known, and the evaluations that they take."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from lagcli.engine.constraints.minimum import minimum

#: Functions with a minimum at 0, and how closely rounding errors let it be found.
SHAPES = {
    "parabola": (lambda x, a: a * x**2 + 1, 1e-7),
    "corner": (lambda x, a: a * abs(x), 1e-7),
    "branches that miss each other": (lambda x, a: np.sqrt((a * x) ** 2 + 1e-6), 1e-7),
    "flat": (lambda x, a: a * x**4, 1e-2),
    "corner and parabola": (lambda x, a: a * x**2 + abs(x), 1e-7),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_minima_of_random_functions(shape: str) -> None:
    random, (function, close) = np.random.default_rng(1), SHAPES[shape]
    ours = theirs = 0
    for _ in range(100):
        c, a = random.uniform(-1, 1), 10 ** random.uniform(-2, 2)
        low, high = c - random.uniform(1e-3, 2), c + random.uniform(1e-3, 2)
        places: list[float] = []

        def value(x: float, a=a, c=c, places=places) -> float:
            places.append(x)
            return float(function(x - c, a))

        x, least = minimum(value, low, high, 1e-12)
        ours += len(places)
        assert least == function(x - c, a) == min(function(place - c, a) for place in places)
        assert low < min(places)
        assert max(places) < high
        assert abs(x - c) < close * (1 + 1 / a)
        found = minimize_scalar(
            value, bounds=(low, high), method="bounded", options={"xatol": 1e-12}
        )
        theirs += found.nfev
    assert ours < 1.05 * theirs


@pytest.mark.parametrize("towards", [1.0, -1.0])
def test_a_function_without_a_minimum_inside_ends_at_its_lower_end(towards: float) -> None:
    x, _ = minimum(lambda x: towards * x, -1.0, 2.0, 1e-12)
    assert x == pytest.approx(-1.0 if towards > 0 else 2.0, abs=1e-7)
