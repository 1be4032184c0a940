"""A notebook shows models and equations in LaTeX, runs with animation and plot."""

import html
import re

import numpy as np
import pytest
from page_checks import TEXTS
from patience import PATIENCE

import lagcli
from lagcli.pictures.report.notebook import (
    _RESULTS,
    analysis_html,
    check_markdown,
    model_html,
    sweep_html,
    trajectory_html,
)
from lagcli.settings.settings import SettingsOverrides


@pytest.fixture(scope="module")
def run():
    return lagcli.simulate(lagcli.load("pendulum_cartesian"), t_end=0.5, samples=20)


def test_a_notebook_is_executed():
    nbformat = pytest.importorskip("nbformat", reason="nbclient is not installed")
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    sources = [
        "import lagcli\nmodel = lagcli.load('pendulum_cartesian')\nmodel",
        "lagcli.derive(model)",
        "run = lagcli.simulate(model, t_end=0.5, samples=20)\nrun",
        "run.to_xarray()",
    ]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(s) for s in sources])
    nbclient.NotebookClient(notebook, timeout=int(PATIENCE), kernel_name="python3").execute()
    model, equations, run, dataset = (cell.outputs[-1].data for cell in notebook.cells)
    assert "Coordinates" in model["text/html"]
    assert r"m \ddot{x} &= 2 \, \lambda \, x" in equations["text/markdown"]
    assert "<iframe" in run["text/html"]
    assert "data:image/png;base64," in run["text/html"]
    assert "xarray.Dataset" in dataset["text/html"]


def test_the_html_of_a_run(run):
    text = trajectory_html(run)
    assert "<b>Pendulum</b>: completed, t = 0 to 0.5 s, 20 samples" in text
    (page,) = re.findall(r'srcdoc="([^"]*)"', text)
    assert html.unescape(page).startswith("<!doctype html>")
    assert "Plot of the run" in text
    still, plot = re.findall(r'<img [^>]*alt="([^"]*)"', text)
    assert (still, plot) == ("The mechanism at one moment of the run", "Plot of the run")


def test_a_model_is_a_card():
    card = model_html(lagcli.load("pendulum_cartesian"))
    assert "<b>Pendulum</b>" in card
    assert "Constraints: <code>rod</code>." in card
    assert "<details>" not in card
    assert len(card) < 4000
    many = model_html(lagcli.load("chain"))
    assert "<summary>Coordinates: 40</summary>" in many
    assert "rod[12]</code> and 8 more." in many
    assert "&lt;b&gt;" in model_html(_titled("<b>"))


def _titled(title):
    text = f"title: '{title}'\ncoordinates: [x]\nT: x'^2\ninitial: {{x: 0, x': 0}}\n"
    return lagcli.load_text(text)


def test_a_check_is_its_page_in_latex():
    shown = check_markdown(lagcli.check(lagcli.load("parallelogram")))
    assert "## Multipliers" in shown
    assert "Not unique: right" in shown
    assert r"\lambda_{" in shown


def test_a_sweep_is_a_table_of_its_measures(tmp_path):
    model = lagcli.load("pendulum_cartesian")
    done = lagcli.sweep(model, ["m=1,2"], tmp_path / "s.h5", measures={"high": "max(y)"}, t_end=0.1)
    shown = sweep_html(done)
    assert "2 of 2 rows completed" in shown
    assert "<code>high</code>" in shown


def test_the_functions_are_listed():
    assert dir(lagcli) == sorted(lagcli.__all__)  # no modules, as of the imports


def test_results_of_analyses_are_tables():
    crank, hoop = lagcli.load("slider_crank"), lagcli.load("bead_on_rotating_hoop")
    results = {
        "modes": lagcli.modes(crank),
        "matrices": lagcli.linearize(crank, inputs=["tau"]),
        "equilibria": lagcli.equilibrium(hoop),
        "branches": lagcli.follow_equilibria(hoop, "Omega", 3.0, 3.2),
        "models": lagcli.compare_models(crank, lagcli.load("slider_crank_textbook")),
        "runs": lagcli.compare(crank, SettingsOverrides(t_end=0.01), ["projection"]),
    }
    shown = {name: analysis_html(x) for name, x in results.items()}
    assert "Eigenvalue [1/s]" in shown["modes"]
    assert '<span class="name">tau</span>' in shown["matrices"]
    assert "Potential energy" in shown["equilibria"]
    assert re.search(r"branch point.*>3\.13209195", shown["branches"])
    assert "DOP853" in shown["runs"]
    assert "Models Slider-crank and " in shown["models"]
    assert not any("<img" in text for text in shown.values())
    known = {(f"lagcli.analysis.{module}", type_) for module, type_ in _RESULTS}
    assert {(type(x).__module__, type(x).__name__) for x in results.values()} <= known


def test_a_browser_shows_a_run(run, visit, until, tmp_path):
    """The animation fills its frame, nothing is cut off, the plot is as wide as the page."""
    text = f"<!doctype html><meta charset='utf-8'><body>{trajectory_html(run)}"
    (tmp_path / "cell.html").write_text(text, encoding="utf-8")
    page = visit(tmp_path / "cell.html", reduced_motion="reduce")
    (frame,) = page.frames[1:]
    until(frame, "document.querySelector('canvas')?.width > 300")
    assert frame.evaluate(TEXTS) == []
    inside = "document.documentElement.scrollHeight <= innerHeight + 1"
    assert frame.evaluate(inside), "all of the player is in view"
    width, room = page.evaluate(
        "[document.querySelector('img').clientWidth, document.body.clientWidth]"
    )
    assert room / 2 < width <= room


def test_a_dataset(run):
    pytest.importorskip("xarray", reason="xarray is not installed")
    dataset = run.to_xarray()
    rod = dataset.multipliers.sel(constraint="rod")
    assert np.array_equal(rod, run.multipliers[:, 0])
    assert np.array_equal(dataset.q.sel(coordinate="y"), run.q[:, 1])
    forces = dataset.constraint_force_by.sel(term="rod.x")
    assert np.array_equal(forces, run.constraint_force_of("rod")[:, 0])
    assert dataset.energy_kinetic.attrs["units"] == "J"
    assert dataset.coordinate_unit.sel(coordinate="x") == "m"
    assert dataset.attrs["status"] == "completed"
    assert set(run.outputs) <= set(dataset)


def test_a_dataset_has_the_variables_of_the_file(run, tmp_path):
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    pytest.importorskip("h5netcdf", reason="h5netcdf is not installed")
    lagcli.write(run, tmp_path / "run.h5")
    with xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf") as stored:
        made = run.to_xarray()
        shared = set(made.variables) & set(stored.variables)
        assert set(stored.variables) - shared <= {"term_constraint", "term_coordinate"}
        for name in shared:
            assert made[name].dims == stored[name].dims, name
            assert np.all((made[name] == stored[name]) | made[name].isnull()), name
