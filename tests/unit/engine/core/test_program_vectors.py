"""Operations on vectors: they give what the same operations give one by one."""

from __future__ import annotations

import itertools
import random

import numpy as np
import pytest
import symengine as se
from core_parts import run_tape
from tape_values import assert_same

from lagcli.engine.core.batch import BatchTable
from lagcli.engine.core.program import (
    assemble,
    progressions,
    unpacked,
)
from lagcli.engine.lowering.compiler import compile_tape
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import LONGEST, PLACES, SHORTEST, VECTOR, Op
from lagcli.engine.tape.tape import Builder, Tape

BODIES = 300


def coordinates(bodies: int) -> tuple[list[se.Symbol], list[str]]:
    """Return x_i and y_i, body by body, and their families."""
    names = [f"{name}_{i}" for i in range(bodies) for name in "xy"]
    return [se.Symbol(name) for name in names], [name[0] for name in names]


def chain(bodies: int) -> tuple[Tape, list[str]]:
    """Return a tape in which every body meets its neighbours, and the labels of its inputs."""
    symbols, families = coordinates(bodies)
    x, y = symbols[::2], symbols[1::2]
    m = se.Symbol("m")
    found = []
    for i in range(1, bodies):
        square = (x[i] - x[i - 1]) ** 2 + (y[i] - y[i - 1]) ** 2
        found += [se.sqrt(square), m * (x[i] - x[i - 1]) / square, se.Abs(x[i]) - y[i - 1] * 3]
        if i % 7 == 0:  # not all are alike
            found.append(se.sin(x[i]) * y[i] + se.atan2(x[i], y[i]))
    return compile_tape(found, symbols, [m]), families


def operations(stream: np.ndarray) -> tuple[int, int]:
    """Return how many operations of a stream are in vectors, and how many are not."""
    numbers, at, vectors, singles = stream.tolist(), 0, 0, 0
    while numbers[at] != Op.END:
        op, n = numbers[at : at + 2]
        at += 2
        if op < VECTOR:
            singles += n
            at += n * PLACES[op]
            continue
        vectors += n
        at += 1
        for _ in range(PLACES[op - VECTOR] - 1):
            at += 2 + (n if numbers[at + 1] < -(2**30) else 0)
    return vectors, singles


def test_long_tapes_run_on_vectors_and_give_the_same() -> None:
    tape, families = chain(BODIES)
    program = assemble(tape, families)
    vectors, singles = operations(program.main)
    assert vectors > 10 * singles
    inputs = np.random.default_rng(1).uniform(0.5, 2.0, tape.inputs)
    expected = ScalarTape(tape)(inputs)
    assert_same(run_tape(tape, inputs, families), expected)


def test_vectors_unpacked_are_the_same_operations() -> None:
    tape, families = chain(BODIES)
    program = assemble(tape, families)
    stream = unpacked(program.main)
    vectors, singles = operations(stream)
    assert (vectors, singles) == (0, sum(operations(program.main)))
    inputs = np.random.default_rng(2).uniform(0.5, 2.0, tape.inputs)
    table = BatchTable(assemble(tape._replace(parameters=0), families), tape.inputs, 0)
    found = table(inputs[None, None], np.empty((1, 0)))[0, :, 0]
    np.testing.assert_allclose(found, ScalarTape(tape)(inputs), rtol=1e-13)


def test_short_tapes_are_not_packed() -> None:
    tape, families = chain(20)
    assert operations(assemble(tape, families).main)[0] == 0


