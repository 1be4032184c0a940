"""Tapes assembled: the programs give the tapes' values, from fewer operations and registers."""

from __future__ import annotations

import itertools
import math
import random
from collections import Counter

import numpy as np
import pytest

from lagcli.engine.core.program import Program, assemble, nodes_of, series_stream, unpacked
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import INDEXED, OPERATIONS, PLACES, VECTOR, Op
from lagcli.engine.tape.series_operations import SeriesOp
from lagcli.engine.tape.tape import Builder, Tape

#: What programs alone have, in plain Python.
FUSED = {
    Op.MULADD: lambda a, b, c: a * b + c,
    Op.MULSUB: lambda a, b, c: a * b - c,
    Op.SUBMUL: lambda a, b, c: c - a * b,
    Op.MOVE: lambda a: a,
}


def run(part: np.ndarray, registers: list[float]) -> Counter[Op]:
    """Run a stream in Python; return the operations."""
    numbers, at = part.tolist(), 0
    done: Counter[Op] = Counter()
    while numbers[at] != Op.END:
        op, n = OPERATIONS[numbers[at]], numbers[at + 1]
        at += 2
        for _ in range(n):
            places = numbers[at : at + PLACES[op]]
            at += PLACES[op]
            values = [registers[x] for x in places[op.results :]]
            if op is Op.SINCOS:
                registers[places[0]], registers[places[1]] = math.sin(*values), math.cos(*values)
            else:
                registers[places[0]] = (op.scalar or FUSED[op])(*values)
        done[op] += n
    assert numbers[at:] == [Op.END, 0]
    return done


def start(program: Program, inputs: list[float]) -> list[float]:
    """Return the registers after the prelude."""
    registers = program.registers.tolist()
    registers[: len(inputs)] = inputs
    run(program.prelude, registers)
    return registers


def outputs(program: Program, registers: list[float]) -> list[float]:
    return [registers[x] for x in program.outputs.tolist()]


def random_tape(seed: int, **finish: object) -> Tape:
    draw = random.Random(seed)
    builder = Builder(5, parameters=2)
    known = [*range(5), builder.constant(0.5), builder.constant(-3.0)]
    kinds = (Op.ADD, Op.SUB, Op.MUL, Op.NEG, Op.SIN, Op.COS, Op.ABS)
    for _ in range(40):
        op = draw.choice(kinds)
        known.append(builder.emit(op, *draw.choices(known[-12:], k=op.arity)))
    return builder.finish(draw.sample(known, 9), **finish)


INPUTS = [0.3, -1.2, 0.7, 1.9, -0.4]


@pytest.mark.parametrize("seed", range(20))
def test_programs_give_the_values_of_their_tapes(seed: int) -> None:
    tape = random_tape(seed)
    program = assemble(tape)
    registers = start(program, INPUTS)
    done = run(program.main, registers)
    np.testing.assert_allclose(outputs(program, registers), ScalarTape(tape)(INPUTS), rtol=1e-12)
    assert done.total() == program.size <= len(tape.code)


@pytest.mark.parametrize("seed", range(10))
def test_outputs_that_are_asked_for_apart_come_after_the_others(seed: int) -> None:
    tape = random_tape(seed, deferred=(3, 2), output_subsets=((0, 2), (6,)))
    program, expected = assemble(tape), ScalarTape(tape)(INPUTS)
    registers = start(program, INPUTS)
    run(program.main, registers)
    np.testing.assert_allclose(outputs(program, registers)[:4], expected[:4], rtol=1e-12)
    run(program.deferred[0], registers)
    run(program.deferred[1], registers)
    np.testing.assert_allclose(outputs(program, registers), expected, rtol=1e-12)
    # in any order, each without the others, and again
    registers, groups = start(program, INPUTS), (slice(4, 7), slice(7, 9))
    run(program.main, registers)
    for k in (1, 1, 0, 1, 0):
        run(program.deferred[k], registers)
        found = outputs(program, registers)[groups[k]]
        np.testing.assert_allclose(found, expected[groups[k]], rtol=1e-12)
    # alone: instead of the main part, and for a later one what it goes on from
    registers = start(program, INPUTS)
    run(program.output_subsets[0], registers)
    found = outputs(program, registers)
    np.testing.assert_allclose([found[0], found[2]], [expected[0], expected[2]], rtol=1e-12)
    registers = start(program, INPUTS)
    run(program.output_subsets[1], registers)
    run(program.deferred[0], registers)
    assert outputs(program, registers)[6] == pytest.approx(expected[6], rel=1e-12)


def test_what_depends_on_parameters_alone_is_done_once() -> None:
    builder = Builder(3, parameters=2)
    invariant = builder.emit(Op.SQRT, builder.emit(Op.MUL, 1, 2))
    program = assemble(builder.finish([builder.emit(Op.ADD, 0, invariant)]))
    registers = [0.0] * 20
    assert run(program.prelude, registers) == {Op.MUL: 1, Op.SQRT: 1}
    assert run(program.main, registers) == {Op.ADD: 1}


