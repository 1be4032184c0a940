"""Momenta that do not vanish identically on the constraints."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import symengine as se

from lagcli.arrays import Array
from lagcli.engine.constraints.initial import (
    ConsistentState,
    NoStart,
    consistent_state,
    coordinate_reach,
)
from lagcli.engine.constraints.random_states import tangents
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
    states: Callable[[], Iterable[ConsistentState]],
    quantities: Sequence[ConservedQuantity],
) -> tuple[ConservedQuantity, ...]:
    """Return the quantities without momenta that vanish on the constraints or depend on others.

    A field ξ with B ξ = 0 is an admissible velocity. Its momentum p·ξ − F changes by ξᵀM ξ along
    it, and is constant on all consistent states only if ξ is zero there. Fields are compared at
    the initial state and, while one vanishes or depends on those before it, at one random
    consistent state after the other.

    Parameters
    ----------
    equations : Equations
    system : System
    start : ConsistentState
    states : callable
        Returns random consistent states, as `random_walk` does.
    quantities : sequence of ConservedQuantity

    Notes
    -----
    A field may vanish at the start only. Nothing is omitted without other consistent states, unless
    the constraints determine all positions, nor from a rheonomic system without a consistent state
    at another time.
    """
    momenta = [q for q in quantities if q.kind == "momentum"]
    if not system.constraints or all(_is_constant(q, equations) for q in momenta):
        return tuple(quantities)
    reach = coordinate_reach(Evaluator(system, start.state.p), start.state)
    fields = _Fields(equations, momenta, reach)
    fields.add(start.state)
    if not fields.dependent():
        return tuple(quantities)
    alone = True
    for state in states():
        alone = False
        fields.add(state.state)
        if not fields.dependent():
            return tuple(quantities)
    if alone and tangents(system, start.state).shape[1]:
        return tuple(quantities)
    if any(c.rheonomic for c in equations.constraints):
        later = _later(system, start.state)
        if not later:
            return tuple(quantities)
        for at in later:
            fields.add(at)
    omitted = fields.dependent()
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


class _Fields:
    """The fields of momenta at states and at random places off them, relative to the reach."""

    def __init__(self, equations: Equations, momenta: Sequence[ConservedQuantity], reach: Array):
        entries = [(k, i, x) for k, q in enumerate(momenta) for i, x in q.field.items()]
        self.places = [(k, i) for k, i, _ in entries]
        self.names, self.reach = [q.name for q in momenta], reach
        self.random = np.random.default_rng(8)
        self.on, self.off = list[Array](), list[Array]()  # (n, nq) at each state
        self.tape = ScalarTape(
            compile_tape(
                [x for _, _, x in entries],
                [TIME, *equations.q],
                [se.Symbol(n) for n in equations.model.parameters],
                input_functions(equations.model),
            )
        )

    def add(self, state: State) -> None:
        """Evaluate the fields at a state and beside it."""
        self.on.append(self._values(state, state.q))
        beside = state.q + self.reach * self.random.normal(size=len(self.reach))
        self.off.append(self._values(state, beside))

    def dependent(self) -> set[str]:
        """Return the momenta whose fields at the states vanish or depend on those before them."""
        on, off = np.concatenate(self.on, axis=1), np.concatenate(self.off, axis=1)
        kept: list[Array] = []  # orthonormal
        dependent = set()
        for name, field, size in zip(self.names, on, np.linalg.norm(off, axis=1), strict=True):
            rest = field / size
            for direction in (*kept, *kept):  # twice, against cancellation
                rest = rest - (direction @ rest) * direction
            length = float(np.linalg.norm(rest))
            if length > _ZERO:
                kept.append(rest / length)
            else:
                dependent.add(name)
        return dependent

    def _values(self, state: State, q: Array) -> Array:
        fields = np.zeros((len(self.names), len(q)))
        values = self.tape((state.t, *q.tolist(), *state.p))
        for (k, i), x in zip(self.places, values, strict=True):
            fields[k, i] = x / self.reach[i]
        return fields
