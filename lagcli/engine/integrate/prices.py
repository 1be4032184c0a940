"""Prices of the integration methods on a model, for the choice of one: from counted operations.

A price is an estimate of processor time, in nanoseconds on one machine. Only their ratios matter.
They depend on the tapes and the elimination alone, never on a clock, so that a model with the same
settings takes the same method on every machine. `docs/decisions/2026-11-auto.md` has the
measurements behind the constants.
"""

from __future__ import annotations

import math
from functools import cached_property

from lagcli.engine.integrate.prepared import Prepared, may_unroll
from lagcli.engine.linear.elimination import Elimination
from lagcli.engine.system import System, without_numbers
from lagcli.engine.tape.operations import ARITY, Op
from lagcli.engine.taylor.sizes import LONG

#: What a step costs besides evaluations and series: of DOP853, at least and for each constraint;
#: of Taylor's method.
_STEP, _ROW, _STEP_OF_SERIES = 640.0, 260.0, 370.0
#: Evaluations in a step of DOP853; those of Taylor's method without rejected steps: at the start
#: and the end, and in the middle if singular configurations are monitored.
_STAGES = 12.3
_ENDS, _WITH_MIDDLE = 2.0, 3.0
#: An evaluation, by machine code: each number of a program's stream. If the elimination is a loop,
#: each unknown, entry of L and update besides; updates of columns that are eliminated together are
#: cheaper. Of the dense solution: each unknown and product.
_WORD = 0.09
_UNKNOWN, _ENTRY, _UPDATE, _UPDATE_TOGETHER = 15.0, 2.2, 1.5, 0.45
_UNKNOWN_DENSE, _PRODUCT_DENSE = 100.0, 0.5
#: An update once the elimination is unrolled, and the operations for each update, entry of L and
#: unknown.
_UPDATE_UNROLLED, _UNROLLED = 0.75, 2
#: Unrolling it and making the program: each operation of the dynamics, entry of L and update.
_TO_UNROLL, _TO_UNROLL_ENTRY, _TO_UNROLL_UPDATE = 2.5e3, 50e3, 3e3
#: The recursive form: an evaluation, for each coordinate and each constraint, and making its
#: program.
_RECURSIVE, _RECURSIVE_ROW, _FOR_RECURSIVE, _FOR_RECURSIVE_ROW = 60.0, 240.0, 0.7e6, 3e6
#: One order of the series: each product of series, number of the state. Sums cost little beside.
_PRODUCT, _NUMBER = 3.0, 9.0
#: Part of that which the series of families take, which are computed side by side: from an average
#: number of members, and a number of products and sums.
_IN_LAYERS, _MEMBERS = 0.5, 8
#: Making the program of the series: at least; each operation of the unrolled dynamics; each product
#: of series.
_PROGRAM, _FOR_OPERATION, _FOR_PRODUCT = 4e6, 22e3, 18e3
#: Jacobians of an implicit method: at least; each operation of the dynamics. A step of it, in
#: steps of DOP853.
_JACOBIANS, _FOR_DERIVATIVE, _IMPLICIT = 5e6, 70e3, 1.5
#: A state in a step of Taylor's method that is examined: times an evaluation and the products in
#: the orthogonalization of B's rows.
_EXAMINING = 3.0
#: Number of those products above which the factors are used in place of it, as in `core/watch.c`.
_LARGE = 20000


