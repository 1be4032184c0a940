"""What `info` tells of a file."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import signal
from pathlib import Path

import numpy as np
import pytest
from trajectories import make

from lagcli.errors import FileError, UsageError
from lagcli.prose import counted
from lagcli.results import read, write
from lagcli.results.info import describe, format_info
from lagcli.trajectory.trajectory import Trajectory


def _run() -> Trajectory:
    """Return three samples with numbers to calculate by hand."""
    return make(
        3,
        constraints=("guide", "knife"),
        tolerances={"phi": 1e-9},
        warnings=("the energy balance has an error",),
        time=np.array([1.0, 1.5, 2.0]),
        multipliers=np.array([[1.0, np.nan], [-4.0, np.nan], [2.5, np.nan]]),
        residual_position=np.array([[1e-12, np.nan], [-4e-12, np.nan], [0.0, np.nan]]),
        scale_position=np.array([2.0, np.nan]),
        residual_velocity=np.array([[0.0, 3.0], [0.0, -6.0], [0.0, 1.0]]),
        scale_velocity=np.array([0.0, 3.0]),
        residual_equation=np.array([1e-10, 3e-10, 2e-10]),
        energy_kinetic=np.array([1.0, 2.0, 0.5]),
        energy_potential=np.array([-2.0, -3.0, -1.0]),
        energy_total=np.array([-1.0, -1.0, -0.5]),
        energy_balance=np.array([0.0, -1e-9, 5e-10]),
        conserved=np.array([[2.0, 5.0], [2.0 + 1e-9, 5.0], [2.0 - 3e-9, 5.0]]),
        conserved_names=("p_phi", "J_1"),
        conserved_formulas={"p_phi": "p_phi", "J_1": "p_phi + p_psi"},
    )


def test_everything_of_hdf5(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    run = _run()
    write(run, path)
    found = describe(path)
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert found == {
        "path": str(path),
        "format": "hdf5",
        "bytes": path.stat().st_size,
        "kind": "trajectory",
        "schema_version": "3",
        "lagcli_version": "0.1.0",
        "sign_convention": found["sign_convention"],
        "status": "completed",
        "message": "reached t_end",
        "model_name": "slider-crank",
        "model_sha256": run.model_sha256,
        "sizes": {"samples": 3, "coordinates": 2, "constraints": 2, "outputs": 2},
        "coordinates": ["phi", "psi"],
        "constraints": ["guide", "knife"],
        "outputs": ["rod_force", "a_first"],
        "inputs": {},
        "sensitivity": [],
        "units": run.units,
        "time": {"first": 1.0, "last": 2.0},
        "parameters": run.parameters,
        "given": {},
        "options": run.options,
        "counts": run.counts,
        "seconds": run.seconds,
        "initial_correction": {"psi": [0.1, 0.16057], "psi_dot": [0.0, 2.9]},
        "freedom": {},
        "events": None,
        "impulses": {},
        "tolerances": {"phi": 1e-9},
        "warnings": ["the energy balance has an error"],
        "residual_position": {
            "guide": {"max": 4e-12, "scaled": 2e-12},
            "knife": {"max": None, "scaled": None},
        },
        "residual_velocity": {
            "guide": {"max": 0.0, "scaled": 0.0},
            "knife": {"max": 6.0, "scaled": 2.0},
        },
        "residual_equation": 3e-10,
        "energy_balance": {"max": 1e-9, "relative": 1e-9 / 2.0},
        "conserved": {
            "p_phi": {"formula": "p_phi", "first": 2.0, "drift": pytest.approx(3e-9)},
            "J_1": {"formula": "p_phi + p_psi", "first": 5.0, "drift": 0.0},
        },
        "multipliers": {
            "guide": {"min": -4.0, "time_min": 1.5, "max": 2.5, "time_max": 2.0},
            "knife": {"min": None, "time_min": None, "max": None, "time_max": None},
        },
    }


def test_csv_with_its_sidecar_gives_the_same(tmp_path: Path) -> None:
    write(_run(), tmp_path / "run.h5")
    write(_run(), tmp_path / "run.csv", meta=True)
    one, other = describe(tmp_path / "run.h5"), describe(tmp_path / "run.csv")
    differ = {name for name in one if one[name] != other[name]}
    assert differ == {"path", "format", "bytes"}


def test_csv_alone_tells_what_the_numbers_say(tmp_path: Path) -> None:
    write(_run(), tmp_path / "run.csv")
    found = describe(tmp_path / "run.csv")
    assert (found["status"], found["model_name"], found["parameters"]) == ("", None, {})
    assert found["multipliers"]["guide"]["min"] == -4.0
    assert found["residual_position"]["guide"] == {"max": 4e-12, "scaled": None}
    assert "not recorded" in format_info(found)


@pytest.mark.parametrize("size", [{"nt": 0}, {"nt": 1}, {"constraints": ()}, {"coordinates": ()}])
def test_odd_sizes(tmp_path: Path, size: dict[str, object]) -> None:
    write(make(**size), tmp_path / "run.h5")  # type: ignore[arg-type]
    found = describe(tmp_path / "run.h5")
    json.dumps(found, allow_nan=False)
    assert counted(found["sizes"]["samples"], "sample") in format_info(found)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("name: pendulum\n", "pendulum"),
        ("# model\nname:  'two words'  # so\r\nT: 0\n", "two words"),
        ('name: "quoted"\n', "quoted"),
        ("coordinates: [x]\n  name: nested\n", None),
        ("name:\n", None),
        ("", None),
    ],
)
def test_the_name_of_the_model(tmp_path: Path, text: str, name: str | None) -> None:
    write(make(model=text), tmp_path / "run.h5")
    assert describe(tmp_path / "run.h5")["model_name"] == name


def test_the_text(tmp_path: Path) -> None:
    write(_run(), tmp_path / "run.h5")
    text = format_info({**describe(tmp_path / "run.h5"), "path": "run.h5", "bytes": 20107})
    assert text == (
        """\
