"""Machine code of streams: its results are the interpreter's to the last bit."""

from __future__ import annotations

import gc
import itertools
import mmap
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from core_parts import NativeProgram, restore, save
from core_runs import pendulum
from random_cases import FUZZ_COUNT
from random_streams import NOTHING, SPECIAL, random_numbers, random_program
from shipped import PATHS, every_model

import lagcli
from lagcli.arrays import Array
from lagcli.engine.core import library, run
from lagcli.engine.core.batch import LANES
from lagcli.engine.core.library import AVX2, NATIVE
from lagcli.engine.core.program import Program
from lagcli.engine.tape.operations import INDEXED, PLACES, VECTOR, Kind, Op

pytestmark = [
    pytest.mark.bits,
    pytest.mark.skipif(library._core.lag_best_kernel() != NATIVE, reason="another processor"),
]


def bits(numbers: Array) -> Array:
    """Return numbers as integers; one for all NaN, whose sign and payload nothing determines."""
    return np.where(np.isnan(numbers), -1, np.ascontiguousarray(numbers).view(np.int64))


def program(code: list[int], registers: Array, outputs: list[int], *deferred: list[int]) -> Program:
    """Return a program of some words."""
    main, *rest = (np.array([*x, Op.END, 0], dtype=np.int32) for x in (code, *deferred))
    return Program(
        NOTHING, main, tuple(rest), (), registers, np.array(outputs, dtype=np.int32), 1, 1
    )


def check(made: Program, lanes: int, again: int = 2) -> None:
    """Compare a program's machine code with the interpreter, from some states."""
    rng = np.random.default_rng(0)
    count = 1 + len(made.deferred)
    native, plain = NativeProgram(made, lanes), NativeProgram(made, lanes, at_once=False)
    registers = np.repeat(made.registers, lanes)
    for i in range(count):
        native.run(i, registers.copy())
        assert native.size(i)
        assert not plain.size(i)
    found, expected = registers.copy(), registers.copy()
    outputs = (made.outputs[:, None] * lanes + np.arange(lanes)).ravel()
    for _ in range(again):
        for i in range(count):
            native.run(i, found)
            plain.run(i, expected)
            np.testing.assert_array_equal(bits(found[outputs]), bits(expected[outputs]))
        found[:] = expected[:] = random_numbers(rng, len(found))


