"""Which constraints depend on each other where B has a deficient rank."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.state import State
from lagcli.engine.system import System

#: Entries of the projection onto the dependencies that count: those that vanish are some 1e-8,
#: the rank's tolerance.
_TAKES_PART = 1e-6


def dependent_sets(
    system: System, state: State, rank: int, held: Sequence[int]
) -> list[tuple[list[int], int]]:
    """Return the sets of constraints whose rows of B depend on each other at a state.

    The projection P onto the combinations of rows that vanish does not depend on how they are
    written. Constraints that it joins form a set; P's trace over the set is the number of rows in
    it that follow from the others.

    Parameters
    ----------
    system : System
    state : State
        On the constraints.
    rank : int
        Rank of the active rows of B.
    held : sequence of int
        The constraints that hold.

    Returns
    -------
    list of (list of int, int)
        The constraints of each set, and how many of them follow from the others.
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
