"""Conditions that change only by jumps, of time or of the motion, against exact arithmetic.

A particle moves uniformly, so that all jumps are at rational times. Bounds are values that the
functions take: what jumps to its bound meets `>=` and `<=`, but not `>` and `<`.
"""

from __future__ import annotations

import math
import operator
import random
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

import pytest
from random_cases import seeds

import lagcli

SPEED, END = Fraction(45, 64), 5
COMPARISONS = {">=": operator.ge, ">": operator.gt, "<=": operator.le, "<": operator.lt}


class Jumping(NamedTuple):
    """A function of x and t: its text, its value, and where it may jump."""

    text: str
    value: Callable[[dict[str, Fraction]], Fraction]
    jumps: tuple[tuple[str, Fraction], ...]


def leaf(rng: random.Random) -> Jumping:
    name, at = rng.choice("xt"), Fraction(rng.randint(1, 20), 8)
    low, high = (Fraction(rng.randint(-8, 8), 4) for _ in range(2))
    factor = rng.choice([1, 2])
    wholes = tuple((name, Fraction(i, factor)) for i in range(1, 9 * factor))
    return rng.choice(
        [
            Jumping(
                f"step({name} - {float(at)})", lambda s: Fraction(s[name] >= at), ((name, at),)
            ),
            Jumping(
                f"step({float(at)} - {name})", lambda s: Fraction(s[name] <= at), ((name, at),)
            ),
            Jumping(
                f"sign({name} - {float(at)})",
                lambda s: Fraction((s[name] > at) - (s[name] < at)),
                ((name, at),),
            ),
            Jumping(
                f"if({name} > {float(at)}, {float(high)}, {float(low)})",
                lambda s: high if s[name] > at else low,
                ((name, at),),
            ),
            Jumping(
                f"floor({factor}*{name})", lambda s: Fraction(math.floor(factor * s[name])), wholes
            ),
            Jumping(
                f"floor({factor}*{name} - 1/4)/4",
                lambda s: Fraction(math.floor(factor * s[name] - Fraction(1, 4)), 4),
                tuple((name, (i + Fraction(1, 4)) / factor) for i in range(9 * factor)),
            ),
        ]
    )


def combined(rng: random.Random, depth: int) -> Jumping:
    if depth == 0:
        return leaf(rng)
    a, b = combined(rng, depth - 1), combined(rng, rng.randrange(depth))
    form, apply = rng.choice(
        [
            ("({} + {})", operator.add),
            ("({} - {})", operator.sub),
            ("({})*({})", operator.mul),
            ("min({}, {})", min),
            ("max({}, {})", max),
        ]
    )
    return Jumping(
        form.format(a.text, b.text), lambda s: apply(a.value(s), b.value(s)), a.jumps + b.jumps
    )


@pytest.mark.parametrize("seed", seeds(30, 300))
def test_they_happen_when_they_jump_to_their_bound(seed: int) -> None:
    rng = random.Random(seed)
    function = combined(rng, rng.randint(0, 2))
    times = {at / SPEED if name == "x" else at for name, at in function.jumps}
    jumps = sorted(t for t in times if 0 < t < END)
    ends = [Fraction(0), *jumps, Fraction(END)]
    between = [(a + b) / 2 for a, b in pairwise(ends)]
    values = [function.value({"t": t, "x": SPEED * t}) for t in between]
    bound, sign = rng.choice(values), rng.choice(list(COMPARISONS))
    holds = [COMPARISONS[sign](value, bound) for value in values]
    expected = [t for t, (a, b) in zip(jumps, pairwise(holds), strict=True) if b and not a]
    model = lagcli.load_text(f"""
coordinates: [x]
T: x'^2/2
events: {{hit: {{when: '{function.text} {sign} {float(bound)}'}}}}
initial: {{x: 0, x': {float(SPEED)}}}
simulation: {{t_end: {END}}}
""")
    run = lagcli.simulate(model)
    assert run.status == "completed"
    assert run.events.time == pytest.approx(list(map(float, expected)), abs=1e-8)


@pytest.mark.parametrize(
    ("condition", "times"),
    [
        ("step(x - 1)^2 >= 1", [2.0]),
        ("2*sign(x - 1) - 2 >= 0", [2.0]),
        ("0.1*step(x - 1) + 0.2 >= 0.1 + 0.2", [2.0]),
        ("k*step(x - 1) >= k", [2.0]),
        ("step(x - 1) > 0", [2.0]),
        ("not (step(x - 1) <= 0)", [2.0]),
        ("floor(x) >= 1 and t > 2.5", [2.5]),
        ("floor(x) >= 1 or t > 1.5", [1.5]),
        ("floor(t) = 2", [2.0]),
    ],
)
def test_what_meets_its_bound_exactly(condition: str, times: list[float]) -> None:
    model = lagcli.load_text(f"""
coordinates: [x]
parameters: {{k: 0.3}}
T: x'^2/2
events: {{hit: {{when: '{condition}'}}}}
initial: {{x: 0, x': 0.5}}
simulation: {{t_end: 3.7}}
""")
    assert lagcli.simulate(model).events.time == pytest.approx(times, abs=1e-9)
