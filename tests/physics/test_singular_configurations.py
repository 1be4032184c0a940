"""No run passes a singular configuration unseen, or ends at one that its constraints exclude."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from known_events import METHODS
from singular_motions import (
    Passage,
    beside_an_oscillator,
    folding_crank,
    losing_rank,
    stated_accuracy,
    stated_time,
    straight_four_bar,
    swinging_crank,
    turning_velocity,
)

import lagcli

LINKAGES = (folding_crank, straight_four_bar)
#: Of lengths: how far two branches of the motion miss each other.
SHORT = (1e-3, 1e-5, 1e-7)


def check_losing_rank(seed: int, method: str, beside: float = 0.0) -> None:
    rng = np.random.default_rng(seed)
    text, time = losing_rank(rng)
    text = beside_an_oscillator(text, beside) if beside else text
    found = lagcli.simulate(lagcli.load_text(text), t_end=1.0, samples=2, method=method)
    assert found.status == "failed", (seed, method)
    # where the weakest singular value is below 1e-5, and its rate may be small
    assert stated_time(found.message) == pytest.approx(time, abs=5e-3), (seed, method)
    regular = lagcli.load_text(text.replace("{o: 0,", "{o: 1.3,"))
    kept = lagcli.simulate(regular, t_end=1.0, samples=2, method=method)
    assert kept.status == "completed", (seed, method, kept.message)


def oscillation(seed: int) -> float:
    """Return the angular frequency of an oscillator beside the constraints, rad/s."""
    return round(float(np.random.default_rng([seed, 5]).uniform(0.5, 20)), 3)


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
    within = stated_accuracy(found.message)
    assert within < 1e-4 * passage.time
    assert stated_time(found.message) == pytest.approx(passage.time, abs=within), (seed, method)
    assert found.message.endswith("--through-singular continues through it"), (seed, method)


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


def check_continued_passage(seed: int, method: str, beside: int) -> None:
    """A run that says that it can be continued is, on the branch of the closed form."""
    passage = swinging_crank(np.random.default_rng([seed, 31]), beside)
    model, options = lagcli.load_text(passage.text), {"samples": 9, "method": method, "rtol": 1e-10}
    found = lagcli.simulate(model, t_end=passage.end, **options)
    assert found.status == "failed", (seed, method)
    within = stated_accuracy(found.message)
    assert within < 1e-4 * passage.time
    assert stated_time(found.message) == pytest.approx(passage.time, abs=within), (seed, method)
    assert found.message.endswith("--through-singular continues through it"), (seed, method)
    passed = lagcli.simulate(model, t_end=passage.end, through_singular=True, **options)
    assert passed.status == "completed", (seed, method, passed.message)
    at = passed.coordinates.index(passage.name)
    wrong = np.abs(passed.q[:, at] - passage.exact(passed.time)).max()
    assert wrong < 1e-8, (seed, method, wrong)


def check_turning_velocity(seed: int, method: str) -> None:
    """Where B depends on v: with few steps, and with many."""
    rng = np.random.default_rng([seed, 33])
    options = {"method": method, "rtol": float(10 ** rng.uniform(-9, -3)), "samples": 2}
    state = rng.bit_generator.state
    text, time = turning_velocity(rng, 0.0)
    found = lagcli.simulate(lagcli.load_text(text), t_end=time + 0.5, **options)
    assert found.status == "failed", (seed, method)
    within = stated_accuracy(found.message)
    since = re.search(r"extrapolated from t = (\S+) s\)", found.message)
    rounding = 2 * 10 ** np.floor(np.log10(within))  # of both numbers
    assert since is None or within < stated_time(found.message) - float(since[1]) + rounding
    within = max(within, 5e-3)
    assert within < 0.1
    assert stated_time(found.message) == pytest.approx(time, abs=within), (seed, method)
    rng.bit_generator.state = state
    text, _ = turning_velocity(rng, 1e-2)
    kept = lagcli.simulate(lagcli.load_text(text), t_end=time + 0.5, **options)
    assert kept.status == "completed", (seed, method, kept.message)


@pytest.mark.parametrize("method", METHODS)
def test_constraints_that_lose_rank_stop_the_run(method: str) -> None:
    for seed in range(4):
        check_losing_rank(seed, method)


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_constraints_on_velocities_that_lose_rank_stop_the_run(method: str) -> None:
    for seed in range(4):
        check_turning_velocity(seed, method)


@pytest.mark.parametrize(("seed", "method"), [(368, "Radau"), (255, "Rodas5P")])
def test_a_time_is_not_extrapolated_from_states_that_are_too_far(seed: int, method: str) -> None:
    check_turning_velocity(seed, method)


@pytest.mark.parametrize("seed", [4, 7, 15, 17])
def test_steps_in_which_b_moves_far_pass_no_singular_configuration(seed: int) -> None:
    """Few rows, whose determinant is watched where the path of B exceeds what it may be."""
    check_losing_rank(seed, "DOP853", beside=oscillation(seed))


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "method"), [(5, "Radau")])
def test_many_constraints_that_lose_rank_stop_the_run(seed: int, method: str) -> None:
    check_many_rows(seed, method)


def test_redundant_constraints_that_leave_no_freedom() -> None:
    """As many independent constraints as coordinates, and one more: no singular configuration."""
    found = lagcli.simulate(
        lagcli.load_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
constraints: {one: x = t, two: y = t^2, three: x + y = t + t^2}
initial: {x: {guess: 0}, y: {guess: 0}, x': {guess: 0}, y': {guess: 0}}
"""),
        t_end=2.0,
        samples=2,
    )
    assert found.status == "completed"
    np.testing.assert_allclose(found.q[-1], [2, 4], rtol=1e-12)


