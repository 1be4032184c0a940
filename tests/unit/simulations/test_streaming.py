"""Samples go through a run in blocks, and nothing depends on where one ends."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from random_cases import some
from trajectories import ARRAYS, assert_same, assert_same_arrays, make

import lagcli
from lagcli.errors import FileError
from lagcli.results import open_writer, read, write
from lagcli.results.csv import writer as csv_writer
from lagcli.results.formats import Writer
from lagcli.results.hdf5 import trajectories
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations import simulation
from lagcli.trajectory.samples import Samples
from lagcli.trajectory.trajectory import Trajectory, joined

MODELS = Path(__file__).parents[3] / "models"


def blocks_of(run: Trajectory, rows: int) -> Iterator[Samples]:
    """Yield the samples of a trajectory in blocks; an empty one if it has none."""
    for start in range(0, max(len(run.time), 1), rows):
        some = slice(start, start + rows)
        yield Samples(
            coordinates=run.coordinates,
            constraints=run.constraints,
            terms=run.terms,
            conserved_names=run.conserved_names,
            outputs={name: values[some] for name, values in run.outputs.items()},
            **{
                name: getattr(run, name)[some]
                for name in ARRAYS
                if name not in ("scale_position", "scale_velocity")
            },
        )


def assert_same_motion(one: Trajectory, other: Trajectory) -> None:
    """Compare everything but the time that it took."""
    assert_same(*(dataclasses.replace(run, seconds={}) for run in (one, other)))


@pytest.fixture
def block_rows(monkeypatch: pytest.MonkeyPatch) -> object:
    """Set how many samples a block holds."""

    def limit(rows: int) -> None:
        monkeypatch.setattr(simulation, "_block_rows", lambda system: rows)

    return limit


# samples and derived columns


@pytest.mark.parametrize("name", ["slider_crank", "rolling_disk", "andrews_squeezer", "four_bar"])
def test_a_run_does_not_depend_on_its_blocks(name: str, block_rows: object) -> None:
    model = lagcli.load(MODELS / f"{name}.yaml")
    options = {"samples": 21, "t_end": 0.1 * model.settings.t_end}
    block_rows(4096)
    whole = lagcli.simulate(model, **options)
    assert len(whole.time) == 21
    # a sample by itself, blocks that end with the run, one before and one behind
    for rows in (1, 7, 20, 21, 22):
        block_rows(rows)
        assert_same_motion(lagcli.simulate(model, **options), whole)


def test_blocks_are_full_except_for_the_last(block_rows: object) -> None:
    block_rows(8)
    model = lagcli.load(MODELS / "pendulum_cartesian.yaml")
    ready = simulation.prepare(model, SettingsOverrides(samples=21, t_end=0.5))
    taken: list[Samples] = []
    record = ready.run(taken.append)
    assert record.status == "completed"
    assert [len(block.time) for block in taken] == [8, 8, 5]
    np.testing.assert_array_equal(joined(taken).time, np.linspace(0, 0.5, 21))


@pytest.mark.parametrize("through", [False, True])
def test_a_singular_configuration_in_the_second_block(through: bool, block_rows: object) -> None:
    model = lagcli.load(MODELS / "parallelogram.yaml", set_initial={"alpha_1'": "6"})
    options = {"samples": 401, "t_end": 0.7, "through_singular": through}
    block_rows(4096)
    whole = lagcli.simulate(model, **options)
    assert whole.status == ("completed" if through else "failed")
    stop = len(whole.time)
    assert stop == 401 if through else 20 < stop < 401
    for rows in (stop // 2 + 1, stop - 1, stop, 3):
        block_rows(rows)
        assert_same_motion(lagcli.simulate(model, **options), whole)


def test_a_value_that_is_not_finite_in_the_second_block(block_rows: object) -> None:
    model = lagcli.load_text("""
