"""Functions that are undefined beyond a kink: roots of negative numbers, vanishing divisors."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from lagcli.engine.tape.crossings import lines_across
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape
from lagcli.functions import Domain

#: Operations that are undefined for some operands, and may be so beyond a kink.
_PARTIAL = {Op.POW} | {op for op in Op if op.function and op.function.domain != Domain()}
#: Operations that are never negative, and those that are always positive.
_NOT_NEGATIVE, _POSITIVE = (Op.SQRT, Op.EXP, Op.ABS, Op.COSH), (Op.EXP, Op.COSH)
_NOTHING: frozenset[int] = frozenset()
#: Part of its value at this distance from a kink that a divisor which vanishes there may have.
_VANISHES, _BESIDE = 1e-9, 0.1


class PartialFunctions:
    """Finds the comparisons beyond which a function in a tape may be undefined.

    Parameters
    ----------
    needs : list of frozenset of int
        For each comparison, the inputs on which it depends; may grow.
    tape : Tape
    moving : int
        Number of its inputs that change along a run, the first ones.

    Attributes
    ----------
    excluded : frozenset of int
        The comparisons found.
    """

    def __init__(self, needs: list[frozenset[int]], tape: Tape, moving: int):
        self.needs, self.tape, self.moving = needs, tape, moving
        self.excluded: frozenset[int] = _NOTHING
        self._places: dict[int, int] = {}  # registers of comparisons
        self._compared: dict[int, frozenset[int]] = {}  # comparisons that decide a truth value
        self._selected: dict[int, frozenset[int]] = {}  # comparisons that have selected a value
        self._risky: dict[int, frozenset[int]] = {}  # operands of partial functions
        self._divisors: dict[int, frozenset[int]] = {}  # registers that may vanish
        # parameters are assumed positive; at worst a run fails beyond a kink that must not be
        # frozen
        fixed = range(moving, tape.inputs)
        constants = dict(enumerate(tape.constants, tape.inputs))
        self._not_negative = {*fixed, *(i for i, x in constants.items() if x >= 0)}
        self._positive = {*fixed, *(i for i, x in constants.items() if x > 0)}

    def comparison(self, to: int, which: int) -> None:
        """Note that a register is the truth value of a comparison."""
        self._compared[to] = frozenset((which,))
        self._places[which] = to

    def operation(self, op: int, to: int, operands: list[int], needs: frozenset[int]) -> None:
        """Track an operation that depends on some inputs, except replaced comparisons."""
        if to in self._compared:
            return
        if op == Op.SELECT:
            self._select(to, operands)
            return
        if op in (Op.AND, Op.OR, Op.NOT):
            self._compared[to] = _union(self._compared, operands)
            return
        for sets in (self._selected, self._risky, self._divisors):
            if union := _union(sets, operands):
                sets[to] = union
        if op in _PARTIAL and operands[0] not in self._not_negative:
            self.excluded |= self._selected.get(operands[0], _NOTHING)
            self._risky[to] = self._risky.get(to, _NOTHING) | needs
        if op == Op.DIV and needs and operands[1] not in self._positive:
            self._divisors[to] = self._divisors.get(to, _NOTHING) | {operands[1]}
        self._sign(op, to, operands)

    def _select(self, to: int, operands: list[int]) -> None:
        """Track a choice; exclude its comparisons if its values may be undefined beyond them."""
        condition, *values = operands
        risky, divisors = _union(self._risky, values), _union(self._divisors, values)
        compared = self._compared.get(condition, _NOTHING)
        self.excluded |= {k for k in compared if self.needs[k] & risky or self._vanish(k, divisors)}
        self._selected[to] = _union(self._selected, values) | compared
        self._risky[to], self._divisors[to] = risky, divisors
        for signs in (self._not_negative, self._positive):
            if signs.issuperset(values):
                signs.add(to)

    def _sign(self, op: int, to: int, operands: list[int]) -> None:
        """Note whether a result cannot be negative, or not be zero on a surface.

        Sums of two squares vanish at points only.
        """
        not_negative = self._not_negative.issuperset(operands)
        square = op == Op.MUL and operands[0] == operands[1]
        kept = op in (Op.ADD, Op.MUL, Op.DIV, Op.CLIP) and not_negative
        if square or kept or op in _NOT_NEGATIVE:
            self._not_negative.add(to)
        solid = self._positive.issuperset(operands) and op in (Op.MUL, Op.DIV, Op.SQRT, Op.ABS)
        if solid or op in _POSITIVE or (op == Op.ADD and not_negative):
            self._positive.add(to)

    def _vanish(self, which: int, divisors: frozenset[int]) -> bool:
        """Return whether one of some divisors vanishes where the sides of a comparison are equal,
        for any values of the parameters."""
        if not divisors:
            return False
        place = self._places[which]
        pair = next((a, b) for _, to, a, b, _ in self.tape.code if to == place)
        fixed = self.tape.inputs - self.moving - self.tape.functions.size
        p = [1.0 + 0.37 * math.sin(1.0 + i) for i in range(fixed)]
        for at in lines_across(self.tape, pair, [*divisors], p):
            here, *beside = (abs(at(s)) for s in (0.0, -_BESIDE, _BESIDE))
            return bool((here <= _VANISHES * np.maximum(*beside)).any())
        return False


def _union(sets: dict[int, frozenset[int]], operands: Iterable[int]) -> frozenset[int]:
    return _NOTHING.union(*(sets[x] for x in operands if x in sets))
