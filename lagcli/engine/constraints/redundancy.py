"""Sets of dependent constraints if the rank of B is deficient."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.state import State
from lagcli.engine.system import System

#: Entries of the projection onto the dependencies above this count: vanishing ones are about 1e-8,
#: the tolerance of the rank.
_TAKES_PART = 1e-6


def dependent_sets(
    system: System, state: State, rank: int, held: Sequence[int]
) -> list[tuple[list[int], int]]:
    """Return the sets of constraints whose rows of B are linearly dependent at a state.

    The projection P onto the combinations of rows that vanish does not depend on their basis.
    Constraints coupled by it form a set; the trace of P over the set is the number of redundant
    rows in it.

    Parameters
    ----------
    system : System
    state : State
        On the constraints.
    rank : int
        Rank of the active rows of B.
    held : sequence of int
        The active constraints.

    Returns
    -------
    list of (list of int, int)
        The constraints of each set, and the number of redundant ones.
    """
    held = list(held)
    if rank == len(held):
        return []
    evaluator, t, q, v = Evaluator(system, state.p), state.t, state.q, state.v
    c = evaluator.constraints(t, q, v)
    sizes = evaluator.sizes(t, q, v)
    lengths = evaluator.row_lengths(t, q, v, c, sizes)[held]
    found = dense.decompose(c.jacobian[held], rank, scale=lengths, sizes=sizes).dependent
    projection = found @ found.T
    joined = np.abs(projection) > _TAKES_PART
    left = {int(i) for i in np.flatnonzero(np.diag(joined))}
    sets = []
    while left:
        members: set[int] = set()
        stack = [min(left)]
        while stack:
            i = stack.pop()
            if i not in members:
                members.add(i)
                stack.extend(left.intersection(np.flatnonzero(joined[i]).tolist()) - members)
        left -= members
        inside = sorted(members)
        sets.append(([held[i] for i in inside], round(float(projection[inside, inside].sum()))))
    return sets
