"""State of a System, including its parameter values."""

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
        """y = (q, v, 0), (2 nq + 1,): the initial state of a run, with zero work."""
        return np.concatenate([self.q, self.v, [0.0]])
