"""Impulses of constraint forces against a closed form."""

from pathlib import Path

import numpy as np

import lagcli

MODELS = Path(__file__).parents[2] / "models"


def test_impulse_is_the_integral_of_the_multiplier() -> None:
    run = lagcli.simulate(lagcli.load(MODELS / "slider_crank.yaml"), t_end=1, samples=101)
    found = lagcli.impulses(run).by_constraint["guide"]
    assert found == np.trapezoid(run.multipliers[:, 0], run.time)
