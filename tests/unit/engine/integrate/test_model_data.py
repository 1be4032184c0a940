"""Models as data: a C program simulates them as lagcli does, and damaged data are rejected."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from ctypes import byref, c_int, c_int64, c_void_p
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from core_parts import parts
from core_runs import MODELS, data_of, prepared
from two_routes import by_simulate

import lagcli
from lagcli.engine.contract import Stop
from lagcli.engine.core.library import LIBRARY
from lagcli.engine.core.run import core
from lagcli.engine.core.status import Status
from lagcli.engine.core.structures import Arguments, lag_model, lag_program, lag_report, lag_stream
from lagcli.engine.event_entries import OCCURRENCES
from lagcli.engine.integrate import prepared as preparation
from lagcli.engine.integrate import run
from lagcli.engine.integrate.model_data import model_data
from lagcli.engine.tape.operations import Op
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import Simulation, prepare

#: lag_model_status.
STATUSES = (
    *("read", "format", "length", "sizes", "index", "program", "outputs", "number", "method"),
    "memory",
)
FOUND = Path(__file__).parents[3] / "found"
PROGRAM = Path(__file__).parents[1] / "core" / "simulate.c"
COMPILER = os.environ.get("CC", "cc").split()

Numbers = np.ndarray[Any, np.dtype[np.float64]]


class Run(NamedTuple):
    """Where a simulation has ended: its samples, λ in the order of the constraints, and its log."""

    status: int
    event: int
    samples: Numbers
    log: Numbers


@pytest.fixture(scope="module")
def simulate(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Run]:
    """Simulate data by a C program that knows the public header alone."""
    if shutil.which(COMPILER[0]) is None:
        pytest.skip(f"no C compiler: {COMPILER[0]}")
    folder = tmp_path_factory.mktemp("simulate")
    made, file = folder / "simulate", folder / "model"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1"]
    # no header but the public ones, and what they include
    for name in ("lagmodel.h", "lagcore.h", "settings.h", "tables.h"):
        shutil.copy(LIBRARY.parent / name, folder)
    subprocess.run(
        [*COMPILER, *flags, f"-I{folder}", PROGRAM, LIBRARY, "-lm", "-o", made], check=True
    )

    def run(data: bytes, method: str, rows: int = 0, saved_at: int = 0) -> Run:
        file.write_bytes(data)
        done = subprocess.run(
            [made, file, method, str(rows), str(saved_at)],
            capture_output=True,
            text=True,
            env={**os.environ, "LD_LIBRARY_PATH": str(LIBRARY.parent)},
        )
        assert done.returncode == 0, done.stderr
        lines = iter(done.stdout.splitlines())
        status, event = map(int, next(lines).split())
        return Run(status, event, _table(lines), _table(lines))

    return run


def _table(lines: Any) -> Numbers:
    count, width = map(int, next(lines).split())
    rows = [[float.fromhex(x) for x in next(lines).split()] for _ in range(count)]
    return np.array(rows).reshape(count, width)


def expected(simulation: Simulation) -> Run:
    """Return a simulation by lagcli."""
    run = by_simulate(simulation)
    assert run.completed
    return Run(Status.DONE, run.event, run.samples, run.log)


def check_equal(found: Run, simulation: Simulation) -> None:
    """Compare a run with lagcli's bit by bit."""
    wanted = expected(simulation)
    assert (found.status, found.event) == (wanted.status, wanted.event)
    np.testing.assert_array_equal(found.samples, wanted.samples)
    if len(wanted.log) or len(found.log):
        np.testing.assert_array_equal(found.log, wanted.log)
    # zeros have signs
    assert np.ascontiguousarray(found.samples).tobytes() == wanted.samples.tobytes()


def check_method(simulate: Callable[..., Run], name: str, method: str) -> None:
    simulation = prepared(name, method=method)
    data = model_data(simulation.system, simulation.request, (method,))
    check_equal(simulate(data, method), simulation)


