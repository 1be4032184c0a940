"""The elimination of exported code, also where its order of pivots does not suit a state."""

from __future__ import annotations

import math
import shutil
from ctypes import c_double
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported import compiled, module, pointers

import lagcli
from lagcli.export.c import write_c
from lagcli.export.content import Content, content_of
from lagcli.export.python import write_casadi, write_jax, write_numpy

NEEDS_CC = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
#: z has no inertia: λ = k z. Its pivot with x vanishes where cos(w t) = 0.
MASSLESS = """
name: massless
coordinates: [x, z]
parameters: {w: 1, k: 3, m: 1, c: 4, a: 2}
T: m*x'^2/2
V: c*(x - 1)^2/2 + k*z^2/2
constraints: {rod: z = a*cos(w*t)*x}
initial: {x: 1.3, x': 0, z: {guess: 2.6}, z': {guess: 0}}
simulation: {t_end: 1}
"""
BESIDE = (0.0, 1e-16, 1e-14, -1e-12, 1e-10, -1e-8, 1e-6, 1e-3)


def exact(t: float, x: float, v: float, z: float, p: Any) -> list[float]:
    """Return x″, z″ and λ of `MASSLESS` at any state."""
    w, k, m, c, a = p
    multiplier = k * z  # k z = λ; m x″ = −c (x − 1) − λ a cos(w t)
    b, rate, second = a * math.cos(w * t), -a * w * math.sin(w * t), -a * w**2 * math.cos(w * t)
    x2 = (-c * (x - 1) - multiplier * b) / m
    return [x2, b * x2 + 2 * rate * v + second * x, multiplier]


def massless_states() -> list[tuple[float, Any, Any, Any]]:
    """Return states at and beside vanishing pivots, on the constraint and not, with other p."""
    rng, found = np.random.default_rng(2), []
    for beside in BESIDE:
        for consistent in (True, False):
            p = np.array([1, 3, 1, 4, 2]) * rng.uniform(0.5, 2, 5)
            x, v, z = rng.uniform(0.5, 2, 3)
            t = math.pi / 2 / p[0] + beside
            if consistent:
                z = p[4] * math.cos(p[0] * t) * x
            found.append((t, np.array([x, z]), np.array([v, 0.3]), p))
    return found


def check(found: Any, state: tuple[float, Any, Any, Any]) -> None:
    t, q, v, p = state
    expected = exact(t, q[0], v[0], q[1], p)
    got = np.concatenate([np.ravel(x) for x in found])
    assert np.abs(got - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.fixture(scope="module")
def massless() -> Content:
    content = content_of(lagcli.load_text(MASSLESS))
    assert content.solved is not None
    return content


def solver_in_c(content: Content, folder: Path) -> Any:
    library, counts = compiled(write_c(content), folder, "-O2"), content.system.counts

    def solve(t: float, *arrays: Any) -> Any:
        a, multipliers = np.zeros(counts.nq), np.zeros(counts.nc + 1)
        given = [np.ascontiguousarray(x, dtype=float) for x in arrays]
        function = library[f"{content.model.name}_dynamics"]
        status = function(c_double(t), *pointers(*given), *pointers(a, multipliers))
        return None if status else (a, multipliers[: counts.nc])

    return solve


@NEEDS_CC
def test_c_where_pivots_vanish(massless: Content, tmp_path: Path) -> None:
    solve = solver_in_c(massless, tmp_path)
    for state in massless_states():
        check(solve(*state), state)


def test_numpy_where_pivots_vanish(massless: Content) -> None:
    own = module(write_numpy(massless), "massless")
    for state in massless_states():
        check(own.dynamics(*state), state)
    accurate = [own.eliminated(*state)[2] for state in massless_states()]
    assert not all(accurate), "no state is near enough to a vanishing pivot"


def test_casadi_where_pivots_vanish(massless: Content) -> None:
    ca = pytest.importorskip("casadi")
    own = module(write_casadi(massless), "massless")
    dynamics, state = own.dynamics(), own.symbols()
    point = [ca.MX.sym("x", *x.shape) for x in state]
    slope = ca.Function("slope", point, [ca.jacobian(dynamics(*point)[1], point[1])])
    for t, q, v, p in massless_states():
        check([np.array(x) for x in dynamics(t, q, v, p)], (t, q, v, p))
        assert np.allclose(np.array(slope(t, q, v, p)), [[0, p[1]]], rtol=1e-10, atol=1e-10)


def test_jax_where_pivots_vanish(massless: Content) -> None:
    jax = pytest.importorskip("jax")
    own = module(write_jax(massless), "massless")
    states = massless_states()
    columns = [np.array(x) for x in zip(*states, strict=True)]
    one, many = jax.jit(own.dynamics), jax.jit(jax.vmap(own.dynamics))
    for k, state in enumerate(states):
        check(one(*state), state)
        check([x[k] for x in many(*columns)], state)
    # reverse mode, through states that are accurate and states that are not
    slopes = jax.grad(lambda q: many(columns[0], q, *columns[2:])[1].sum())(columns[1])
    expected = np.column_stack([np.zeros(len(states)), columns[3][:, 1]])
    assert np.allclose(slopes, expected, rtol=1e-10, atol=1e-10)


#: Two masses on rods; their order of elimination depends on m and M, which may vanish.
SINGULAR = """
name: singular
coordinates: [x, y]
parameters: {m: 1, M: 2, k: 3}
T: m*x'^2/2 + M*y'^2/2
V: k*x^2/2 + k*y
constraints: {c: x = y^2}
initial: {y: 1, x: {guess: 1}, y': 0, x': {guess: 0}}
simulation: {t_end: 0.5}
"""


@NEEDS_CC
def test_undetermined_accelerations_are_refused_in_c(tmp_path: Path) -> None:
    solve = solver_in_c(content_of(lagcli.load_text(SINGULAR)), tmp_path)
    q, v = np.array([1.0, 1.0]), np.array([2.0, 1.0])
    for m, M in [(1, 2), (0, 2), (1, 0), (1e-30, 1), (1, 1e-30), (1e20, 1e-20)]:
        a, multipliers = solve(0.0, q, v, np.array([m, M, 3.0]))
        # x″ = 2 y″ + 2; m x″ = −k x + λ; M y″ = −k − 2 y λ
        y2 = -(9 + 4 * m) / (M + 4 * m)
        multiplier = -(3 + M * y2) / 2
        expected = [2 * y2 + 2 if m <= M else (multiplier - 3) / m, y2]
        assert np.abs(a - expected).max() <= 1e-12 * np.abs(expected).max()
        assert np.allclose(multipliers, multiplier, rtol=1e-12, atol=0)
    assert solve(0.0, q, v, np.array([0.0, 0.0, 3.0])) is None
    assert solve(0.0, np.array([math.nan, 1.0]), v, np.array([1.0, 2.0, 3.0])) is None
    assert solve(0.0, np.array([math.inf, 1.0]), v, np.array([1.0, 2.0, 3.0])) is None
