"""The search for all equilibria."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.analysis.equilibria import search

MODELS = Path(__file__).parents[4] / "models"


def test_angles_are_folded_and_duplicates_removed() -> None:
    text = (
        "coordinates: [theta, x]\nparameters: {k: 2}\n"
        "T: theta'^2/2 + x'^2/2\nV: -cos(theta) + k/2*(x - 1)^2\n"
        "initial: {theta: 50, x: 0, theta': 0, x': 0}\n"
    )
    found = lagcli.equilibrium(lagcli.load_text(text), all=True, starts=8)
    q = np.array([one.operating_point.point.q for one in found.equilibria])
    assert q == pytest.approx(np.array([[0, 1], [np.pi, 1]]), abs=1e-10)
    assert [one.stability.verdict for one in found.equilibria] == ["stable", "unstable"]


def test_a_set_of_equilibria_is_one() -> None:
    # the mass slides along x freely
    text = (
        "coordinates: [x, y]\nT: (x'^2 + y'^2)/2\nV: 9.81*y\nconstraints: {table: y = 0}\n"
        "initial: {x: 0, y: 0, x': 0, y': 0}\n"
    )
    (one,) = lagcli.equilibrium(lagcli.load_text(text), all=True, starts=8).equilibria
    assert (one.dimension, one.neutral_coordinates) == (1, (0,))
    assert one.operating_point.point.multipliers == pytest.approx([9.81])


def test_a_root_that_is_found_again_is_not_examined_again(count_calls) -> None:
    counts = count_calls((search, "completed"), (search, "_keep"))
    found = lagcli.equilibrium(lagcli.load(MODELS / "pendulum_cartesian.yaml"), all=True, starts=8)
    assert counts["completed"] == len(found.equilibria) == 2
    assert counts["_keep"] > 2


@pytest.mark.slow
def test_a_chain_of_three_rods_has_eight_equilibria() -> None:
    model = lagcli.load(MODELS / "chain.yaml", set={"N": "3"})
    found = lagcli.equilibrium(model, all=True)
    signs = {tuple(np.sign(np.diff([0, *x.operating_point.point.q[3:]]))) for x in found.equilibria}
    assert len(signs) == len(found.equilibria) == 8
