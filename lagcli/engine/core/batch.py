"""Batches of runs, and tables, on the core: `lagbatch.h`."""

from __future__ import annotations

from ctypes import byref, c_int, c_int64, c_void_p
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli.arrays import Array, Numbers
from lagcli.engine.core.library import KERNEL, Functions, check
from lagcli.engine.core.program import Program, assemble, unpacked
from lagcli.engine.core.run import Integrator
from lagcli.engine.core.structures import (
    Arguments,
    Doubles,
    Integers,
    Structure,
    address,
    each,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from lagcli.engine.tape.tape import Tape


class lag_batch_settings(Structure):
    """The settings of a batch."""

    _fields_ = (
        ("times", Doubles),
        *each(c_int64, "times_count runs"),
        *each(Doubles, "parameters states"),
        ("slots", c_int64),
        ("kernel", c_int),
        ("status", Integers),
        ("counts", c_void_p),
        ("samples", Doubles),
    )


core = Functions(
    {
        "lag_batch_create": (c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_void_p),
        "lag_batch_destroy": (None, c_void_p),
        "lag_batch_advance": (c_int, c_void_p, c_int64),
        "lag_batch_take": (c_int64, c_void_p, c_void_p, c_void_p),
        "lag_batch_runs": (c_void_p, c_void_p),
        "lag_batch_leave": (None, c_void_p, c_int),
        "lag_table_create": (c_void_p, c_void_p, c_void_p, c_int, c_int, c_int),
        "lag_table_destroy": (None, c_void_p),
        "lag_table_evaluate": (None, c_void_p, c_void_p, c_void_p, c_int64, c_int64, c_void_p),
        "lag_batch_sincos": (None, c_void_p, c_void_p, c_void_p, c_int),
    }
)

#: Runs that are integrated at once: LAG_LANES.
LANES = 8


def _scalar(program: Program) -> Program:
    """Return a program whose operations are on single registers."""
    return program._replace(
        prelude=unpacked(program.prelude),
        main=unpacked(program.main),
        deferred=tuple(map(unpacked, program.deferred)),
        output_subsets=tuple(map(unpacked, program.output_subsets)),
    )


class BatchIntegrator:
    """Integrates many runs of one System, eight at a time.

    Parameters
    ----------
    single : Integrator
        What looks closer at one run: with the settings of all and an unrolled elimination.
    dynamics, constraint : Program
        As the single one has them.
    times : (nt,) array
    parameters : (n, np) array
    states : (n, 2 nq) array
        q and v at the start.
    slots : int
        Runs whose samples are held at once, more than LANES.
    kernel : int
        Version of the core's loops.

    Attributes
    ----------
    status : (n + 1,) array of int
        `LaneStatus` of each run.
    counts : (n + 1, 3) array
        Steps, rejected steps and evaluations of each run.
    samples : (slots, nt, width) array
    """

    _batch: int | None = None

    def __init__(
        self,
        single: Integrator,
        dynamics: Program,
        constraint: Program,
        times: ArrayLike,
        parameters: Array,
        states: Array,
        slots: int,
        kernel: int = KERNEL,
    ):
        given = Arguments()
        self._single, self._slots = single, slots
        runs, count = len(states), np.size(times)
        self.status = np.zeros(runs + 1, dtype=np.int32)
        self.counts = np.zeros((runs + 1, 3), dtype=np.int64)
        self.samples = np.empty((slots, count, single.sample_width))
        record = given.filled(
            lag_batch_settings,
            times=times,
            times_count=count,
            runs=runs,
            parameters=parameters,
            states=states,
            slots=slots,
            kernel=kernel,
            status=self.status,
            counts=address(self.counts),
            samples=self.samples,
        )
        programs = given.program(_scalar(dynamics)), given.program(_scalar(constraint))
        self._batch = core.lag_batch_create(
            None, single.handle, *map(byref, programs), byref(record)
        )
        check(not self._batch)

    # an argument, because globals may be gone when the interpreter exits
    def __del__(self, destroy: Any = core.lag_batch_destroy) -> None:
        if self._batch:
            destroy(self._batch)

    def advance(self, attempts: int) -> int:
        """Try at most so many steps in each lane; return RUNNING, BLOCK_FULL or DONE."""
        status: int = core.lag_batch_advance(self._batch, attempts)
        return status

    def take(self) -> tuple[Numbers, Array]:
        """Return the runs done since the last call and their samples, by run."""
        runs, slots = np.empty((2, self._slots), dtype=np.int64)
        count = core.lag_batch_take(self._batch, address(runs), address(slots))
        return runs[:count], self.samples[slots[:count]]

    def under_way(self) -> list[int]:
        """Return the run in each lane; −1 where there is none."""
        return (c_int64 * LANES).from_address(core.lag_batch_runs(self._batch))[:]

    def leave(self, lane: int) -> None:
        """Let the run in a lane leave it."""
        core.lag_batch_leave(self._batch, lane)


class BatchTable:
    """A program evaluated over the rows of tables, eight at a time; threads take turns.

    Parameters
    ----------
    program : Program
    inputs, parameters : int
        Numbers of all inputs, and of those among them, the last, that are the same for a table.
    kernel : int
        As for `BatchIntegrator`.
    """

    _table: int | None = None

    def __init__(
        self,
        program: Program,
        inputs: int,
        parameters: int,
        kernel: int = KERNEL,
    ):
        given = Arguments()
        self._parameters, self._outputs = parameters, len(program.outputs)
        self._turn = Lock()  # the registers belong to the table
        record = given.program(_scalar(program))
        self._table = core.lag_table_create(
            None, byref(record), inputs - parameters, parameters, kernel
        )
        check(not self._table)

    @classmethod
    def of_rows(cls, tape: Tape) -> BatchTable:
        """Return the table of a tape whose inputs all differ between rows."""
        return cls(assemble(tape._replace(parameters=0), long=None), tape.inputs, 0)

    # an argument, because globals may be gone when the interpreter exits
    def __del__(self, destroy: Any = core.lag_table_destroy) -> None:
        if self._table:
            destroy(self._table)

    def __call__(self, tables: Any, parameters: ArrayLike) -> Array:
        """Return the outputs, (tables, outputs, rows).

        Parameters
        ----------
        tables : (n, rows, width) array
            The first of each row are the inputs.
        parameters : (n, parameters) array
        """
        given = np.ascontiguousarray(tables, dtype=float)
        count, rows, width = given.shape
        out = np.empty((count, self._outputs, rows))
        if not out.size:
            return out
        values = np.ascontiguousarray(parameters, dtype=float)
        begin = address(values), address(given), address(out)
        steps = 8 * self._parameters, given.strides[0], out.strides[0]
        with self._turn:
            for i in range(count):
                own, table, to = (at + i * step for at, step in zip(begin, steps, strict=True))
                core.lag_table_evaluate(self._table, own, table, rows, width, to)
        return out
