"""Matrices of a System at many states, evaluated by the core and by NumPy."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from lowered import lowered
from shipped import PATHS

import lagcli
from lagcli.arrays import Array
from lagcli.engine.integrate import many_states
from lagcli.engine.integrate.many_states import Batch


@pytest.mark.parametrize("name", ["heavy_top", "chain", "four_bar", "stick_slip_belt"])
@pytest.mark.parametrize("count", [0, 1, 7, 8, 13])
def test_long_tapes_have_the_values_of_arrays(
    name: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    system, p = lowered(lagcli.load(PATHS[name]))
    random = np.random.default_rng(count)
    t, nq, nc = random.normal(size=count), len(system.coordinates), len(system.constraints)
    q, v, a = random.normal(size=(3, count, nq))
    multipliers = random.normal(size=(count, nc))
    found = []
    for long in (0, 10**9):
        monkeypatch.setattr(many_states, "_LONG", long)
        many_states._on_arrays.cache_clear()
        batch = Batch(system, p, t, q, v)
        found.append([*batch.entries(), batch.report(a, multipliers)])
    many_states._on_arrays.cache_clear()
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-14)


def test_threads_share_a_long_tape(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many_states, "_LONG", 0)
    many_states._on_arrays.cache_clear()
    system, p = lowered(lagcli.load(PATHS["chain"]))
    states = np.random.default_rng(1).normal(size=(4, 200, 1 + 2 * len(system.coordinates)))

    def evaluated(x: Array) -> Array:
        nq = len(system.coordinates)
        batch = Batch(system, p, x[:, 0], x[:, 1 : 1 + nq], x[:, 1 + nq :])
        return np.vstack(batch.entries())

    expected = [evaluated(x) for x in states]
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(evaluated, [x for _ in range(25) for x in states]))
    many_states._on_arrays.cache_clear()
    for k, one in enumerate(found):
        np.testing.assert_array_equal(one, expected[k % 4])
