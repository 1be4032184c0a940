"""Plots of sweep files: families of curves, measures over what was varied, maps."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from svg_labels import with_whole_labels

import lagcli
from lagcli.cli.app import run
from lagcli.pictures.curves import Catalogue, read_curves
from lagcli.pictures.plots.sweep_plot import MOST, PlottedTable, Rows

pytest.importorskip("matplotlib")

MODEL = str(Path(__file__).parents[2] / "models" / "slider_crank.yaml")
PEAK = ("--measure", "peak=max(abs(lambda.guide))")
SWEEPS = {
    "kept": ("--vary", "l=0.2:0.4:0.025", *PEAK, "--keep", "trajectories"),
    "grid": ("--vary", "l=0.2:0.4:0.05", "--vary", "m=logspace(0.1, 10, 4)", *PEAK),
    "drawn": ("--vary", "l=0.2..0.4", "--vary", "m=1..2", "--sample", "sobol:16", *PEAK),
    "three": ("--vary", "l=0.2,0.3", "--vary", "m=1,2", "--vary", "r=0.1,0.12", *PEAK),
    "both": ("--vary", "l=0.2:0.4:0.05", "--vary", "m=1,2", *PEAK, "--keep", "trajectories"),
    "uneven": ("--vary", "l=0.2,0.25,0.3", "--vary", "m=1,2,5", *PEAK),
    "many": ("--vary", "l=0.2,0.3", "--vary", "m=1:5:1", "--vary", "r=0.1,0.12", *PEAK),
    "wide": (
        "--vary",
        "l=0.2,0.3,0.4",
        "--vary",
        "m=1,2,3",
        "--vary",
        "r=0.1,0.11,0.12",
        "--vary",
        "g=1,5,9",
        *PEAK,
    ),
    "holes": ("--vary", "l=0.01,0.2,0.3", "--vary", "m=1,2", *PEAK),
    "start": ("--vary", "phi=linspace(0, 3, 8)", *PEAK, "--keep", "trajectories"),
    "bad": ("--vary", "l=0.01,0.02", *PEAK, "--keep", "trajectories"),
}


@pytest.fixture(scope="module")
def sweeps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweeps")
    for name, options in SWEEPS.items():
        output = ["-o", str(folder / f"{name}.h5"), "--quiet", "--jobs", "1"]
        status = run(["sweep", MODEL, *options, "--t-end", "0.3", "--samples", "31", *output])
        assert status == (3 if name in ("bad", "holes") else 0)
    return folder


@pytest.fixture(autouse=True)
def _no_warnings(sweeps: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(sweeps)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def plot(tmp_path: Path, *arguments: str) -> str:
    path = tmp_path / "figure.svg"
    assert run(["plot", *arguments, "-o", str(path), "--force"]) == 0
    return with_whole_labels(path.read_text(encoding="utf-8"))


def test_rows_are_runs() -> None:
    rows = Rows("kept.h5")
    assert len(rows.runs) == rows.good == 9
    source = rows.runs[4]
    assert source.varied == {"l": pytest.approx(0.3)}
    model = lagcli.load(MODEL, set={"l": source.varied["l"]})
    alone = lagcli.simulate(model, t_end=0.3, samples=31)
    catalogue = Catalogue(source)
    curves = [catalogue.find(name)[0] for name in ("phi", "psi_dot", "lambda.guide", "slider")]
    found = read_curves(source, curves)
    expected = (alone.q[:, 0], alone.v[:, 1], alone.multipliers[:, 0], alone.outputs["slider"])
    for curve, values in zip(curves, expected, strict=True):
        np.testing.assert_allclose(found[curve.name], values, rtol=1e-6, atol=1e-7)


def test_a_file_is_checked_once_for_all_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its checksum, attributes and structure: each took as long as drawing a row."""
    from lagcli.results.hdf5 import seal
    from lagcli.sweeps.file import store

    summed, opened = [], []
    digest, check = seal._digest, store._check_facts
    monkeypatch.setattr(seal, "_verified", set())
    monkeypatch.setattr(seal, "_digest", lambda *x: (summed.append(x), digest(*x))[1])
    monkeypatch.setattr(store, "_check_facts", lambda x: (opened.append(x), check(x))[1])
    plot(tmp_path, "kept.h5", "psi", "slider")
    assert (len(summed), len(opened)) == (1, 2)  # the table of rows, and the rows


