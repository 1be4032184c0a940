"""Programs of the core, and how they are made from tapes: `lagprogram.h`."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import byref, c_int, c_int32, c_int64, c_void_p
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Int32
from lagcli.engine.core.library import Functions, check
from lagcli.engine.core.structures import (
    Arguments,
    Doubles,
    Integers,
    Structure,
    address,
    copied,
    copied_integers,
    each,
    lag_program,
    lag_stream,
)
from lagcli.engine.tape.operations import NODE_VALUES

if TYPE_CHECKING:
    from lagcli.engine.tape.tape import Tape


class lag_tape(Structure):
    """Operations on a register file."""

    _fields_ = (
        *each(c_int, "inputs parameters rhs_inputs"),
        ("constants", Doubles),
        ("constant_count", c_int64),
        ("code", Integers),
        ("code_count", c_int64),
        ("outputs", Integers),
        ("output_count", c_int64),
        ("deferred", Integers),
        ("deferred_count", c_int),
        *each(Integers, "subset subset_ends"),
        ("subset_count", c_int),
        *each(Integers, "isomorphic isomorphic_ends"),
        ("isomorphic_count", c_int64),
        ("families", Integers),
        *each(c_int64, "family_count vectors_from"),
    )


class lag_assembled(Structure):
    """A program and the number of operations in its main stream."""

    _fields_ = (("program", lag_program), ("size", c_int64))


class lag_nodes(Structure):
    """Operations of a program for power series."""

    _fields_ = (("count", c_int64), ("numbers", Integers), ("values", c_int64))


core = Functions(
    {
        "lag_assemble": (c_void_p, c_void_p, c_void_p, c_void_p),
        "lag_assembled_destroy": (None, c_void_p),
        "lag_unpack": (c_int64, c_void_p, c_void_p),
        "lag_series_stream": (c_int64, *[c_void_p, c_int64], *[c_void_p] * 4),
        "lag_series_levels": (c_int64, c_void_p, c_void_p, c_void_p),
        "lag_progressions": (c_int64, c_void_p, c_int64, c_int, c_void_p, c_void_p),
    }
)

#: Number of operations from which programs are vectorized.
LONG = 1500
_NEVER = 2**63 - 1


class Program(NamedTuple):
    """A tape with its order of execution and its registers.

    A stream contains, for each run of operations: the operation, their number, and for each of them
    its destinations and operands; it ends with END. A vector operation has VECTOR added; it is
    followed by the number of elements, the first destination, and the first register and the step
    of each operand.

    Parameters
    ----------
    prelude, main : int32 arrays
        Streams; the prelude runs once.
    deferred : tuple of int32 arrays
        Streams for deferred outputs, run after ``main`` when they are needed.
    output_subsets : tuple of int32 arrays
        Streams for output subsets, run instead of ``main``; for those in ``deferred``, intermediate
        results.
    registers : (n,) array
        The register file before the prelude: inputs (zero), constants.
    outputs : int32 array
        The registers of the outputs.
    size : int
        Number of operations in ``main``.
    inputs : int
        Number of input registers, except those that only deferred outputs depend on.
    """

    prelude: Int32
    main: Int32
    deferred: tuple[Int32, ...]
    output_subsets: tuple[Int32, ...]
    registers: Array
    outputs: Int32
    size: int
    inputs: int


def assemble(tape: Tape, families: Sequence[str | None] = (), long: int | None = LONG) -> Program:
    """Convert a tape to a program.

    Parameters
    ----------
    tape : Tape
    families : sequence of str or None
        Labels of inputs; inputs of the same family have the same label.
    long : int, optional
        Number of operations from which programs are vectorized; None: they are not.

    Raises
    ------
    ValueError
        An operand is not ready, or an operation is unknown.
    """
    numbers: dict[str | None, int] = {None: -1}
    given = Arguments()
    record = given.filled(
        lag_tape,
        inputs=tape.inputs,
        parameters=tape.parameters,
        rhs_inputs=tape.rhs_inputs,
        constants=tape.constants,
        constant_count=len(tape.constants),
        code=tape.code,
        code_count=len(tape.code),
        outputs=tape.outputs,
        output_count=len(tape.outputs),
        deferred=tape.deferred,
        deferred_count=len(tape.deferred),
        **_groups("subset", tape.output_subsets),
        **_groups("isomorphic", tape.isomorphic),
        families=[numbers.setdefault(x, len(numbers) - 1) for x in families],
        family_count=len(families),
        vectors_from=_NEVER if long is None else long,
    )
    valid = c_int()
    made = core.lag_assemble(None, byref(record), byref(valid))
    if not valid:
        raise ValueError("the tape has operands that are not ready, or unknown operations")
    check(not made)
    try:
        return _program(lag_assembled.from_address(made), tape)
    finally:
        core.lag_assembled_destroy(made)


def _groups(name: str, groups: Sequence[Sequence[int]]) -> dict[str, Any]:
    """Return the fields of groups of numbers."""
    return {
        name: [x for group in groups for x in group],
        f"{name}_ends": np.cumsum([len(group) for group in groups]),
        f"{name}_count": len(groups),
    }


def _program(made: Any, tape: Tape) -> Program:
    program = made.program
    return Program(
        prelude=_numbers(program.prelude),
        main=_numbers(program.main),
        deferred=tuple([_numbers(program.deferred[i]) for i, _ in enumerate(tape.deferred)]),
        output_subsets=tuple(
            [_numbers(program.output_subsets[i]) for i, _ in enumerate(tape.output_subsets)]
        ),
        registers=copied(program.registers, program.register_count),
        outputs=copied_integers(program.outputs, program.output_count),
        size=made.size,
        inputs=program.inputs,
    )


def _numbers(stream: lag_stream) -> Int32:
    return copied_integers(stream.code, stream.length)


def unpacked(stream: Int32) -> Int32:
    """Return a stream with the same operations as scalar ones."""
    record = Arguments().stream(stream)
    made = np.empty(core.lag_unpack(byref(record), None), dtype=np.int32)
    core.lag_unpack(byref(record), address(made))
    return made


# programs for power series


def nodes_of(lines: Sequence[Sequence[int]]) -> Int32:
    """Return operations as an array, from the kind, the results and the operands of each."""
    unused = [(-1,) * (NODE_VALUES - n) for n in range(NODE_VALUES + 1)]
    return np.array([(*line, *unused[len(line) - 1]) for line in lines], dtype=np.int32)


def series_stream(
    nodes: Int32, ordered: int, place: Int32, kept: np.ndarray[Any, Any], count: int
) -> tuple[Int32, int]:
    """Order operations in runs of a kind, allocate registers, and return the stream.

    Parameters
    ----------
    nodes : (n, 1 + NODE_VALUES) int32 array
        The kind of each operation, its result and its operands, as numbers of values.
    ordered : int
        Number of operations that are ordered; the others follow.
    place : (m,) int32 array
        The register of each value, or −1: completed.
    kept : (m,) bool array
        Values that are needed at the end.
    count : int
        The first free register.

    Returns
    -------
    stream : int32 array
    count : int
        Number of registers.
    """
    given = Arguments()
    record = given.filled(lag_nodes, count=len(nodes), numbers=nodes, values=len(place))
    registers, stream = c_int32(count), np.empty((2 + NODE_VALUES) * len(nodes) + 2, dtype=np.int32)
    length = core.lag_series_stream(
        byref(record), ordered, address(place), address(kept), byref(registers), address(stream)
    )
    check(length < 0)
    return stream[:length], registers.value


def series_levels(nodes: Int32, values: int) -> list[list[int]]:
    """Return sets of operations of one kind that can be executed together, in order.

    Operations near the beginning are scheduled as early as possible, those near the end as late as
    possible. ``nodes`` are as for `series_stream`; values have numbers below ``values``.
    """
    given = Arguments()
    record = given.filled(lag_nodes, count=len(nodes), numbers=nodes, values=values)
    members, ends = (np.empty(len(nodes), dtype=np.int32) for _ in range(2))
    sets = core.lag_series_levels(byref(record), address(members), address(ends))
    check(sets < 0)
    return _divided(members, ends[:sets])


def progressions(points: Sequence[Sequence[int]]) -> tuple[list[list[int]], list[int]]:
    """Find points in arithmetic progression.

    Parameters
    ----------
    points : (n, k) sequences of int
        The registers of k ≤ 4 operands.

    Returns
    -------
    runs : list of lists of int
        Indices of points; in some progressions, one of the coordinates is arbitrary.
    rest : list of int
        Indices of the points in no progression.
    """
    places = np.array(points, dtype=np.int32)
    members, ends = (np.empty(len(places), dtype=np.int32) for _ in range(2))
    found = core.lag_progressions(address(places), *places.shape, address(members), address(ends))
    check(found < 0)
    *runs, rest = _divided(members, [*ends[:found].tolist(), len(members)])
    return runs, rest


def _divided(members: Int32, ends: Any) -> list[list[int]]:
    """Return the parts of an array that end at some places."""
    values = members.tolist()
    return [values[a:b] for a, b in pairwise([0, *ends])]
