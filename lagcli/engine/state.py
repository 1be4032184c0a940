"""State: where a System is, and with which values of its parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array


class State(NamedTuple):
    """Time, coordinates, velocities and parameters.

    Parameters
    ----------
    t : float
        s.
    q, v : (nq,) arrays
    p : tuple of float
        Values of the System's parameters, in their order.
    """

    t: float
    q: Array
    v: Array
    p: tuple[float, ...] = ()

    @property
    def y(self) -> Array:
        """(q, v, 0), (2 nq + 1,): the state of a run that has done no work yet."""
        return np.concatenate([self.q, self.v, [0.0]])