def test_families_of_curves(tmp_path: Path) -> None:
    text = plot(tmp_path, "kept.h5", "psi", "lambda.guide", "phi:phi_dot")
    assert "l [m]" in text
    assert "[rad]" in text
    assert "phi [rad]" in plot(tmp_path, "start.h5", "psi")


def test_measures_are_what_a_sweep_shows(tmp_path: Path) -> None:
    text = plot(tmp_path, "kept.h5")
    assert "peak" in text
    assert "l [m]" in text


def test_maps(tmp_path: Path) -> None:
    for name in ("grid.h5", "drawn.h5"):
        text = plot(tmp_path, name)
        for word in ("peak", "l [m]", "m [kg]", "Slider-crank"):
            assert word in text
    assert "<image" in plot(tmp_path, "grid.h5", "l:m:peak")
    assert "<image" in plot(tmp_path, "three.h5", "peak:m:l")


def test_cells_without_a_value_are_hatched_and_explained(tmp_path: Path) -> None:
    text = plot(tmp_path, "holes.h5", "l:m:peak")
    assert "no value: the row failed" in text
    assert "<pattern" in text  # of hatches
    assert "no value" not in plot(tmp_path, "grid.h5", "l:m:peak")


def figure_of(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, *arguments: str) -> Any:
    """Return the figure that is drawn."""
    from matplotlib.figure import Figure

    found: list[Figure] = []
    usual = Figure.savefig

    def savefig(figure: Figure, *values: Any, **named: Any) -> None:
        found.append(figure)
        usual(figure, *values, **named)

    monkeypatch.setattr(Figure, "savefig", savefig)
    plot(tmp_path, *arguments)
    return found[0]


def panels(figure: Any) -> list[Any]:
    return [ax for ax in figure.axes if ax.get_label() != "<colorbar>"]


def test_rows_without_a_value_are_crossed_in_curves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (ax,) = panels(figure_of(monkeypatch, tmp_path, "holes.h5", "l:peak"))
    crosses = next(line for line in ax.lines if line.get_marker() == "x")
    assert list(crosses.get_xdata()) == [0.01, 0.01]
    assert "no value" in ax.get_title(loc="left")
    low, high = ax.get_xlim()
    assert low < 0.01 < 0.3 < high
    # all of them: no numbers without a meaning along the axis
    (ax,) = panels(figure_of(monkeypatch, tmp_path, "bad.h5"))
    assert [t.get_text() for t in ax.get_yticklabels()] == []
    assert ax.get_xlim()[0] < 0.01
    assert ax.get_xlim()[1] > 0.02
    (ax,) = panels(figure_of(monkeypatch, tmp_path, "both.h5", "l:peak"))
    assert not ax.get_title(loc="left")


