"""The core's search for consistent initial states, of one System; see core/lagstart.h."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import byref, c_double, c_int, c_int64, c_void_p
from typing import Any

import numpy as np

from lagcli.arrays import Array, Flags, Int32
from lagcli.engine.core.fields import equations_fields
from lagcli.engine.core.library import Functions, check
from lagcli.engine.core.program import Program
from lagcli.engine.core.status import StartStatus
from lagcli.engine.core.structures import (
    Arguments,
    Doubles,
    address,
    copied,
    lag_equations,
)
from lagcli.engine.system import System

core = Functions(
    {
        "lag_make_start_search": (c_void_p, c_void_p, c_void_p, c_void_p, c_int),
        "lag_destroy_start_search": (None, c_void_p),
        "lag_find_positions": (None, c_void_p, c_double, c_int64, *[c_void_p] * 5),
        "lag_find_velocities": (None, c_void_p, c_double, c_int64, *[c_void_p] * 5),
        "lag_least_scales": (Doubles, c_void_p),
    }
)


class CoreSearch:
    """Moves free positions and velocities to the constraints.

    Parameters
    ----------
    system : System
    constraint, mass : Program
        The constraints with their rates, and the nonzero entries of M, of (t, q, v, p).
    spins : sequence of (places, fixed)
        Quaternions whose angular velocities are given: the places of their four components among
        the coordinates, and which of the three components of the angular velocity are fixed.
    """

    _search: int | None = None

    def __init__(
        self,
        system: System,
        constraint: Program,
        mass: Program,
        spins: Sequence[tuple[Sequence[int], Sequence[bool]]] = (),
    ):
        # the search points into the arrays
        self._system, self._given = system, Arguments()
        given = self._given
        equations = given.filled(lag_equations, **equations_fields(system, constraint))
        numbers = [int(x) for places, fixed in spins for x in (*places, *fixed)]
        self._search = core.lag_make_start_search(
            byref(equations), byref(given.program(mass)), given.integers(numbers), len(spins)
        )
        check(self._search is None)

    # an argument, because globals may be gone when the interpreter exits
    def __del__(self, destroy: Any = core.lag_destroy_start_search) -> None:
        if self._search:
            destroy(self._search)

    def positions(
        self, t: float, p: Array, held: Sequence[int], fixed: Flags, q: Array, v: Array
    ) -> tuple[Int32, Array]:
        """Return whether positions on the constraints were found, and the last ones.

        Parameters
        ----------
        t : float
            s.
        p : (n, np) array
            Parameters of each row.
        held : sequence of int
            The constraints that hold.
        fixed : (nq,) array of bool
        q, v : (n, nq) arrays

        Returns
        -------
        statuses : (n,) array of StartStatus
        positions : (n, nq) array
        """
        found, y = self._find(core.lag_find_positions, t, p, held, fixed, q, v)
        return found, y[:, : q.shape[1]]

    def velocities(
        self, t: float, p: Array, held: Sequence[int], fixed: Flags, q: Array, v: Array
    ) -> tuple[Int32, Array]:
        """Return the same of velocities."""
        found, y = self._find(core.lag_find_velocities, t, p, held, fixed, q, v)
        return found, y[:, q.shape[1] :]

    def _find(
        self,
        function: Any,
        t: float,
        p: Array,
        held: Sequence[int],
        fixed: Flags,
        q: Array,
        v: Array,
    ) -> tuple[Int32, Array]:
        given, y = Arguments(), np.hstack([q, v])
        holds = np.zeros(len(self._system.constraints), dtype=np.int32)
        holds[list(held)] = 1
        found = np.zeros(len(y), dtype=np.int32)
        pieces = self._system.held_at(t, ())
        parameters = np.hstack([p, np.tile(pieces, (len(p), 1))]) if pieces else p
        function(
            self._search,
            t,
            len(y),
            given.doubles(parameters),
            given.integers(holds),
            given.integers(fixed),
            address(y),
            address(found),
        )
        check(bool((found == StartStatus.NO_MEMORY).any()))
        return found, y

    @property
    def least_scales(self) -> Array:
        """The least scales of the constraints in the last search, (nc,), by their terms at the
        guess."""
        return copied(core.lag_least_scales(self._search), len(self._system.constraints))
