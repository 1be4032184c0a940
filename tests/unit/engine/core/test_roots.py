"""Roots inside a bracket: against closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from core_parts import bracketed_root, last_digit_root

Function = Callable[[float], float]
#: Functions that are positive at the first place and negative at the second, and their roots.
FALLING: list[tuple[Function, float, float, float]] = [
    (lambda x: 2.0 - x * x, 0.0, 2.0, math.sqrt(2.0)),
    (lambda x: math.cos(x), 0.0, 3.0, math.pi / 2),
    (lambda x: -((x - 1.0) ** 9), 0.0, 3.0, 1.0),
    (lambda x: 1.0 if x < 0.3 else -1e-6, 0.0, 1.0, 0.3),
    (lambda x: -math.expm1(40.0 * (x - 0.9)), 0.0, 1.0, 0.9),
]


@pytest.mark.parametrize(("f", "low", "high", "root"), FALLING)
def test_the_function_is_negative_there_and_not_just_before(
    f: Function, low: float, high: float, root: float
) -> None:
    exact = 1e-12
    asked: list[float] = []

    def counted(x: float) -> float:
        asked.append(x)
        return f(x)

    found = bracketed_root(counted, low, high, exact)
    assert f(found) < 0
    assert any(found - exact <= x < found and f(x) >= 0 for x in asked)
    assert all(low <= x <= high for x in asked)
    assert abs(found - root) < (0.05 if f(root + 1e-3) > -1e-20 else 2 * exact)
    assert len(asked) < 130


def test_a_smooth_function_takes_few_values() -> None:
    asked: list[float] = []

    def f(x: float) -> float:
        asked.append(x)
        return 2.0 - x * x

    bracketed_root(f, 1.0, 2.0, 1e-14)
    assert len(asked) <= 20


def test_bisection_ends_at_the_last_digit() -> None:
    root = 0.1 + 0.2
    assert last_digit_root(lambda x: root - x, 0.0, 1.0) == root
    found = last_digit_root(lambda x: 2.0 - x * x, 1.0, 2.0)
    assert 2.0 - found * found <= 0
    assert 2.0 - math.nextafter(found, 0.0) ** 2 > 0


def test_an_exception_of_the_function_reaches_the_caller() -> None:
    asked: list[float] = []

    def f(x: float) -> float:
        asked.append(x)
        if len(asked) > 3:
            raise KeyError(x)
        return 1.0 - x

    for find in (lambda: bracketed_root(f, 0.0, 3.0, 1e-12), lambda: last_digit(f)):
        asked.clear()
        with pytest.raises(KeyError):
            find()
        assert len(asked) == 4


def last_digit(f: Function) -> float:
    found: float = last_digit_root(f, 0.0, 3.0)
    return found
