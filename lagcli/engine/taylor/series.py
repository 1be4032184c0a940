"""Programs for power series: the motion's Taylor coefficients, order by order.

The operations on coefficients are defined in `lagcli.engine.taylor.expansion`; here they are
ordered and get places.

The solution of K x = r with K = [[M, −Bᵀ], [B, 0]] needs one factorization: coefficient k of x is
the solution of K_0 x_k = r_k − K_1 x_{k−1} − … − K_k x_0, so all orders have the matrix of order 0
(Nedialkov and Pryce). Sums of products are factored, because a convolution costs several times as
much as a sum: f a + f b becomes f (a + b).

References
----------
À. Jorba and M. Zou, A software package for the numerical integration of ODEs by means of high-order
Taylor methods, Experimental Mathematics 14 (2005), doi:10.1080/10586458.2005.10128904.

N. S. Nedialkov and J. D. Pryce, Solving differential-algebraic equations by Taylor series (I):
computing Taylor coefficients, BIT 45 (2005), doi:10.1007/s10543-005-0019-y.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, groupby
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Int32
from lagcli.engine.core.program import series_stream
from lagcli.engine.layout import UnrolledLayout
from lagcli.engine.system import System, without_numbers
from lagcli.engine.tape.operations import LINE, Op
from lagcli.engine.tape.series_operations import SeriesOp
from lagcli.engine.tape.tape import Arithmetic, Builder, Tape
from lagcli.engine.taylor.expansion import SeriesExpansion
from lagcli.engine.taylor.forms import Form
from lagcli.engine.taylor.layers import Layers, SeriesVector, layered, vector_stream
from lagcli.engine.taylor.series_nodes import (
    WORK,
    ZERO,
    Delayed,
    Name,
    NextCoefficient,
    Operand,
    RegisterValue,
    SeriesNode,
    UnnamedSeries,
    numbered,
)
from lagcli.engine.taylor.sizes import LONG

#: Operation, results, operands, as offsets.
_Node = tuple[int, tuple[int, ...], tuple[int, ...]]
#: Places between rows, because four coefficients are read at a time, some of them beyond a row.
PADDING = 4


class SeriesProgram(NamedTuple):
    """A program for the Taylor coefficients of a motion.

    The file contains the numbers that multiply series, constant ones first, then a row of
    coefficients for each convolved series, then one place for each of the other series, which are
    not stored. Their places move by one with each order, so that an offset has the same meaning for
    both. The first rows are t, q, v, W, and zeros. In a long program, layers follow, which contain
    the state: see `lagcli.engine.taylor.layers`.

    Parameters
    ----------
    values : Tape
        (t, q, v, parameters) → the numbers, the first coefficients of series other than the
        state's, a, power.
    stream : int32 array
        Operations on offsets in the file, as those of `Program`; each operand of a vector has two,
        including numbers.
    convolutions : int
        Number of convolutions outside of vectors.
    order : int
    invariant, numbers : int
        Number of constant numbers; number including those computed at each state.
    begins : int32 array
        Offsets of the first coefficients of series other than the state's.
    origin, layer : int
        Start of the layers, and distance of one order from the next.
    state : int32 array
        Offsets of t, q, v, W in a layer.
    size : int
        Size of the file.
    """

    values: Tape
    stream: Int32
    convolutions: int
    order: int
    invariant: int
    numbers: int
    begins: Int32
    origin: int
    layer: int
    state: Int32
    size: int


def expand(
    system: System,
    tape: Tape,
    order: int,
    working: Iterable[int],
    left_out: Sequence[int] = (),
) -> SeriesProgram:
    """Create the program for the series of a motion up to an order.

    Parameters
    ----------
    system : System
    tape : Tape
        Its dynamics tape with the unrolled elimination, and the solution for another right side.
    order : int
        At most ``MAX_ORDER``.
    working : iterable of int
        The constraints whose power is computed: all, or if the motion is projected onto them, those
        that depend on time.
    left_out : sequence of int
        The constraints that the elimination leaves out.

    Raises
    ------
    NotAnalytic
    """
    builder = Arithmetic(tape.inputs, tape.parameters, tape.rhs_inputs, tape.functions)
    outputs = builder.extend(tape)
    nq, layout = system.counts.nq, UnrolledLayout(system.counts)
    inputs = range(tape.inputs)
    state, v = inputs[: 1 + 2 * nq], inputs[system.sample_layout.v]
    expansion = SeriesExpansion(builder, state)
    used = [i for i in range(system.counts.nc) if i not in left_out]
    unknowns = LinearSystem(expansion, system, outputs, used).solve()
    power = _power(system, builder, outputs, working)
    expansion.expand([power])
    rates = [*v, *unknowns[:nq], expansion.result(power)]
    kinds = system.families[1 : 1 + 2 * nq]
    families: tuple[list[list[Name]], list[list[Name]]] = (
        [[0], [ZERO], *_alike(state[1:], kinds), [WORK]],
        [
            *_alike(unknowns[:nq], kinds[:nq]),
            *_alike(unknowns[nq:], [without_numbers(system.constraints[i]) for i in used]),
        ],
    )
    return _program(expansion, families, rates, [*outputs[layout.solution][:nq], power], order)


def _alike(values: Iterable[Name], kinds: Iterable[str | None]) -> list[list[Name]]:
    """Return the values of each kind."""
    members: dict[str | None, list[Name]] = {}
    for x, kind in zip(values, kinds, strict=True):
        members.setdefault(kind, []).append(x)
    return list(members.values())


def depending_on_time(system: System) -> list[int]:
    """Return the constraints ψ = B v + b_0 with b_0 not identically zero."""
    tape = system.constraint
    drift = tape.outputs[system.constraint_layout.drift]
    values = dict(enumerate(tape.constants, tape.inputs))
    return [i for i, x in enumerate(drift) if values.get(x) != 0.0]


def _power(system: System, builder: Builder, outputs: Sequence[int], working: Iterable[int]) -> int:
    """Emit the power of the applied forces, of time, and of the constraints that do work."""
    layout, v = UnrolledLayout(system.counts), system.sample_layout.v.start
    multipliers = outputs[layout.solution][system.counts.nq :]
    (total,) = outputs[layout.power]
    for i in working:
        for (row, column), x in zip(system.jacobian_pattern, outputs[layout.jacobian], strict=True):
            if row == i:
                force = builder.emit(Op.MUL, multipliers[i], x)
                part = builder.emit(Op.MUL, force, v + column)
                total = builder.emit(Op.ADD, total, part)
    return total


def _program(
    expansion: SeriesExpansion,
    families: tuple[list[list[Name]], list[list[Name]]],
    rates: Sequence[Name],
    outputs: Sequence[int],
    order: int,
) -> SeriesProgram:
    """Return the program; rates are the series v, a, power, and outputs the values of a, power."""
    nodes = _merged(factored(expansion, rates), rates, SeriesOp.MUL, SeriesOp.MULSUM)
    state: list[Name] = [*range(len(rates)), WORK]
    kept = _kept(nodes, {*state, ZERO})
    ends: list[SeriesNode] = [
        (SeriesOp.INTEGRATE, (NextCoefficient(x),), (y,))
        for x, y in zip(state[1:], rates, strict=True)
    ]
    layers = layered([*nodes, *ends], kept, *families) if len(nodes) >= LONG else None
    if layers is None:
        nodes = _merged(nodes, rates, SeriesOp.MUL_TAIL, SeriesOp.MUL_TAIL_SUM)
        return _in_rows(expansion, nodes, ends, state, kept, outputs, order)
    return _in_layers(expansion, layers, state, outputs, order)


def _in_rows(
    expansion: SeriesExpansion,
    nodes: list[SeriesNode],
    ends: list[SeriesNode],
    state: Sequence[Name],
    kept: Sequence[Name],
    outputs: Sequence[int],
    order: int,
) -> SeriesProgram:
    """Return a program with rows for convolved series; those of the state are the first."""
    places, numbers, invariant = _place_numbers(expansion, _numbers(nodes), [])
    place: dict[Operand, int] = {RegisterValue(x): at for (x,), at in places.items()}
    row, first = _row(order), _first(numbers)
    rows = [*state, ZERO, *kept]
    end = _place_rows(place, rows, first, row)
    place.update((NextCoefficient(x), place[x]) for x in state)
    number = {x: i for i, x in enumerate(place)}
    lines, count = numbered([*map(_marked, nodes), *ends], number)
    registers = np.full(count, -1, dtype=np.int32)
    registers[: len(place)] = [*place.values()]
    kept_values = np.zeros(count, dtype=bool)
    kept_values[[number[x] for x in (*rows, *map(NextCoefficient, state))]] = True
    stream, size = series_stream(lines, len(nodes), registers, kept_values, end)
    return SeriesProgram(
        values=_values(expansion, numbers, kept, outputs),
        stream=stream,
        convolutions=sum(bool(op.convolved) for op, _, _ in nodes),
        order=order,
        invariant=invariant,
        numbers=len(numbers),
        begins=_array(place[x] for x in kept),
        origin=0,
        layer=1,
        state=_array(place[x] for x in state),
        size=size + order + 2 * PADDING,
    )


def _in_layers(
    expansion: SeriesExpansion,
    layers: Layers,
    state: Sequence[Name],
    outputs: Sequence[int],
    order: int,
) -> SeriesProgram:
    """Return a program with layers, and rows for operands of scalar convolutions."""
    singles = [x for part in layers.parts if not isinstance(part, SeriesVector) for x in part]
    vectors = [x.numbers for x in layers.parts if isinstance(x, SeriesVector)]
    place, numbers, invariant = _place_numbers(expansion, _numbers(singles), chain(*vectors))
    rows = _kept(singles, set())
    row, first = _row(order), _first(numbers)
    in_rows: dict[Any, int] = {}
    end = _place_rows(in_rows, rows, first, row)
    whole: list[int] = []
    for part in layers.parts:
        if isinstance(part, SeriesVector):
            whole += vector_stream(part, place)
        else:
            placed = [_placed(node, place, in_rows, layers.place) for node in part]
            whole += _runs(placed)
    origin = -(-end // LINE) * LINE
    # core/series/recurrence.c stores the sums of the state, up to W, beyond the last order
    last = layers.place[WORK]
    return SeriesProgram(
        values=_values(expansion, numbers, [*rows, *layers.kept.values()], outputs),
        stream=_array([*whole, SeriesOp.END, 0]),
        convolutions=sum(bool(op.convolved) for op, _, _ in singles),
        order=order,
        invariant=invariant,
        numbers=len(numbers),
        begins=_array([*(in_rows[x] for x in rows), *(origin + x for x in layers.kept)]),
        origin=origin,
        layer=layers.size,
        state=_array(layers.place[x] for x in state),
        size=origin + order * layers.size + max(layers.end, 2 * last + 2 * LINE),
    )


def _runs(nodes: Iterable[_Node]) -> Iterator[int]:
    """Yield the numbers of operations in a stream."""
    for op, run in groupby(nodes, key=lambda node: node[0]):
        members = [(*results, *operands) for _, results, operands in run]
        yield from (op, len(members), *chain.from_iterable(members))


def _array(values: Iterable[int]) -> Int32:
    return np.array([*values], dtype=np.int32)


def _placed(
    node: SeriesNode,
    numbers: Mapping[tuple[int, ...], int],
    rows: Mapping[Any, int],
    layer: Mapping[Operand, int],
) -> _Node:
    """Return an operation with the places of numbers, of rows, and in the layer."""
    op, (to,), operands = node
    if op == SeriesOp.TO_ROW:
        return op, (rows[to],), (layer[to],)
    places = []
    for i, x in enumerate(operands):
        if i in op.numbers:
            places.append(numbers[x,])
        else:
            convolved = i in op.convolved or isinstance(x, Delayed)
            places.append((rows if convolved else layer)[x])
    return op, (layer[to],), tuple(places)


def _marked(node: SeriesNode) -> SeriesNode:
    """Return an operation with marked numbers."""
    op, to, operands = node
    return (
        op,
        to,
        tuple([RegisterValue(x) if i in op.numbers else x for i, x in enumerate(operands)]),
    )


def _numbers(nodes: Iterable[SeriesNode]) -> Iterator[tuple[int]]:
    return ((o[i],) for op, _, o in nodes for i in op.numbers)


def _place_numbers(
    expansion: SeriesExpansion,
    numbers: Iterable[tuple[int]],
    of_vectors: Iterable[tuple[int, ...]],
) -> tuple[dict[tuple[int, ...], int], list[int], int]:
    """Allocate places for numbers, those of vectors contiguously and constant ones first.

    Returns
    -------
    place : dict of tuple of int to int
        Place of a number; of a vector's numbers, the first one's.
    ordered : list of int
        The registers.
    invariant : int
        Number of constant ones.
    """
    known = expansion.builder.invariant
    parts: tuple[list[tuple[int, ...]], list[tuple[int, ...]]] = [], []
    for part in dict.fromkeys(chain(numbers, of_vectors)):
        changing = any(x >= 0 and x not in known for x in part)
        parts[changing].append(part)
    place: dict[tuple[int, ...], int] = {}
    ordered: list[int] = []
    for part in chain(*parts):
        place[part] = len(ordered)
        ordered += part
    return place, ordered, sum(map(len, parts[0]))


def _row(order: int) -> int:
    return -(-(PADDING + order + 1) // 4) * 4


def _first(numbers: Sequence[int]) -> int:
    """Return the start of the first row, aligned with a cache line, which saves 3 % of a run."""
    return -(-(len(numbers) + PADDING) // LINE) * LINE


def _place_rows(place: dict[Any, int], rows: Sequence[Name], first: int, row: int) -> int:
    """Allocate rows for series that are not alive together; return their end."""
    for n, x in enumerate(rows):
        place[x] = place[Delayed(x)] = first + n * row
    return first + len(rows) * row


def _values(
    expansion: SeriesExpansion,
    numbers: Sequence[int],
    begins: Iterable[Any],
    outputs: Sequence[int],
) -> Tape:
    first = map(expansion.begin, begins)
    return expansion.builder.finish([*numbers, *first, *outputs])


def _merged(
    nodes: list[SeriesNode], results: Sequence[Name], product: SeriesOp, merged: SeriesOp
) -> list[SeriesNode]:
    """Merge each product of a kind that is used once, in a sum, with that sum."""
    uses: dict[Name, int] = dict.fromkeys(results, 2)
    for op, _, operands in nodes:
        for i, x in enumerate(operands):
            if i not in op.numbers:
                x = x.series if isinstance(x, Delayed) else x
                # a series that is convolved keeps its own row
                uses[x] = uses.get(x, 0) + (1 if op == SeriesOp.SUM else 2)
    products = {
        to: operands for op, (to,), operands in nodes if op == product and uses.get(to) == 1
    }
    nodes_by_name: dict[Any, SeriesNode] = {}
    for op, to, operands in nodes:
        nodes_by_name[to[0]] = op, to, operands
        if op == SeriesOp.SUM:
            s, a, t, b = operands
            if b in products:
                s, a, t, b = t, b, s, a
            if a in products:
                del nodes_by_name[a]
                nodes_by_name[to[0]] = merged, to, (s, *products[a], t, b)
    return list(nodes_by_name.values())


def _kept(nodes: Iterable[SeriesNode], state: set[Name]) -> list[Name]:
    """Return the series, besides the state's, whose coefficients of all orders are needed."""
    kept: dict[Name, None] = {}
    for op, _, operands in nodes:
        if op.convolved:
            kept.update((operands[i], None) for i in op.convolved)
            kept.update((x.series, None) for x in operands if isinstance(x, Delayed))
    return [x for x in kept if x not in state]


