"""Exported code of many random models has the values of the tapes, and solves the equations."""

from __future__ import annotations

import shutil
from ctypes import c_double
from pathlib import Path

import numpy as np
import pytest
from exported import compiled, module, pointers
from modelica import ModelicaModel
from random_cases import FUZZ_COUNT
from random_models import RandomModel

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.errors import LagcliError, UsageError
from lagcli.export.c import write_c
from lagcli.export.content import Content, content_of
from lagcli.export.modelica import write_modelica
from lagcli.export.python import write_casadi, write_numpy

#: Beyond this, rounding makes two solutions of the same equations differ.
CONDITION = 1e6
TOLERANCE = 1e-9
#: A program in C has tolerances from a run, which may be stiff.
SETTINGS = "name: random\nsimulation: {t_end: 0.01, samples: 3, max_steps: 200}\n"


def differ(found: object, expected: object) -> float:
    """Return the largest difference, relative to the largest entry; entries without value agree."""
    expected = np.asarray(expected, dtype=float).ravel()
    found = np.asarray(found, dtype=float).ravel()[: expected.size]
    known = np.isfinite(expected)
    size = max(1.0, np.abs(expected[known]).max(initial=0.0))
    if not np.isfinite(found[known]).all():
        return np.inf
    return float(np.abs(found - expected)[known].max(initial=0.0)) / size


def equations(content: Content, t: float, q: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
    """Return M, f, B and γ of the engine."""
    d = Evaluator(content.system, content.start.state.p).dynamics(t, q, v)
    return [d.mass_matrix, d.forcing, d.jacobian, d.rhs]


def check(seed: int, content: Content, folder: Path) -> None:
    """Compare the code in each language that can be run at three random states."""
    name, random = content.model.name, np.random.default_rng(seed)
    python = module(write_numpy(content), name)
    library = None
    if shutil.which("cc"):
        folder.mkdir()
        library = compiled(write_c(content), folder, "-O0")
    try:
        import casadi  # noqa: F401

        casadi_solution = module(write_casadi(content), name).dynamics()
    except ImportError:
        casadi_solution = None
    try:
        modelica = ModelicaModel(write_modelica(content))
    except UsageError:  # no erf
        modelica = None
    counts, state = content.system.counts, content.start.state
    p = np.array(state.p)
    for _ in range(3):
        t = np.float64(random.uniform(0, 2))
        q = np.array(state.q) + 0.3 * random.standard_normal(counts.nq)
        v = np.array(state.v) + random.standard_normal(counts.nq)
        mass, force, jacobian, rhs = expected = equations(content, t, q, v)
        if not all(np.isfinite(x).all() for x in expected):
            continue
        for found, own in zip(python.equations(t, q, v, p), expected, strict=True):
            assert differ(found, own) < 1e-13, seed
        arguments = [c_double(t), *pointers(q, v, p)]
        if library is not None:
            arrays = [np.zeros(x.size + 1) for x in expected]
            library[f"{name}_equations"](*arguments, *pointers(*arrays))
            for found, own in zip(arrays, expected, strict=True):
                # a compiler computes functions of constants itself, with another rounding
                assert differ(found, own) < 1e-13, seed
        if content.redundant:
            continue
        border = np.block([[mass, -jacobian.T], [jacobian, np.zeros((counts.nc, counts.nc))]])
        if np.linalg.cond(border) > CONDITION:
            continue
        solution = np.split(np.linalg.solve(border, np.concatenate([force, rhs])), [counts.nq])
        for own, found in zip(solution, python.dynamics(t, q, v, p), strict=True):
            assert differ(found, own) < TOLERANCE, seed
        if library is not None:
            a, multipliers = np.zeros(counts.nq), np.zeros(counts.nc + 1)
            assert library[f"{name}_dynamics"](*arguments, *pointers(a, multipliers)) == 0
            assert differ(a, solution[0]) < TOLERANCE, seed
            assert differ(multipliers, solution[1]) < TOLERANCE, seed
        if casadi_solution is not None:
            for own, found in zip(solution, casadi_solution(t, q, v, p), strict=True):
                assert differ(found, own) < TOLERANCE, seed
        if modelica is not None:
            motion = dict(zip(modelica.start, [*q, *v], strict=True))
            found = modelica.solution(float(t), motion, {"stabilization": 0.0})
            rates = [found[f"der({x})"] for x in modelica.start]
            assert differ(rates, [*v, *solution[0]]) < TOLERANCE, seed
        out = python.outputs(t, q, v, *solution, p)
        own = ScalarTape(content.report)([t, *q, *v, *solution[0], *solution[1], *p])
        assert differ(out, own) < 1e-12, seed


@pytest.mark.fuzz
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # values out of a domain
def test_code_of_random_models_has_their_values(tmp_path: Path) -> None:
    written = 0
    for seed in range(FUZZ_COUNT):
        try:
            content = content_of(lagcli.load_text(RandomModel(seed).text() + SETTINGS))
            content.rows  # noqa: B018  (refused where they are not clear)
        except LagcliError:  # no consistent initial state, or no value there
            continue
        written += 1
        check(seed, content, tmp_path / str(seed))
    assert written > 0.2 * FUZZ_COUNT
