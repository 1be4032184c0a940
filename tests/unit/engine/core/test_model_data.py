"""Models as data: runs are those of the binding, and damaged data are rejected."""

from __future__ import annotations

import ctypes
from ctypes import byref

import numpy as np
import pytest
from core_parts import lag_model, parts
from core_runs import Recorded, data_of, pendulum

from lagcli.engine.core.model_data import model_data
from lagcli.engine.core.run import core
from lagcli.engine.core.status import Status
from lagcli.engine.core.structures import Arguments, lag_program, lag_stream
from lagcli.engine.tape.operations import Op

SOLUTIONS = ("densely", "unrolled", "in a loop")
#: lag_model_status.
STATUSES = ("read", "format", "length", "sizes", "index", "program", "outputs", "number", "memory")


def read(data: bytes) -> tuple[str, lag_model, np.ndarray]:
    """Return the status of data that are aligned, the model, and what it points into."""
    memory = np.frombuffer(data + bytes(-len(data) % 8), dtype=np.int64).copy()
    model = lag_model()
    status = parts.lag_read_model(memory.ctypes.data, len(data), byref(model))
    return STATUSES[status], model, memory


@pytest.fixture(scope="module")
def integration() -> Recorded:
    return pendulum()


@pytest.mark.parametrize("solution", SOLUTIONS)
def test_a_run_from_data_is_that_of_the_binding(solution: str) -> None:
    integration = pendulum()
    if solution == "densely":
        integration.core.allow_dense(10**6)
    status, model, memory = read(data_of(integration, solution))
    assert status == "read"
    given, times = Arguments(), np.linspace(0.0, 5.0, 51)
    block = np.empty((51, integration.core.block.shape[1]))
    s = model.settings
    for name in ("t_end", "h_max", "rtol", "alpha", "beta", "watching", "projecting", "refinable"):
        setattr(s, name, integration.given[name])
    s.atol, s.times, s.times_count = given.doubles(integration.given["atol"]), times.ctypes.data, 51
    s.block, s.block_rows = block.ctypes.data, 51
    handle = ctypes.c_void_p()
    assert STATUSES[parts.lag_run_model(None, byref(model), byref(handle))] == "read"
    assert core.lag_start(handle) == Status.RUNNING
    while core.lag_advance(handle, 100) == Status.RUNNING:
        pass
    assert core.lag_take(handle) == 51
    core.lag_destroy(handle)
    assert len(memory)
    if solution == "unrolled":
        expected = integration.core
        expected.start()
        while expected.advance(100) == Status.RUNNING:
            pass
        np.testing.assert_array_equal(block, expected.take())
    length = np.hypot(block[:, 1], block[:, 2])
    np.testing.assert_allclose(length, 1.0, rtol=1e-14)
    energy = 0.5 * (block[:, 3:5] ** 2).sum(axis=1) + 9.81 * block[:, 2]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)


def words(data: bytes) -> np.ndarray:
    return np.frombuffer(data, dtype=np.int64).copy()


@pytest.mark.parametrize(
    ("place", "value", "status"),
    [
        (0, 1, "format"),
        (1, 2, "format"),
        (2, 7, "length"),
        (3, 0, "sizes"),
        (3, 1 << 40, "sizes"),
        (4, -1, "sizes"),
        (5, 3, "sizes"),  # more holonomic constraints than constraints
        (9, 2, "sizes"),  # a rank that B cannot have
        (10, 3, "sizes"),
        (11, 1 << 60, "length"),
        (12, 1, "index"),  # there is one constraint, 0
        (14, 2, "index"),  # the row of an entry of M
    ],
)
def test_damage_is_named(place: int, value: int, status: str, integration: Recorded) -> None:
    data = words(data_of(integration, "unrolled"))
    data[place] = value
    assert read(data.tobytes())[0] == status


def test_a_part_of_a_model_is_rejected(integration: Recorded) -> None:
    data = words(data_of(integration, "in a loop"))
    for length in range(3, len(data)):
        part = data[:length].copy()
        part[2] = length
        assert read(part.tobytes())[0] not in ("read", "memory"), length
    longer = np.append(data, 0)
    longer[2] += 1
    assert read(longer.tobytes())[0] == "length"
    assert read(data.tobytes()[:-4])[0] == "format"


def test_a_start_that_is_not_finite_is_rejected(integration: Recorded) -> None:
    given = integration.given | {"y": np.array([np.nan, 0.0, 0.0, 0.0, 0.0])}
    dynamics = integration.in_use.dynamics
    data = model_data(integration.system, integration.constraint, dynamics, given)
    assert read(data)[0] == "number"


def test_dynamics_without_the_solution_are_no_unrolled_elimination(integration: Recorded) -> None:
    data = words(data_of(integration, "densely"))
    assert data[10] == 0
    data[10] = 1
    assert read(data.tobytes())[0] == "outputs"


def checked(*stream: int) -> bool:
    """Whether a program of 8 registers is valid whose stream this is."""
    given = Arguments()
    end = given.stream([int(Op.END), 0])
    program = lag_program(
        prelude=end,
        main=lag_stream(given.integers(stream), len(stream)),
        inputs=2,
        registers=given.doubles(np.zeros(8)),
        register_count=8,
        outputs=given.integers([7]),
        output_count=1,
    )
    return STATUSES[parts.lag_check_program(byref(program))] == "read"


def test_programs_stay_within_their_registers() -> None:
    end, add, vector, indexed = (int(Op.END), 0), int(Op.ADD), 64, -(2**31)
    assert checked(add, 1, 7, 0, 1, *end)
    assert not checked(add, 1, 8, 0, 1, *end)
    assert not checked(add, 1, 7, -1, 1, *end)
    assert not checked(add, 2, 7, 0, 1, *end)
    assert not checked(add, -1, *end)
    assert not checked(add, 1, 7, 0, 1)  # no end
    assert not checked(99, 1, 7, 0, 1, *end)
    assert not checked(-1, 1, 7, 0, 1, *end)
    assert checked(add + vector, 2, 6, 0, 1, 2, 2, *end)
    assert checked(add + vector, 4, 4, 3, -1, 0, 0, *end)
    assert not checked(add + vector, 2, 7, 0, 1, 2, 2, *end)  # results beyond the last register
    assert not checked(add + vector, 4, 4, 2, -1, 0, 0, *end)  # operands before the first
    assert not checked(add + vector, 2, 6, 0, 1, 2, 2**30, *end)
    assert not checked(add + vector, 0, 6, 0, 1, 2, 2, *end)
    assert not checked(add + vector, 257, 0, 0, 0, 0, 0, *end)
    assert not checked(int(Op.SIN) + vector, 2, 6, 0, 1, *end)  # it has no version for vectors
    assert checked(add + vector, 2, 6, 0, indexed, 5, 1, 0, 1, *end)
    assert not checked(add + vector, 2, 6, 0, indexed, 5, 8, 0, 1, *end)
    assert not checked(add + vector, 2, 6, 0, 1, 0, indexed, 5)
