"""Tapes assembled: the programs give the tapes' values, from fewer operations and registers."""

from __future__ import annotations

import math
import random
from collections import Counter

import numpy as np
import pytest

from lagcli.engine.program.nodes import INDEXED, VECTOR
from lagcli.engine.program.program import (
    Program,
    allocate,
    assemble,
    excerpt,
    in_order,
    stream,
    unpacked,
)
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import OPERATIONS, PLACES, Op
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


def test_operations_of_a_kind_follow_each_other() -> None:
    # y_i = −(x_i + x_0) for four x, given one after the other
    nodes = []
    for i in range(4):
        nodes += [(Op.ADD, (10 + i,), (i, 0)), (Op.NEG, (20 + i,), (10 + i,))]
    found = in_order(nodes)
    assert [op for op, _, _ in found] == [Op.ADD] * 4 + [Op.NEG] * 4
    assert sorted(found) == sorted(nodes)


def test_places_of_dead_values_are_used_again() -> None:
    # a chain of negations needs two places at most, whatever its length
    nodes = [(Op.NEG, (i + 1,), (i,)) for i in range(50)]
    place = {0: 0}
    placed, count = allocate(nodes, place, 1, {50})
    assert count <= 3
    registers = [7.0] + [0.0] * count
    run(stream(placed), registers)
    assert registers[place[50]] == 7.0
    # what is kept at the end is not overwritten
    place = {0: 0}
    placed, count = allocate(nodes, place, 1, {1, 50})
    registers = [7.0] + [0.0] * count
    run(stream(placed), registers)
    assert (registers[place[1]], registers[place[50]]) == (-7.0, 7.0)


def test_a_stream_counts_operations_of_a_kind() -> None:
    found = stream([(Op.NEG, (2,), (0,)), (Op.NEG, (3,), (1,)), (Op.ADD, (4,), (2, 3))])
    assert found.dtype == np.int32
    assert found.tolist() == [Op.NEG, 2, 2, 0, 3, 1, Op.ADD, 1, 4, 2, 3, Op.END, 0]


def numbers_of(*numbers: int) -> np.ndarray:
    return np.array([*numbers, Op.END, 0], dtype=np.int32)


#: Registers 0 to 3 are inputs: r4 = r0 + r1, r5 = r2 + r3; r6, r7 = sin, cos of r4; r8 = r7 r5.
SINGLES = numbers_of(
    *(Op.ADD, 2, 4, 0, 1, 5, 2, 3),
    *(Op.SINCOS, 1, 6, 7, 4),
    *(Op.MUL, 1, 8, 7, 5),
)


def test_an_excerpt_holds_what_results_depend_on() -> None:
    for results, expected in (
        ([5], numbers_of(Op.ADD, 1, 5, 2, 3)),
        ([6], numbers_of(Op.ADD, 1, 4, 0, 1, Op.SINCOS, 1, 6, 7, 4)),
        ([8], SINGLES),
        ([5, 4], numbers_of(Op.ADD, 2, 4, 0, 1, 5, 2, 3)),
        ([0], numbers_of()),
        ([], numbers_of()),
    ):
        np.testing.assert_array_equal(excerpt(SINGLES, results), expected)


def test_a_value_that_is_overwritten_is_not_needed_before() -> None:
    # r2 = −r0, used by nothing; r2 = −r1; r3 = r2 + r2
    again = numbers_of(Op.NEG, 2, 2, 0, 2, 1, Op.ADD, 1, 3, 2, 2)
    expected = numbers_of(Op.NEG, 1, 2, 1, Op.ADD, 1, 3, 2, 2)
    np.testing.assert_array_equal(excerpt(again, [3]), expected)


#: r20 … r22 = r0, r2, r4 times r5, r9, r7.
VECTORS = (VECTOR + Op.MUL, 3, 20, 0, 2, 0, INDEXED, 5, 9, 7)


def test_vectors_stay_whole_in_excerpts() -> None:
    given = numbers_of(Op.NEG, 2, 9, 1, 10, 1, *VECTORS)
    found = excerpt(given, [21])
    np.testing.assert_array_equal(found, numbers_of(Op.NEG, 1, 9, 1, *VECTORS))
    np.testing.assert_array_equal(excerpt(given, [10]), numbers_of(Op.NEG, 1, 10, 1))


def test_vectors_are_taken_apart_element_by_element() -> None:
    given = numbers_of(*VECTORS, Op.MUL, 1, 30, 20, 22)
    expected = numbers_of(Op.MUL, 4, 20, 0, 5, 21, 2, 9, 22, 4, 7, 30, 20, 22)
    np.testing.assert_array_equal(unpacked(given), expected)
    np.testing.assert_array_equal(unpacked(SINGLES), SINGLES)
