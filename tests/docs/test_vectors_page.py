"""The models on the page on vectors and bodies load and run as the page says."""

import re
from pathlib import Path

import numpy as np
import pytest

import lagcli

PAGE = (Path(__file__).parents[2] / "docs" / "vectors.md").read_text()
BLOCKS = re.findall(r"```yaml\n(.*?)```", PAGE, re.S)
MODELS = [block for block in BLOCKS if "coordinates:" in block and "initial:" in block]


def test_the_page_shows_models() -> None:
    assert len(MODELS) == 4


def test_door_turns_about_its_hinge() -> None:
    model = lagcli.load_text(MODELS[0])
    assert model.coordinate_names == ("r.x", "r.y", "r.z", "e.0", "e.1", "e.2", "e.3")
    assert model.constraint_names[:5] == ("lower.x", "lower.y", "lower.z", "upright.x", "upright.y")
    run = lagcli.simulate(model, t_end=1, samples=5)
    # about a vertical hinge, the door keeps its rate, and the hinge bears its weight
    assert np.allclose(run.outputs["rate"], 1, atol=1e-9)
    assert np.allclose(run.outputs["force"], 20 * 9.81, rtol=1e-9)


@pytest.mark.parametrize(
    ("block", "parameters"),
    [(MODELS[1], "{N: 2, M: 3, m: 1, a: 0.1}"), (MODELS[2], "{k: 2, c: 1}")],
)
def test_other_models_load(block: str, parameters: str) -> None:
    lagcli.load_text(f"{block}\nparameters: {parameters}\n")


def test_charge_circles_at_the_frequency_that_the_page_says() -> None:
    run = lagcli.simulate(lagcli.load_text(MODELS[3]), t_end=10, samples=5)
    exact = np.stack([np.cos(run.time / 2), np.sin(run.time / 2)], axis=1)
    assert np.allclose(run.q, exact, atol=1e-8)
