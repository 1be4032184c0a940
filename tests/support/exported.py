"""Models with states at which exported code is compared with the engine."""

from __future__ import annotations

import subprocess
from ctypes import CDLL, POINTER, c_double
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from shipped import PATHS

import lagcli
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.export.content import Content, content_of

#: One part in this many of the largest entry: two eliminations of one matrix, in other orders.
TOLERANCE = 1e-12


class Point(NamedTuple):
    """A state and what the engine computes there."""

    t: float
    q: Any
    v: Any
    p: Any
    mass: Any
    force: Any
    jacobian: Any
    rhs: Any
    a: Any
    multipliers: Any
    position: Any
    velocity: Any
    outputs: Any

    @property
    def state(self) -> tuple[Any, ...]:
        return self.t, self.q, self.v, self.p


@cache
def exported(name: str) -> Content:
    return content_of(lagcli.load(str(PATHS[name])))


@cache
def points(name: str, count: int = 6) -> list[Point]:
    """Return states of a run, moved at random away from it where no constraint is redundant."""
    content, random = exported(name), np.random.default_rng(1)
    system = content.system
    run = lagcli.simulate(content.model, samples=count + 1)
    reported, own = ScalarTape(system.report), ScalarTape(content.constraints)
    found = []
    for t, q, v in zip(run.time[1:], run.q[1:], run.v[1:], strict=True):
        p = np.array(content.start.state.p)
        if not content.redundant:
            q = q + 0.05 * random.standard_normal(len(q)) * np.abs(run.q).max(axis=0)
            v = v + 0.3 * random.standard_normal(len(v)) * (0.1 + np.abs(run.v).max(axis=0))
            p = p * (1 + 0.01 * random.standard_normal(len(p)))
        evaluator = Evaluator(system, tuple(p.tolist()))
        index1 = Index1(evaluator, content.start.rank)
        index1.measure(t, q, v)
        a, multipliers, _ = index1.accelerations(t, q, v)
        d = evaluator.dynamics(t, q, v)
        out = np.array(own([t, *q, *v, *p]))
        rest = np.array(reported([t, *q, *v, *a, *multipliers, *p]))
        parts = (d.mass_matrix, d.forcing, d.jacobian, d.rhs, a, multipliers)
        nh = system.counts.nh
        found.append(Point(float(t), q, v, p, *parts, out[:nh], out[nh:], rest))
    return found


def close(found: Any, expected: Any) -> bool:
    """Return whether arrays agree, relative to the largest entry."""
    expected = np.asarray(expected, dtype=float)
    found = np.asarray(found, dtype=float).reshape(expected.shape)
    size = np.abs(expected).max(initial=0.0)
    return bool(np.abs(found - expected).max(initial=0.0) <= TOLERANCE * size + 1e-13)


def module(text: str, name: str) -> ModuleType:
    """Return a module of Python from its text."""
    made = ModuleType(name)
    exec(compile(text, f"{name}.py", "exec"), made.__dict__)
    return made


def compiled(text: str, folder: Path, *flags: str) -> CDLL:
    """Compile code in C, with warnings as errors, to a library."""
    source, library = folder / "model.c", folder / "model.so"
    source.write_text(text, encoding="utf-8")
    strict = ("-std=c11", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off")
    command = ["cc", *strict, *flags, "-shared", "-fPIC", str(source), "-lm", "-o", str(library)]
    subprocess.run(command, check=True)
    return CDLL(str(library))


def pointers(*arrays: Any) -> list[Any]:
    return [x.ctypes.data_as(POINTER(c_double)) for x in arrays]
