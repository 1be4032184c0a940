"""The models on the page on contact run as the page says."""

import re
from math import hypot
from pathlib import Path

import numpy as np

import lagcli

PAGE = (Path(__file__).parents[2] / "docs" / "contact.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```yaml\n(.*?)```", PAGE, re.S)
MODELS = [block for block in BLOCKS if "coordinates:" in block]


def test_the_page_shows_models() -> None:
    assert len(MODELS) == 2


def test_ball_with_restitution_and_friction_loses_energy() -> None:
    found = lagcli.simulate(lagcli.load_text(MODELS[0]), t_end=0.5, samples=11)
    assert found.status == "completed"
    assert found.events is not None
    assert (found.events.loss > 0).any()


def test_ball_slides_in_a_plane_and_rolls() -> None:
    """A billiard ball slides with the constant acceleration μ g against its slip s0, and rolls
    from t = 2 s0/(7 μ g) with v0 − 2/7 s0 (Coriolis, 1835)."""
    found = lagcli.simulate(lagcli.load_text(MODELS[1]), t_end=1, samples=101)
    start, slip = np.array([1, 0.5]), np.array([1 + 0.028 * 20, 0.5 + 0.028 * 30])
    end = 2 * hypot(*slip) / (7 * 0.2 * 9.81)
    assert np.allclose(found.v[-1, :2], start - 2 / 7 * slip, rtol=0, atol=1e-7)
    sliding = found.time < end
    t = found.time[sliding, None]
    parabola = start * t - 0.2 * 9.81 / 2 * t**2 * slip / hypot(*slip)
    assert np.abs(found.q[sliding, :2] - parabola).max() < 1e-5  # eps is 1 mm/s
    assert sliding.sum() > 20