file                run.h5: trajectory, HDF5, 20.1 kB, lagcli 0.1.0, layout 3
status              completed
message             reached t_end
warning             the energy balance has an error
model               slider-crank (sha256 59357d64d278…)
time                1 to 2 s, 3 samples
coordinates         phi [rad], psi [rad]
constraints         guide, knife
outputs             rod_force [N], a_first
parameters          m = 1 kg, r = 0.1, tau = -0
options             rtol = 1e-09, method = dop853, times = [0.5, 1.0], events = -
atol at end         phi = 1e-09
counts              steps = 120, rejected = 3, evaluations = 1443
seconds             derive = 0.014, integrate = 0.002
start adjusted      psi 0.1 -> 0.16057, psi_dot 0 -> 2.9
energy balance      1e-09 J at worst
  relative          5e-10
equation residual   3e-10 at worst
conserved           J_1 = p_phi + p_psi

conserved quantity          first          drift
p_phi                           2          3e-09
J_1                             5              0

constraint residual       position         scaled       velocity         scaled
guide                        4e-12          2e-12              0              0
knife                            -              -              6              2

multiplier: min … max
guide  -4 (1.5 s) … 2.5 (2 s)
knife  -"""
    )


def test_the_text_is_narrow_and_harmless_whatever_the_names(tmp_path: Path) -> None:
    long = tuple(f"{'x' * 70}{i}" for i in range(40))
    run = make(
        4,
        coordinates=long,
        constraints=long,
        outputs=long,
        message="word " * 60 + "\x1b[31m" + "y" * 300,
        parameters=dict.fromkeys(long, 1.0),
        multipliers=np.full((4, 40), -1.2345678e-300),
    )
    write(run, tmp_path / f"{'long' * 50}.h5")
    text = format_info(describe(tmp_path / f"{'long' * 50}.h5"))
    assert max(map(len, text.split("\n"))) <= 100
    assert "\x1b" not in text
    assert re.search(r"^x+…?\d*  min -1.23457e-300 ", text, re.MULTILINE)


@pytest.mark.parametrize("name", ["run.txt", "run", "-"])
def test_an_unknown_suffix_is_a_usage_error(name: str) -> None:
    for action in (describe, read):
        with pytest.raises(UsageError, match=r"standard input|\.h5 .*\.csv"):
            action(name)
    if name != "-":
        with pytest.raises(UsageError, match=r"run\.h5 .*run\.csv"):
            write(make(), name)


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_a_missing_file_is_reported(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(FileError, match="no such file"):
        describe(tmp_path / f"run{suffix}")


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_a_message_with_an_odd_file_name_loses_no_run(tmp_path: Path, suffix: str) -> None:
    name = os.fsdecode(b"a\xff.csv")
    run = make(message=f"cannot read {name}\0", options={"input": Path(name)})
    write(run, tmp_path / f"run{suffix}", meta=True)
    back = read(tmp_path / f"run{suffix}")
    assert back.message == "cannot read a?.csv�"
    assert back.options == {"input": "a?.csv"}


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_a_pipe_is_rejected_at_once(tmp_path: Path, suffix: str) -> None:
    def too_late(*args: object) -> None:
        raise TimeoutError

    os.mkfifo(tmp_path / f"run{suffix}")
    before = signal.signal(signal.SIGALRM, too_late)
    signal.alarm(5)
    try:
        with pytest.raises(FileError, match="not a regular file"):
            describe(tmp_path / f"run{suffix}")
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def test_a_failed_run_is_reported(tmp_path: Path) -> None:
    run = dataclasses.replace(_run(), status="failed", message="singular at t = 2 s")
    write(run, tmp_path / "run.hdf5")
    text = format_info(describe(tmp_path / "run.hdf5"))
    assert "status              failed" in text
    assert "singular at t = 2 s" in text
