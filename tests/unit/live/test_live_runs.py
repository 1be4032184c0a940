"""Runs of the core as WebAssembly against `simulate`, without a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live import Live
from shipped import PATHS

import lagcli
from lagcli.simulations.simulation import simulate
from lagcli.trajectory.trajectory import Trajectory

#: Models whose pages are tried by default: constraints, contacts, events that set parameters.
CHOSEN = ("slider_crank", "bouncing_ball", "sampled_pendulum")
#: Functions of libm differ in the last bit, by which steps are accepted or rejected: differences
#: are those of the tolerance, 1e-9 of the largest value by default, grown along the motion.
TOLERANCE = 1e-6


def assert_close(found: np.ndarray, expected: np.ndarray, what: str) -> None:
    """Compare columns by the largest value of each, and of all."""
    assert found.shape == expected.shape, what
    if found.size:
        largest = np.abs(expected).max(axis=0)
        scale = np.where(largest > 1e-6 * largest.max(), largest, largest.max())
        scale[scale == 0.0] = 1.0
        assert (np.abs(found - expected) / scale).max() < TOLERANCE, what


def assert_agrees(live: Live, made: dict[str, Any], expected: Trajectory) -> None:
    """The samples, the energies and the log of a page are those of `simulate`."""
    assert made.get("error") is None
    assert made["status"] == 1, made["message"]
    for name, values in live.quantities(made).items():
        assert_close(
            values.reshape(len(values), -1), getattr(expected, name).reshape(len(values), -1), name
        )
    for name in ("energy_total", "energy_kinetic", "energy_potential"):
        column = made["columns"][live.drawn[name]]
        assert_close(column[:, None], getattr(expected, name)[:, None], name)
    for name, values in expected.outputs.items():
        scale = np.abs(values).max() or 1.0
        if scale > 1e-9 and name in live.drawn:  # not noise
            assert np.abs(made["columns"][live.drawn[name]] - values).max() < 1e-5 * scale
    if expected.events is not None:
        times = sorted(entry[0] for entry in made["log"])
        np.testing.assert_allclose(times, np.sort(expected.events.time), atol=1e-8)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in CHOSEN else pytest.mark.slow) for name in PATHS],
)
def test_a_page_has_the_numbers_of_simulate(name: str, tmp_path: Path) -> None:
    model = lagcli.load(name)
    live = Live(model, tmp_path)
    [made] = live.run([live.case()])
    assert_agrees(live, made, simulate(model))


def test_changed_values_start_consistently(tmp_path: Path) -> None:
    """Parameters on which initial values depend; a guess; then the model's own values again."""
    model = lagcli.load("slider_crank")
    live = Live(model, tmp_path)
    cases = [
        live.case({"m": 2.5, "l": 0.35}),
        live.case(initial={"phi": (0.4, False), "psi": (0.3, True)}),
        live.case(),
    ]
    made = live.run(cases)
    changed = lagcli.load("slider_crank", {"m": "2.5*1", "l": "0.35*1"})
    assert_agrees(live, made[0], simulate(changed))
    turned = lagcli.load("slider_crank", {}, {"phi": "0.4*1", "psi": "{guess: 0.3*1}"})
    assert_agrees(live, made[1], simulate(turned))
    assert_agrees(live, made[2], simulate(model))


def test_contradictions_and_violated_contacts_are_errors(tmp_path: Path) -> None:
    folder = tmp_path / "crank"
    folder.mkdir()
    crank = Live(lagcli.load("slider_crank"), folder)
    wrong = crank.case(initial={"phi": (0.4, False), "psi": (1.4, False)})
    ball = Live(lagcli.load("bouncing_ball"), tmp_path)
    below = ball.case(initial={"y": (-0.5, False)})
    assert "do not satisfy the constraints" in crank.run([wrong])[0]["error"]
    assert "a contact is violated" in ball.run([below])[0]["error"]


def test_a_lower_accuracy_takes_fewer_steps(tmp_path: Path) -> None:
    live = Live(lagcli.load("slider_crank"), tmp_path)
    fine, coarse = live.run([live.case(), live.case(rtol=1e-6)])
    assert coarse["steps"] < 0.7 * fine["steps"]


def test_guesses_at_zero_are_found(tmp_path: Path) -> None:
    """All terms of x − u(t) = 0 may vanish at the start, where rounding is as large as they are."""
    model = lagcli.load("car_on_road")
    name, value = next((n, x.value) for n, x in model.initial.items() if not x.fixed)
    live = Live(model, tmp_path)
    made = live.run([live.case(initial={name: (value - 0.056, True)})])
    changed = lagcli.load("car_on_road", {}, {name: f"{{guess: {value - 0.056}*1}}"})
    assert_agrees(live, made[0], simulate(changed))
