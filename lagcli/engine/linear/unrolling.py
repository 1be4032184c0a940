"""The elimination of [[M, Bᵀ], [B, 0]], unrolled into operations of the dynamics tape.

One stream of operations then computes a and λ, structural zeros cost nothing, and values that
depend only on parameters (the inverse of a mass) are computed once for a run.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import zip_longest

from lagcli.engine.linear.elimination import Elimination
from lagcli.engine.system import System
from lagcli.engine.tape.arithmetic import Arithmetic
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape


def unroll(system: System, elimination: Elimination) -> Tape:
    """Append the solution of [[M, Bᵀ], [B, 0]] [a; −λ] = [f; γ] to the dynamics tape.

    Parameters
    ----------
    system : System
    elimination : Elimination

    Returns
    -------
    Tape
        Outputs follow `UnrolledLayout`. There are nq + 2 nc additional inputs at the end: another
        right side, in the order of the unknowns, and one for the constraints only. The cancellation
        of a pivot of order one is twice its magnitude over the sum of the magnitudes of its terms,
        between 0 and 2; that of order two is the magnitude of its determinant over that of the
        determinant's terms, between 0 and 1. Cancellation and the two additional solutions are
        deferred, and the additional solutions are an output subset. With derivatives, the solution
        is that of all blocks, or that of the motion with zeros for the rest (see
        `TangentBlocks.complete`), and the others are those of one block.
    """
    return _Unrolling(system, elimination).tape()


class _Unrolling(Arithmetic):
    """Emits the operations of a factorization and of its solutions."""

    def __init__(self, system: System, elimination: Elimination):
        size, given, motion = len(elimination.order), system.dynamics, system.motion
        mass, jacobian, nq = motion.mass_pattern, motion.jacobian_pattern, len(motion.coordinates)
        nc = len(motion.constraints)
        rhs_inputs = size + nc
        super().__init__(given.inputs + rhs_inputs, given.parameters, rhs_inputs, given.functions)
        self.outputs = outputs = self.extend(given)
        self.nq, self.nc, self.plan = nq, nc, elimination
        self.tangent = system.tangent
        self.blocks = 1 if system.tangent is None else system.tangent.blocks
        place = {unknown: k for k, unknown in enumerate(elimination.order)}
        self.place = place
        layout = system.dynamics_layout
        v = system.sample_layout.v.start
        self.entries: dict[tuple[int, int], int] = {}
        for (i, j), x in zip(mass, outputs[layout.mass_matrix], strict=self.blocks == 1):
            if place[i] >= place[j]:
                self.entries[place[i], place[j]] = x
        self.rows: list[list[int]] = [[] for _ in range(nc)]
        self.speeds: list[int] = [self.zero for _ in range(nc)]  # B v
        for (i, j), x in zip(jacobian, outputs[layout.jacobian], strict=self.blocks == 1):
            p, q = place[nq + i], place[j]
            self.entries[max(p, q), min(p, q)] = x
            self.rows[i].append(x)
            self.speeds[i] = self.plus(self.speeds[i], self.times(x, v + j))
        right = [*outputs[layout.forcing][:nq], *outputs[layout.rhs][:nc]]
        self.right = [right[unknown] for unknown in elimination.order]
        self.other_right = [given.inputs + unknown for unknown in elimination.order]
        # for a right side that is zero except for the constraints
        self.other_rhs = [
            given.inputs + nc + unknown if unknown >= nq else self.zero
            for unknown in elimination.order
        ]
        self.diagonal, self.beside = [self.zero] * size, [self.zero] * size
        self.lower: list[dict[int, int]] = [{} for _ in range(size)]
        self.kept: list[int] = []
        self.taken: list[list[int]] = [[] for _ in range(size)]
        self.isomorphic: list[list[int]] = []

    def tape(self) -> Tape:
        for k in self.pivots():
            self.eliminate(k, 2 if self.plan.paired[k] else 1)
        solution = self.solution(self.right)
        a, multipliers = solution[: self.nq], solution[self.nq :]
        further = self.derivatives(solution)
        whole = [
            *a,
            *(x for found in further for x in found[: self.nq]),
            *multipliers,
            *(x for found in further for x in found[self.nq :]),
        ]
        main = [*self.outputs, *whole, self.power(multipliers)]
        watched = [*self.kept, *[*map(self.square, self.rows)] * self.blocks]
        rhs_inputs, moved = (
            self.solution(self.other_right),
            self.solution(self.other_rhs)[: self.nq],
        )
        outputs = [*main, *watched, *rhs_inputs, *moved]
        return self.finish(
            outputs,
            deferred=(len(watched), len(rhs_inputs), len(moved)),
            output_subsets=(tuple(range(len(main) + len(watched), len(outputs))),),
            isomorphic=self.isomorphic,
        )

    def derivatives(self, solution: Sequence[int]) -> list[list[int]]:
        """Emit the solutions of the derivatives; zeros if the engine computes them."""
        size = self.nq + self.nc
        if self.tangent is None or not self.tangent.complete:
            return [[self.zero] * size] * (self.blocks - 1)
        first = 1 + 2 * self.nq * self.blocks
        held = range(first, first + self.parameters)
        sides = self.splice(self.tangent.tape, [*range(first), *solution, *held])
        return [
            self.solution([sides[k * size + unknown] for unknown in self.plan.order])
            for k in range(self.blocks - 1)
        ]

    def diagonal_entry(self, k: int) -> int:
        """Return the diagonal entry of the matrix in its current state of reduction."""
        return self.entries.get((k, k), self.zero)

    def pivots(self) -> Iterable[int]:
        """Yield the positions at which pivots begin."""
        return (k for k in range(len(self.place)) if not (k and self.plan.paired[k - 1]))

    def power(self, multipliers: Sequence[int]) -> int:
        """Return the power of all forces, including those of the constraints."""
        terms = [self.times(x, y) for x, y in zip(multipliers, self.speeds, strict=True)]
        while len(terms) > 1:  # pairwise, which can be vectorized
            pairs = zip_longest(terms[::2], terms[1::2], fillvalue=self.zero)
            terms = [self.plus(a, b) for a, b in pairs]
        return self.plus(self.outputs[-1], *(terms or [self.zero]))

    def square(self, row: list[int]) -> int:
        """Return the square of a row's length."""
        total = self.zero
        for x in row:
            total = self.plus(total, self.times(x, x))
        return total

    def keep(self, k: int, width: int) -> None:
        """Emit the cancellation of a pivot."""
        a = self.diagonal_entry(k)
        if width == 1:
            total = size = self.magnitude(a)
            for x in self.taken[k]:
                total = self.plus(total, x)
            if self.taken[k]:
                self.kept.append(self.emit(Op.DIV, self.plus(size, size), total))
            return
        b, c = self.entries[k + 1, k], self.diagonal_entry(k + 1)
        product, square = self.times(a, c), self.times(b, b)
        if product != self.zero:
            rest = self.magnitude(self.minus(product, square))
            terms = self.plus(self.magnitude(product), square)
            self.kept.append(self.emit(Op.DIV, rest, terms))

    def take(self, k: int, width: int, i: int) -> None:
        """Emit the magnitudes of the terms that a pivot subtracts from later diagonal entries."""
        x, a = self.lower[k][i], self.diagonal_entry(k)
        terms = [self.times(self.times(x, x), self.magnitude(a))]
        if width == 2:
            y, b, c = self.lower[k + 1][i], self.entries[k + 1, k], self.diagonal_entry(k + 1)
            both = self.magnitude(self.times(self.times(x, y), b))
            terms += [self.plus(both, both), self.times(self.times(y, y), self.magnitude(c))]
        self.taken[i] += [term for term in terms if term != self.zero]

    def pivot(self, k: int, width: int) -> list[list[int]]:
        """Return the inverse of a pivot."""
        a = self.diagonal_entry(k)
        if width == 1:
            return [[self.inverse(a)]]
        b, c = self.entries[k + 1, k], self.diagonal_entry(k + 1)
        if a == self.zero and c == self.zero:
            x = self.inverse(b)
            return [[self.zero, x], [x, self.zero]]
        determinant = self.minus(self.times(a, c), self.times(b, b))
        x = self.inverse(determinant)
        off = self.negative(self.times(b, x))
        return [[self.times(c, x), off], [off, self.times(a, x)]]

    def eliminate(self, k: int, width: int) -> None:
        """Emit a pivot's part of L and its updates."""
        self.keep(k, width)
        inverse = self.pivot(k, width)
        self.diagonal[k : k + width] = [inverse[i][i] for i in range(width)]
        if width == 2:
            self.beside[k] = inverse[0][1]
        below = self.in_order(self.plan.columns[k])
        rows: dict[int, list[int]] = {}
        for i in below:
            rows[i] = entries = [self.entries.pop((i, k + p), self.zero) for p in range(width)]
            for p in range(width):
                total = self.times(entries[0], inverse[0][p])
                if width == 2:
                    total = self.plus(total, self.times(entries[1], inverse[1][p]))
                self.lower[k + p][i] = total
            self.take(k, width, i)
        for n, i in enumerate(below):
            for j in below[: n + 1]:
                entry = max(i, j), min(i, j)
                value = self.entries.get(entry, self.zero)
                for p in range(width):
                    value = self.minus(value, self.times(self.lower[k + p][i], rows[j][p]))
                if value != self.zero:
                    self.entries[entry] = value

    def in_order(self, places: Iterable[int]) -> list[int]:
        """Return positions in the order of their unknowns: a chain's bodies then have equal
        operations."""
        return sorted(places, key=self.plan.order.__getitem__)

    def solution(self, right: Sequence[int]) -> list[int]:
        """Emit the substitutions for a right side by place; return a, λ."""
        paired, order, z = self.plan.paired, self.plan.order, list(right)
        for k in self.pivots():
            for p in range(2 if paired[k] else 1):
                for i in self.in_order(self.lower[k + p]):
                    z[i] = self.minus(z[i], self.times(self.lower[k + p][i], z[k + p]))
        x = [self.zero] * len(z)
        multipliers: dict[int, int] = {}  # by position
        for k in reversed(range(len(z))):
            total = self.times(self.diagonal[k], z[k])
            if paired[k]:
                total = self.plus(total, self.times(self.beside[k], z[k + 1]))
            elif k and paired[k - 1]:
                total = self.plus(total, self.times(self.beside[k - 1], z[k - 1]))
            for i in self.in_order(self.lower[k]):
                if order[k] < self.nq and i in multipliers:
                    total = self.plus(total, self.times(self.lower[k][i], multipliers[i]))
                else:
                    total = self.minus(total, self.times(self.lower[k][i], x[i]))
            x[k] = total
            if order[k] >= self.nq:
                multipliers[k] = self.negative(total)
                # the sign is applied here: all entries are then used in the same way
                self.opposite.pop(multipliers[k], None)
        a = [x[self.place[unknown]] for unknown in range(self.nq)]
        found = [multipliers[self.place[unknown]] for unknown in range(self.nq, len(z))]
        self.isomorphic.append([y for y in found if y != self.zero])
        return [*a, *found]
