"""Times counted in whole numbers."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest

from lagcli.engine.tape.ticks import ticks_of


@pytest.mark.parametrize(
    ("period", "offset", "expected"),
    [
        (0.01, 0.0, (0, 1, 100)),
        (0.01, 0.002, (1, 5, 500)),
        (1 / 3, 0.0, (0, 1, 3)),
        (2.5, -0.5, (-1, 5, 2)),
        (3.0, 7.0, (7, 3, 1)),
        (1e-9, 0.0, (0, 1, 10**9)),
        (0.01, math.pi, (math.pi, 0.01, 1.0)),  # no simple fractions
        (1e-12, 0.0, (0.0, 1e-12, 1.0)),  # its denominator is too large
    ],
)
def test_ticks_in_whole_numbers(
    period: float, offset: float, expected: tuple[float, float, float]
) -> None:
    assert ticks_of(period, offset) == expected


def test_fractions_round_to_the_period_and_the_offset() -> None:
    chance = random.Random(1)
    for _ in range(500):
        period = 10 ** chance.uniform(-13, 9)
        offset = chance.choice([0.0, period / 4, round(chance.uniform(-9, 9), 3)])
        first, step, per = map(Fraction, ticks_of(period, offset))
        assert (float(first / per), float(step / per)) == (offset, period)
