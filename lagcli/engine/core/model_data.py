"""A model as data for programs on the core: `lagmodel.h` states the format."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli.engine.program.program import Program

if TYPE_CHECKING:
    from lagcli.engine.linear.elimination import Elimination
    from lagcli.engine.system import System

#: lag_model_solution: how a and λ are solved for.
DENSE, UNROLLED, ELIMINATION = range(3)
_MAGIC, _VERSION = int.from_bytes(b"lagmodel", "little"), 1


def model_data(
    system: System,
    constraint: Program,
    dynamics: Program,
    settings: dict[str, Any],
    plan: Elimination | None = None,
    *,
    unrolled: bool = False,
) -> bytes:
    """Return a System and a start as data, which `lag_read_model` reads.

    Parameters
    ----------
    system : System
        Without rows that switch and without known functions of time.
    constraint, dynamics : Program
    settings : dict
        Of `Integrator`: its start, and what belongs to the model.
    plan : Elimination, optional
        The static order of elimination; without one, a and λ are solved for densely.
    unrolled : bool
        Whether the elimination is appended to the dynamics.
    """
    assert system.switching is None
    assert not system.functions.functions
    nq, nc = len(system.coordinates), len(system.constraints)
    first = {j: group[0] for group in system.same_unit for j in group}
    parameters = system.held_at(settings["t_start"], settings["parameters"])
    solution = DENSE if plan is None else UNROLLED if unrolled else ELIMINATION
    entries = len(system.mass_pattern), len(system.jacobian_pattern)
    constraints = nc, len(system.holonomic)
    counts = (nq, *constraints, len(parameters), *entries, settings["rank"], solution)
    parts = [
        _words(counts),
        _integers(system.holonomic),
        *_rows_and_columns(system.mass_pattern),
        *_rows_and_columns(system.jacobian_pattern),
        _integers(first.get(j, j) for j in range(nq)),
        _integers(settings["kind"]),
        _numbers([settings["t_start"]]),
        *(_numbers(x) for x in (settings["y"], parameters)),
        *(_numbers(settings[name]) for name in ("sizes", "lengths", "plain_lengths")),
        *_program(constraint),
        *_program(dynamics),
    ]
    if solution == ELIMINATION:
        assert plan is not None
        lower = plan.targets([(nq + i, j) for i, j in system.jacobian_pattern])
        upper = plan.targets([(j, nq + i) for i, j in system.jacobian_pattern])
        rows = [i for column in plan.columns for i in column]
        arrays = (plan.order, plan.paired, plan.starts, rows, *plan.left)
        targets = (plan.targets(system.mass_pattern), np.maximum(lower, upper))
        parts += [_integers(x) for x in (*arrays, *targets)]
    body = b"".join(parts)
    return _words([_MAGIC, _VERSION, 3 + len(body) // 8]) + body


def _words(values: Iterable[int]) -> bytes:
    return np.array([*values], dtype=np.int64).tobytes()


def _integers(values: Iterable[int]) -> bytes:
    array = np.array([*values], dtype=np.int32)
    return _words([len(array)]) + array.tobytes() + bytes(4 * (len(array) % 2))


def _numbers(values: Iterable[float]) -> bytes:
    array = np.array([*values], dtype=float)
    return _words([len(array)]) + array.tobytes()


def _rows_and_columns(pattern: Iterable[tuple[int, int]]) -> list[bytes]:
    rows, columns = zip(*pattern, strict=True) if pattern else ((), ())
    return [_integers(rows), _integers(columns)]


def _program(program: Program) -> list[bytes]:
    none = program.main[:0]
    deferred = [*program.deferred, none, none, none][:3]
    subsets = [*program.output_subsets, none, none][:2]
    streams = [program.prelude, program.main, *deferred, *subsets]
    return [
        _words([program.inputs]),
        *map(_integers, (*streams, program.outputs)),
        _numbers(program.registers),
    ]
