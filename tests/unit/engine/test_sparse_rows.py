"""Jacobians by their nonzero entries give what arrays give."""

from __future__ import annotations

import numpy as np
import pytest
from random_cases import FUZZ_COUNT
from shipped import PATHS, REPRESENTATIVES

import lagcli
from lagcli.engine import evaluator
from lagcli.engine.scales import coordinate_sizes, least_scales, lengths_of_rows, row_lengths
from lagcli.engine.sparse_rows import SparseRows, entries_of, in_turns, magnitudes
from lagcli.errors import LagcliError
from lagcli.model.loader import load_text
from lagcli.simulations.simulation import prepare

#: Sums run in another order.
ROUNDING = {"rtol": 1e-13, "atol": 1e-15}


def random_rows(random: np.random.Generator) -> tuple[SparseRows, np.ndarray]:
    """Return a matrix by its entries, in any order, and as an array; rows and columns may be
    empty."""
    shape = tuple(random.integers(1, 12, 2).tolist())
    whole = random.normal(size=shape) * (random.random(shape) < random.random())
    row, column = whole.nonzero()
    order = random.permutation(len(row))
    row, column = row[order], column[order]
    return SparseRows(shape, row, column, whole[row, column]), whole


def check(seed: int) -> None:
    random = np.random.default_rng(seed)
    rows, whole = random_rows(random)
    n, nq = whole.shape
    np.testing.assert_array_equal(np.asarray(rows), whole)
    np.testing.assert_array_equal(np.asarray(magnitudes(rows)), np.abs(whole))
    assert sorted(entries_of(rows)) == sorted(whole[whole != 0])
    some = random.permutation(n)[: random.integers(0, n + 1)].tolist()
    np.testing.assert_array_equal(np.asarray(rows[some]), whole[some])
    np.testing.assert_array_equal(rows[0], whole[0])
    np.testing.assert_array_equal(rows[:, : nq // 2], whole[:, : nq // 2])
    x, sizes = random.normal(size=nq), random.uniform(0.1, 10, nq)
    np.testing.assert_allclose(rows @ x, whole @ x, **ROUNDING)
    np.testing.assert_array_equal(np.asarray(rows * sizes), whole * sizes)
    np.testing.assert_allclose(
        lengths_of_rows(rows, sizes), lengths_of_rows(whole, sizes), **ROUNDING
    )
    np.testing.assert_allclose(lengths_of_rows(rows, 2.0), lengths_of_rows(whole, 2.0), **ROUNDING)
    inertia = random.uniform(0.5, 2, nq) * (random.random(nq) < random.random())
    np.testing.assert_allclose(
        least_scales(inertia, rows, x), least_scales(inertia, whole, x), **ROUNDING
    )
    np.testing.assert_allclose(
        coordinate_sizes(inertia, rows), coordinate_sizes(inertia, whole), **ROUNDING
    )
    terms, reach = random.uniform(0, 1e6, n), random.uniform(0, 2, n)
    np.testing.assert_allclose(
        row_lengths(rows, sizes, terms, reach), row_lengths(whole, sizes, terms, reach), **ROUNDING
    )


def check_least(seed: int) -> None:
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 40))
    nq = n + int(random.integers(0, 40))
    whole = random.normal(size=(n, nq)) * (random.random((n, nq)) < 4 / nq) + np.eye(n, nq)
    if random.random() < 0.5:  # almost dependent
        part = 10.0 ** -random.uniform(0, 12)
        whole[-1] = part * whole[-1] + whole[:-1].T @ random.normal(size=n - 1)
    rows = SparseRows(whole.shape, *whole.nonzero(), whole[whole.nonzero()])
    values = np.linalg.svd(whole, compute_uv=False)
    # half of the digits, since the matrix is squared
    assert abs(rows.least_singular_value() - values[-1]) < 1e-9 * values[-1] + 3e-7 * values[0]
    if values[-1] > 1e-5 * values[0]:
        assert rows.least_singular_value() == pytest.approx(values[-1], rel=1e-3)


@pytest.mark.parametrize("seed", range(40))
def test_the_least_singular_value_is_that_of_an_array(seed: int) -> None:
    check_least(seed)


@pytest.mark.parametrize("seed", range(30))
def test_rows_are_those_of_an_array(seed: int) -> None:
    check(seed)


@pytest.mark.fuzz
def test_any_rows_are_those_of_an_array() -> None:
    for seed in range(30, 30 + FUZZ_COUNT):
        check(seed)
        check_least(10 + seed)


@pytest.mark.parametrize("name", REPRESENTATIVES)
def test_the_start_is_that_with_an_array(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before = prepare(lagcli.load(PATHS[name])).start
    monkeypatch.setattr(evaluator, "_LARGE", 0)
    after = prepare(lagcli.load(PATHS[name])).start
    np.testing.assert_allclose(after.state.q, before.state.q, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(after.state.v, before.state.v, rtol=1e-12, atol=1e-14)
    assert (after.rank, after.moved.keys()) == (before.rank, before.moved.keys())


@pytest.mark.parametrize(
    "initial",
    [
        "x: 0.3\n  y: ~0.3\n  x': 0",  # y moves
        "x: 3\n  y: ~0.3",  # there is no position
        "x: 0.6\n  y: ~0.3\n  x': 1\n  y': 1",  # nor velocity
        "x: 0.6\n  y: 0\n  x': ~0",
    ],
)
def test_what_moves_and_what_is_refused_are_those_with_an_array(
    initial: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (
        "name: rod\ncoordinates: [x, y]\nT: x'^2 + y'^2\nV: 9*y\n"
        f"constraints:\n  rod: x^2 + y^2 = 1\ninitial:\n  {initial}\nsimulation: {{t_end: 1}}\n"
    )

    def found() -> object:
        try:
            start = prepare(load_text(text)).start
        except LagcliError as error:
            return str(error)
        return start.state.q.round(12).tolist(), start.state.v.round(12).tolist()

    before = found()
    monkeypatch.setattr(evaluator, "_LARGE", 0)
    assert found() == before


def test_turns_have_the_entries_of_each_row_in_order() -> None:
    random = np.random.default_rng(8)
    for _ in range(40):
        rows = random.integers(0, 9, random.integers(0, 60))
        turns = in_turns(rows)
        assert sorted(x for turn in turns for x in turn) == list(range(len(rows)))
        for row in range(9):
            assert [x for turn in turns for x in turn if rows[x] == row] == [
                *np.flatnonzero(rows == row)
            ]
        assert all(len(set(rows[turn])) == len(turn) for turn in turns)
