"""Momenta that do not vanish identically on the constraints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import symengine as se

from lagcli.arrays import Array
from lagcli.engine.constraints.initial import (
    ConsistentState,
    NoStart,
    consistent_state,
    coordinate_reach,
)
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.system import State, System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.symmetry.conserved import ConservedQuantity
from lagcli.model.model import TIME

#: Fields below this part of their size off the constraints count as zero: on consistent states they
#: are about 1e-8 where constraints touch, and about 1e-12 elsewhere.
_ZERO = 1e-6
#: Times at which the constraints of a rheonomic system are also satisfied, s after the start.
_LATER = (0.3, 1.7)


def distinct(
    equations: Equations,
    system: System,
    start: ConsistentState,
    states: Sequence[ConsistentState],
    quantities: Sequence[ConservedQuantity],
) -> tuple[ConservedQuantity, ...]:
    """Return the quantities without momenta that vanish on the constraints or depend on others.

    A field ξ with B ξ = 0 is an admissible velocity. Its momentum p·ξ − F changes by ξᵀM ξ along
    it, and is constant on all consistent states only if ξ is zero there. Fields are compared at
    random consistent states, each with those before it.

    Parameters
    ----------
    equations : Equations
    system : System
    start : ConsistentState
    states : sequence of ConsistentState
        Random consistent states, from `random_states`; none if the constraints determine all
        positions.
    quantities : sequence of ConservedQuantity

    Notes
    -----
    Nothing is omitted from a rheonomic system without a consistent state at another time: a field
    may vanish at the start only.
    """
    momenta = [q for q in quantities if q.kind == "momentum"]
    if not system.constraints or all(_is_constant(q, equations) for q in momenta):
        return tuple(quantities)
    points = [start.state, *(x.state for x in states)]
    if any(c.rheonomic for c in equations.constraints):
        later = _later(system, start.state)
        if not later:
            return tuple(quantities)
        points += later
    reach = coordinate_reach(Evaluator(system, start.state.p), start.state)
    on, off = _fields(equations, momenta, points, reach)
    sizes = np.linalg.norm(off, axis=1)
    kept: list[Array] = []  # orthonormal
    omitted = set()
    for quantity, field, size in zip(momenta, on, sizes, strict=True):
        rest = field / size
        for direction in (*kept, *kept):  # twice, against cancellation
            rest = rest - (direction @ rest) * direction
        length = float(np.linalg.norm(rest))
        if length > _ZERO:
            kept.append(rest / length)
        else:
            omitted.add(quantity.name)
    return tuple(q for q in quantities if q.name not in omitted)


def _is_constant(quantity: ConservedQuantity, equations: Equations) -> bool:
    coordinates = set(equations.q)
    return all(coordinates.isdisjoint(x.free_symbols) for x in quantity.field.values())


def _later(system: System, state: State) -> list[State]:
    free = np.zeros(len(state.q), dtype=bool)
    later = []
    for delay in _LATER:
        guess = State(state.t + delay, state.q, state.v, state.p)
        try:
            later.append(consistent_state(system, guess, free, free).state)
        except (NoStart, np.linalg.LinAlgError):
            continue
    return later


def _fields(
    equations: Equations,
    momenta: Sequence[ConservedQuantity],
    points: Iterable[State],
    reach: Array,
) -> tuple[Array, Array]:
    """Return the fields on the constraints and at random points off them, (n, points × nq)."""
    entries = [(k, i, x) for k, q in enumerate(momenta) for i, x in q.field.items()]
    parameters = [se.Symbol(n) for n in equations.model.parameters]
    tape = ScalarTape(
        compile_tape(
            [x for _, _, x in entries],
            [TIME, *equations.q],
            parameters,
            input_functions(equations.model),
        )
    )
    random = np.random.default_rng(8)

    def values(t: float, q: Array, p: tuple[float, ...]) -> Array:
        fields = np.zeros((len(momenta), len(q)))
        for (k, i, _), x in zip(entries, tape((t, *q.tolist(), *p)), strict=True):
            fields[k, i] = x / reach[i]
        return fields

    on, off = [], []
    for s in points:
        on.append(values(s.t, s.q, s.p))
        off.append(values(s.t, s.q + reach * random.normal(size=len(reach)), s.p))
    return np.concatenate(on, axis=1), np.concatenate(off, axis=1)
