"""Curves of vectors, of their components, and of families with two indices, in all formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.pictures.curves import Catalogue
from lagcli.pictures.plots.run_plot import asked
from lagcli.pictures.run_file import RunFile

MODEL = """
coordinates: {r: point, q[1..2]: point, u[1..2, 1..2]: m}
parameters: {m: 1 kg}
T: >
  m/2*dot(r', r') + sum(m/2*dot(q[i]', q[i]') + sum(m/2*u[i,j]'^2, j = 1..2), i = 1..2)
constraints:
  pin: r = q[1]
  tie[i = 1..2]: u[i,1] = u[i,2]
initial: {r: 0, q[1..2]: 0, u[1..2, 1..2]: 0, r': 1, q[1..2]': [1, 1, 1], u[1..2, 1..2]': 1}
simulation: {t_end: 1, samples: 3}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("vectors")
    model = lagcli.load_text(MODEL.replace("r': 1", "r': [1, 1, 1]"))
    run = lagcli.simulate(model)
    for name in ("run.h5", "run.csv"):
        lagcli.write(run, path / name)
    return path


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("r", ["r.x", "r.y", "r.z"]),
        ("r'", ["r.x_dot", "r.y_dot", "r.z_dot"]),
        ("r.x", ["r.x"]),
        ("q[1]", ["q[1].x", "q[1].y", "q[1].z"]),
        ("lambda.pin", ["lambda.pin.x", "lambda.pin.y", "lambda.pin.z"]),
        ("Qc.r", ["Qc.r.x", "Qc.r.y", "Qc.r.z"]),
        ("u", ["u[1,1]", "u[1,2]", "u[2,1]", "u[2,2]"]),
        ("u[2,1]'", ["u[2,1]_dot"]),
    ],
)
def test_names_of_vectors_are_their_components(folder: Path, name: str, found: list[str]) -> None:
    curves = Catalogue(RunFile(str(folder / "run.h5"))).find(name)
    assert [curve.name for curve in curves] == found


def test_commas_in_brackets_join_nothing(folder: Path) -> None:
    catalogue = Catalogue(RunFile(str(folder / "run.h5")))
    (panel,) = asked(catalogue, ["u[1,2],r.x"])
    assert [curve.name for curve in panel.curves] == ["u[1,2]", "r.x"]


def test_files_keep_the_names(folder: Path) -> None:
    one, two = (lagcli.read(folder / name) for name in ("run.h5", "run.csv"))
    assert one.coordinates == two.coordinates
    assert one.constraints == two.constraints
    assert "u[2,1]" in one.coordinates
    assert "pin.x" in one.constraints
    assert np.array_equal(one.multipliers, two.multipliers)
    assert np.array_equal(one.constraint_force_of("pin.x"), two.constraint_force_of("pin.x"))
