"""Assemblies of a mechanism: the initial states that its constraints allow for the same values.

A loop of links closes in several ways, such as a four-bar linkage with its coupler above or below
the line of its pivots. Which one a run has follows from the guesses of the initial values.
"""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.initial import ConsistentSearch, ConsistentState, NoStart
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.system import State
from lagcli.errors import LagcliError
from lagcli.simulations.sensitivity import Sensitivity

#: 2 to the power of this is the number of guesses from which other assemblies are searched for.
#: Each leads to one of two with about the same chance.
_GUESSES = 3
#: Largest number of free coordinates: a large mechanism has more assemblies than guesses find.
_MOST = 50
#: Difference of two assemblies over the reach of a coordinate, below which they are the same.
_SAME = 1e-6
#: Change of φ along a whole turn, relative to its terms, for which a coordinate is an angle.
_PERIODIC = 1e-10


class Assemblies:
    """The assemblies of one experiment.

    Parameters
    ----------
    sensitivity : Sensitivity
        Of the model with the experiment's values.
    """

    def __init__(self, sensitivity: Sensitivity):
        self.sensitivity, self.system = sensitivity, sensitivity.system
        self.free = ~np.asarray(sensitivity.directions.fixed[0], bool)

    def others(self, given: State, own: ConsistentState) -> list[ConsistentState]:
        """Return other assemblies for the same values, in the order in which they are found.

        There are none where the constraints leave the free coordinates a choice: then these follow
        from their guesses.

        Parameters
        ----------
        given : State
            State from `Directions.state`, with the guesses.
        own : ConsistentState
            The assembly that is known.
        """
        from scipy.stats import qmc

        count = int(self.free.sum())
        if not 0 < count <= _MOST or not self.sensitivity.determined(own):
            return []
        evaluator = Evaluator(self.system, given.p)
        search = ConsistentSearch(evaluator, given.t, ~self.free, ~self.free)
        turning, reach = self._reach(search, own.state)
        known = [own]
        for point in 2 * qmc.Sobol(count, rng=0).random_base2(_GUESSES) - 1:
            q = own.state.q.copy()
            q[self.free] += point * reach[self.free]
            try:
                _, q = search.find(search.core.positions, search.fixed_q, q, own.state.v)
                whole = np.round((q - given.q) / (2 * np.pi))
                q = np.where(turning, q - 2 * np.pi * whole, q)
                near = own._replace(state=own.state._replace(q=q))
                if not self._on_constraints(search, near.state):
                    continue
                found = self.sensitivity.consistent(given, near)
            except (NoStart, LagcliError, ArithmeticError):
                continue
            if not any(same_assembly(found, x, reach) for x in known):
                known.append(found)
        return known[1:]

    def same(self, one: ConsistentState, other: ConsistentState) -> bool:
        """Return whether two states for the same values are the same assembly."""
        evaluator = Evaluator(self.system, one.state.p)
        search = ConsistentSearch(evaluator, one.state.t, ~self.free, ~self.free)
        return same_assembly(one, other, self._reach(search, one.state)[1])

    def _on_constraints(self, search: ConsistentSearch, state: State) -> bool:
        phi, scale, _ = search.residual(state.q, state.v)
        return bool(np.abs(phi / scale).max() <= _SAME)

    def _reach(self, search: ConsistentSearch, state: State) -> tuple[Flags, Array]:
        """Return which coordinates are angles, and how far each may be from another assembly.

        An angle is a coordinate whose whole turns change no constraint. Others reach as far as the
        terms of their constraints.
        """
        q, v = state.q, state.v
        _, scale, jacobian = search.residual(q, v)
        rows = np.abs(np.asarray(jacobian))
        turning = np.zeros(len(q), dtype=bool)
        # at a place where no angle is zero
        aside = q + np.cos(1.0 + np.arange(len(q))) * np.where(self.free, 1.0, 0.0)
        before = search.evaluator.constraints(state.t, aside, v).position[search.places]
        for i in np.flatnonzero(self.free).tolist():
            turned = aside.copy()
            turned[i] += 2 * np.pi
            after = search.evaluator.constraints(state.t, turned, v).position[search.places]
            turning[i] = bool((np.abs(after - before) <= _PERIODIC * scale).all())
        lengths = rows[:, ~turning].max(axis=1, initial=0.0)
        reach = np.zeros(len(q))
        for i in range(len(q)):
            with_it = (rows[:, i] > 0.0) & (lengths > 0.0)
            reach[i] = (scale[with_it] / lengths[with_it]).max(initial=0.0)
        return turning, np.where(turning, np.pi, reach)


def same_assembly(one: ConsistentState, other: ConsistentState, reach: Array) -> bool:
    """Return whether the coordinates of two states differ by rounding errors."""
    return bool((np.abs(one.state.q - other.state.q) <= _SAME * reach).all())