class LinearSystem:
    """Computes the series of a and λ.

    Parameters
    ----------
    expansion : Expansion
    system : System
    outputs : sequence of int
        Registers of the outputs of the dynamics tape with the unrolled elimination.
    used : sequence of int
        The constraints that are not left out.
    """

    def __init__(
        self,
        expansion: SeriesExpansion,
        system: System,
        outputs: Sequence[int],
        used: Sequence[int],
    ):
        layout, nq, size = UnrolledLayout(system.counts), system.counts.nq, system.counts.unknowns
        number = {row: nq + k for k, row in enumerate(used)}
        entries = zip(system.jacobian_pattern, outputs[layout.jacobian], strict=True)
        rows = [(number[i], j, x) for (i, j), x in entries if i in number]
        masses = zip(system.mass_pattern, outputs[layout.mass_matrix], strict=True)
        self.expansion = expansion
        # rows, columns and registers of the matrix, and their signs in r − K x
        self.entries = [
            *((i, j, x, -1) for (i, j), x in masses),
            *((i, j, x, -1) for i, j, x in rows),
            *((j, i, x, 1) for i, j, x in rows),
        ]
        places = [*range(nq), *(nq + i for i in used)]
        right = [*outputs[layout.forcing], *outputs[layout.rhs]]
        values = outputs[layout.solution]
        solution = outputs[len(outputs) - nq - size : len(outputs) - nq]
        self.right, self.values, self.solution = (
            [x[i] for i in places] for x in (right, values, solution)
        )
        self.other_right = [system.dynamics.inputs + i for i in places]

    def solve(self) -> list[Name]:
        """Convert the matrix and the right side, then the substitutions; return the unknowns."""
        expansion = self.expansion
        expansion.expand([*(x for _, _, x, _ in self.entries), *self.right])
        unknowns = self.unknowns()
        rows: list[dict[Name, list[Form]]] = [{} for _ in unknowns]
        for i, j, x, sign in self.entries:
            if not expansion.is_invariant(x):
                number, base = expansion.tail(x)
                number = number if sign > 0 else expansion.builder.negative(number)
                rows[i].setdefault(base, []).append((number, unknowns[j]))
        moving: set[Name] = set()
        for to, right, row in zip(self.other_right, self.right, rows, strict=True):
            terms = [] if expansion.is_invariant(right) else [expansion.tail(right)]
            terms += [self.product(base, factors) for base, factors in row.items()]
            if terms:
                moving.add(to)
                expansion.whole[to] = expansion.add(terms)
        # from the right side to the solution, everything else is of order 0: numbers
        before, expansion.moving = expansion.moving, moving
        names = dict(zip(self.solution, unknowns, strict=True))
        for x in names.keys() & set(self.other_right):  # without an operation
            expansion.rename(x, names[x])
        expansion.expand(names, names)
        expansion.moving = before
        return unknowns

    def unknowns(self) -> list[Name]:
        """Return names of the series of a and λ: registers if they are not computed otherwise."""
        expansion = self.expansion
        unknowns: list[Name] = []
        for x in self.values:
            known = x in expansion.taken or x < expansion.builder.inputs
            if not known:
                expansion.taken.add(x)
                expansion.moving.add(x)
            unknowns.append(expansion.new(x) if known else x)
        return unknowns

    def product(self, base: Name, factors: list[Form]) -> Form:
        """Return the product of a series, without its first coefficient, and a sum."""
        expansion = self.expansion
        number, x = factors[0] if len(factors) == 1 else expansion.bracket(factors, list)
        return number, expansion.multiply(base, x, tail=True)


