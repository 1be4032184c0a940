"""The core's watch for singular configurations: what it costs, and that it sees them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.engine.constraints.singular import RankWatch

FOUND = Path(__file__).parents[3] / "found"

#: A slider-crank whose rod is as long as its crank, beside pendulums that make B large.
FOLDING = """
parameters: {{N: {count}}}
coordinates: [phi, theta, x[1..N], y[1..N]]
T: phi'^2/2 + (phi'*cos(phi) - theta'*cos(theta))^2/2 + theta'^2/2 + sum(s[i], i = 1..N)
definitions: {{"s[i = 1..N]": x[i]'^2/2 + y[i]'^2/2}}
V: 9.81*sum(y[i], i = 1..N)
constraints:
  guide: sin(phi) - sin(theta) = 0
  rod[i = 1..N]: x[i]^2 + y[i]^2 = 1
initial:
  phi: 0.3
  theta: 2.841592653589793
  phi': 1
  theta': {{guess: -1}}
  x[i = 1..N]: sin(i/N)
  y[i = 1..N]: -cos(i/N)
  x[1..N]': 0
  y[1..N]': {{guess: 0}}
"""


@pytest.fixture
def decompositions(monkeypatch):
    """Count the singular value decompositions."""
    seen = []
    svd = np.linalg.svd

    def watched(*args, **kwargs):
        seen.append(args[0].shape)
        return svd(*args, **kwargs)

    monkeypatch.setattr(np.linalg, "svd", watched)
    return seen


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("ring100.yaml", {"set": {"N": 40}}),
        ("net_rods.yaml", {"set": {"N": 4}}),
    ],
)
def test_regular_motion_needs_no_decomposition(name, options, decompositions):
    """Pivots of a static order get small where B is far from losing rank."""
    found = lagcli.simulate(lagcli.load(FOUND / name, **options), samples=3)
    assert found.status == "completed", found.message
    assert not decompositions


@pytest.mark.parametrize(
    ("name", "most"), [("whitworth", 0), ("jansen_leg", 0), ("delta_robot", 1)]
)
def test_python_is_asked_only_next_to_a_singular_configuration(name, most, monkeypatch):
    """Their steps towards one are limited by the core: 94, 21 and 36 of them."""
    asked = []
    ahead = RankWatch.ahead

    def watched(self, states, *args):
        asked.append(states)
        return ahead(self, states, *args)

    monkeypatch.setattr(RankWatch, "ahead", watched)
    found = lagcli.simulate(lagcli.load(FOUND / f"{name}.yaml"), samples=3)
    assert found.status == "completed", found.message
    assert len(asked) <= most


def test_redundant_constraints_need_no_decomposition_in_each_step(decompositions):
    found = lagcli.simulate(lagcli.load(FOUND / "door_two_hinges.yaml"), t_end=2, samples=3)
    assert found.status == "completed", found.message
    steps = found.counts["steps"]
    # for the start alone
    assert len(decompositions) <= 25 < steps


@pytest.mark.parametrize("count", [1, 30])
def test_a_singular_configuration_is_seen_in_large_models_too(count):
    """Few rows of B are orthogonalized; of many the least singular value is estimated."""
    model = lagcli.load_text(FOLDING.format(count=count))
    found = lagcli.simulate(model, t_end=3, samples=31)
    assert found.status == "failed"
    assert "singular configuration at t = " in found.message
    assert "`guide`" in found.message
    # the crank is upright, and the rod lies on it, whatever there is beside
    phi = found.q[-1, 0]
    assert phi < np.pi / 2 < phi + 0.2
    passed = lagcli.simulate(model, t_end=3, samples=31, through_singular=True)
    assert passed.status == "completed", passed.message
    # beyond, the momentum is kept: the rod turns on
    assert passed.q[-1, 0] > np.pi / 2
