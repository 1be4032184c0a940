"""Random states that satisfy the constraints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.initial import (
    ConsistentState,
    NoStart,
    consistent_state,
    coordinate_reach,
)
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.dense import decompose
from lagcli.engine.system import State, System

#: Number of random consistent states, and the largest number of coordinates for which they are
#: computed: for larger models, each takes seconds.
_STATES, MOST_COORDINATES = 20, 60
#: Their distance from the initial state, relative to the sizes of the coordinates.
_SPREAD = 0.5


def random_states(
    system: System, start: ConsistentState, count: int = _STATES
) -> list[ConsistentState]:
    """Return random consistent states near the initial state, reproducibly; see `random_walk`.

    Returns
    -------
    list of ConsistentState
        Up to `count`; none for a large system, without constraints, or if these determine all
        positions.
    """
    return list(random_walk(system, start, count))


def random_walk(
    system: System, start: ConsistentState, count: int = _STATES
) -> Iterator[ConsistentState]:
    """Yield random consistent states near the initial state, each when it is asked for.

    A random walk: each state is a step along the position constraints from the previous one,
    projected onto them. Guesses far from the constraints would converge to singular configurations.
    """
    random, state = np.random.default_rng(8), start.state
    free = np.zeros(len(state.q), dtype=bool)
    if not system.constraints or len(free) > MOST_COORDINATES:
        return
    size = coordinate_reach(Evaluator(system, state.p), state)
    found = 0
    for _ in range(2 * count):
        basis = tangents(system, state)
        if not basis.shape[1]:
            break
        step = basis @ random.normal(size=basis.shape[1])
        step *= _SPREAD * random.uniform() / (np.abs(step / size).max() or 1.0)
        v = state.v + random.normal(size=len(free)) * np.maximum(np.abs(state.v), size)
        try:
            guess = State(state.t, state.q + step, v, state.p)
            consistent = consistent_state(system, guess, free, free)
        except (NoStart, np.linalg.LinAlgError):
            state = start.state
            continue
        yield consistent
        state, found = consistent.state, found + 1
        if found == count:
            break


def tangents(system: System, state: State) -> Array:
    """Return a basis of the admissible changes of the coordinates, (nq, n)."""
    evaluator = Evaluator(system, state.p)
    sizes = evaluator.sizes(state.t, state.q, state.v)
    if not system.holonomic:
        return np.diag(sizes)
    jacobian = evaluator.constraints(state.t, state.q, state.v).jacobian
    return decompose(jacobian[list(system.holonomic)], sizes=sizes).null
