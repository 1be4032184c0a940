"""Angles and lengths of coordinates."""

from __future__ import annotations

from pathlib import Path

import pytest

import lagcli
from lagcli.analysis.local.local_equations import LocalEquations

MODELS = Path(__file__).parents[4] / "models"


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("slider_crank", {"phi", "psi"}),
        ("pendulum_cartesian", set()),
        ("bead_on_rotating_hoop", {"theta"}),  # phi = Omega*t is no angle that can be folded
        ("rolling_disk", {"psi", "theta"}),  # phi enters nothing
        ("heavy_top", set()),
        ("chaplygin_sleigh", {"theta"}),
    ],
)
def test_angles_are_coordinates_with_the_period_of_a_turn(name: str, expected: set[str]) -> None:
    model = lagcli.load(MODELS / f"{name}.yaml")
    found = LocalEquations(model).angles
    assert {q for q, x in zip(model.coordinate_names, found, strict=True) if x} == expected


def test_lengths_are_of_the_size_of_the_mechanism() -> None:
    local = LocalEquations(lagcli.load(MODELS / "pendulum_cartesian.yaml"))
    length = local.p[list(local.model.parameters).index("l")]
    assert local.lengths == pytest.approx([length, length], rel=0.5)
    crank = LocalEquations(lagcli.load(MODELS / "slider_crank.yaml"))
    assert crank.lengths.tolist() == [1.0, 1.0]
    assert crank.entering == (0, 1)
