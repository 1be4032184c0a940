"""Lines across the surfaces on which two values are equal."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.lowering.lower import lower
from lagcli.engine.tape.crossings import lines_across
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.lagrange import derive


def tape_of(condition: str) -> tuple[Tape, tuple[int, int]]:
    """Return a tape with a comparison, and the operands of this."""
    text = (
        "coordinates: [x, y]\nparameters: {c: 3}\nT: (x'^2 + y'^2)/2\n"
        f"Q: {{x: \"if({condition}, 1, 0)\"}}\ninitial: {{x: 1, y: 0, x': 0, y': 0}}\n"
    )
    tape = lower(derive(lagcli.load_text(text))).dynamics
    (pair,) = ((a, b) for op, _, a, b, _ in tape.code if op in (Op.LT, Op.LE))
    return tape, pair


@pytest.mark.parametrize(
    "condition",
    [
        "x > c",
        "x' > 5.03",
        "x > 1e4",
        "x + 1e6 > 1e6 + 2",
        "x^2 + y^2 < 0.01",  # most lines miss it
        "(x - 7)^2 + 4*(y' + 2)^2 < 0.0001*c",
        "sin(20*t) < y",
        "exp(x) < 1e-9",
    ],
)
def test_lines_cross_the_surface(condition: str) -> None:
    tape, pair = tape_of(condition)
    found = list(lines_across(tape, pair, pair, [3.0]))
    assert len(found) > 1
    for at in found:
        differences = np.array([np.subtract(*at(s)) for s in (-1e-6, 0.0, 1e-6)])
        assert abs(differences[1]) <= 1e-11 * np.abs(at(0.0)).max()
        assert differences[0] * differences[2] < 0


@pytest.mark.parametrize("condition", ["x^2 + 1 < 0", "exp(x) < 0", "log(-1 - x^2) < 0"])
def test_surfaces_without_points(condition: str) -> None:
    tape, pair = tape_of(condition)
    assert list(lines_across(tape, pair, pair, [3.0])) == []


def test_other_values_along_a_line() -> None:
    tape, pair = tape_of("x > c")
    for at in lines_across(tape, pair, [0, 1, 2, 5], [3.0]):
        t, x, y, c = at(0.0)
        assert (x, c) == (pytest.approx(3.0), 3.0)
        assert at(0.1) == pytest.approx([t, x - 0.1 * (1 + x), y, c])  # towards c > x