@pytest.mark.parametrize("make", LINKAGES)
@pytest.mark.parametrize("method", METHODS)
def test_a_linkage_stops_where_its_branches_meet(
    method: str, make: Callable[[np.random.Generator, float], Passage]
) -> None:
    for seed in range(3):
        check_singular_passage(seed, method, make)


@pytest.mark.parametrize("rows", [1, 30])
@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Radau"])
def test_the_motion_ends_at_a_cusp(method: str, rows: int) -> None:
    """Arcs of y² = x³ from the cusp to x = u are as long as ((4 + 9 u)^(3/2) - 8)/27. A polynomial
    is no good path to it, where the accelerations are infinite, and no motion goes on."""
    model = lagcli.load_text(f"""
parameters: {{N: {rows}}}
coordinates: [x, y, u[1..N]]
T: (x'^2 + y'^2 + sum(u[i]'^2, i = 1..N))/2
constraints:
  c: y^2 = x^3
  other[i = 1..N]: u[i] = 0
initial:
  x: 1
  x': -1
  y: {{guess: 1}}
  y': {{guess: -1.5}}
  u[1..N]: 0
  u[1..N]': 0
simulation: {{t_end: 2, samples: 2}}
""")
    time = (13**1.5 - 8) / 27 / np.hypot(1, 1.5)
    found = lagcli.simulate(model, method=method)
    within = stated_accuracy(found.message)
    assert 1e-4 < within < 1e-2
    assert stated_time(found.message) == pytest.approx(time, abs=within)
    assert "extrapolated from t = 0.7" in found.message
    assert found.message.endswith("no smooth continuation beyond it has been found")
    assert lagcli.simulate(model, method=method, through_singular=True).status == "failed"


@pytest.mark.parametrize("beside", [1, 30])
def test_the_motion_continues_as_advised(beside: int) -> None:
    check_continued_passage(0, "DOP853", beside)


@pytest.mark.parametrize("short", SHORT)
@pytest.mark.parametrize("make", LINKAGES)
@pytest.mark.parametrize("method", ["DOP853", "Taylor"])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.fuzz)])
def test_a_linkage_turns_where_its_branches_miss_each_other(
    seed: int, method: str, make: Callable[[np.random.Generator, float], Passage], short: float
) -> None:
    check_close_passage(seed, method, make, short)


@pytest.mark.fuzz
@pytest.mark.parametrize("method", METHODS)
def test_many_random_models(method: str) -> None:
    for seed in range(100, 500):
        check_losing_rank(seed, method)
        check_turning_velocity(seed, method)
        check_losing_rank(seed, method, beside=oscillation(seed))
    for seed in range(100, 150):
        check_many_rows(seed, method)
        check_continued_passage(
            seed, method, int(10 ** np.random.default_rng(seed).uniform(0, 2.6))
        )
        for make in LINKAGES:
            check_singular_passage(seed, method, make)
            for short in SHORT:
                check_close_passage(seed, method, make, short)