def test_outputs_asked_for_apart_are_found_apart() -> None:
    symbols, families = coordinates(BODIES)
    x, y = symbols[::2], symbols[1::2]
    sums = [a + b for a, b in zip(x, y, strict=True)]
    tape = compile_tape(
        [*sums, *(s * s for s in sums), *(s * a for s, a in zip(sums, x, strict=True))], symbols
    )
    tape = tape._replace(deferred=(BODIES, BODIES))
    program = assemble(tape, families)
    values = np.random.default_rng(3).normal(size=2 * BODIES)
    s = values[::2] + values[1::2]
    expected = np.concatenate([s, s * s, s * values[::2]])
    assert_same(run_tape(tape, values, families), expected)
    # each part has its own operations alone
    moves = 2 * BODIES
    sizes = [sum(operations(part)) for part in (program.main, *program.deferred)]
    assert sizes in ([BODIES + moves, BODIES, BODIES], [BODIES, BODIES, BODIES])


@pytest.mark.bits  # sums of thousands of random terms cancel
@pytest.mark.parametrize("seed", range(30))
def test_any_order_of_operations_gives_the_same(seed: int) -> None:
    """Random operations on what is there: nothing is in progression but by chance."""
    draw = random.Random(seed)
    builder = Builder(40)
    known = list(range(40))
    kinds = (Op.ADD, Op.SUB, Op.MUL, Op.NEG, Op.ABS)
    for _ in range(200):
        op, step, a, b = draw.choice(kinds), draw.choice((1, 2, 3)), draw.randrange(40), 0
        b = draw.randrange(40)
        for i in range(draw.choice((1, 8, 13, 20))):
            operands = (known[-1 - (a + i * step) % len(known)], known[(b + i) % len(known)])
            known.append(builder.emit(op, *operands[: 1 if op in (Op.NEG, Op.ABS) else 2]))
    outputs = known[40::5]
    some = tuple(sorted(draw.sample(range(len(outputs)), 20)))
    tape = builder.finish(
        outputs, output_subsets=(some,), isomorphic=[draw.sample(known[40:], 200)]
    )
    inputs = np.random.default_rng(seed).uniform(-1.0, 1.0, 40)
    with np.errstate(all="ignore"):
        expected = np.array(ScalarTape(tape)(inputs))
        np.testing.assert_array_equal(run_tape(tape, inputs), expected)
        output_subsets = run_tape(tape, inputs, output_subset=0)
        np.testing.assert_array_equal(output_subsets[list(some)], expected[list(some)])


@pytest.mark.bits  # products with random numbers cancel
def test_what_is_used_alike_is_brought_side_by_side() -> None:
    """Results of many levels, as a recursive elimination finds them, and what is between them."""
    builder = Builder(2 * BODIES)
    found = []
    for i in range(BODIES):
        x = i
        for _ in range(((i + 1) & -(i + 1)).bit_length()):  # every second one has a level more
            x = builder.emit(Op.MUL, x, BODIES + i)
        found.append(builder.emit(Op.ADD, x, BODIES + (7 * i) % BODIES))
    pairs = list(itertools.pairwise(found))
    ends = [builder.emit(Op.SUB, builder.emit(Op.MUL, a, b), a) for a, b in pairs]
    ends = [builder.emit(op, x, found[0]) for x in ends for op in (Op.ADD, Op.SUB, Op.MUL)]
    apart, isomorphic = builder.finish(ends), builder.finish(ends, isomorphic=[found])
    sizes = [len(assemble(tape).main) for tape in (isomorphic, apart)]
    assert sizes[0] < 0.9 * sizes[1]
    inputs = np.random.default_rng(5).normal(size=2 * BODIES)
    np.testing.assert_array_equal(run_tape(isomorphic, inputs), ScalarTape(isomorphic)(inputs))


def test_what_is_asked_for_alone_is_all_that_is_done() -> None:
    symbols, families = coordinates(2 * BODIES)
    pairs = list(zip(symbols[::2], symbols[1::2], strict=True))
    squares = [x * x + y * y for x, y in pairs]
    some = tuple(range(2 * BODIES, 4 * BODIES))
    tape = compile_tape(
        [*(s * x for s, (x, _) in zip(squares, pairs, strict=True)), *squares], symbols
    )
    tape = tape._replace(output_subsets=(some, ()))
    program = assemble(tape, families)
    moves = 4 * BODIES
    assert sum(operations(program.output_subsets[0])) == 4 * BODIES + moves
    assert sum(operations(program.main)) == 6 * BODIES + moves
    assert operations(program.output_subsets[1]) == (0, 0)
    values = np.random.default_rng(4).normal(size=4 * BODIES)
    found = run_tape(tape, values, families, output_subset=0)
    expected = np.array(ScalarTape(tape)(values))
    assert_same(found[list(some)], expected[list(some)])