def test_of_three_quantities_each_map_has_one_value_of_the_third(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for names in ([], ["l:m:peak"]):
        figure = figure_of(monkeypatch, tmp_path, "three.h5", *names)
        found = panels(figure)
        titles = sorted(ax.get_title(loc="right") for ax in found)
        third = titles[0].split(" = ")[0].strip("$")
        table = PlottedTable("three.h5")
        values = np.unique(table.find(third).values)
        assert titles == [f"${third}$ = {x:.4g} {table.find(third).unit}" for x in values]
        # one scale of colours for all
        assert len({ax.collections[0].get_clim() for ax in found}) == 1
        peak = table.find("peak").values
        for ax, value in zip(found, values, strict=True):
            cells = ax.collections[0].get_array().ravel()
            mine = peak[table.find(third).values == value]
            np.testing.assert_allclose(np.sort(cells), np.sort(mine))


def test_few_values_are_written_along_a_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (ax,) = panels(figure_of(monkeypatch, tmp_path, "uneven.h5"))
    assert [t.get_text() for t in ax.get_yticklabels()] == ["1", "2", "5"]
    assert [t.get_text() for t in ax.get_xticklabels()] == ["0.20", "0.25", "0.30"]
    assert ax.get_ylabel() == "$m$ [kg]"
    edges = ax.collections[0].get_coordinates()[:, 0, 1]
    assert np.allclose(np.diff(edges), 1), "cells of values that are unevenly spaced are alike"


def test_colours_of_values_far_apart_follow_their_logarithm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.colors import LogNorm

    (ax,) = panels(figure_of(monkeypatch, tmp_path, "grid.h5"))
    assert isinstance(ax.collections[0].norm, LogNorm)  # from 0.1 kg to 10 kg
    (ax,) = panels(figure_of(monkeypatch, tmp_path, "drawn.h5"))
    assert not isinstance(ax.collections[0].norm, LogNorm)


def test_many_curves_over_one_of_three_are_coloured_and_explained(tmp_path: Path) -> None:
    text = plot(tmp_path, "many.h5", "l:peak")
    assert "m [kg] (r varies too)" in text
    assert "m = 2 kg" in plot(tmp_path, "three.h5", "l:peak")


def test_a_family_over_two_quantities_is_coloured_by_one_of_them(tmp_path: Path) -> None:
    text = plot(tmp_path, "both.h5", "psi")
    assert "l [m] (m varies too)" in text
    assert ">run<" not in text


def test_curves_over_one_of_two(tmp_path: Path) -> None:
    text = plot(tmp_path, "grid.h5", "l:peak")
    for mass in ("0.1", "0.4642", "2.154", "10"):
        assert f"m = {mass} kg" in text
    text = plot(tmp_path, "grid.h5", "m:peak", "l:peak")
    assert text.count("peak") >= 2
    plot(tmp_path, "drawn.h5", "m:peak")
    plot(tmp_path, "three.h5", "m:peak")


def test_values_of_measures() -> None:
    table = PlottedTable("grid.h5")
    peak, mass = table.find("peak").values, table.find("m").values
    at = table.find("l").values == 0.2
    # without friction, lambda is proportional to the mass
    np.testing.assert_allclose(peak[at] / mass[at], peak[at][0] / mass[at][0], rtol=1e-6)
    assert table.find("m").log
    assert not table.find("l").log


def test_rows_that_failed_are_not_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plot(tmp_path, "bad.h5")
    assert np.isnan(PlottedTable("bad.h5").find("peak").values).all()
    assert run(["plot", "bad.h5", "phi", "-o", str(tmp_path / "x.svg")]) == 2
    assert "no row was completed" in capsys.readouterr().err


def test_a_few_of_many_rows_are_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert MOST == 200
    monkeypatch.setattr("lagcli.pictures.plots.sweep_plot.MOST", 5)
    plot(tmp_path, "kept.h5", "psi")
    assert re.search("5 of 9 rows", capsys.readouterr().err)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["grid.h5", "peek"], "did you mean `peak`"),
        (["grid.h5", "phi"], "no trajectories"),
        (["wide.h5"], "`r`, `g` varied too, with 9 combinations"),
        (["grid.h5", "l:m:l:peak"], "more than a map shows"),
        (["kept.h5", "residual_velocity"], "has no `residual_velocity`"),
        (["kept.h5", "Qc.guide.phi"], "has no `Qc.guide.phi`"),
        (["kept.h5", "grid.h5"], "plot it separately"),
    ],
)
def test_wrong_inputs(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["plot", *arguments, "-o", str(tmp_path / "x.png")]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_histograms_write_the_quantiles_that_info_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["info", "drawn.h5", "--quantiles", "--json"]) == 0
    (peak,) = json.loads(capsys.readouterr().out)["measures"]
    values = PlottedTable("drawn.h5").find("peak").values
    expected = {f"{p:g}": float(np.quantile(values, p)) for p in (0.05, 0.25, 0.5, 0.75, 0.95)}
    assert peak["quantiles"] == pytest.approx(expected)
    text = plot(tmp_path, "drawn.h5", "hist:peak", "hist:l")
    for part in (0.05, 0.5, 0.95):
        assert f"{100 * part:g} %: {expected[f'{part:g}']:.4g}" in text
    assert run(["info", "drawn.h5", "--quantiles"]) == 0
    assert "95 %" in capsys.readouterr().out
    assert run(["plot", "bad.h5", "hist:peak", "-o", str(tmp_path / "x.svg")]) == 2
    assert "no row has a value of `peak`" in capsys.readouterr().err


