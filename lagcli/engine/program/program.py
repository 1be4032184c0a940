"""Tape → program: bytecode for the core's evaluator.

Equal operations are grouped into runs, so that the evaluator dispatches once for many of them;
those on equidistant registers become vector operations; operations on parameters are moved to a
prelude that runs once; a product used only in a sum is merged with the sum, and the sine and cosine
of one angle are merged; registers are reused when their values are dead.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any, TypeVar

import numpy as np

from lagcli.arrays import Array, Int32
from lagcli.engine.program.nodes import INDEXED, VECTOR, Node
from lagcli.engine.tape.operations import ARITY, PLACES, Op
from lagcli.engine.tape.tape import Tape
from lagcli.named_tuples import NamedTuple

#: Number of operations from which programs are vectorized.
LONG = 1500
#: Number of operations that are ordered at a time: values that are alive together stay close.
_WINDOW = 4096

AnyNode = TypeVar("AnyNode", bound=Node)


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


def assemble(tape: Tape, families: Sequence[str | None] = (), long: int = LONG) -> Program:
    """Convert a tape to a program.

    Parameters
    ----------
    tape : Tape
    families : sequence of str or None
        Labels of inputs; inputs of the same family have the same label.
    long : int
        Number of operations from which programs are vectorized.
    """
    fixed = tape.inputs + len(tape.constants)
    if not tape.outputs:
        nothing = stream(())
        return Program(nothing, nothing, (), (), np.zeros(fixed), nothing[:0], 0, tape.inputs)
    of = _part_of_outputs(tape)
    prelude, *parts = _parts(tape, of)
    place = {x: x for x in range(fixed)}
    for _, destinations, _ in prelude:
        place[destinations[0]] = len(place)
    prelude = [_placed(node, place) for node in prelude]
    needed = [set(tape.outputs).union(*map(_operands, parts[i + 1 :])) for i in range(len(parts))]
    parts = [
        _sines_with_cosines(_products_with_sums(nodes, keep))
        for nodes, keep in zip(parts, needed, strict=True)
    ]
    streams, count = _arranged(parts, needed, place, families, tape.isomorphic, long)
    registers = np.zeros(count)
    registers[tape.inputs : fixed] = tape.constants
    outputs = np.array([place[x] for x in tape.outputs], dtype=np.int32)
    return Program(
        prelude=stream(prelude),
        main=streams[0],
        deferred=tuple(streams[1:]),
        output_subsets=tuple(
            excerpt(streams[0], [place[x] for x in _asked_of_main(tape, some, of, parts)])
            for some in tape.output_subsets
        ),
        registers=registers,
        outputs=outputs,
        size=len(parts[0]),
        inputs=tape.inputs - tape.rhs_inputs,
    )


def as_it_stands(tape: Tape) -> Program:
    """Convert a tape to a program with a register for each operation, in the tape's order.

    It is made at a fiftieth of the time of `assemble`, for a few evaluations of a long tape.
    """
    op, *registers = np.array(tape.code, dtype=np.int32).reshape(-1, 5).T
    numbers = np.column_stack([op, np.ones_like(op), *registers])
    width = 2 + np.array(PLACES)[op]
    code = numbers[np.arange(numbers.shape[1]) < width[:, None]]
    nothing, end = stream(()), np.array([Op.END, 0], dtype=np.int32)
    values = np.zeros(tape.registers)
    values[tape.inputs : tape.inputs + len(tape.constants)] = tape.constants
    return Program(
        prelude=nothing,
        main=np.concatenate([code, end]),
        deferred=(),
        output_subsets=(),
        registers=values,
        outputs=np.array(tape.outputs, dtype=np.int32),
        size=len(tape.code),
        inputs=tape.inputs - tape.rhs_inputs,
    )


def _part_of_outputs(tape: Tape) -> list[int]:
    """Return the part of each output: 0, or the number of its deferred group."""
    counts = [len(tape.outputs) - sum(tape.deferred), *tape.deferred]
    return [part for part, count in enumerate(counts) for _ in range(count)]


def _asked_of_main(
    tape: Tape, some: Sequence[int], of: Sequence[int], parts: Sequence[Sequence[Node]]
) -> set[int]:
    """Return the results of the first part that some outputs need."""
    asked = {tape.outputs[i] for i in some if not of[i]}
    for part in {of[i] for i in some} - {0}:
        asked |= _operands(parts[part]) - {x for _, results, _ in parts[part] for x in results}
    return asked


def _parts(tape: Tape, part_of_outputs: Sequence[int]) -> list[list[Node]]:
    """Return the operations that depend only on parameters, and the other operations of each part.

    An operation belongs to the first part that needs it; unused operations are omitted.
    """
    fixed = tape.inputs + len(tape.constants)
    first = tape.inputs - tape.rhs_inputs
    invariant = {*range(first - tape.parameters, first), *range(tape.inputs, fixed)}
    of: dict[int, int] = {}  # the part of each register
    for x, part in zip(tape.outputs, part_of_outputs, strict=True):
        of[x] = min(of.get(x, part), part)
    for _, to, a, b, c in reversed(tape.code):
        if (own := of.get(to)) is not None:
            for x in (a, b, c):
                if of.get(x, own) >= own:
                    of[x] = own
    parts: list[list[Node]] = [[] for _ in range(2 + len(tape.deferred))]
    for op, to, a, b, c in tape.code:
        if to not in of:
            continue
        operands = (a, b, c)[: ARITY[op]]
        if invariant.issuperset(operands):
            invariant.add(to)
            parts[0].append((op, (to,), operands))
        else:
            parts[1 + of[to]].append((op, (to,), operands))
    return parts


def _operands(nodes: Sequence[Node]) -> set[int]:
    return {x for _, _, operands in nodes for x in operands}


def _arranged(
    parts: Sequence[list[Node]],
    needed: Sequence[set[int]],
    place: dict[int, int],
    families: Sequence[str | None],
    isomorphic: Sequence[Sequence[int]],
    long: int,
) -> tuple[list[Int32], int]:
    """Return the streams of successive parts, whose needed results are kept, and how many places
    there are; complete ``place``.
    """
    count, operations = len(place), sum(map(len, parts))
    if operations >= long:
        # imported here, since most programs are short
        from lagcli.engine.program.vectorize import REPEATED, WORTH, Packing, repeated

        if repeated(parts) >= REPEATED * operations:
            packing = Packing(dict(place), count, families, isomorphic)
            streams = packing.streams(parts, needed)
            if packing.packed >= WORTH * operations:
                place.update(packing.place)
                return streams, packing.count
    streams = []
    for nodes, keep in zip(parts, needed, strict=True):
        ordered, count = allocate(in_order(nodes), place, count, keep)
        streams.append(stream(ordered))
    return streams, count


def _products_with_sums(nodes: list[Node], outputs: Collection[int]) -> list[Node]:
    """Merge each product that is used once, in a sum, with that sum."""
    uses: dict[int, int] = dict.fromkeys(outputs, 2)
    for _, _, operands in nodes:
        for x in operands:
            uses[x] = uses.get(x, 0) + 1
    products = {d[0]: o for op, d, o in nodes if op == Op.MUL and uses.get(d[0]) == 1}
    merged: set[int] = set()
    merged_nodes: list[Node] = []
    for op, to, operands in nodes:
        if op in (Op.ADD, Op.SUB):
            a, b = operands
            if b in products and b != a:
                merged.add(b)
                merged_nodes.append(
                    (Op.MULADD if op == Op.ADD else Op.SUBMUL, to, (*products[b], a))
                )
                continue
            if a in products and b != a:
                merged.add(a)
                merged_nodes.append(
                    (Op.MULADD if op == Op.ADD else Op.MULSUB, to, (*products[a], b))
                )
                continue
        merged_nodes.append((op, to, operands))
    return [node for node in merged_nodes if node[1][0] not in merged]


def _sines_with_cosines(nodes: list[Node]) -> list[Node]:
    """Merge the sine and the cosine of one operand."""
    sines = {o[0]: d[0] for op, d, o in nodes if op == Op.SIN}
    both = {o[0]: (sines[o[0]], d[0]) for op, d, o in nodes if op == Op.COS and o[0] in sines}
    merged: list[Node] = []
    done: set[int] = set()
    for node in nodes:
        op, _, operands = node
        if op in (Op.SIN, Op.COS) and operands[0] in both:
            if operands[0] not in done:
                done.add(operands[0])
                merged.append((Op.SINCOS, both[operands[0]], operands))
        else:
            merged.append(node)
    return merged


def in_order(nodes: Sequence[AnyNode]) -> list[AnyNode]:
    """Return operations in runs of a kind, window by window. Operands come first."""
    return [
        node
        for first in range(0, len(nodes), _WINDOW)
        for node in _in_runs(nodes[first : first + _WINDOW])
    ]


def _in_runs(nodes: Sequence[AnyNode]) -> list[AnyNode]:
    """Order operations so that those of a kind are adjacent where possible."""
    producer = {x: i for i, (_, destinations, _) in enumerate(nodes) for x in destinations}
    users: list[list[int]] = [[] for _ in nodes]
    waiting = [0] * len(nodes)
    for i, (_, _, operands) in enumerate(nodes):
        for x in set(operands):
            if x in producer:
                users[producer[x]].append(i)
                waiting[i] += 1
    ready: dict[int, list[int]] = {}
    for i, (op, _, _) in enumerate(nodes):
        if not waiting[i]:
            ready.setdefault(op, []).append(i)
    ordered: list[AnyNode] = []
    while ready:
        op = max(ready, key=lambda kind: len(ready[kind]))
        queue = ready.pop(op)
        for i in queue:  # grows during the iteration
            ordered.append(nodes[i])
            for user in users[i]:
                waiting[user] -= 1
                if not waiting[user]:
                    kind = nodes[user][0]
                    (queue if kind == op else ready.setdefault(kind, [])).append(user)
    return ordered


def allocate(
    nodes: Sequence[Node], place: dict[Any, int], count: int, kept: Collection[Any]
) -> tuple[list[Node], int]:
    """Allocate registers for results; those of dead values are reused.

    Parameters
    ----------
    nodes : sequence of Node
        Operations in order.
    place : dict to int
        Registers of values; existing ones are kept, the others are added.
    count : int
        The first free register.
    kept : collection
        Results needed at the end.

    Returns
    -------
    nodes, count
        Operations with registers instead of names; the number of registers used.
    """
    last: dict[Any, int] = {}
    own = {x for _, destinations, _ in nodes for x in destinations}
    for i, (_, _, operands) in enumerate(nodes):
        for x in operands:
            last[x] = i
    free: list[int] = []
    placed: list[Node] = []
    for i, node in enumerate(nodes):
        _, destinations, operands = node
        for x in set(operands):
            if last[x] == i and x in own and x not in kept:
                free.append(place[x])
        for x in destinations:
            if x in place:
                continue
            if free:
                place[x] = free.pop()
            else:
                place[x] = count
                count += 1
        placed.append(_placed(node, place))
        for x in destinations:
            if x not in last and x not in kept:
                free.append(place[x])
    return placed, count


def _placed(node: Node, place: dict[Any, int]) -> Node:
    op, destinations, operands = node
    return op, tuple(place[x] for x in destinations), tuple(place[x] for x in operands)


def stream(nodes: Sequence[Node], end: int = Op.END) -> Int32:
    """Return the stream of operations with registers."""
    numbers: list[int] = []
    at, kind = 0, -1
    for op, destinations, operands in nodes:
        if op != kind:
            kind, at = op, len(numbers) + 1
            numbers += (op, 0)
        numbers[at] += 1
        numbers += destinations
        numbers += operands
    return np.array([*numbers, end, 0], dtype=np.int32)


class _Step(NamedTuple):
    """A scalar or vector operation of a stream, and its registers."""

    op: int
    size: int
    numbers: list[int]
    results: Sequence[int]
    operands: list[Sequence[int]]


def excerpt(stream: Int32, registers: Iterable[int]) -> Int32:
    """Return the operations of a stream on which the final values of some registers depend."""
    live = set(registers)
    kept = []
    for step in reversed(list(_steps(stream.tolist()))):
        if not live.isdisjoint(step.results):
            live.difference_update(step.results)
            live.update(*step.operands)
            kept.append(step)
    return _joined((step.op, step.size, step.numbers) for step in reversed(kept))


def unpacked(stream: Int32) -> Int32:
    """Return a stream with the same operations as scalar ones."""
    return _joined(_one_by_one(step) for step in _steps(stream.tolist()))


def _one_by_one(step: _Step) -> tuple[int, int, list[int]]:
    """Return an operation, how often it is done, and the numbers of all."""
    if step.op < VECTOR:
        return step.op, step.size, step.numbers
    first = step.numbers[0]
    columns = [range(first, first + step.size), *step.operands]
    return step.op - VECTOR, step.size, [x for one in zip(*columns, strict=True) for x in one]


def _joined(parts: Iterable[tuple[int, int, list[int]]]) -> Int32:
    """Return a stream of operations, with adjacent operations of a kind as one run."""
    numbers: list[int] = []
    at = kind = -1
    for op, size, own in parts:
        if op != kind or op >= VECTOR:
            at, kind = len(numbers) + 1, op
            numbers += (op, 0)
        numbers[at] += size
        numbers += own
    return np.array([*numbers, Op.END, 0], dtype=np.int32)


def _steps(numbers: list[int]) -> Iterator[_Step]:
    """Yield the operations of a stream, vector operations as one."""
    at = 0
    while numbers[at] != Op.END:
        op, n = numbers[at : at + 2]
        at += 2
        if op < VECTOR:
            width, first = PLACES[op], 2 if op == Op.SINCOS else 1
            for _ in range(n):
                own = numbers[at : at + width]
                at += width
                yield _Step(op, 1, own, own[:first], [own[first:]])
            continue
        begin, at = at, at + 1
        operands: list[Sequence[int]] = []
        for _ in range(PLACES[op - VECTOR] - 1):
            first, step = numbers[at : at + 2]
            at += 2
            if step == INDEXED:
                operands.append(numbers[at : at + n])
                at += n
            else:
                operands.append([first + i * step for i in range(n)])
        to = numbers[begin]
        yield _Step(op, n, numbers[begin:at], range(to, to + n), operands)
