"""Detection of jumps of forces inside steps: those of multipliers, or next to a root."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.switching.kinks import frozen_of
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape

_COMPARED, _WHOLE = (Op.LT, Op.LE), (Op.FLOOR, Op.CEIL)
#: Number of lines for each comparison, number of steps to its surface, and relative accuracy; step
#: across the surface, and relative difference that is a jump.
_LINES, _SECANT, _ON, _OVER, _JUMP = 8, 40, 1e-14, 1e-12, 1e-3


def has_hidden_jumps(system: System, p: Sequence[float]) -> bool:
    """Return whether forces, limits or constraints jump at branches that are not frozen.

    The two sides of each comparison are evaluated at points of its surface on random lines.

    Parameters
    ----------
    system : System
    p : sequence of float
        Values of its parameters.
    """
    if not system.has_kinks:
        return False
    frozen = frozen_of(system)
    values = list(p)
    if frozen is not None:
        system, values = frozen.system, [*p, *[1.0] * len(frozen.kinks)]
    tapes: list[tuple[Tape, int | None]]
    tapes = [(system.dynamics, None), (system.constraint, None)]
    switching = system.switching
    if switching is not None:  # their outputs end with derivatives, which may jump
        limits = 2 * sum(row.limit is not None for row in switching.rows)
        tapes.append((switching.limits, limits))
        if switching.forces is not None:
            tapes.append((switching.forces, len(switching.force_coordinates)))
    return any(_jumps(tape, count, values) for tape, count in tapes)


def _jumps(tape: Tape, count: int | None, p: list[float]) -> bool:
    """Return whether one of the first outputs of a tape jumps."""
    compared = [(a, b) for op, _, a, b, _ in tape.code if op in _COMPARED]
    if any(line[0] in _WHOLE for line in tape.code):
        return True
    if not compared:
        return False
    outputs = tape.outputs[:count]
    count = len(outputs)
    run = ScalarTape(tape._replace(outputs=(*outputs, *(x for pair in compared for x in pair))))
    rng, moving = np.random.default_rng(0), tape.inputs - tape.functions.size - len(p)

    for k in range(len(compared)):
        for _ in range(_LINES):
            start, along = rng.normal(size=(2, moving))

            def at(s: float, start: Array = start, along: Array = along) -> Array:
                return np.array(run((*(start + s * along).tolist(), *p)))

            s = _surface(at, count + 2 * k)
            if s is None:
                continue
            below, above = at(s - _OVER)[:count], at(s + _OVER)[:count]
            if (np.abs(above - below) > _JUMP * (1 + np.abs(below))).any():
                return True
    return False


def _surface(at: Callable[[float], Array], place: int) -> float | None:
    """Return the point of a line where the operands of a comparison are equal, by the secant
    method."""
    s, t = 0.0, 1.0
    values = at(s)[place : place + 2]
    g = values[0] - values[1]
    for _ in range(_SECANT):
        a, b = at(t)[place : place + 2]
        h = a - b
        if not np.isfinite(h):
            return None
        if abs(h) <= _ON * (abs(a) + abs(b)):
            return t
        if h == g:
            return None
        s, t, g = t, t - h * (t - s) / (h - g), h
    return None