@pytest.mark.parametrize("lanes", [1, LANES])
@pytest.mark.parametrize("op", [op for op in Op if op is not Op.END], ids=lambda op: op.name)
def test_each_operation_of_special_numbers(op: Op, lanes: int) -> None:
    operands = PLACES[op] - (2 if op is Op.SINCOS else 1)
    cases = list(itertools.product(SPECIAL, repeat=operands))
    if operands == 3:
        cases = cases[:: len(SPECIAL) // 3]  # a third, over all pairs
    registers = np.array(cases).ravel()
    given, count = len(registers), len(cases) * (PLACES[op] - operands)
    words = [int(op), len(cases)]
    for i in range(len(cases)):
        results = PLACES[op] - operands
        words += range(given + results * i, given + results * (i + 1))
        words += range(operands * i, operands * (i + 1))
    registers = np.append(registers, np.zeros(count))
    check(program(words, registers, [*range(given, given + count)]), lanes)


@pytest.mark.parametrize("op", [op for op in Op if op.kind is Kind.VECTOR], ids=lambda op: op.name)
@pytest.mark.parametrize("n", [1, 3, 4, 7, 33, 64])
@pytest.mark.parametrize("step", [0, 1, 2, -1, INDEXED])
def test_each_operation_on_vectors(op: Op, n: int, step: int) -> None:
    rng = np.random.default_rng(n)
    size, operands = 2 * n, PLACES[op] - 1
    words = [VECTOR + op, n, operands * size]
    for i in range(operands):
        first = i * size + (n if step == -1 else 0)
        listed = (i * size + rng.integers(0, size, n)).tolist() if step == INDEXED else []
        words += [first, step, *listed]
    registers = np.append(random_numbers(rng, operands * size), np.zeros(n))
    check(program(words, registers, [*range(operands * size, operands * size + n)]), 1)


@pytest.mark.parametrize("seed", range(24))
def test_random_streams(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vectors = (0.0, 0.3)[seed % 2]
    check(random_program(rng, vectors, (30, 12)[seed % 2], (40, 140)[seed % 2]), 1)
    check(random_program(rng, 0.0, 20, 40), LANES)


@pytest.mark.fuzz
def test_many_random_streams() -> None:
    for seed in range(5 * FUZZ_COUNT):
        rng = np.random.default_rng(seed)
        length, count = int(rng.integers(1, 60)), int(rng.integers(12, 200))
        check(random_program(rng, rng.choice([0.0, 0.2, 0.9]), length, count), 1)
        check(random_program(rng, 0.0, length, count), LANES)


def test_an_input_that_a_stream_replaces_is_read_before() -> None:
    """The sum of two inputs goes where one of them is, which is read after that."""
    made = program(
        [Op.ADD, 1, 0, 0, 1, Op.MUL, 1, 2, 0, 1, Op.SUB, 1, 1, 2, 0],
        np.array([3.0, 5.0, 0.0]),
        [0, 1, 2],
    )
    check(made, 1)
    check(made, LANES)


@pytest.mark.parametrize(
    ("words", "deferred"),
    [
        ([VECTOR + Op.ADD, 4, 2, 0, 1, 0, 1], [Op.NEG, 1, 0, 1]),  # operands where results are
        ([Op.NEG, 1, 0, 1], [Op.NEG, 1, 0, 8]),  # a register that is not there
        ([Op.NEG, 1, 0, 1], [Op.NEG, 1, -1, 1]),
        ([Op.NEG, 1, 0, 1], [50, 1, 0, 1]),  # an operation that is not there
        ([Op.NEG, 1, 0, 1], [VECTOR + Op.NEG, 9, 0, 0, 0]),  # more elements than registers
        ([Op.NEG, 1, 0, 1], [VECTOR + Op.SIN, 2, 0, 4, 0]),
        ([Op.NEG, 1, 0, 1], [Op.NEG, 2**30, 0, 1]),
    ],
)
def test_nothing_is_emitted_of_invalid_programs(words: list[int], deferred: list[int]) -> None:
    native = NativeProgram(program(words, np.ones(8), [0], deferred))
    for _ in range(3):
        native.run(0, np.ones(8))
    assert not native.size(0)


def test_an_output_that_is_not_there_is_invalid() -> None:
    native = NativeProgram(program([Op.NEG, 1, 0, 1], np.ones(8), [8]))
    native.run(0, np.ones(8))
    assert not native.size(0)


def test_nothing_is_emitted_before_it_is_worth_it() -> None:
    made = random_program(np.random.default_rng(1), 0.0, 60, 60)
    native, registers = NativeProgram(made, at_once=False), made.registers
    native.run(0, registers, 99)
    assert not native.size(0)
    native.run(0, registers, 100_000)
    assert native.size(0)


@pytest.fixture(scope="module", autouse=True)
def nothing_left() -> None:
    """Keep what other tests have left out of the collections of these.

    Runs release their code when they are collected, and to look through all objects takes a second.
    """
    gc.collect()
    gc.freeze()


def executable() -> set[tuple[int, str]]:
    """Return the pages, and their permissions, that are executable and have no file."""
    gc.collect()  # runs release theirs then
    pages = set()
    for line in Path("/proc/self/maps").read_text("utf-8").splitlines():
        at, may, *rest = line.split()
        if "x" in may and len(rest) < 4:
            first, end = (int(x, 16) for x in at.split("-"))
            pages |= {(page, may) for page in range(first, end, mmap.PAGESIZE)}
    return pages


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="no list of mapped memory")
def test_code_is_executable_not_writable_and_released() -> None:
    before = executable()
    made = program([Op.NEG, 1, 0, 1], np.ones(4), [0])
    native = NativeProgram(made)
    native.run(0, np.ones(4))
    new = executable() - before
    assert len(new) == 1
    assert all("w" not in may for _, may in new)
    del native
    assert executable() == before


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="no list of mapped memory")
def test_a_run_that_goes_back_keeps_its_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was emitted after the state was saved is still there, and is released once."""
    monkeypatch.setattr(run, "KERNEL", NATIVE)
    before = executable()
    integration = pendulum(t_end=20.0)
    core = integration.core
    core.start()
    core.advance(2)
    assert executable() == before
    saved = save(core)
    core.advance(300)
    emitted, state = executable(), core.state
    assert emitted > before
    assert restore(core, saved)
    core.advance(300)
    np.testing.assert_array_equal(core.state, state)
    assert executable() >= emitted
    del integration, core
    gc.collect()
    assert executable() == before


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="no list of mapped memory")
@pytest.mark.parametrize(("samples", "emitted"), [(51, False), (20_000, True)])
def test_code_is_emitted_at_once_if_the_samples_are_worth_it(
    samples: int, *, emitted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "KERNEL", NATIVE)
    before = executable()
    integration = pendulum(samples=samples)
    integration.core.start()
    assert (executable() > before) == emitted


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="no list of mapped memory")
@pytest.mark.parametrize(("t_end", "emitted"), [(5.0, False), (500.0, True)])
def test_code_is_emitted_early_if_many_steps_are_left(
    t_end: float, *, emitted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "KERNEL", NATIVE)
    before = executable()
    integration = pendulum(t_end)
    integration.core.start()
    integration.core.advance(15)
    assert executable() == before
    integration.core.advance(3)
    assert (executable() > before) == emitted


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="no list of mapped memory")
@pytest.mark.parametrize(("t_end", "emitted"), [(8.0, False), (20.0, True)])
def test_code_is_not_emitted_shortly_before_the_end(
    t_end: float, *, emitted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After 6 s, interpretation has taken as long as emission; what is left is not worth it."""
    monkeypatch.setattr(run, "KERNEL", NATIVE)
    before = executable()
    integration = pendulum(t_end)
    integration.run()
    assert (executable() > before) == emitted


