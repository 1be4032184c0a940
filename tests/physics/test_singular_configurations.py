"""No run passes a singular configuration unseen, or ends at one that its constraints exclude."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from known_events import METHODS
from singular_motions import Passage, folding_crank, losing_rank, stated_time, straight_four_bar

import lagcli

LINKAGES = (folding_crank, straight_four_bar)
#: Of lengths: how far two branches of the motion miss each other.
SHORT = (1e-3, 1e-5, 1e-7)


def check_losing_rank(seed: int, method: str) -> None:
    rng = np.random.default_rng(seed)
    text, time = losing_rank(rng)
    found = lagcli.simulate(lagcli.load_text(text), t_end=1.0, samples=2, method=method)
    assert found.status == "failed", (seed, method)
    # where the weakest singular value is below 1e-5, and its rate may be small
    assert stated_time(found.message) == pytest.approx(time, abs=5e-3), (seed, method)
    regular = lagcli.load_text(text.replace("{o: 0,", "{o: 1.3,"))
    kept = lagcli.simulate(regular, t_end=1.0, samples=2, method=method)
    assert kept.status == "completed", (seed, method, kept.message)


def check_many_rows(seed: int, method: str) -> None:
    """With as many rows as are watched by the determinant, and fewer."""
    rng = np.random.default_rng([seed, 28])
    rows, miss = int(np.exp(rng.uniform(np.log(12), np.log(60)))), 10 ** rng.uniform(-6, -2)
    state = rng.bit_generator.state
    text, time = losing_rank(rng, rows)
    found = lagcli.simulate(lagcli.load_text(text), t_end=1.0, samples=2, method=method)
    assert found.status == "failed", (seed, method)
    assert stated_time(found.message) == pytest.approx(time, abs=5e-3), (seed, method)
    rng.bit_generator.state = state
    text, _ = losing_rank(rng, rows, miss)
    kept = lagcli.simulate(lagcli.load_text(text), t_end=1.0, samples=2, method=method)
    assert kept.status == "completed", (seed, method, kept.message)


def check_singular_passage(
    seed: int, method: str, make: Callable[[np.random.Generator, float], Passage]
) -> None:
    passage = make(np.random.default_rng(seed), 0.0)
    found = lagcli.simulate(
        lagcli.load_text(passage.text), t_end=passage.end, samples=2, method=method
    )
    assert found.status == "failed", (seed, method)
    assert stated_time(found.message) == pytest.approx(passage.time, rel=1e-3), (seed, method)


def check_close_passage(
    seed: int,
    method: str,
    make: Callable[[np.random.Generator, float], Passage],
    short: float,
) -> None:
    passage = make(np.random.default_rng(seed), short)
    found = lagcli.simulate(
        lagcli.load_text(passage.text), t_end=passage.end, samples=51, method=method
    )
    assert found.status == "completed", (seed, method, found.message)
    at = found.coordinates.index(passage.name)
    wrong = np.abs(found.q[:, at] - passage.exact(found.time))
    # the driven coordinates are those of the projection: rounding errors times 1/√short
    assert np.minimum(wrong, np.abs(wrong - 2 * np.pi)).max() < 1e-8, (seed, method)


@pytest.mark.parametrize("method", METHODS)
def test_constraints_that_lose_rank_stop_the_run(method: str) -> None:
    for seed in range(8):
        check_losing_rank(seed, method)


@pytest.mark.parametrize(("seed", "method"), [(5, "Radau")])
def test_many_constraints_that_lose_rank_stop_the_run(seed: int, method: str) -> None:
    check_many_rows(seed, method)


@pytest.mark.parametrize("make", LINKAGES)
@pytest.mark.parametrize("method", METHODS)
def test_a_linkage_stops_where_its_branches_meet(
    method: str, make: Callable[[np.random.Generator, float], Passage]
) -> None:
    for seed in range(3):
        check_singular_passage(seed, method, make)


@pytest.mark.parametrize("short", SHORT)
@pytest.mark.parametrize("make", LINKAGES)
@pytest.mark.parametrize("method", ["DOP853", "Taylor"])
def test_a_linkage_turns_where_its_branches_miss_each_other(
    method: str, make: Callable[[np.random.Generator, float], Passage], short: float
) -> None:
    for seed in range(2):
        check_close_passage(seed, method, make, short)


@pytest.mark.fuzz
@pytest.mark.parametrize("method", METHODS)
def test_many_random_models(method: str) -> None:
    for seed in range(100, 500):
        check_losing_rank(seed, method)
    for seed in range(100, 150):
        check_many_rows(seed, method)
        for make in LINKAGES:
            check_singular_passage(seed, method, make)
            for short in SHORT:
                check_close_passage(seed, method, make, short)