def test_products_used_once_join_sums_and_sines_join_cosines() -> None:
    builder = Builder(3)
    product = builder.emit(Op.MUL, 0, 1)
    results = [
        builder.emit(Op.ADD, 2, product),
        builder.emit(Op.SIN, 2),
        builder.emit(Op.COS, 2),
        builder.emit(Op.SIN, 1),
    ]
    registers = [1.0, 2.0, 3.0] + [0.0] * 9
    done = run(assemble(builder.finish(results)).main, list(registers))
    assert done == {Op.MULADD: 1, Op.SINCOS: 1, Op.SIN: 1}
    for op, merged in ((Op.SUB, Op.MULSUB),):
        difference = builder.emit(op, product, 2)
        done = run(assemble(builder.finish([difference])).main, list(registers))
        assert done == {merged: 1}
    done = run(assemble(builder.finish([builder.emit(Op.SUB, 2, product)])).main, list(registers))
    assert done == {Op.SUBMUL: 1}
    # used twice, the product stays
    done = run(assemble(builder.finish([results[0], product])).main, list(registers))
    assert done == {Op.MUL: 1, Op.ADD: 1}


def test_operations_that_no_output_needs_are_left_out() -> None:
    builder = Builder(2)
    needed = builder.emit(Op.ADD, 0, 1)
    builder.emit(Op.DIV, 0, 1)
    assert assemble(builder.finish([needed])).size == 1


def test_inputs_of_later_outputs_are_counted_apart() -> None:
    builder = Builder(5, parameters=1, rhs_inputs=2)
    tape = builder.finish([builder.emit(Op.ADD, 0, 3)])
    assert assemble(tape).inputs == 3


#: Kinds of operations on series, whose numbers of operands are one and two.
ONE, TWO = SeriesOp.RATE, SeriesOp.MUL


def arranged(
    lines: list[tuple[int, ...]], place: dict[int, int], kept: set[int], ordered: int | None = None
) -> tuple[list[tuple[int, ...]], dict[int, int], int]:
    """Return operations with registers, the registers of values, and how many there are."""
    nodes = nodes_of(lines)
    values = int(nodes[:, 1:].max()) + 1
    registers = np.array([place.get(x, -1) for x in range(values)], dtype=np.int32)
    flags = np.array([x in kept for x in range(values)])
    ordered = len(lines) if ordered is None else ordered
    stream, count = series_stream(nodes, ordered, registers, flags, max(place.values()) + 1)
    numbers, at = stream.tolist(), 0
    found = []
    while numbers[at] != SeriesOp.END:
        op, n = numbers[at : at + 2]
        at += 2
        width = 1 + len(SeriesOp(op).operands)
        for _ in range(n):
            found.append((op, *numbers[at : at + width]))
            at += width
    assert numbers[at:] == [SeriesOp.END, 0]
    return found, dict(enumerate(registers.tolist())), count


def test_operations_of_a_kind_follow_each_other() -> None:
    # y_i = (x_i x_0)' for four x, given one after the other
    lines = []
    for i in range(4):
        lines += [(TWO, 10 + i, i, 0), (ONE, 20 + i, 10 + i)]
    found, place, _ = arranged(lines, {i: i for i in range(4)}, set(range(10, 24)))
    assert [op for op, *_ in found] == [TWO] * 4 + [ONE] * 4
    expected = [(op, *[place[x] for x in values]) for op, *values in lines]
    assert sorted(found) == sorted(expected)


def test_operations_that_are_not_ordered_follow_as_they_are() -> None:
    lines = [(ONE, 2, 0), (TWO, 3, 0, 1), (ONE, 4, 1), (TWO, 5, 3, 1), (ONE, 6, 3), (TWO, 7, 6, 1)]
    found, _, _ = arranged(lines, {0: 0, 1: 1}, set(range(8)), ordered=3)
    assert [op for op, *_ in found] == [ONE, ONE, TWO, TWO, ONE, TWO]


@pytest.mark.parametrize("count", [4096, 4097, 9000])
def test_windows_do_not_break_the_order(count: int) -> None:
    """Operands are ready in programs that are ordered in several windows."""
    draw = random.Random(count)
    lines = []
    for i in range(2, count + 2):
        op = draw.choice((ONE, TWO))
        operands = [draw.randrange(max(0, i - 50), i) for _ in op.operands]
        lines.append((op, i, *operands))
    found, _, _ = arranged(lines, {0: 0, 1: 1}, set(range(count + 2)))  # registers are of one value
    ready = {0, 1}
    for _, to, *operands in found:
        assert ready.issuperset(operands)
        assert to not in ready
        ready.add(to)
    assert len(found) == count
    runs = 1 + sum(a[0] != b[0] for a, b in itertools.pairwise(found))
    assert runs < count / 4  # as given, every second operation begins a run


def test_places_of_dead_values_are_used_again() -> None:
    # a chain of operations needs two places at most, whatever its length
    lines = [(ONE, i + 1, i) for i in range(50)]
    found, place, count = arranged(lines, {0: 0}, {50})
    assert count <= 3
    values = {0: 0}  # the depth of what is in each register
    for _, to, a in found:
        values[to] = values[a] + 1
    assert values[place[50]] == 50
    # what is kept at the end is not overwritten
    found, place, count = arranged(lines, {0: 0}, {1, 50})
    values = {0: 0}
    for _, to, a in found:
        values[to] = values[a] + 1
    assert (values[place[1]], values[place[50]]) == (1, 50)