def results(name: str) -> Iterator[Array]:
    """Yield the numbers of a model's default run."""
    found = lagcli.simulate(lagcli.load(PATHS[name]), samples=41)
    for field in ("time", "q", "v", "a", "multipliers", "energy_total"):
        yield np.asarray(getattr(found, field))
    yield np.array([*found.counts.values()], dtype=float)


@pytest.mark.parametrize("name", every_model())
def test_runs_of_models_are_equal(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "KERNEL", AVX2)
    expected = [*results(name)]
    monkeypatch.setattr(run, "KERNEL", NATIVE)
    for found, other in zip(results(name), expected, strict=True):
        np.testing.assert_array_equal(bits(found), bits(other))


#: Refuses executable memory, as hardened systems do.
_REFUSING = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stddef.h>
int mprotect(void *at, size_t bytes, int protection)
{
    int (*system)(void *, size_t, int) = (int (*)(void *, size_t, int))dlsym(RTLD_NEXT, "mprotect");
    return protection & 4 ? -1 : system(at, bytes, protection);
}
"""
_RUN = """
import sys; sys.path.insert(0, {support!r})
import numpy as np
from core_parts import NativeProgram
from random_streams import random_program
made = random_program(np.random.default_rng(1), 0.0, 60, 60)
native, registers = NativeProgram(made), made.registers
native.run(0, registers, 5)
from lagcli.engine.core.library import KERNEL
print(native.size(0), KERNEL, *(x.hex() for x in registers[made.outputs].tolist()))
"""


def outcome(**environment: str) -> list[str]:
    """Return what a process of its own finds: bytes of code, the kernel, and numbers."""
    done = subprocess.run(
        [sys.executable, "-c", _RUN.format(support=str(Path(__file__).parents[3] / "support"))],
        env={**os.environ, **environment}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert not done.stderr
    return done.stdout.split()


@pytest.mark.skipif(sys.platform != "linux" or not shutil.which("cc"), reason="needs Linux and cc")
def test_where_memory_is_refused_the_interpreter_stays(tmp_path: Path) -> None:
    source, refusing = tmp_path / "refusing.c", tmp_path / "refusing.so"
    source.write_text(_REFUSING)
    subprocess.run(["cc", "-shared", "-fPIC", source, "-o", refusing, "-ldl"], check=True)
    size, kernel, *numbers = outcome(LAGCLI_NATIVE="1")
    preloaded = f"{os.environ.get('LD_PRELOAD', '')} {refusing}"  # that of sanitizers first
    without, _, *others = outcome(LAGCLI_NATIVE="1", LD_PRELOAD=preloaded)
    assert int(size) > 0
    assert int(kernel) == NATIVE
    assert int(without) == 0
    assert numbers == others


def test_the_environment_turns_it_off() -> None:
    assert outcome(LAGCLI_NATIVE="0")[1] == str(AVX2)
