"""The elimination of [[M, Bᵀ], [B, 0]], written out as operations of the dynamics tape.

One stream of operations then yields a and λ, structural zeros cost nothing, and what depends on
parameters alone (the inverse of a mass) is computed once for a run.
"""

from __future__ import annotations

from lagcli.engine.elimination import Elimination
from lagcli.engine.system import System
from lagcli.engine.tape import Builder, Op, Tape


def unroll(system: System, elimination: Elimination) -> Tape:
    """Append the solution of [[M, Bᵀ], [B, 0]] [a; −λ] = [f; γ] to the dynamics tape.

    Parameters
    ----------
    system : System
    elimination : Elimination

    Returns
    -------
    Tape
        With the outputs of ``system.dynamics``, then a, λ, then the factors: by place, the inverse
        of D (its diagonal; right of the diagonal where a pair begins, else 0), then L by columns.
    """
    return _Unrolling(system, elimination).tape()


class _Unrolling:
    """Emits the operations of a factorization and of its use."""

    def __init__(self, system: System, elimination: Elimination):
        builder, outputs = Builder.extending(system.dynamics)
        mass, jacobian, nq = system.mass_pattern, system.jacobian_pattern, len(system.coordinates)
        self.builder, self.outputs, self.nq, self.plan = builder, outputs, nq, elimination
        self.zero, self.one = builder.constant(0.0), builder.constant(1.0)
        place = {unknown: k for k, unknown in enumerate(elimination.order)}
        self.place = place
        nm, nb = len(mass), len(jacobian)
        self.entries: dict[tuple[int, int], int] = {}
        for (i, j), x in zip(mass, outputs, strict=False):
            if place[i] >= place[j]:
                self.entries[place[i], place[j]] = x
        for (i, j), x in zip(jacobian, outputs[nm + nq :], strict=False):
            p, q = place[nq + i], place[j]
            self.entries[max(p, q), min(p, q)] = x
        size = len(elimination.order)
        right = [*outputs[nm : nm + nq], *outputs[nm + nq + nb : nm + nb + size]]
        self.right = [right[unknown] for unknown in elimination.order]

    # arithmetic that knows zeros and ones

    def times(self, a: int, b: int) -> int:
        if self.zero in (a, b):
            return self.zero
        if a == self.one:
            return b
        return a if b == self.one else self.builder.emit(Op.MUL, a, b)

    def minus(self, a: int, b: int) -> int:
        if b == self.zero:
            return a
        if a == self.zero:
            return self.builder.emit(Op.NEG, b)
        return self.builder.emit(Op.SUB, a, b)

    def inverse(self, a: int) -> int:
        return a if a == self.one else self.builder.emit(Op.DIV, self.one, a)

    def tape(self) -> Tape:
        plan, size = self.plan, len(self.plan.order)
        diagonal, beside = [self.zero] * size, [self.zero] * size
        lower: list[list[int]] = [[] for _ in range(size)]
        k = 0
        while k < size:
            width = 2 if plan.paired[k] else 1
            inverse = self.pivot(k, width)
            diagonal[k : k + width] = [inverse[i][i] for i in range(width)]
            if width == 2:
                beside[k] = inverse[0][1]
            self.column(k, width, inverse, lower)
            k += width
        x = self.backward(diagonal, beside, lower)
        solution = [x[self.place[i]] for i in range(size)]
        solution[self.nq :] = [self.minus(self.zero, y) for y in solution[self.nq :]]
        factors = [*diagonal, *beside, *(y for column in lower for y in column)]
        return self.builder.finish([*self.outputs, *solution, *factors])

    def pivot(self, k: int, width: int) -> list[list[int]]:
        """Return the inverse of a pivot."""
        a = self.entries.get((k, k), self.zero)
        if width == 1:
            return [[self.inverse(a)]]
        b, c = self.entries[k + 1, k], self.entries.get((k + 1, k + 1), self.zero)
        if a == self.zero and c == self.zero:
            x = self.inverse(b)
            return [[self.zero, x], [x, self.zero]]
        determinant = self.minus(self.times(a, c), self.times(b, b))
        x = self.inverse(determinant)
        off = self.minus(self.zero, self.times(b, x))
        return [[self.times(c, x), off], [off, self.times(a, x)]]

    def column(self, k: int, width: int, inverse: list[list[int]], lower: list[list[int]]) -> None:
        """Emit a pivot's part of L, its updates, and its part of the forward substitution."""
        below = self.plan.columns[k]
        rows: dict[int, list[int]] = {}
        for i in below:
            entries = [self.entries.pop((i, k + p), self.zero) for p in range(width)]
            factors = []
            for p in range(width):
                total = self.times(entries[0], inverse[0][p])
                if width == 2:
                    total = self.plus(total, self.times(entries[1], inverse[1][p]))
                factors.append(total)
                lower[k + p].append(total)
            for p in range(width):
                self.right[i] = self.minus(self.right[i], self.times(factors[p], self.right[k + p]))
            rows[i] = entries
        for n, i in enumerate(below):
            for j in below[: n + 1]:
                value = self.entries.get((i, j), self.zero)
                for p in range(width):
                    value = self.minus(value, self.times(lower[k + p][n], rows[j][p]))
                if value != self.zero:
                    self.entries[i, j] = value

    def plus(self, a: int, b: int) -> int:
        if a == self.zero:
            return b
        return a if b == self.zero else self.builder.emit(Op.ADD, a, b)

    def backward(self, diagonal: list[int], beside: list[int], lower: list[list[int]]) -> list[int]:
        """Emit the division by D and the backward substitution."""
        plan, z = self.plan, self.right
        x = [self.zero] * len(z)
        for k in reversed(range(len(z))):
            total = self.times(diagonal[k], z[k])
            if plan.paired[k]:
                total = self.plus(total, self.times(beside[k], z[k + 1]))
            elif k and plan.paired[k - 1]:
                total = self.plus(total, self.times(beside[k - 1], z[k - 1]))
            for i, factor in zip(plan.columns[k], lower[k], strict=True):
                total = self.minus(total, self.times(factor, x[i]))
            x[k] = total
        return x