def test_what_is_asked_for_apart_continues_from_what_is_alone() -> None:
    symbols, families = coordinates(BODIES)
    x, y = symbols[::2], symbols[1::2]
    sums = [a + b for a, b in zip(x, y, strict=True)]
    roots = [se.sqrt(a * a + b * b) for a, b in zip(x, y, strict=True)]
    tape = compile_tape([*roots, *sums, *(s * s + s for s in sums)], symbols)
    deferred = range(2 * BODIES, 3 * BODIES)
    tape = tape._replace(deferred=(BODIES,), output_subsets=(tuple(deferred),))
    values = np.random.default_rng(3).normal(size=2 * BODIES)
    found = run_tape(tape, values, families, output_subset=0)
    expected = np.array(ScalarTape(tape)(values))
    assert_same(found[list(deferred)], expected[list(deferred)])
    program = assemble(tape, families)
    assert sum(operations(program.output_subsets[0])) <= 3 * BODIES < sum(operations(program.main))


@pytest.mark.bits  # products of hundreds of factors
def test_many_results_that_end_at_once() -> None:
    """Every second value of a chain is used by one vector; the others are needed at the end."""
    count = 300
    builder = Builder(2 * count + 1)
    vectors = [builder.emit(Op.ADD, i, count + i) for i in range(count)]
    for _ in range(4):
        vectors = [builder.emit(Op.MUL, x, i) for i, x in enumerate(vectors)]
    chain = [2 * count]
    for k in range(count):
        chain.append(builder.emit(Op.MUL if k % 2 else Op.SUB, chain[-1], k))
    ends = [builder.emit(Op.ADD, x, i) for i, x in enumerate(chain[1::2])]
    tape = builder.finish([*vectors, *chain[2::2], *ends])
    assert operations(assemble(tape, long=1).main)[0] > 5 * count
    inputs = np.random.default_rng(6).uniform(0.9, 1.1, 2 * count + 1)
    np.testing.assert_array_equal(run_tape(tape, inputs), ScalarTape(tape)(inputs))


def test_operations_on_places_in_progression_are_one() -> None:
    count = 64
    builder = Builder(2 * count)
    # x_i + y_(63 − i), in any order
    order = [*range(count)]
    random.Random(1).shuffle(order)
    results = [builder.emit(Op.ADD, i, 2 * count - 1 - i) for i in order]
    program = assemble(builder.finish(results), long=1)
    numbers = program.main.tolist()
    assert numbers[:2] == [VECTOR + Op.ADD, count]
    at = program.outputs.tolist()
    first = numbers[2]
    assert sorted(at) == [*range(first, first + count)]
    assert first >= 2 * count
    # one by one they are the same operations, with the places that were given
    singles = np.array(unpacked(program.main).tolist()[2:-2]).reshape(count, 3).tolist()
    expected = [[to, i, 2 * count - 1 - i] for to, i in zip(at, order, strict=True)]
    assert sorted(singles) == sorted(expected)


def test_progressions_are_found_between_others() -> None:
    one = [(10 + 3 * i, 500 - i) for i in range(40)]
    other = [(11 + 3 * i, 900 + 2 * i) for i in range(25)]
    single = [(7, 7), (1000, 3), (1001, 77)]
    points = [*one, *other, *single]
    random.Random(1).shuffle(points)
    found, rest = progressions(points)
    runs = sorted([points[i] for i in run] for run in found)
    assert runs == [one, other]
    assert sorted(points[i] for i in rest) == sorted(single)


