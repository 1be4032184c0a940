"""The rates of constraints, as the core evaluates them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from core_parts import run_tape
from lowered import Lowered, lowered

import lagcli
from lagcli.engine.constraints.rates import constraint_program, with_rates

MODELS = Path(__file__).parents[4] / "models"


def shipped(name: str) -> Lowered:
    return lowered(lagcli.load(MODELS / f"{name}.yaml"))


def at(
    case: Lowered, t: float, q: np.ndarray, v: np.ndarray, output_subset: int = -1
) -> np.ndarray:
    """Return the outputs of the tape with ψ."""
    inputs = [t, *q, *v, *case.p]
    return np.asarray(run_tape(with_rates(case.system), inputs, output_subset=output_subset))


@pytest.mark.parametrize(
    "name", ["slider_crank", "four_bar", "chain", "driven_slider_crank", "rolling_disk"]
)
def test_rates_are_those_of_the_positions(name: str) -> None:
    case = shipped(name)
    system = case.system
    nh, nc, nq = len(system.holonomic), len(system.constraints), len(system.coordinates)
    rng = np.random.default_rng(1)
    q, v, h = rng.uniform(0.2, 1.0, nq), rng.normal(size=nq), 1e-5
    rates = at(case, 0.3, q, v)[-nc:]
    ahead, behind = (at(case, 0.3 + s * h, q + s * h * v, v)[:nh] for s in (1, -1))
    np.testing.assert_allclose(
        rates[list(system.holonomic)], (ahead - behind) / (2 * h), rtol=1e-7, atol=1e-7
    )
    # the others vanish with the velocities, but for what drives them
    still = at(case, 0.3, q, 0 * v)[-nc:]
    drift = nh + len(system.jacobian_pattern)
    np.testing.assert_array_equal(still, at(case, 0.3, q, v)[drift : drift + nc])


@pytest.mark.parametrize("name", ["slider_crank", "rolling_disk"])
def test_what_is_asked_for_alone_is_the_same(name: str) -> None:
    case = shipped(name)
    system = case.system
    nq = len(system.coordinates)
    q, v = np.linspace(0.3, 0.9, nq), np.linspace(-1.0, 2.0, nq)
    every = at(case, 0.1, q, v)
    for number, places in enumerate(with_rates(system).output_subsets):
        some = list(places)
        np.testing.assert_array_equal(at(case, 0.1, q, v, number)[some], every[some])


def test_the_program_is_made_once() -> None:
    system = shipped("slider_crank").system
    assert constraint_program(system) is constraint_program(system)
