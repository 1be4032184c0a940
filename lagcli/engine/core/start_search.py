"""The core's search for consistent states of one System; see core/lagstart.h."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import byref, c_double, c_int, c_int64, c_void_p
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Flags, Int32
from lagcli.engine.core.fields import equations_fields
from lagcli.engine.core.library import Functions, check
from lagcli.engine.core.program import Program
from lagcli.engine.core.status import StartStatus
from lagcli.engine.core.structures import (
    Arguments,
    Doubles,
    Integers,
    Structure,
    address,
    copied,
    each,
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
        "lag_make_adjustment": (c_void_p, c_void_p, c_void_p, c_void_p),
        "lag_destroy_adjustment": (None, c_void_p),
        "lag_supplied": (c_double, c_void_p, c_double, *[c_void_p] * 3),
        "lag_adjust": (c_int, c_void_p, c_double, *[c_void_p] * 5),
    }
)


class lag_held_rows(Structure):
    """What holds while an event sets values."""

    _fields_ = (
        *each(Integers, "positions velocities sign"),
        *each(Doubles, "no_gap accuracy"),
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


class HeldRows(NamedTuple):
    """What holds while an event sets values.

    Parameters
    ----------
    positions, velocities : (nc,) arrays of int
        1 for the constraints that hold, contacts apart; those that the event engages are only in
        the latter.
    sign : (nc,) array of int
        1 for closed contacts with φ ≥ 0, −1 for those with φ ≤ 0, 0 for the rest.
    no_gap : (nc,) array
        Their gaps that count as none.
    """

    positions: Int32
    velocities: Int32
    sign: Int32
    no_gap: Array


class CoreAdjustment:
    """Moves free values to the nearest state on the constraints.

    Parameters
    ----------
    system, constraint, mass
        As for `CoreSearch`.
    """

    _adjustment: int | None = None

    def __init__(self, system: System, constraint: Program, mass: Program):
        # it points into the arrays
        self._system, self._given = system, Arguments()
        equations = self._given.filled(lag_equations, **equations_fields(system, constraint))
        program = self._given.program(mass)
        self._adjustment = core.lag_make_adjustment(None, byref(equations), byref(program))
        check(self._adjustment is None)

    # an argument, because globals may be gone when the interpreter exits
    def __del__(self, destroy: Any = core.lag_destroy_adjustment) -> None:
        if self._adjustment:
            destroy(self._adjustment)

    def adjust(
        self, t: float, p: Sequence[float], held: HeldRows, fixed: Flags, y: Array, accuracy: Array
    ) -> tuple[int, Array, Array]:
        """Return a `StartStatus`, the nearest state, and the impulse that leads to its velocities.

        Parameters
        ----------
        t : float
            s.
        p : sequence of np float
        held : HeldRows
        fixed : (2, nq) array of bool
        y : (2 nq,) array
        accuracy : (nq,) array
            Errors that velocities may have.
        """
        given, found = Arguments(), y.copy()
        impulse = np.zeros(len(self._system.constraints))
        rows = given.filled(lag_held_rows, **held._asdict(), accuracy=accuracy)
        status: int = core.lag_adjust(
            self._adjustment,
            t,
            given.doubles(self._system.held_at(t, p)),
            byref(rows),
            given.integers(fixed),
            address(found),
            address(impulse),
        )
        check(status == StartStatus.NO_MEMORY)
        return status, found, impulse

    def supplied(self, t: float, p: Sequence[float], y: Array, impulse: Array) -> float:
        """Return the energy in J that moving constraints supply by an impulse, (nc,), after which
        the state is y."""
        given = Arguments()
        energy: float = core.lag_supplied(
            self._adjustment,
            t,
            given.doubles(self._system.held_at(t, p)),
            given.doubles(y),
            given.doubles(impulse),
        )
        return energy
