"""Falls through zero within a step."""

from collections.abc import Callable

import numpy as np
import pytest

from lagcli.engine.switching.reference.crossings import Crossings, first_crossings


def find(
    *functions: Callable[[float], float], high: float = 4.0, noise: float = 0.0
) -> Crossings | None:
    return first_crossings(
        lambda t: np.array([f(t) for f in functions]),
        0.0,
        high,
        np.full(len(functions), noise),
        lambda values: np.maximum(values, 0.0),
        lambda t: False,
    )


def test_first_of_several() -> None:
    found = find(lambda t: 3.1 - t, lambda t: np.cos(t))
    assert found is not None
    assert found.time == pytest.approx(np.pi / 2, abs=1e-14)
    assert found.numbers == (1,)


def test_roots_of_one_instant() -> None:
    found = find(lambda t: 2.0 - t, lambda t: 4.0 - t**2, lambda t: 2.1 - t)
    assert found == Crossings(2.0, (0, 1))


@pytest.mark.parametrize("depth", [1e-2, 1e-6, 1e-10, 1e-13])
def test_grazing(depth: float) -> None:
    """A parabola that dips below zero by so little, for √depth on each side."""
    found = find(lambda t: (t - 1.7) ** 2 - depth)
    assert found is not None
    # the root's condition is 1/(2 √depth)
    assert found.time == pytest.approx(1.7 - np.sqrt(depth), abs=1e-15 / np.sqrt(depth) + 1e-14)
    assert find(lambda t: (t - 1.7) ** 2 + depth) is None


def test_rounding_is_no_fall() -> None:
    assert find(lambda t: 1e-17 * np.sin(100 * t), noise=1e-16) is None


def test_what_begins_counts_as_positive() -> None:
    """A gap that opens from a value below zero by rounding, and closes again."""
    found = find(lambda t: t * (3.0 - t) - 1e-17)
    assert found is not None
    assert found.time == pytest.approx(3.0, abs=1e-12)
    short = find(lambda t: t * (1e-9 - t))
    assert short is not None
    assert short.time == pytest.approx(1e-9, rel=1e-6)
    falling = find(lambda t: -t)
    assert falling is not None
    assert falling.time == 0.0


def test_undefined_functions_are_not_watched() -> None:
    assert find(lambda t: np.nan) is None
