"""The conditions of a symmetry, which prove that its quantity is conserved."""

from __future__ import annotations

from collections.abc import Iterator

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.derivation.motion import ZERO
from lagcli.equations.symmetry.conserved import THOROUGH, ConservedQuantity
from lagcli.equations.symmetry.monomials import Monomials, term_count


class Proof:
    """The conditions that a symmetry satisfies, as expressions that vanish identically.

    Parameters
    ----------
    equations : Equations
    quantity : ConservedQuantity
    """

    def __init__(self, equations: Equations, quantity: ConservedQuantity):
        self.equations, self.quantity = equations, quantity

    def products(self) -> Iterator[tuple[Basic, Basic]]:
        """Yield the factors of the products in (∂L/∂q + Q)·ξ + p·ξ̇ + τ (∂L/∂t − Q·v)."""
        eq, quantity = self.equations, self.quantity
        for i, x in quantity.field.items():
            yield eq.gradient[i] + eq.applied_forces[i], x
            yield eq.momenta[i], self.rate(x)
        if quantity.time != ZERO:
            yield quantity.time, -eq.time_power
            for force, v in zip(eq.applied_forces, eq.v, strict=True):
                yield -quantity.time * force, v

    def constraint_products(self, beta: int) -> Iterator[tuple[Basic, Basic]]:
        """Yield the factors of the products in b_β·ξ + τ b_0."""
        c = self.equations.constraints[beta]
        for i, b in c.row.items():
            if i in self.quantity.field:
                yield b, self.quantity.field[i]
        yield self.quantity.time, c.drift

    def multiple(self, beta: int) -> Basic:
        """Return Σ_γ μ_βγ φ_γ."""
        positions = [c.position for c in self.equations.constraints if c.position is not None]
        multiples = self.quantity.multiples.items()
        return se.Add(*[x * positions[j] for (i, j), x in multiples if i == beta])

    def rate(self, expression: Basic) -> Basic:
        """Return the time derivative of a function of q."""
        pairs = zip(self.equations.q, self.equations.v, strict=True)
        return se.Add(*[expression.diff(q) * v for q, v in pairs])

    def holds_generally(self) -> bool:
        """Whether the conditions hold for all values of the parameters."""
        conditions = [se.Add(*[x * y for x, y in self.products()], -self.rate(self.quantity.gauge))]
        for beta in range(len(self.equations.constraints)):
            products = [x * y for x, y in self.constraint_products(beta)]
            conditions.append(se.Add(*products, -self.multiple(beta)))
        return all(map(_vanishes, conditions))


def _vanishes(expression: Basic) -> bool:
    write = Monomials({})
    exponential = write.exponential(expression)
    return term_count(exponential) <= THOROUGH and not any(True for _ in write.terms(exponential))
