"""Matrices of a System at many states, evaluated by the core and by NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from lowered import lowered
from shipped import PATHS

import lagcli
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
