"""Interpreter of tapes in Python: one state with `math`, many with NumPy.

Both follow IEEE 754, as compiled code does: 1/0 is ∞, log(-1) is NaN, no exceptions are raised, and
an undefined value matters only if it reaches an output.
"""

from __future__ import annotations

import copy
import operator
from collections.abc import Callable, Iterable
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.tape.operations import ARITY, OPERATIONS, ROUNDING, Kind
from lagcli.engine.tape.tape import Tape
from lagcli.functions import Domain

#: Functions on floats that never raise.
_TOTAL = (operator.add, operator.sub, operator.mul, operator.neg, abs, max)


@cache
def _on_arrays(number: int) -> Callable[..., Any]:
    """Return an operation on arrays; its dependencies are imported on first use."""
    op = OPERATIONS[number]
    module, _, name = op.array.rpartition(".")
    function: Any = getattr(import_module(module), name) if op.array else op.scalar
    if op.kind is Kind.RELATION:
        return lambda a, b: np.where(function(a, b), 1.0, 0.0)
    if op.function is not None and op.function.domain.rounded:
        domain = op.function.domain
        return lambda a: function(bounded(a, domain))
    return function


@cache
def _on_floats(number: int) -> Callable[..., float]:
    """Return an operation on floats that returns ±∞ or NaN according to IEEE 754 and never
    raises."""
    op = OPERATIONS[number]
    function = op.scalar
    assert function is not None, f"{op.name} is not an operation of tapes"
    if function in _TOTAL:
        return function
    if op.kind is Kind.RELATION:
        return lambda a, b: 1.0 if function(a, b) else 0.0

    def guarded(*arguments: float) -> float:
        try:
            return function(*arguments)
        except (ValueError, ZeroDivisionError, OverflowError):
            with np.errstate(all="ignore"):
                return float(_on_arrays(number)(*map(np.float64, arguments)))

    return guarded


class ScalarTape:
    """A tape compiled to operations on Python floats.

    Its inputs are those of the tape, without the pieces of known functions of time: these are the
    ones at t, or fixed ones.
    """

    def __init__(self, tape: Tape):
        self._functions = tape.functions if tape.functions.functions else None
        self._held: list[float] | None = None
        self._rest = list(tape.constants) + [0.0] * len(tape.code)
        self._outputs = tape.outputs
        self._steps = [(_on_floats(op), ARITY[op], to, a, b, c) for op, to, a, b, c in tape.code]

    def __call__(self, inputs: Iterable[float]) -> list[float]:
        """Return the outputs for one set of inputs; undefined values are NaN or ±∞."""
        if self._functions is None:
            r = [*inputs, *self._rest]
        else:
            given = list(inputs)
            pieces = self._functions.pieces_at(given[0]) if self._held is None else self._held
            r = [*given, *pieces, *self._rest]
        for function, operands, to, a, b, c in self._steps:
            if operands == 2:
                r[to] = function(r[a], r[b])
            elif operands == 1:
                r[to] = function(r[a])
            else:
                r[to] = function(r[a], r[b], r[c])
        return [r[i] for i in self._outputs]

    def own(self) -> ScalarTape:
        """Return a copy of the tape with pieces of its own."""
        return self if self._functions is None else copy.copy(self)

    def hold(self, pieces: list[float] | None) -> None:
        """Use given pieces of the known functions of time; None selects those at t."""
        self._held = pieces


class ArrayTape:
    """A tape compiled to operations on arrays, one entry for each state."""

    def __init__(self, tape: Tape):
        self._tape = tape
        used = {step[0] for step in tape.code}
        self._operations = {op: (_on_arrays(op), ARITY[op]) for op in used}
        given = tape.inputs + len(tape.constants)
        needed = bytearray([1] * given + [0] * len(tape.code))  # later, or not to be dropped
        for register in tape.outputs:
            needed[register] = 1
        self._last_uses: list[list[int]] = []
        for _, _, *operands in reversed(tape.code):
            done = []
            for register in operands:
                if not needed[register]:
                    needed[register] = 1
                    done.append(register)
            self._last_uses.append(done)
        self._last_uses.reverse()

    def __call__(self, inputs: Iterable[Array | float], count: int) -> Array:
        """Evaluate the tape at many states.

        Parameters
        ----------
        inputs : iterable of (count,) arrays or numbers
            Inputs without the pieces of known functions of time, which are those at t.
        count : int
            Number of states.

        Returns
        -------
        (outputs, count) array
        """
        tape, operations = self._tape, self._operations
        given = list(inputs)
        if tape.functions.functions:
            given += list(tape.functions.pieces(np.broadcast_to(given[0], count)).T)
        r: list[Any] = [*given, *tape.constants, *([None] * len(tape.code))]
        with np.errstate(all="ignore"):
            for (op, to, a, b, c), done in zip(tape.code, self._last_uses, strict=True):
                function, operands = operations[op]
                if operands == 2:
                    r[to] = function(r[a], r[b])
                elif operands == 1:
                    r[to] = function(r[a])
                else:
                    r[to] = function(r[a], r[b], r[c])
                for register in done:  # its memory is in the cache: the next results take it
                    r[register] = None
        out = np.empty((len(tape.outputs), count))
        for i, register in enumerate(tape.outputs):
            out[i] = r[register]
        return out


def run_arrays(tape: Tape, inputs: Iterable[Array | float], count: int) -> Array:
    """Evaluate a tape at many states, once; see `ArrayTape`."""
    return ArrayTape(tape)(inputs, count)


def bounded(a: Array, domain: Domain) -> Array:
    """Return a, or the bound of a domain where it is beyond by rounding."""
    low, high = domain.low, domain.high
    a = np.where((a < low) & (a >= low - ROUNDING), low, a)
    return np.where((a > high) & (a <= high + ROUNDING), high, a)


def clipped(a: Array, b: Array) -> Array:
    """Return a, or 0 where it is negative by rounding of terms whose squares add up to b."""
    return np.where((a < 0.0) & (a * a <= ROUNDING * ROUNDING * b), a - a, a)