def test_one_operand_may_lie_anywhere() -> None:
    draw = random.Random(2)
    points = [(100 + 2 * i, draw.randrange(10**6), 50) for i in range(64)]
    found, rest = progressions(points)
    assert [[points[i] for i in run] for run in found] == [points]
    assert rest == []


def test_equal_points_are_no_progression() -> None:
    found, rest = progressions([(3, 4)] * 2000)
    assert found == []
    assert sorted(rest) == [*range(2000)]


@pytest.mark.parametrize("length", [16, LONGEST, LONGEST + 1, 5 * LONGEST - 3])
def test_vectors_are_no_longer_than_the_core_allows(length: int) -> None:
    """Nor much shorter: results are divided into equal parts."""
    builder = Builder(2 * length)
    results = [builder.emit(Op.ADD, i, length + i) for i in range(length)]
    numbers, at, sizes = assemble(builder.finish(results), long=1).main.tolist(), 0, []
    while numbers[at] != Op.END:
        assert numbers[at] == VECTOR + Op.ADD
        sizes.append(numbers[at + 1])
        at += 7
    assert sum(sizes) == length
    assert max(sizes) <= LONGEST
    assert min(sizes) >= min(length, LONGEST // 2)


@pytest.mark.parametrize("seed", range(10))
def test_every_point_is_found_once(seed: int) -> None:
    draw = random.Random(seed)
    points = [(draw.randrange(60), draw.randrange(60)) for _ in range(200)]
    found, rest = progressions(points)
    assert sorted([*itertools.chain.from_iterable(found), *rest]) == [*range(200)]
    for run in found:
        assert len(run) >= SHORTEST
        # in each coordinate but one, at most, equal steps
        columns = zip(*(points[i] for i in run), strict=True)
        assert sum(len({b - a for a, b in itertools.pairwise(c)}) > 1 for c in columns) <= 1


def test_fewer_points_than_a_vector_is_worth_are_left() -> None:
    points = [(i, 5 * i) for i in range(SHORTEST - 1)]
    assert progressions(points) == ([], [*range(SHORTEST - 1)])


def test_points_that_occur_twice_make_two_progressions() -> None:
    found, rest = progressions([(i, 5 * i) for i in range(2 * SHORTEST)] * 2)
    assert ([len(run) for run in found], rest) == ([2 * SHORTEST] * 2, [])


@pytest.mark.parametrize("copies", [SHORTEST - 1, 2 * SHORTEST, 40])
def test_vectors_are_sought_where_operations_repeat(copies: int) -> None:
    """Those of one function of inputs, whichever inputs these are, make three fifths of a tape."""
    for others, expected in ((copies, copies >= SHORTEST), (3 * copies, False)):
        builder = Builder(2 * copies + 2)
        results = [
            builder.emit(Op.MUL, builder.emit(Op.ADD, i, copies + i), 2 * copies)
            for i in range(copies)
        ]
        one = 2 * copies + 1  # each of these is a function of the one before
        for _ in range(others):
            one = builder.emit(Op.SUB, one, 2 * copies)
        program = assemble(builder.finish([*results, one]), long=1)
        assert (operations(program.main)[0] > 0) == expected


def test_programs_of_operations_that_do_not_repeat_have_no_vectors() -> None:
    """Equal ones or not: results are those of single operations, and vectors are where they pay."""
    rng = random.Random(5)
    symbols = [se.Symbol(f"x_{i}") for i in range(40)]
    values = list(symbols)
    for _ in range(1800):
        values.append(rng.choice([se.sin, se.exp, se.sqrt])(rng.choice(values[-60:])) * symbols[1])
    diverse = assemble(compile_tape(values[-60:], symbols, []), ["x"] * 40)
    assert operations(diverse.main)[0] == 0
    tape, families = chain(BODIES)
    assert operations(assemble(tape, [*families, None]).main)[0] > 0