class Prices:
    """What steps and preparations cost on a model, ns.

    Parameters
    ----------
    system : System
    prepared : Prepared
        How a and λ are computed.
    order : int
        Order of Taylor's method.
    """

    def __init__(self, system: System, prepared: Prepared, order: int):
        self.system, self.prepared, self.order = system, prepared, order

    @cached_property
    def evaluation(self) -> float:
        """An evaluation of y′."""
        elimination, unknowns = self.prepared.elimination, self.system.counts.unknowns
        if self.prepared.unrolled:
            return self._program
        if elimination is None:
            solving = unknowns * (_UNKNOWN_DENSE + _PRODUCT_DENSE * unknowns**2 / 3)
        else:
            update = _UPDATE if may_unroll(elimination) else _UPDATE_TOGETHER
            solving = _UNKNOWN * unknowns + _ENTRY * _entries(elimination)
            solving += update * elimination.updates
        return self._program + solving

    @property
    def _program(self) -> float:
        """The program of the dynamics, in an evaluation."""
        return _WORD * len(self.prepared.dynamics.main)

    @cached_property
    def explicit(self) -> float:
        """A step of DOP853."""
        return self._step + _STAGES * self.evaluation

    @property
    def _step(self) -> float:
        """What a step of DOP853 costs besides evaluations."""
        return _STEP + _ROW * self.system.counts.nc

    @cached_property
    def evaluation_unrolled(self) -> float:
        """The same once the elimination, or that of the recursive form, is unrolled, if it may."""
        if self._recurs:
            counts = self.system.counts
            return min(self.evaluation, _RECURSIVE * counts.nq + _RECURSIVE_ROW * counts.nc)
        elimination = self.prepared.elimination
        if self.prepared.unrolled or not may_unroll(elimination):
            return self.evaluation
        return self._program + _UPDATE_UNROLLED * elimination.updates

    def steps(self, count: float) -> float:
        """So many further steps of DOP853, at some of which the elimination may be unrolled."""
        soon = min(count, self.steps_to_unroll)
        later = self._step + _STAGES * self.evaluation_unrolled
        return soon * self.explicit + (count - soon) * later

    @property
    def _recurs(self) -> bool:
        """Whether a long run solves by the recursive form."""
        elimination = self.prepared.elimination
        known = self.system.recursive_form is not None and elimination is not None
        return known and not self.prepared.unrolled and not may_unroll(elimination)

    @property
    def steps_to_unroll(self) -> float:
        """Number of steps which the unrolled elimination, or that of the recursive form, shortens
        by as much as its program costs."""
        saved = _STAGES * (self.evaluation - self.evaluation_unrolled)
        return math.ceil(self.unrolling / saved) if saved > 0.0 else math.inf

    @property
    def unrolling(self) -> float:
        """The program of the unrolled elimination, or of that of the recursive form."""
        if self._recurs:
            counts = self.system.counts
            return _FOR_RECURSIVE * counts.nq + _FOR_RECURSIVE_ROW * counts.nc
        elimination = self.prepared.elimination
        if self.prepared.unrolled or elimination is None:
            return 0.0
        unrolling = _TO_UNROLL * self.prepared.dynamics.size
        unrolling += _TO_UNROLL_ENTRY * _entries(elimination)
        return unrolling + _TO_UNROLL_UPDATE * elimination.updates

    @cached_property
    def usual(self) -> float:
        """Number of evaluations in a step of Taylor's method."""
        return _WITH_MIDDLE if self.system.constraints else _ENDS

    @cached_property
    def taylor(self) -> float:
        """A step of Taylor's method."""
        products, sums = self._counts
        one = _PRODUCT * products + _NUMBER * (2 * len(self.system.coordinates) + 1)
        if products + sums >= LONG and self._members >= _MEMBERS:
            one *= _IN_LAYERS
        return _STEP_OF_SERIES + self.order * one + self.usual * self.evaluation_unrolled

    @property
    def _members(self) -> float:
        """Average number of members of the families of coordinates."""
        coordinates = self.system.coordinates
        return len(coordinates) / max(1, len(set(map(without_numbers, coordinates))))

    @cached_property
    def least_expanding(self) -> float:
        """A lower bound of `expanding`, known at once."""
        return _PROGRAM + _FOR_OPERATION * self.prepared.dynamics.size

    @cached_property
    def expanding(self) -> float:
        """The program of the series."""
        making = _PROGRAM + _FOR_OPERATION * self._operations + _FOR_PRODUCT * self._counts[0]
        return self.unrolling + making

    @property
    def _operations(self) -> int:
        """Number of operations of the dynamics with the elimination, once it is unrolled."""
        elimination, operations = self.prepared.elimination, self.prepared.dynamics.size
        if self.prepared.unrolled or elimination is None:
            return operations
        entries, unknowns = _entries(elimination), len(elimination.order)
        return operations + _UNROLLED * (elimination.updates + entries + unknowns)

    @cached_property
    def implicit(self) -> float:
        """A step of an implicit method."""
        return _IMPLICIT * self.explicit

    @cached_property
    def differentiating(self) -> float:
        """The Jacobians of an implicit method."""
        return _JACOBIANS + _FOR_DERIVATIVE * len(self.system.dynamics.code)

    @cached_property
    def examining(self) -> float:
        """A state in a step of Taylor's method that is examined for singular configurations."""
        nq, nc = self.system.counts.nq, self.system.counts.nc
        orthogonalizing = nc * nc * nq
        if orthogonalizing > _LARGE and self.prepared.elimination is not None:
            return _EXAMINING * self.evaluation  # by the factors, as `core/watch.c`
        return _EXAMINING * (self.evaluation + orthogonalizing)

    @cached_property
    def _counts(self) -> tuple[int, int]:
        """Numbers of products of series, and of sums."""
        system, tape = self.system, self.system.dynamics
        moving = set(range(1 + 2 * len(system.coordinates)))
        products = sums = 0
        for op, to, *operands in tape.code:
            changing = [x in moving for x in operands[: ARITY[op]]]
            if not any(changing):
                continue
            moving.add(to)
            if op == Op.MUL and all(changing):
                products += 1
            elif op == Op.DIV:
                products += 2 * changing[1]
            elif op in (Op.ADD, Op.SUB, Op.NEG, Op.MUL):
                sums += 1
            else:
                products += 1
        layout = system.dynamics_layout
        # the entries of M and B that change are multiplied by a and λ
        for part in (layout.mass_matrix, layout.jacobian):
            products += sum(x in moving for x in tape.outputs[part])
        if self.prepared.elimination is not None:
            sums += 2 * _entries(self.prepared.elimination)
        return products, sums


def _entries(elimination: Elimination) -> int:
    """Return the number of entries of L."""
    return sum(map(len, elimination.columns))
