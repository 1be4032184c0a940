"""Points at which two values of a tape are equal, such as the operands of a comparison."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.tape import Tape

#: Number of random starts; largest number of Newton steps, and relative accuracy; step of
#: difference quotients.
_STARTS, _NEWTON, _ROOT, _DIFFERENCE = 8, 60, 1e-14, 1e-7


def lines_across(
    tape: Tape, pair: tuple[int, int], others: Sequence[int], p: Sequence[float]
) -> Iterator[Callable[[float], Array]]:
    """Return other values along lines that cross a surface on which two values are equal.

    Its points are found by Newton's method from random starts; where it fails, there is no line.

    Parameters
    ----------
    tape : Tape
    pair, others : sequences of int
        Registers.
    p : sequence of float
        The values of its last inputs, which are the same everywhere.

    Returns
    -------
    iterator of callable
        s → values of `others`. The surface is at 0; the inputs change by about s times their size.
    """
    every = tape._replace(outputs=tuple(range(tape.registers)))
    run = ScalarTape(every.selected([*pair, *others]))
    moving = tape.inputs - tape.functions.size - len(p)
    needed = sorted(i for i in tape._replace(outputs=pair).read if i < moving)
    rng = np.random.default_rng(0)
    for _ in range(_STARTS):
        found = _point(lambda x: run((*x.tolist(), *p)), needed, rng.normal(size=moving))
        if found is None:
            continue
        point, along = found

        def at(s: float, point: Array = point, along: Array = along) -> Array:
            return np.array(run((*(point + s * along).tolist(), *p))[2:])

        yield at


def _point(
    values: Callable[[Array], list[float]], needed: list[int], x: Array
) -> tuple[Array, Array] | None:
    """Return a point where the first two values are equal and a vector across the surface, of the
    size of the point; None if Newton's method finds none."""

    def difference(x: Array) -> tuple[float, float]:
        a, b, *_ = values(x)
        return a - b, abs(a) + abs(b)

    for _ in range(_NEWTON):
        h, size = difference(x)
        gradient = np.zeros(len(x))
        for i in needed:
            moved = x.copy()
            moved[i] += _DIFFERENCE * (1 + abs(x[i]))
            gradient[i] = (difference(moved)[0] - h) / (moved[i] - x[i])
        square = float(gradient @ gradient)
        if not (np.isfinite(h) and 0 < square < np.inf):
            return None
        step = h / square * gradient
        if abs(h) <= _ROOT * size or np.abs(step).max() <= _ROOT * np.abs(x[needed]).max():
            return x, gradient * (1 + np.abs(x[needed]).max()) / np.sqrt(square)
        x = x - step
    return None
