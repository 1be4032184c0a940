"""Power series of the solution of [[M, −Bᵀ], [B, 0]] [a; λ] = [f; γ], from one factorization.

If K x = r, coefficient k of x is the solution of K_0 x_k = r_k − K_1 x_{k−1} − … − K_k x_0: all
orders have the matrix of order 0, whose factors the tape computes anyway. Therefore the
factorization needs no series, and substitutions are sums of numbers times coefficients.

References
----------
N. S. Nedialkov and J. D. Pryce, Solving differential-algebraic equations by Taylor series (I):
computing Taylor coefficients, BIT 45 (2005), doi:10.1007/s10543-005-0019-y.
"""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.engine.layout import UnrolledLayout
from lagcli.engine.system import System
from lagcli.engine.taylor.expansion import SeriesExpansion
from lagcli.engine.taylor.forms import Form
from lagcli.engine.taylor.series_nodes import Name


class LinearSystem:
    """Computes the series of a and λ.

    Parameters
    ----------
    expansion : Expansion
    system : System
    outputs : sequence of int
        Registers of the outputs of the dynamics tape with the unrolled elimination.
    """

    def __init__(self, expansion: SeriesExpansion, system: System, outputs: Sequence[int]):
        mass, jacobian = system.mass_pattern, system.jacobian_pattern
        layout, nq, size = UnrolledLayout(system.counts), system.counts.nq, system.counts.unknowns
        rows = outputs[layout.jacobian]
        self.expansion = expansion
        # rows, columns and registers of the matrix, and their signs in r − K x
        self.entries = [
            *((i, j, x, -1) for (i, j), x in zip(mass, outputs[layout.mass_matrix], strict=True)),
            *((nq + i, j, x, -1) for (i, j), x in zip(jacobian, rows, strict=True)),
            *((j, nq + i, x, 1) for (i, j), x in zip(jacobian, rows, strict=True)),
        ]
        self.right = [*outputs[layout.forcing], *outputs[layout.rhs]]
        self.values = outputs[layout.solution]
        self.solution = outputs[len(outputs) - nq - size : len(outputs) - nq]
        self.other_right = range(system.dynamics.inputs, system.dynamics.inputs + size)

    def solve(self) -> list[Name]:
        """Convert the matrix and the right side, then the substitutions; return the unknowns."""
        expansion = self.expansion
        expansion.expand([*(x for _, _, x, _ in self.entries), *self.right])
        unknowns = self.unknowns()
        rows: list[dict[Name, list[Form]]] = [{} for _ in unknowns]
        for i, j, x, sign in self.entries:
            if not expansion.is_invariant(x):
                number, base = expansion.tail(x)
                number = number if sign > 0 else expansion.builder.negative(number)
                rows[i].setdefault(base, []).append((number, unknowns[j]))
        moving: set[Name] = set()
        for to, right, row in zip(self.other_right, self.right, rows, strict=True):
            terms = [] if expansion.is_invariant(right) else [expansion.tail(right)]
            terms += [self.product(base, factors) for base, factors in row.items()]
            if terms:
                moving.add(to)
                expansion.whole[to] = expansion.add(terms)
        # from the right side to the solution, everything else is of order 0: numbers
        before, expansion.moving = expansion.moving, moving
        names = dict(zip(self.solution, unknowns, strict=True))
        for x in names.keys() & set(self.other_right):  # without an operation
            expansion.rename(x, names[x])
        expansion.expand(names, names)
        expansion.moving = before
        return unknowns

    def unknowns(self) -> list[Name]:
        """Return names of the series of a and λ: registers if they are not computed otherwise."""
        expansion = self.expansion
        found: list[Name] = []
        for x in self.values:
            known = x in expansion.taken or x < expansion.builder.inputs
            if not known:
                expansion.taken.add(x)
                expansion.moving.add(x)
            found.append(expansion.new(x) if known else x)
        return found

    def product(self, base: Name, factors: list[Form]) -> Form:
        """Return the product of a series, without its first coefficient, and a sum."""
        expansion = self.expansion
        number, x = factors[0] if len(factors) == 1 else expansion.bracket(factors, list)
        return number, expansion.multiply(base, x, tail=True)
