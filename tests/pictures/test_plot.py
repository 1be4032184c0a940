"""Plots: what they show, what they look like, what they reject.

`LAGCLI_REWRITE=1 pytest tests/pictures` stores new pictures. Look at each.
"""

from __future__ import annotations

import dataclasses
import os
import time
import warnings
from collections.abc import Iterator
from dataclasses import fields
from html import escape
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from shipped import REPRESENTATIVES, WRITTEN, every_model
from svg_labels import with_whole_labels

import lagcli
from lagcli.cli.app import run
from lagcli.errors import UsageError
from lagcli.pictures.curves import Catalogue, read_curves
from lagcli.pictures.plots.run_plot import labels_of
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.style import CONSTRAINT_COLORS
from lagcli.trajectory.samples import Samples

pytest.importorskip("matplotlib")

MODELS = Path(__file__).parents[2] / "models"
STORED = Path(__file__).parent / "stored"
#: Of 255, root mean square: fonts may be placed by another fraction of a pixel elsewhere.
TOLERANCE = 6.0


def short_run(name: str, folder: Path) -> None:
    """Write a result file of a shipped model."""
    model = lagcli.load(name)
    end = (model.settings.t_end or 1.0) / 5
    lagcli.write(lagcli.simulate(model, t_end=end, samples=201), folder / f"{name}.h5")


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with short runs of some shipped models, and some others."""
    folder = tmp_path_factory.mktemp("results")
    for name in (*REPRESENTATIVES, "chain", "double_pendulum_cartesian"):
        short_run(name, folder)
    for mass in (1, 2, 3):
        model = lagcli.load(MODELS / "slider_crank.yaml", set={"m": mass})
        trajectory = lagcli.simulate(model, t_end=0.6, samples=201)
        lagcli.write(trajectory, folder / f"mass_{mass}.h5")
    for place in range(8):
        model = lagcli.load(MODELS / "slider_crank.yaml", set={"l": 0.2 + place / 50})
        trajectory = lagcli.simulate(model, t_end=0.6, samples=101)
        lagcli.write(trajectory, folder / f"rod_{place}.h5")
    # its residuals are no rounding, which may look otherwise with the next revision
    model = lagcli.load(MODELS / "slider_crank.yaml")
    drifting = lagcli.simulate(
        model, t_end=2, samples=201, formulation="index1", rtol=1e-5, atol=1e-5
    )
    lagcli.write(drifting, folder / "drifting.h5")
    lagcli.write(lagcli.read(folder / "mass_1.h5"), folder / "table.csv")
    return folder


@pytest.fixture(autouse=True)
def _no_warnings(results: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(results)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def plot(tmp_path: Path, *arguments: str, suffix: str = "svg") -> str:
    """Plot to a file, and return its text."""
    path = tmp_path / f"figure.{suffix}"
    assert run(["plot", *arguments, "-o", str(path), "--force"]) == 0
    return with_whole_labels(path.read_text(encoding="utf-8", errors="replace"))


# what is drawn


@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_every_shipped_model_is_plotted(name: str, results: Path, tmp_path: Path) -> None:
    if not (results / f"{name}.h5").exists():
        short_run(name, results)
    text = plot(tmp_path, f"{name}.h5")
    title = escape(lagcli.load(name).title, quote=False)
    for word in (title, "[J]", "[s]"):
        assert word in text
    assert "residuals" not in text


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_formats_are_what_their_names_say_and_always_the_same(suffix: str, tmp_path: Path) -> None:
    begin = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix]
    written = []
    for _ in range(2):
        plot(tmp_path, "slider_crank.h5", "phi", suffix=suffix)
        written.append((tmp_path / f"figure.{suffix}").read_bytes())
    assert written[0].startswith(begin)
    assert written[0] == written[1]


@pytest.mark.parametrize(
    ("file", "name", "values"),
    [
        ("slider_crank", "phi", lambda r: r.q[:, 0]),
        ("slider_crank", "psi'", lambda r: r.v[:, 1]),
        ("slider_crank", "psi_ddot", lambda r: r.a[:, 1]),
        ("slider_crank", "lambda.guide", lambda r: r.multipliers[:, 0]),
        ("slider_crank", "lambda", lambda r: r.multipliers[:, 0]),
        ("slider_crank", "Qc.psi", lambda r: r.constraint_force[:, 1]),
        ("four_bar", "Qc.joint_y.theta_3", lambda r: r.constraint_force_of("joint_y")[:, 2]),
        ("slider_crank", "energy_total", lambda r: r.energy_total),
        ("slider_crank", "power_applied", lambda r: r.power_applied),
        ("slider_crank", "slider", lambda r: r.outputs["slider"]),
        ("four_bar", "residual_velocity.joint_y", lambda r: abs(r.residual_velocity[:, 1])),
        (
            "four_bar",
            "residual_position",
            lambda r: (abs(r.residual_position) / r.scale_position).max(axis=1),
        ),
        (
            "rolling_disk",
            "residual_position",
            lambda r: abs(r.residual_position[:, 0]) / r.scale_position[0],
        ),
        ("chain", "x_dot[3]", lambda r: r.v[:, 2]),
        ("chain", "x[3]'", lambda r: r.v[:, 2]),
        ("chain", "tension[2]", lambda r: r.outputs["tension[2]"]),
        ("chain", "Qc.rod[2].y[1]", lambda r: r.constraint_force_of("rod[2]")[:, 20]),
    ],
)
def test_names_are_the_columns_of_results(file: str, name: str, values: object) -> None:
    source = RunFile(f"{file}.h5")
    (curve,) = Catalogue(source).find(name)
    expected = values(lagcli.read(f"{file}.h5"))  # type: ignore[operator]
    np.testing.assert_array_equal(read_curves(source, [curve])[curve.name], expected)


@pytest.mark.parametrize(
    ("name", "count"),
    [("x", 20), ("x_dot", 20), ("lambda.rod", 20), ("*_ddot", 40), ("Qc.rod*.x*", 400)],
)
def test_families_and_stars(name: str, count: int) -> None:
    assert len(Catalogue(RunFile("chain.h5")).find(name)) == count


def test_names_in_tex_and_units(tmp_path: Path) -> None:
    text = plot(tmp_path, "four_bar.h5", "theta_1", "theta_1_dot", "lambda.*", "Qc.theta_1")
    for word in ("θ", "[rad]", "[rad/s]", "λ", "[N·m]", "joint"):
        assert word in text


def test_outputs_are_named_as_they_are(tmp_path: Path) -> None:
    assert "rod_tension" in plot(tmp_path, "slider_crank.h5", "rod_tension")


def test_csv_without_a_model(tmp_path: Path) -> None:
    assert "lambda.guide" in plot(tmp_path, "table.csv")
    assert "λ" in plot(tmp_path, "table.csv", "--model", str(MODELS / "slider_crank.yaml"))


def test_runs_are_distinguished_by_their_parameters(tmp_path: Path) -> None:
    text = plot(tmp_path, *(f"mass_{m}.h5" for m in (1, 2, 3)), "lambda.guide", "phi:phi'")
    for m in (1, 2, 3):
        assert f"m = {m} kg" in text


def test_many_runs_are_a_family_of_curves(tmp_path: Path) -> None:
    text = plot(tmp_path, *(f"rod_{i}.h5" for i in range(8)), "psi")
    assert "l [m]" in text
    assert "l = 0.2" not in text


def test_runs_that_differ_in_nothing_known_are_distinguished_by_name(tmp_path: Path) -> None:
    text = plot(tmp_path, "mass_1.h5", "./mass_1.h5", "table.csv", "phi")
    assert "table" in text


@pytest.mark.parametrize(
    ("options", "label"),
    [({"set_initial": {"phi": 1}}, r"$\varphi$(0) = 1"), ({"rtol": 1e-5}, "rtol = 1e-05")],
)
def test_runs_of_other_starts_or_options(
    options: dict[str, object], label: str, tmp_path: Path
) -> None:
    start = {k: options.pop(k) for k in list(options) if k == "set_initial"}
    model = lagcli.load(MODELS / "pendulum_chain.yaml", set={"N": 1}) if not start else None
    model = model or lagcli.load(MODELS / "slider_crank.yaml", **start)  # type: ignore[arg-type]
    again = lagcli.load_text(model.text, set={"N": 1} if not start else None)
    runs = [
        RunFile(lagcli.simulate(m, t_end=0.1, samples=3, **o))
        for m, o in ((again, {}), (model, options))
    ]
    assert label in labels_of(runs)[0][1]


@pytest.mark.parametrize("arguments", [{"names": "phi"}, {"bands": "l=5%"}, {"names": 3}])
def test_one_text_is_no_list_of_texts(tmp_path: Path, arguments: dict[str, object]) -> None:
    with pytest.raises(UsageError, match="must be a list of texts such as"):
        lagcli.plot("slider_crank.h5", tmp_path / "a.svg", **arguments)  # type: ignore[arg-type]


def test_from_python(tmp_path: Path) -> None:
    trajectory = lagcli.read("slider_crank.h5")
    assert lagcli.plot(trajectory, tmp_path / "a.svg", ["phi"]) == ()
    assert lagcli.plot("slider_crank.h5", tmp_path / "b.svg", ["phi"], size=(4, 3)) == ()
    lagcli.plot([trajectory, "mass_1.h5"], tmp_path / "c.svg", ["phi"])


# what it looks like


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("usual", ["drifting.h5"]),
        ("portrait", ["double_pendulum_cartesian.h5", "x_2:y_2", "x_1,y_1"]),
        # no energy balance, which is rounding and differs between processors
        (
            "runs",
            [
                "mass_1.h5",
                "mass_2.h5",
                "mass_3.h5",
                "lambda.guide",
                "energy_kinetic,energy_potential,energy_total",
            ],
        ),
    ],
)
def test_pictures_look_as_they_did(name: str, arguments: list[str], tmp_path: Path) -> None:
    import matplotlib as mpl
    from matplotlib.image import imread

    if mpl.__version_info__ < (3, 11):
        pytest.skip("the stored pictures are by matplotlib 3.11")
    path = tmp_path / f"{name}.png"
    assert run(["plot", *arguments, "-o", str(path), "--size", "5x5", "--dpi", "50"]) == 0
    if os.environ.get("LAGCLI_REWRITE"):
        (STORED / path.name).write_bytes(path.read_bytes())
    now, then = (255 * imread(p)[..., :3] for p in (path, STORED / path.name))
    assert now.shape == then.shape
    assert np.sqrt(np.mean((now - then) ** 2)) < TOLERANCE


def test_size_and_resolution(tmp_path: Path) -> None:
    from matplotlib.image import imread

    plot(tmp_path, "slider_crank.h5", "phi", "--size", "4x3", "--dpi", "70", suffix="png")
    assert imread(tmp_path / "figure.png").shape[:2] == (210, 280)


def test_titles(tmp_path: Path) -> None:
    text = plot(tmp_path, "slider_crank.h5", "phi", "--title", "A $ and ü 漢")
    assert "A $ and ü" in text
    assert "slider_crank" not in plot(tmp_path, "slider_crank.h5", "phi", "--title", "")


def test_a_run_that_failed_is_reported(tmp_path: Path) -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml")
    lagcli.write(lagcli.simulate(model, max_steps=20), tmp_path / "part.h5")
    assert "Slider-crank (failed)" in plot(tmp_path, str(tmp_path / "part.h5"))


def test_a_single_sample(tmp_path: Path) -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml")
    lagcli.write(lagcli.simulate(model, t_end=0.1, samples=1), tmp_path / "one.h5")
    plot(tmp_path, str(tmp_path / "one.h5"))


@pytest.mark.slow
def test_a_million_samples_take_seconds_and_keep_their_peaks(tmp_path: Path) -> None:
    from matplotlib.image import imread

    count, peak = 10**6, 654_321
    short = lagcli.read("mass_1.h5")
    changes = {
        f.name: np.resize(values, (count, *values.shape[1:]))
        for f in fields(Samples)
        if isinstance(values := getattr(short, f.name), np.ndarray)
    }
    changes["time"] = np.linspace(0, 1, count)
    changes["multipliers"][:] = 0
    changes["multipliers"][peak] = 1
    outputs = dict.fromkeys(short.outputs, changes["time"])
    lagcli.write(dataclasses.replace(short, **changes, outputs=outputs), tmp_path / "long.h5")
    began = time.process_time()  # the machine may have other things to do
    plot(tmp_path, str(tmp_path / "long.h5"), "lambda.guide", "--size", "6x2", suffix="png")
    assert time.process_time() - began < 5
    image = imread(tmp_path / "figure.png")[..., :3]
    color = np.array(to_rgb(CONSTRAINT_COLORS[0]))
    inked = (np.abs(image - color).max(axis=-1) < 0.3).sum(axis=0)
    # one column, from the bottom to the top of the panel
    assert inked.max() > 150
    assert np.argmax(inked) / image.shape[1] == pytest.approx(peak / count, abs=0.1)


# what is rejected


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["phi"], 2, "no result file"),
        (["slider_crank.h5", "phii"], 2, "did you mean `phi`"),
        (["slider_crank.h5", "Qc.guide.x"], 2, "has no `Qc.guide.x`"),
        (["chain.h5", "x[99]"], 2, "x[1..20]"),
        (["slider_crank.h5", ""], 2, "names nothing"),
        (["slider_crank.h5", "nothing*"], 2, "has no `nothing*`"),
        (["slider_crank.h5", "phi:"], 2, "not a pair"),
        (["slider_crank.h5", "phi:psi:phi"], 2, "not a pair"),
        (["slider_crank.h5", "phi:phi,psi"], 2, "give them separately"),
        (["chain.h5", "x:theta"], 2, "has no `theta`"),
        (["slider_crank.h5", "chain.h5"], 2, "different models"),
        (["slider_crank.h5", "--size", "big"], 2, "is not a size"),
        (["slider_crank.h5", "--size", "0.1x3"], 2, "a side of a plot"),
        (["slider_crank.h5", "--dpi", "0"], 2, "out of range"),
        (["slider_crank.h5", "--dpi", "nan"], 2, "out of range"),
        (["slider_crank.h5", "--size", "50x50", "--dpi", "1000"], 2, "pixels"),
        (["missing.h5"], 4, "no such file"),
    ],
)
def test_wrong_inputs(
    arguments: list[str],
    status: int,
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    output = tmp_path / "figure.png"
    assert run(["plot", *arguments, "-o", str(output)]) == status
    assert message in capsys.readouterr().err
    assert not output.exists()


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.svg"
    path.write_text("mine")
    assert run(["plot", "slider_crank.h5", "-o", str(path)]) == 4
    assert "--force" in capsys.readouterr().err
    assert path.read_text() == "mine"


@pytest.mark.parametrize("name", ["figure.gif", "figure", "figure.h5"])
def test_formats_that_are_none(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plot", "slider_crank.h5", "-o", name]) == 2
    assert "is not a plot format" in capsys.readouterr().err


def test_values_that_no_axis_can_show_are_left_out(tmp_path: Path) -> None:
    model = lagcli.load_text(
        "coordinates: [x]\nparameters: {m: 1}\nT: m*x'^2/2\n"
        "initial: {x: 0, x': 1}\noutputs: {big: 1e308*(1 - 2*x), small: x}\n"
    )
    lagcli.write(lagcli.simulate(model, t_end=1, samples=5), tmp_path / "run.h5")
    for names in (["big"], ["small:big"], ["big", "small"]):
        lagcli.plot(tmp_path / "run.h5", tmp_path / "run.png", names, force=True)
    lagcli.sweep(
        model,
        ["m=1,1e308"],
        tmp_path / "s.h5",
        measures={"big": "max(big)*m/m", "small": "max(x)"},
        t_end=1,
        samples=5,
        jobs=1,
    )
    for names in (["big"], ["small"], ["small:big"]):
        lagcli.plot(tmp_path / "s.h5", tmp_path / "s.png", names, force=True)


@pytest.mark.parametrize("value", [np.finfo(float).max, np.inf])
def test_numbers_near_the_largest_leave_a_gap(tmp_path: Path, value: float) -> None:
    trajectory = lagcli.simulate(lagcli.load(MODELS / "slider_crank.yaml"), samples=9, t_end=0.1)
    q, balance = trajectory.q.copy(), trajectory.energy_balance.copy()
    q[3, 0] = balance[4] = value
    q[4, 0] = -value
    odd = dataclasses.replace(trajectory, q=q, energy_balance=balance)
    lagcli.plot(odd, tmp_path / "odd.svg")
    lagcli.plot(odd, tmp_path / "residual.svg", ["phi", "residual_position"])


def test_pure_numbers_have_no_unit_in_labels() -> None:
    model = lagcli.load("bouncing_ball")
    changed = [lagcli.load_text(model.text, set={"e": e}) for e in (0.5, 0.75)]
    runs = [RunFile(lagcli.simulate(m, t_end=0.1, samples=3)) for m in changed]
    assert labels_of(runs) == (["$e$ = 0.5", "$e$ = 0.75"], [0.5, 0.75], "$e$")
