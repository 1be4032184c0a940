"""Random systems with redundant constraints: what the elimination leaves out costs nothing."""

from __future__ import annotations

import re

import numpy as np
import pytest

import lagcli
from lagcli.engine.integrate import run
from tests.support.redundant_systems import check_like_dense, random_manifold, random_platform
from tests.support.rows_alone import check_like_alone

SEEDS = 150


@pytest.fixture
def left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "LEAST_LEFT_OUT", 0)


@pytest.mark.fuzz
@pytest.mark.usefixtures("left_out")
@pytest.mark.parametrize("seed", range(SEEDS))
def test_the_motion_is_that_of_the_dense_solution(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    method = ("auto", "auto", "Taylor", "Radau")[seed % 4]
    check_like_dense(lagcli.load_text(random_manifold(seed)), monkeypatch, method=method)


@pytest.mark.fuzz
@pytest.mark.usefixtures("left_out")
@pytest.mark.parametrize("seed", range(SEEDS // 5))
def test_cranks_turn_fully(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    check_like_dense(lagcli.load_text(random_platform(seed)), monkeypatch)


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(SEEDS))
def test_rows_of_sweeps_are_single_runs(seed: int) -> None:
    if seed % 5:
        text = re.sub("V: (.*)", r"V: s*(\1)", random_manifold(seed))
        text = "parameters: {s: 1, k: 1}\n" + re.sub("T: (.*)", r"T: k*(\1)", text)
        columns = ["s", "k", *(["x0'"] if seed % 2 else [])]
    else:
        text, columns = random_platform(seed), ["al0'"]
    model = lagcli.load_text(text)
    given = model.parameter_values | {f"{q}'": x.value for q, x in model.initial_velocities.items()}
    parts = np.random.default_rng(seed).uniform(0.95, 1.05, (10, len(columns)))
    table = parts * [given[name] for name in columns]
    # a thousand times rtol: a and λ where some rows have become almost dependent
    check_like_alone(model, columns, table, 1e-6, t_end=2.0, rtol=1e-9)
