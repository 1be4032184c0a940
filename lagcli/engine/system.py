"""System: what an engine integrates, as tapes, sizes and sparsity. It knows no symbols."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import symengine as se
from numpy.typing import NDArray

from lagcli.engine.compilation import compile_tape
from lagcli.engine.tape import Tape

if TYPE_CHECKING:
    from lagcli.engine.variation import Variation
    from lagcli.equations.lagrange import Equations

Array = NDArray[np.float64]
Pattern = tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class System:
    """M a = f + Bᵀλ, B a = γ, φ = 0, ψ = 0 in numbers.

    nq coordinates, nc constraints, nh of them holonomic. A System can be written by hand: only
    the tapes' inputs and outputs, in the order given here, are the contract.

    Parameters
    ----------
    coordinates, constraints : tuples of str
        Names, in the model's order.
    holonomic : tuple of nh int
        Indices of the holonomic constraints.
    parameters : tuple of float
        Values of the tapes' last inputs.
    mass_pattern : tuple of (row, column)
        Places of the nonzero entries of M, both triangles.
    jacobian_pattern : tuple of (constraint, coordinate)
        Places of the nonzero entries of B.
    dynamics : Tape
        (t, q, v, parameters) → (M entries, f, B entries, γ, power), where power is that of the
        applied forces and of explicit time, Q·v − ∂L/∂t.
    constraint : Tape
        (t, q, v, parameters) → (φ, B entries, b_0, scale of φ, scale of ψ), where ψ = B v + b_0
        and a scale is the sum of the magnitudes of the terms; φ and its scale have nh entries.
    report : Tape
        (t, q, v, a, λ, parameters) → (T, V, v·∂L/∂v − L, Q·v, −∂L/∂t, outputs).
    outputs : tuple of str
        Names of the outputs at the end of ``report``.
    events : Tape, optional
        (t, q, v, parameters) → functions whose sign changes are events.
    variation : callable, optional
        Returns the derivatives that stiff methods need; called when one is going to run.
    alike : tuple of tuples of int
        Coordinates that certainly have the same unit, such as those of a quaternion.
    """

    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    holonomic: tuple[int, ...]
    parameters: tuple[float, ...]
    mass_pattern: Pattern
    jacobian_pattern: Pattern
    dynamics: Tape
    constraint: Tape
    report: Tape
    outputs: tuple[str, ...] = ()
    events: Tape | None = None
    variation: Callable[[], Variation] | None = None
    alike: tuple[tuple[int, ...], ...] = ()

    def inertia(self, mass_diagonal: Array) -> Array:
        """Return the inertia by which coordinates are compared, (..., nq).

        M_jj or, among coordinates with the same unit, the largest: a quaternion has none along
        itself.
        """
        inertia = mass_diagonal
        if self.alike:
            inertia = mass_diagonal.copy()
            for group in map(list, self.alike):
                inertia[..., group] = mass_diagonal[..., group].max(axis=-1)[..., None]
        return inertia

    @property
    def families(self) -> list[str | None]:
        """Labels of the tapes' inputs t, q, v, parameters: a coordinate's name without its numbers.

        Coordinates with the same label are likely to be treated alike.
        """
        kinds = [without_numbers(name) for name in self.coordinates]
        return [None, *kinds, *(kind + "'" for kind in kinds), *[None for _ in self.parameters]]


def without_numbers(name: str) -> str:
    """Return a name without its numbers."""
    return re.sub(r"\d+", "", name)


def compile_system(equations: Equations) -> System:
    """Turn symbols into tapes.

    Parameters
    ----------
    equations : Equations

    Returns
    -------
    System
        With the model's parameter values.
    """
    from lagcli.model.model import TIME

    eq, model = equations, equations.model
    parameters = [se.Symbol(name) for name in model.parameters]
    state = [TIME, *eq.q, *eq.v]
    rows = [c.row for c in eq.constraints]
    holonomic = tuple(i for i, c in enumerate(eq.constraints) if c.position is not None)
    mass_pattern = tuple((i, j) for i, row in enumerate(eq.mass_matrix) for j in sorted(row))
    jacobian_pattern = tuple((i, j) for i, row in enumerate(rows) for j in sorted(row))
    mass = [eq.mass_matrix[i][j] for i, j in mass_pattern]
    jacobian = [rows[i][j] for i, j in jacobian_pattern]
    applied = se.Add(*[q * v for q, v in zip(eq.applied_forces, eq.v, strict=True)])

    positions = [eq.constraints[i].position for i in holonomic]
    return System(
        coordinates=model.coordinate_names,
        constraints=model.constraint_names,
        holonomic=holonomic,
        parameters=tuple(model.parameter_values.values()),
        mass_pattern=mass_pattern,
        jacobian_pattern=jacobian_pattern,
        dynamics=compile_tape(
            [
                *mass,
                *eq.forcing,
                *jacobian,
                *(c.rhs for c in eq.constraints),
                applied + eq.time_power,
            ],
            state,
            parameters,
        ),
        constraint=compile_tape(
            [
                *positions,
                *jacobian,
                *(c.drift for c in eq.constraints),
                *(_magnitude(x) for x in positions if x is not None),
                *(_magnitude(c.velocity) for c in eq.constraints),
            ],
            state,
            parameters,
        ),
        report=compile_tape(
            [eq.kinetic, eq.potential, eq.energy, applied, eq.time_power, *eq.outputs.values()],
            [*state, *eq.a, *eq.multipliers],
            parameters,
        ),
        outputs=tuple(eq.outputs),
        variation=partial(_variation, eq),
        alike=_alike([x for x in positions if x is not None], eq.q),
    )


def _variation(equations: Equations) -> Variation:
    # imported when called: most runs need none
    from lagcli.engine.variation import compile_variation

    return compile_variation(equations)


def _alike(expressions: Sequence[se.Basic], q: Sequence[se.Basic]) -> tuple[tuple[int, ...], ...]:
    """Return coordinates with the same unit: those that a sum has alike, c x² + c y² + ...

    Without units in the model this is all that is certain, and enough for quaternions.
    """
    number = {x: i for i, x in enumerate(q)}
    groups: dict[int, set[int]] = {}
    for expression in expressions:
        found: dict[tuple[se.Basic, se.Basic], set[int]] = {}
        for term in expression.args if isinstance(expression, se.Add) else ():
            factors = term.args if isinstance(term, se.Mul) else (term,)
            powers = [x.args if isinstance(x, se.Pow) else (x, se.Integer(1)) for x in factors]
            bases = [(base, exponent) for base, exponent in powers if base in number]
            if len(bases) == 1:
                base, exponent = bases[0]
                coefficient = se.Abs(term / base**exponent)
                found.setdefault((coefficient, exponent), set()).add(number[base])
        for same in found.values():
            merged = same.union(*(groups.get(i, ()) for i in same))
            groups.update(dict.fromkeys(merged, merged))
    unique = {min(g): tuple(sorted(g)) for g in groups.values() if len(g) > 1}
    return tuple(unique[i] for i in sorted(unique))


def _magnitude(expression: se.Basic) -> se.Basic:
    """Return the sum of the magnitudes of an expression's terms, products of sums written out.

    It is what the rounding error of the expression is proportional to.
    """
    if isinstance(expression, se.Add):
        return se.Add(*[_magnitude(x) for x in expression.args])
    if isinstance(expression, se.Mul):
        return se.Mul(*[_magnitude(x) for x in expression.args])
    if isinstance(expression, se.Pow):
        base, exponent = expression.args
        if isinstance(exponent, se.Integer) and exponent > 0:
            return _magnitude(base) ** exponent
    return se.Abs(expression)