def test_axes_have_the_units_of_the_model_file(tmp_path: Path) -> None:
    model = Path(MODEL).read_text(encoding="utf-8").replace("value: 0.3 m,", "value: 30 cm,")
    (tmp_path / "crank.yaml").write_text(model, encoding="utf-8")
    assert lagcli.load(tmp_path / "crank.yaml").parameter_values["l"] == pytest.approx(0.3)
    made = [str(tmp_path / "crank.yaml"), "--vary", "l=20:40:10 cm", *PEAK, "--t-end", "0.1"]
    file = str(tmp_path / "cm.h5")
    assert run(["sweep", *made, "--keep", "trajectories", "-o", file, "-q", "-j", "1"]) == 0
    np.testing.assert_allclose(PlottedTable(file).find("l").values, [20, 30, 40])
    assert "l [cm]" in plot(tmp_path, file)
    assert "l = 20 cm" in plot(tmp_path, file, "phi")


def test_varied_quantities_are_typeset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A rate is φ̇, not phi' or phi_dot."""
    options = ("--vary", "phi'=10,12", "--vary", "theta_0=1,2", *PEAK, "-o", "rates.h5")
    model = tmp_path / "turned.yaml"
    text = Path(MODEL).read_text(encoding="utf-8")
    text = text.replace("parameters:\n", "parameters:\n  theta_0: 0.5 rad\n")
    model.write_text(text.replace("phi: 0.5 rad", "phi: theta_0"), encoding="utf-8")
    run_options = ("--t-end", "0.1", "--samples", "11", "--quiet", "--jobs", "1", "--force")
    assert run(["sweep", str(model), *options, *run_options]) == 0
    (ax,) = panels(figure_of(monkeypatch, tmp_path, "rates.h5"))
    assert ax.get_xlabel() == r"$\dot{\varphi}$ [rad/s]"
    assert ax.get_ylabel() == r"$\theta_{0}$ [rad]"


@pytest.mark.parametrize("suffix", ["svg", "pdf", "png"])
@pytest.mark.parametrize("dpi", ["0", "nan", "1e9", "-1"])
def test_resolutions_out_of_range(
    sweeps: Path, capsys: pytest.CaptureFixture[str], dpi: str, suffix: str
) -> None:
    for name, of in (("grid", ("m:l:peak",)), ("kept", ("phi",))):
        target = str(sweeps / f"resolution.{suffix}")
        assert run(["plot", str(sweeps / f"{name}.h5"), *of, "-o", target, "--dpi", dpi]) == 2
        assert "out of range" in capsys.readouterr().err


def test_bands_of_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("phi", "slider", "phi:phi_dot", "lambda.guide")
    figure = figure_of(monkeypatch, tmp_path, "both.h5", *names, "--band", "80%")
    assert "central 80 % of 10 rows" in figure.axes[0].get_title(loc="right")
    with h5py.File("both.h5") as file:
        stored = {
            "\\varphi": file["q"][:, :, 0],
            "\\lambda": file["multipliers"][:, :, 0],
            "slider": file["outputs/slider"][:],
        }
    for label, values in stored.items():
        (ax,) = (
            x
            for x in panels(figure)
            if label in x.get_ylabel() and x.lines[0].get_xdata()[-1] == 0.3
        )
        drawn = ax.collections[0].get_paths()[0].vertices
        low, middle, high = np.percentile(values, (10, 50, 90), axis=0)
        np.testing.assert_allclose(ax.lines[0].get_ydata(), middle, rtol=1e-12)
        assert drawn[:, 1].min() == pytest.approx(low.min())
        assert drawn[:, 1].max() == pytest.approx(high.max())


def test_bands_of_measures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (ax,) = panels(figure_of(monkeypatch, tmp_path, "both.h5", "l:peak", "--band", "80%"))
    table = PlottedTable("both.h5")
    (l,), peak = table.varied[:1], table.find("peak").values
    for at, median in zip(*ax.lines[0].get_data(), strict=True):
        assert median == pytest.approx(np.median(peak[np.isclose(l.values, at)]))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("grid.h5", "m:l:peak", "--band", "90%"), "--band is not for maps; draw `peak` over one"),
        (("grid.h5", "tornado:peak", "--band", "90%"), "--band is not for tornado charts"),
        (("grid.h5", "l:peak", "--band", "l=5%"), "give it once, as in --band 90%"),
    ],
)
def test_mistakes_in_bands(
    sweeps: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], said: str
) -> None:
    assert run(["plot", *arguments, "-o", str(sweeps / "band.svg")]) == 2
    assert said in capsys.readouterr().err