coordinates: [x]
T: x'^2/2
V: 2*x - sqrt(x)
initial: {x: 1, x': -3}
""")
    options = {"samples": 401, "t_end": 4}
    whole = lagcli.simulate(model, **options)
    assert whole.status == "failed"
    assert "`sqrt(x)`" in whole.message
    stop = len(whole.time)
    assert stop > 10
    for rows in (stop - 3, stop, stop + 1):
        block_rows(rows)
        assert_same_motion(lagcli.simulate(model, **options), whole)


def test_exceptions_of_the_sink_propagate(block_rows: object) -> None:
    block_rows(8)
    model = lagcli.load(MODELS / "pendulum_cartesian.yaml")
    ready = simulation.prepare(model, SettingsOverrides())
    taken = []

    def full(samples: Samples) -> None:
        taken.append(samples)
        if len(taken) == 3:
            raise FileError("the disk is full")

    with pytest.raises(FileError, match="the disk is full"):
        ready.run(full)
    assert len(taken) == 3


def test_no_sample_is_one_empty_block() -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml")
    run = lagcli.simulate(model, times=(2.0,), max_steps=1)
    assert run.status == "failed"
    assert run.time.shape == (0,)
    assert run.constraint_force_by.shape == (0, 2)
    assert list(run.outputs) == ["slider", "rod_tension"]


# writers

SHAPES = {
    "a run": {},
    "no constraint": {"constraints": ()},
    "no coordinate": {"coordinates": ()},
    "no output": {"outputs": ()},
    "no sample": {"nt": 0},
    "one sample": {"nt": 1},
}


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> object:
    """Let fewer bytes wait, so that a small run takes the way of a large one."""
    return lambda size: monkeypatch.setattr(trajectories, "_HELD", size)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("suffix", [".h5", ".csv"])
@pytest.mark.parametrize("rows", some([7, 30, 1, 29, 31], 2))
def test_a_run_in_blocks_comes_back(
    tmp_path: Path, held: object, shape: str, suffix: str, rows: int
) -> None:
    run = make(**{"nt": 30, **SHAPES[shape]})
    for size in (0, 3000, 1 << 23) if suffix == ".h5" else (0,):
        held(size)
        path = tmp_path / f"run{size}{suffix}"
        with open_writer(path, meta=True) as writer:
            for block in blocks_of(run, rows):
                writer.append(block)
            assert not path.exists()
            writer.finish(run)
        assert_same(run, read(path))


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_a_short_run_in_blocks_is_the_file_of_one_in_one_piece(tmp_path: Path, suffix: str) -> None:
    run = make(200)
    write(run, tmp_path / f"whole{suffix}")
    with open_writer(tmp_path / f"blocks{suffix}") as writer:
        for block in blocks_of(run, 30):
            writer.append(block)
        writer.finish(run)
    whole, blocks = ((tmp_path / f"{n}{suffix}").read_bytes() for n in ("whole", "blocks"))
    assert whole == blocks


def test_a_long_run_opens_in_other_programs(tmp_path: Path, held: object) -> None:
    held(10_000)
    run = make(1000)
    with open_writer(tmp_path / "run.h5") as writer:
        for block in blocks_of(run, 64):
            writer.append(block)
        writer.finish(run)
    with xr.open_dataset(tmp_path / "run.h5", engine="h5netcdf") as data:
        sizes = {"time": 1000, "coordinate": 2, "constraint": 1, "term": 2}
        assert dict(data.sizes) == {**sizes, "conserved_quantity": 1}
        assert data["constraint_force_by"].dims == ("time", "term")
        np.testing.assert_array_equal(data["constraint_force"], run.constraint_force)
        np.testing.assert_array_equal(data["time"], run.time)
    with h5py.File(tmp_path / "run.h5") as root:
        assert root["q"].chunks is not None
        assert root["q"].attrs["units"] == b"rad"


def test_columns_of_zeros_take_no_space_in_a_long_run(tmp_path: Path, held: object) -> None:
    held(10_000)
    run = make(20_000, power_applied=np.zeros(20_000))
    with open_writer(tmp_path / "run.h5") as writer:
        for block in blocks_of(run, 1000):
            writer.append(block)
        writer.finish(run)
    with h5py.File(tmp_path / "run.h5") as root:
        assert root["power_applied"].id.get_storage_size() < 10_000
        assert root["power_constraint"].id.get_storage_size() >= 160_000
    assert_same(run, read(tmp_path / "run.h5"))


@pytest.fixture(params=[".h5", ".csv"])
def writer(request: pytest.FixtureRequest, tmp_path: Path, held: object) -> Writer:
    held(0)
    return open_writer(tmp_path / f"run{request.param}", meta=True)  # type: ignore[return-value]


@pytest.mark.parametrize("blocks", [0, 1, 5])
def test_a_run_that_is_not_finished_leaves_nothing(
    tmp_path: Path, writer: AbstractContextManager[Writer], blocks: int
) -> None:
    with writer as opened:
        for block in list(blocks_of(make(), 1))[:blocks]:
            opened.append(block)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("error", [FileError("why"), KeyboardInterrupt(), OSError(28, "full")])
def test_an_error_between_the_blocks_leaves_nothing(
    tmp_path: Path, writer: AbstractContextManager[Writer], error: BaseException
) -> None:
    def fail() -> None:
        with writer as opened:
            for block in blocks_of(make(), 1):
                opened.append(block)
            raise error

    with pytest.raises(FileError if isinstance(error, OSError) else type(error)):
        fail()
    assert os.listdir(tmp_path) == []


def test_csv_pieces_are_whole_lines(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    run = make(50)
    write(run, tmp_path / "one.csv")
    monkeypatch.setattr(csv_writer, "_NUMBERS_WRITTEN", 100)
    write(run, tmp_path / "other.csv")
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "other.csv").read_bytes()


def test_reading_some_columns_piece_by_piece(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from lagcli.results.csv import reader
    from lagcli.results.formats import open_reader

    monkeypatch.setattr(trajectories, "_SLAB", 80)
    monkeypatch.setattr(reader, "_NUMBERS_READ", 170)
    run = make(50)
    for suffix in (".h5", ".csv"):
        path = tmp_path / f"run{suffix}"
        write(run, path, meta=True)
        with open_reader(path) as file:
            assert (file.coordinates, file.outputs) == (run.coordinates, tuple(run.outputs))
            assert file.record.status == run.status
            pieces = list(file.columns(("time", "multipliers")))
        assert len(pieces) > 3
        for name in ("time", "multipliers"):
            found = np.concatenate([piece[name] for piece in pieces])
            np.testing.assert_array_equal(found, getattr(run, name))


def test_a_trajectory_is_its_blocks() -> None:
    run = make(30)
    back = joined(list(blocks_of(run, 7)))
    assert_same_arrays(run, dataclasses.replace(run, **vars(back)))