#: Operations with one term or two.
_SUMS = SeriesOp.SUM, SeriesOp.SCALE


def factored(expansion: SeriesExpansion, results: Sequence[Name]) -> list[SeriesNode]:
    """Return the operations that results need, with common factors of sums factored out."""
    return _Factoring(expansion, results).nodes()


class _Factoring:
    """Rewrites the sums of an expansion, each including nested sums that are used once."""

    def __init__(self, expansion: SeriesExpansion, results: Sequence[Name]):
        self.expansion, self.results = expansion, results
        self.given = {to: node for node in expansion.wanted(results) for to in node[1]}
        self.uses: dict[Name, int] = dict.fromkeys(results, 2)
        self.named = set(results)  # used outside of sums
        self.inside: set[Name] = set()  # sums that are parts of others
        self.multiples: dict[Name, Form] = {}  # sums reduced to one term
        for op, _, operands in self.given.values():
            for i, x in enumerate(operands):
                if i not in op.numbers:
                    x = x.series if isinstance(x, Delayed) else x
                    self.uses[x] = self.uses.get(x, 0) + 1
                    if op not in _SUMS:
                        self.named.add(x)

    def nodes(self) -> list[SeriesNode]:
        """Rewrite all sums."""
        sums = [(to, _terms(node)) for to, node in self.given.items() if node[0] in _SUMS]
        for to, terms in reversed(sums):
            if to not in self.inside:
                self.flat(terms)
        for to, terms in sums:
            if to not in self.inside:
                terms = self.taken_out(self.flat(terms))
                if len(terms) == 1 and to not in self.named:
                    self.multiples[to] = terms[0]
                else:
                    self.expansion.add(terms, to)
        return self.expansion.wanted(self.results)

    def alone(self, x: Name, *ops: SeriesOp) -> SeriesNode | None:
        """Return an operation of some kinds whose result is used once."""
        node = self.given.get(x)
        return node if node and node[0] in ops and self.uses[x] == 1 else None

    def flat(self, terms: Sequence[Form]) -> list[Form]:
        """Return terms with nested sums flattened."""
        flat: list[Form] = []
        waiting = [*reversed(terms)]
        times = self.expansion.builder.times
        while waiting:
            number, x = waiting.pop()
            node = self.alone(x, *_SUMS)
            if node:
                self.inside.add(x)
                waiting += [(times(number, s), a) for s, a in reversed(_terms(node))]
            elif x in self.multiples:
                s, a = self.multiples[x]
                flat.append((times(number, s), a))
            else:
                flat.append((number, x))
        return flat

    def taken_out(self, terms: list[Form]) -> list[Form]:
        """Return terms with common factors of products factored out, the most common first."""
        expansion = self.expansion
        while True:
            members: dict[Name, list[int]] = {}
            for i, (_, x) in enumerate(terms):
                node = self.alone(x, SeriesOp.MUL)
                for factor in set(node[2] if node else ()):
                    members.setdefault(factor, []).append(i)
            factor, which = max(members.items(), key=lambda x: len(x[1]), default=(0, []))
            if len(which) < 2:
                return terms
            others: list[Form] = []
            for i in which:
                number, x = terms[i]
                a, b = self.given[x][2]
                others.append((number, b if a == factor else a))
            others.sort(key=_in_order)  # including those of other sums, in canonical order
            number, rest = expansion.bracket(others, lambda x: self.taken_out(self.flat(x)))
            product = number, expansion.multiply(factor, rest)
            terms = [x for i, x in enumerate(terms) if i not in which[1:]]
            terms[which[0]] = product


def _in_order(term: Form) -> tuple[bool, Name]:
    """Return the sort key of terms: series with registers come first."""
    return isinstance(term[1], UnnamedSeries), term[1]


def _terms(node: SeriesNode) -> list[Form]:
    """Return the terms of a sum."""
    _, _, operands = node
    return list(zip(operands[::2], operands[1::2], strict=True))
