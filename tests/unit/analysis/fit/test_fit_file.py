"""Fit files hold all of a result."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import h5py
import numpy as np
import pytest

import lagcli
from lagcli.analysis.fit.file import read_fit, write_fit
from lagcli.analysis.fit.result import FitResult, format_fit
from lagcli.errors import FileError, UsageError
from lagcli.results.hdf5.seal import seal

MODEL = """
coordinates: {x: m}
parameters: {m: {value: 1, unit: kg}, k: 10}
T: m*x'^2/2
V: k*x^2/2
initial: {x: 0.1, x': 0}
fit:
  data: {file: run.csv}
  observe: {x: {sigma: 0.001}}
  parameters: {m: {min: 0.1}, k: {max: 50}, x: }
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> FitResult:
    """The fit of a model of which only k/m is identified."""
    folder = tmp_path_factory.mktemp("fit")
    times = np.linspace(0, 2, 41)
    x = 0.1 * np.cos(np.sqrt(12) * times) + 0.001 * np.random.default_rng(2).normal(size=41)
    lines = [f"{t},{y}" for t, y in zip(times, x, strict=True)]
    lines[3] = lines[3].partition(",")[0] + ","
    (folder / "run.csv").write_text("t,x\n" + "\n".join(lines) + "\n")
    return lagcli.fit(lagcli.load_text(MODEL, str(folder / "model.yaml")), starts=2)


def test_lagcli_writes_a_fit_too(tmp_path: Path, result: FitResult) -> None:
    path = tmp_path / "fit.h5"
    lagcli.write(result, path)
    assert read_fit(path).values.tolist() == result.values.tolist()
    for write in (write_fit, lagcli.write):
        with pytest.raises(UsageError, match=r"a fit is written as HDF5; name it fit\.h5"):
            write(result, tmp_path / "fit.json")


def test_a_file_reads_as_it_was_written(tmp_path: Path, result: FitResult) -> None:
    path = tmp_path / "fit.h5"
    write_fit(result, path)
    found = read_fit(path)
    for field in fields(FitResult):
        before, after = getattr(result, field.name), getattr(found, field.name)
        if field.name == "data":
            for a, b in zip(before, after, strict=True):
                assert a.path == b.path
                for name in ("times", "measured", "model", "sigmas", "curve_times", "curve"):
                    np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        elif isinstance(before, np.ndarray):
            np.testing.assert_array_equal(before, after, field.name)
        elif field.name == "options":
            assert after["rtol"] == before["rtol"]
        elif before == before:  # but for NaN
            assert after == before, field.name
    assert format_fit(found) == format_fit(result)


def test_the_curve_is_that_of_the_fitted_values_between_the_data_too(result: FitResult) -> None:
    (data,) = result.data
    m, k, x = result.values
    assert len(data.curve_times) > 10 * len(data.times)
    closed = x * np.cos(np.sqrt(k / m) * data.curve_times)
    np.testing.assert_allclose(data.curve[:, 0], closed, atol=1e-7)


def test_files_without_a_curve_have_the_model_at_the_data(
    tmp_path: Path, result: FitResult
) -> None:
    path = tmp_path / "fit.h5"
    write_fit(result, path)
    with h5py.File(path, "r+") as file:
        del file["data_0/curve"]
    with open(path, "r+b") as sealed:
        seal(sealed)
    (data,) = read_fit(path).data
    np.testing.assert_array_equal(data.curve, data.model)


def test_a_fit_opens_like_any_other_analysis(tmp_path: Path, result: FitResult) -> None:
    path = tmp_path / "fit.h5"
    write_fit(result, path)
    content = lagcli.open(path)
    assert content["command"] == "fit"
    assert content["parameters"]["k"]["max"] == 50
    assert content["parameters"]["m"]["standard_error"] is None  # not identified
    assert content["chi_square"] == result.chi_square


def test_files_are_not_overwritten_silently(tmp_path: Path, result: FitResult) -> None:
    path = tmp_path / "fit.h5"
    write_fit(result, path)
    with pytest.raises(FileError, match="--force"):
        write_fit(result, path)
    write_fit(result, path, force=True)


def test_other_files_are_rejected(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    lagcli.write(lagcli.simulate(lagcli.load_text(MODEL), samples=3), path)
    with pytest.raises(FileError, match="not a file of lagcli fit"):
        read_fit(path)


def test_the_text_says_what_is_not_identified(result: FitResult) -> None:
    lines = format_fit(result).splitlines()
    assert max(map(len, lines)) <= 80
    assert "3 quantities from 40 measured values in 1 file" in lines[0]
    (mass,) = (line for line in lines if line.startswith("  m [kg]"))
    assert mass.endswith("not identified")
    (amplitude,) = (line for line in lines if line.startswith("  x [m]"))
    assert " to " in amplitude
    assert any(line.startswith("  searches") for line in lines)