@pytest.mark.bits
@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("contact/woodpecker", "Taylor"),
        ("contact/slider_crank_friction", "DOP853"),
        ("contact/stick_slip_belt", "Radau"),  # kinetic friction below static one
        ("contact/clutch", "Rodas5P"),  # events that engage and release
        ("contact/sampled_pendulum", "DOP853"),  # a clock, and an action
        ("contact/particle_on_sphere", "Radau"),  # an event that ends the run
        ("car_on_road", "Taylor"),  # tables
        ("parallelogram", "Radau"),  # redundant constraints
        ("slider_crank", "Rodas5P"),
    ],
)
def test_a_c_program_simulates_a_model_as_lagcli_does(
    name: str, method: str, simulate: Callable[..., Run]
) -> None:
    check_method(simulate, name, method)


@pytest.mark.bits
@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Radau"])
@pytest.mark.parametrize("short", [1000, 0], ids=["unrolled", "in a loop"])
def test_redundant_constraints_that_an_elimination_leaves_out(
    short: int, method: str, simulate: Callable[..., Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "LEAST_LEFT_OUT", 0)
    monkeypatch.setattr(preparation, "SHORT", short)
    simulation = prepared("parallelogram", method=method, samples=11)
    data = model_data(simulation.system, simulation.request, (method,))
    assert lag_model_of(data).contents & (2 | 4)
    check_equal(simulate(data, method), simulation)


@pytest.mark.bits
@pytest.mark.parametrize("most", [10**6, 0], ids=["unrolled later", "in a loop"])
def test_a_long_elimination_is_run_in_a_loop_first(
    most: int, simulate: Callable[..., Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As those of large models, which are unrolled after 2,500 steps, or never."""
    monkeypatch.setattr(preparation, "SHORT", 0)
    monkeypatch.setattr(preparation, "MOST_UNROLLED", most)
    simulation = prepared("double_pendulum_cartesian", method="DOP853", t_end=110.0, samples=11)
    data = model_data(simulation.system, simulation.request, ("DOP853",))
    assert lag_model_of(data).contents == (1 | 2 | (4 if most else 0))
    check_equal(simulate(data, "DOP853"), simulation)


@pytest.mark.parametrize(
    ("name", "method", "steps"),
    [
        ("contact/woodpecker", "DOP853", 100),
        ("contact/stick_slip_belt", "DOP853", 60),
        ("contact/sampled_pendulum", "Taylor", 40),
        ("contact/clutch", "DOP853", 10),
        ("contact/bouncing_ball", "Radau", 40),
    ],
)
def test_a_run_that_goes_back_is_the_one_that_does_not(
    name: str, method: str, steps: int, simulate: Callable[..., Run]
) -> None:
    data = data_of(name, (method,))
    plain, back = simulate(data, method), simulate(data, method, saved_at=steps)
    assert len(plain.log) > 3
    for found, wanted in zip(back, plain, strict=True):
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize(
    ("name", "method", "steps"),
    [
        ("contact/slider_crank_friction", "Radau", 1),
        ("parallelogram", "Rodas5P", 3),
        ("car_on_road", "DOP853", 10),
    ],
)
def test_a_run_that_goes_back_releases_what_it_needs_for_rounding_errors(
    name: str, method: str, steps: int, simulate: Callable[..., Run]
) -> None:
    """The program fails where an allocation is not released."""
    assert simulate(data_of(name, (method,)), method, saved_at=steps).status == Status.DONE


def test_a_small_block_is_taken_again_and_again(simulate: Callable[..., Run]) -> None:
    data = data_of("contact/bouncing_ball", ("DOP853",))
    for found, wanted in zip(
        simulate(data, "DOP853", rows=3), simulate(data, "DOP853"), strict=True
    ):
        np.testing.assert_array_equal(found, wanted)


# what is read


def read(data: bytes) -> tuple[str, lag_model, Any]:
    """Return the status of data that are aligned, the model, and what it points into."""
    memory = np.frombuffer(data + bytes(-len(data) % 8), dtype=np.int64).copy()
    model = lag_model()
    status = parts.lag_read_model(None, memory.ctypes.data, len(data), byref(model))
    return STATUSES[status], model, memory


def lag_model_of(data: bytes) -> lag_model:
    """Return a model that is read."""
    status, model, memory = read(data)
    assert status == "read"
    model.memory = memory
    return model


class Simulated:
    """A simulation by the library of the binding, with a block of samples."""

    def __init__(self, data: bytes, method: str, **settings: float):
        self.model = lag_model_of(data)
        problem = self.model.problem
        for name, value in settings.items():
            setattr(problem if hasattr(problem, name) else problem.settings, name, value)
        e = self.model.equations
        self.block = np.empty((max(problem.times_count, 1), 2 + 3 * e.nq + e.nc + problem.extra))
        problem.block, problem.block_rows = self.block.ctypes.data, len(self.block)
        self.handle = c_void_p()
        self.status = STATUSES[
            core.lag_make_simulation(None, byref(self.model), method.encode(), byref(self.handle))
        ]

    def run(self, steps: int = 10**6) -> Status:
        return Status(core.lag_simulate(self.handle, steps))

    def log(self) -> list[tuple[float, str]]:
        """Return the times and the kinds of entries."""
        count, width = c_int64(), c_int()
        rows = parts.lag_log_of(self.handle, byref(count), byref(width))
        numbers = np.ctypeslib.as_array(
            (np.ctypeslib.ctypes.c_double * (count.value * width.value)).from_address(rows.value)
        ).reshape(count.value, width.value)
        return [(row[0], OCCURRENCES[int(row[1])]) for row in numbers]

    @property
    def t(self) -> float:
        report = lag_report()
        core.lag_report_of(core.lag_run_of(self.handle), byref(report))
        return float(report.t)

    def __del__(self) -> None:
        if self.handle:
            core.lag_destroy_simulation(self.handle)
        parts.lag_release_model(byref(self.model))


def test_the_caller_may_change_settings() -> None:
    made = Simulated(data_of("contact/bouncing_ball", ("DOP853",)), "DOP853", t_end=0.5)
    assert made.status == "read"
    assert made.run(3) == Status.RUNNING
    assert made.run() == Status.DONE
    assert made.t == 0.5
    assert [what for _, what in made.log()] == ["impact"]


@pytest.mark.parametrize(
    ("method", "settings", "status"),
    [
        ("DOP853", {"rtol": -1.0}, "number"),
        ("DOP853", {"t_end": -1.0}, "number"),
        ("DOP853", {"max_step": 0.0}, "number"),
        ("DOP853", {"t_end": np.inf}, "number"),
        ("DOP853", {"t": np.nan}, "number"),
        ("DOP853", {"rtol": np.nan}, "number"),
        ("DOP853", {"alpha": -1.0}, "number"),
        ("DOP853", {"beta": -1.0}, "number"),
        ("DOP853", {"closed": -1e-9}, "number"),
        ("DOP853", {"alpha": np.nan, "beta": 2.0}, "read"),  # alpha from the step
        ("DOP853", {"extra": 1}, "number"),
        ("Euler", {}, "method"),
        ("Taylor", {}, "method"),  # not among the methods that the data were written for
        ("Radau", {}, "method"),
    ],
)
def test_settings_and_methods_that_cannot_be_used_are_rejected(
    method: str, settings: dict[str, float], status: str
) -> None:
    assert Simulated(data_of("slider_crank", ("DOP853",)), method, **settings).status == status


def test_a_clock_must_have_a_period_beyond_rounding() -> None:
    data = data_of("contact/sampled_pendulum", ("DOP853",))
    made = Simulated(data, "DOP853")
    assert made.status == "read"
    ticks = np.ctypeslib.as_array(
        (np.ctypeslib.ctypes.c_double * 3).from_address(made.model.rules.ticks.value)
    )
    ticks[1] = 1e-18
    handle = c_void_p()
    assert made.model.problem.block_rows
    status = core.lag_make_simulation(None, byref(made.model), b"DOP853", byref(handle))
    assert STATUSES[status] == "number"


@pytest.mark.parametrize("method", ["auto", "DOP853"])
def test_a_singular_start_has_no_data(method: str) -> None:
    """Whoever runs the data elsewhere takes its rank for that of all starts."""
    model = lagcli.load(FOUND / "rod_half_turn.yaml")
    simulation = prepare(model, SettingsOverrides(method=method))
    with pytest.raises(Stop, match="the start is a singular configuration") as stop:
        model_data(simulation.system, simulation.request, ("DOP853",))
    assert str(stop.value) == by_simulate(simulation).why


def test_values_that_contradict_the_constraints_end_the_run(tmp_path: Path) -> None:
    text = (MODELS / "pendulum_cartesian.yaml").read_text("utf-8")
    text += "events:\n  far: {when: t >= 0.5, set: {x: 3}}\n"
    file = tmp_path / "far.yaml"
    file.write_text(text, "utf-8")
    simulation = prepare(lagcli.load(file))
    made = Simulated(model_data(simulation.system, simulation.request, ("DOP853",)), "DOP853")
    assert made.run() == Status.CONFLICT
    assert made.run() == Status.CONFLICT
    assert made.t == pytest.approx(0.5)


def test_the_caller_may_answer_a_status() -> None:
    """It is returned, and the simulation goes on; otherwise the core does what is to be done."""
    data = data_of("contact/clutch", ("DOP853",))
    made, without = Simulated(data, "DOP853"), Simulated(data, "DOP853")
    core.lag_let_answer(made.handle, 1 << Status.HAPPENED | 1 << Status.RESOLVED)
    assert made.run() == Status.HAPPENED
    t = made.t
    assert made.run() == Status.RESOLVED
    assert (made.t, made.run(1)) == (t, Status.RUNNING)
    assert made.t > t
    count, width = c_int64(), c_int()
    parts.lag_log_of(made.handle, byref(count), byref(width))
    assert count.value == 0  # whoever performs the actions has the log
    assert without.run() == Status.DONE
    assert (t, "event") in without.log()


def test_a_simulation_begins_again_from_where_it_is() -> None:
    made = Simulated(data_of("pendulum_cartesian", ("DOP853",)), "DOP853")
    assert made.run(5) == Status.RUNNING
    t, taken = made.t, core.lag_take(core.lag_run_of(made.handle))
    core.lag_begin_again_here(made.handle)
    assert made.run(0) == Status.RUNNING
    assert made.t == t > 0.0
    assert made.run() == Status.DONE
    assert taken + core.lag_take(core.lag_run_of(made.handle)) == len(made.block)


# what is damaged


def words(data: bytes) -> Any:
    return np.frombuffer(data, dtype=np.int64).copy()


@pytest.fixture(scope="module")
def ball() -> bytes:
    return data_of("contact/bouncing_ball")


@pytest.mark.parametrize(
    ("place", "value", "status"),
    [
        (0, 1, "format"),
        (1, 1, "format"),
        (2, 7, "length"),
        (3, 1024, "index"),
        (3, 128, "sizes"),  # of derivatives
        (3, 256 + 1, "sizes"),  # a recursive form that is not unrolled
        (3, 64, "sizes"),  # no dynamics
        (4, -1, "sizes"),
        (5, 0, "sizes"),
        (5, 1 << 40, "sizes"),
        (6, -1, "sizes"),
        (7, 3, "sizes"),  # more holonomic constraints than constraints
        (9, 1 << 60, "length"),
    ],
)
def test_damage_is_named(place: int, value: int, status: str, ball: bytes) -> None:
    data = words(ball)
    data[place] = value
    assert read(data.tobytes())[0] == status


def test_a_part_of_a_model_is_rejected(ball: bytes) -> None:
    data = words(ball)
    for length in range(3, len(data), 3):
        part = data[:length].copy()
        part[2] = length
        assert read(part.tobytes())[0] not in ("read", "memory"), length
    longer = np.append(data, 0)
    longer[2] += 1
    assert read(longer.tobytes())[0] == "length"
    assert read(data.tobytes()[:-4])[0] == "format"


def test_a_start_that_is_not_finite_is_rejected() -> None:
    simulation = prepared("slider_crank")
    request = simulation.request
    data = words(model_data(simulation.system, request, ("DOP853",)))
    start = np.array([request.state.q[0]]).view(np.int64)[0]
    [place] = np.flatnonzero(data == start)[:1]
    data[place] = np.array([np.nan]).view(np.int64)[0]
    assert read(data.tobytes())[0] == "number"


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
