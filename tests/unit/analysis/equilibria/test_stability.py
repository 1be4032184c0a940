"""Verdicts on stability."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli


def verdict(potential: str, more: str = "") -> str:
    text = (
        f"coordinates: [x, y]\nT: (x'^2 + y'^2)/2\nV: {potential}\n{more}\n"
        "initial: {x: 0, y: 0, x': 0, y': 0}\n"
    )
    (one,) = lagcli.equilibrium(lagcli.load_text(text)).equilibria
    return one.stability.verdict


@pytest.mark.parametrize(
    ("potential", "more", "expected"),
    [
        ("x^2 + y^2", "", "stable"),
        ("x^2 - y^2", "", "unstable"),
        ("x^2 + y^2", "D: x'^2 + y'^2", "asymptotically stable"),
        ("x^2 + y^2", "D: x'^2", "stable"),
        ("x^2 + y^2", "D: -x'^2/10", "unstable"),
        ("x^2 + y^4", "", "undecided"),
        # two equal frequencies, the second driven by the first, grow as t
        ("x^2 + y^2", "Q: {y: x}", "undecided"),
        ("x^2 + y^2", "Q: {y: x, x: y/9}", "linearly stable"),
        ("x^2", "", "stable"),  # apart from the motion along the set y, which is neutral
        # a circulatory force
        ("x^2 + y^2", "Q: {x: y/2, y: -x/2}", "unstable"),
    ],
)
def test_linear_terms_decide_or_not(potential: str, more: str, expected: str) -> None:
    assert verdict(potential, more) == expected


def test_gyroscopic_stabilization_is_not_proved_by_linear_terms() -> None:
    text = (
        "coordinates: [x, y]\nT: (x'^2 + y'^2)/2 + 3*(x*y' - y*x')\nV: -x^2 - y^2\n"
        "initial: {x: 0, y: 0, x': 0, y': 0}\n"
    )
    (one,) = lagcli.equilibrium(lagcli.load_text(text)).equilibria
    assert one.stability.verdict == "linearly stable"
    assert one.stability.stiffness == pytest.approx([-2.0, -2.0])
    assert np.abs(one.stability.eigenvalues.real).max() < 1e-14
