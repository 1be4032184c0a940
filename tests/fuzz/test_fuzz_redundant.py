"""Random systems with redundant constraints: what the elimination leaves out costs nothing."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.engine.integrate import run
from tests.support.redundant_systems import check_like_dense, random_manifold, random_platform

SEEDS = 150


@pytest.fixture(autouse=True)
def _left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "LEAST_LEFT_OUT", 0)


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(SEEDS))
def test_the_motion_is_that_of_the_dense_solution(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    method = ("auto", "auto", "Taylor", "Radau")[seed % 4]
    check_like_dense(lagcli.load_text(random_manifold(seed)), monkeypatch, method=method)


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(SEEDS // 5))
def test_cranks_turn_fully(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    check_like_dense(lagcli.load_text(random_platform(seed)), monkeypatch)