@pytest.mark.parametrize("seed", range(20))
def test_registers_of_values_in_use_are_not_overwritten(seed: int) -> None:
    """Random operations, some with results that nothing uses, with given places and kept values."""
    draw = random.Random(seed)
    lines = []
    for i in range(5, 120):
        op = draw.choice((ONE, TWO, SeriesOp.MULSUM))
        lines.append((op, i, *[draw.randrange(max(0, i - 12), i) for _ in op.operands]))
    place = {0: 3, 1: 0, 2: 1, 3: 4, 4: 2, 60: 5}
    kept = {60, *draw.sample(range(5, 120), 6)}
    found, where, count = arranged(lines, place, kept)
    assert all(where[x] == at for x, at in place.items())
    # what a value is made of, by a number
    known: dict[object, int] = {}
    of = {x: known.setdefault(("given", x), len(known)) for x in range(5)}
    for op, to, *operands in lines:
        of[to] = known.setdefault((op, *[of[x] for x in operands]), len(known))
    registers = {place[x]: of[x] for x in range(5)}
    for op, to, *operands in found:
        registers[to] = known[op, *[registers[x] for x in operands]]
    assert {x: registers[where[x]] for x in kept} == {x: of[x] for x in kept}
    assert count < 40  # of 120 values


def numbers_of(*numbers: int) -> np.ndarray:
    return np.array([*numbers, Op.END, 0], dtype=np.int32)


#: Registers 0 to 3 are inputs: r4 = r0 + r1, r5 = r2 + r3; r6, r7 = sin, cos of r4; r8 = r7 r5.
SINGLES = numbers_of(
    *(Op.ADD, 2, 4, 0, 1, 5, 2, 3),
    *(Op.SINCOS, 1, 6, 7, 4),
    *(Op.MUL, 1, 8, 7, 5),
)


#: r20 … r22 = r0, r2, r4 times r5, r9, r7.
VECTORS = (VECTOR + Op.MUL, 3, 20, 0, 2, 0, INDEXED, 5, 9, 7)


def test_vectors_are_taken_apart_element_by_element() -> None:
    given = numbers_of(*VECTORS, Op.MUL, 1, 30, 20, 22)
    expected = numbers_of(Op.MUL, 4, 20, 0, 5, 21, 2, 9, 22, 4, 7, 30, 20, 22)
    np.testing.assert_array_equal(unpacked(given), expected)
    np.testing.assert_array_equal(unpacked(SINGLES), SINGLES)


def test_a_subset_has_the_operations_that_it_depends_on() -> None:
    """u = a + b, w = c + d; sin u, cos u, w cos u: what is computed for some of the results."""
    builder = Builder(4)
    u, w = builder.emit(Op.ADD, 0, 1), builder.emit(Op.ADD, 2, 3)
    sine, cosine = builder.emit(Op.SIN, u), builder.emit(Op.COS, u)
    results = [u, w, sine, builder.emit(Op.MUL, cosine, w), 0]
    for some, expected in (
        ([1], {Op.ADD: 1}),
        ([2], {Op.ADD: 1, Op.SINCOS: 1}),
        ([3], {Op.ADD: 2, Op.SINCOS: 1, Op.MUL: 1}),
        ([0, 1], {Op.ADD: 2}),
        ([4], {}),
        ([], {}),
    ):
        program = assemble(builder.finish(results, output_subsets=(tuple(some),)))
        registers = start(program, INPUTS[:4])
        assert run(program.output_subsets[0], registers) == expected
        found = outputs(program, registers)
        values = ScalarTape(builder.finish(results))(INPUTS[:4])
        assert [found[i] for i in some] == pytest.approx([values[i] for i in some], rel=1e-15)


@pytest.mark.parametrize(
    "changed",
    [
        {"code": ((Op.ADD, 3, 0, 3, 0),)},  # an operand that is not ready
        {"code": ((Op.ADD, 3, 0, -1, 0),)},
        {"code": ((Op.ADD, 3, 0, 9, 0),)},
        {"code": ((Op.ADD, 1, 0, 1, 0),)},  # a result in the place of an input
        {"code": ((Op.ADD, 9, 0, 1, 0),)},
        {"code": ((Op.END, 3, 0, 1, 0),)},
        {"code": ((Op.SINCOS, 3, 0, 1, 0),)},
        {"code": ((-1, 3, 0, 1, 0),)},
        {"outputs": (4,)},
        {"outputs": (-1,)},
        {"deferred": (2,)},
        {"output_subsets": ((1,),)},
        {"isomorphic": ((9,),)},
    ],
)
def test_invalid_tapes_are_refused(changed: dict[str, object]) -> None:
    tape = Tape(2, (0.5,), ((Op.ADD, 3, 0, 2, 0),), (3,))
    assert assemble(tape).size == 1
    with pytest.raises(ValueError, match="tape"):
        assemble(tape._replace(**changed))
