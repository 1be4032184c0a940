"""Starts from rest: coordinates without a size yet, beside others that have one."""

from pathlib import Path

import numpy as np
import pytest

import lagcli

ATWOOD = str(Path(__file__).parents[2] / "models" / "atwood.yaml")


@pytest.mark.parametrize(
    ("formulation", "method"),
    [
        ("baumgarte", "DOP853"),
        ("projection", "Rodas5P"),
        ("projection", "Radau"),
    ],
)
def test_an_atwood_machine_starts_from_rest(formulation: str, method: str) -> None:
    """The first steps are so short that rounding errors of the constraints must not count."""
    run = lagcli.simulate(
        lagcli.load(ATWOOD),
        formulation=formulation,
        method=method,
        max_steps=2000,
        samples=5,
    )
    assert run.status == "completed", run.message
    p = run.parameters
    total = p["m_1"] + p["m_2"] + p["J"] / p["R"] ** 2
    a = (p["m_1"] - p["m_2"]) * p["g"] / total
    np.testing.assert_allclose(run.q[:, 0], a * run.time**2 / 2, atol=1e-9)
    np.testing.assert_allclose(run.multipliers[:, 0], p["m_1"] * (p["g"] - a), rtol=1e-9)
