"""Pages of analyses: what was found, with its numbers, light and dark."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.cli.app import run
from lagcli.errors import UsageError

MODELS = Path(__file__).parents[2] / "models"
CRANK = str(MODELS / "slider_crank.yaml")
pytest.importorskip("matplotlib")


def page_of(tmp_path: Path, command: str, *arguments: str) -> str:
    file, page = tmp_path / "found.h5", tmp_path / "found.html"
    assert run([command, *arguments, "-o", str(file), "--quiet", "--force"]) == 0
    assert run(["report", str(file), "-o", str(page), "--quiet", "--force"]) == 0
    text = page.read_text(encoding="utf-8")
    # nothing is fetched, and pictures are there twice: light and dark
    assert not re.search(r"(src|href)=\"http", text)
    assert text.count('class="light"') == text.count('class="dark"')
    assert "sha256" in text
    return text


def test_modes_have_eigenvalues_and_shapes(tmp_path: Path) -> None:
    chain = str(MODELS / "chain.yaml")
    text = page_of(tmp_path, "modes", chain, "--set", "N=1", "--equilibrium")
    # ω² = g/l
    assert "± 3.13209195 i" in text
    assert "Shapes" in text
    assert "data:image/svg+xml;base64," in text
    assert "img-src data:" in text
    assert "N = 1" in text


def test_equilibria_have_stability_and_multipliers(tmp_path: Path) -> None:
    model = str(MODELS / "pendulum_cartesian.yaml")
    text = page_of(tmp_path, "equilibrium", model, "--all", "--starts", "8")
    assert text.index("stable") < text.index("unstable")
    assert "−4.905" in text
    assert "N/m" in text


def test_branches_have_a_diagram_and_bifurcations(tmp_path: Path) -> None:
    hoop = str(MODELS / "bead_on_rotating_hoop.yaml")
    text = page_of(tmp_path, "equilibrium", hoop, "--along", "Omega=2:4")
    assert "branch point" in text
    # names are those of formulas, in the heading too
    assert re.search(r'<h2>Equilibria over <span title="Omega"><math.*Ω.*</math></span></h2>', text)
    assert 'title="lambda.hoop"><math' in text
    # Ω² = g/R
    assert "3.1320919526" in text


def test_linear_models_have_matrices(tmp_path: Path) -> None:
    text = page_of(tmp_path, "linearize", str(MODELS / "slider_crank.yaml"), "--input", "tau")
    assert "ẋ = A x + B u" in text
    assert '<span title="tau"><math' in text


def test_comparisons_have_a_row_for_each_run(tmp_path: Path) -> None:
    text = page_of(tmp_path, "compare", str(MODELS / "pendulum_cartesian.yaml"), "--t-end", "1")
    for formulation in ("projection", "baumgarte", "index1", "ggl"):
        assert formulation in text


def test_comparisons_of_two_models_have_both_multipliers(tmp_path: Path) -> None:
    models = [str(MODELS / f"slider_crank{x}.yaml") for x in ("", "_textbook")]
    text = page_of(tmp_path, "compare", *models, "--t-end", "0.2")
    assert "explained: see below" in text
    assert "Differences and multipliers over time" in text
    assert run(["plot", str(tmp_path / "found.h5"), "-o", str(tmp_path / "x.svg")]) == 0
    assert "slider_crank_textbook" in (tmp_path / "x.svg").read_text()


def test_sweeps_have_measures_effects_and_rows(tmp_path: Path) -> None:
    few = ["--t-end", "0.1", "--samples", "5", "--jobs", "1", "--measure", "peak=max(lambda.guide)"]
    vary = ["--vary", "l=0.2,0.3,0.01", "--vary", "m=1,2", "--set", "r=0.05"]
    file, page = tmp_path / "sweep.h5", tmp_path / "sweep.html"
    # a rod that does not reach the line fails
    assert run(["sweep", CRANK, *vary, *few, "-o", str(file), "-q"]) == 3
    assert run(["report", str(file), "-o", str(page), "-q"]) == 0
    text = page.read_text(encoding="utf-8")
    assert re.search(r"<td [^>]*>6: [^<]*4 completed", text)
    for part in ("Effects of what was varied", "Rows that failed, by cause", "6 rows"):
        assert part in text
    assert text.count('class="light"') == text.count('class="dark"') == 2
    assert "r = 0.05" in text


def test_kept_motions_of_sweeps_are_drawn(tmp_path: Path) -> None:
    few = ["--t-end", "0.1", "--samples", "5", "--jobs", "1", "--keep", "trajectories"]
    file, page = tmp_path / "sweep.h5", tmp_path / "sweep.html"
    assert run(["sweep", CRANK, "--vary", "l=0.2,0.3", *few, "-o", str(file), "-q"]) == 0
    assert run(["report", str(file), "-o", str(page), "-q"]) == 0
    text = page.read_text(encoding="utf-8")
    assert "The motions of the rows" in text
    assert "Measures" not in text


def test_sensitive_runs_have_tornado_charts_of_their_peaks(tmp_path: Path) -> None:
    def peak(**changed: float) -> float:
        model = lagcli.load(MODELS / "slider_crank.yaml", set=changed)
        made = lagcli.simulate(model, t_end=0.6, samples=61, rtol=1e-12)
        return float(np.abs(made.multipliers[:, 0]).max())

    model = lagcli.load(MODELS / "slider_crank.yaml")
    made = lagcli.simulate(model, t_end=0.6, samples=61, rtol=1e-12, sensitivity=["l", "m", "c"])
    lagcli.report(made, tmp_path / "run.html", modes="start")
    text = (tmp_path / "run.html").read_text(encoding="utf-8")
    chart = text[text.index('<section id="sensitivities">') :]
    rows = re.findall(r'<th scope="row">(\w+)</th>(.*?)</tr>', chart)[:3]
    changes = {
        name: re.sub("<svg.*?</svg>", "", cells).replace("−", "-").split("</td>")[1].split(">")[1]
        for name, cells in rows
    }
    # λ is proportional to m; its derivative with respect to l against a central difference
    assert float(changes["m"]) == pytest.approx(peak() / 100, rel=1e-5)
    difference = (peak(l=0.3 * 1.0001) - peak(l=0.3 * 0.9999)) / 2e-4 / 100
    assert float(changes["l"]) == pytest.approx(difference, rel=1e-4)
    assert list(changes) == ["m", "l", "c"]
    assert changes["c"] == ""  # its value is 0
    assert chart.count('<rect class="up"') == 1
    assert chart.count('<rect class="down"') == 1
    assert 'id="modes"' in chart
    assert "∂λ/∂l" in text


def test_modes_are_asked_for_runs_about_a_point(tmp_path: Path) -> None:
    made = lagcli.simulate(lagcli.load(MODELS / "slider_crank.yaml"), t_end=0.1, samples=5)
    with pytest.raises(UsageError, match="give start, equilibrium or a time"):
        lagcli.report(made, tmp_path / "x.html", modes="end")
    plain = tmp_path / "plain.html"
    lagcli.report(made, plain)
    assert 'id="sensitivities"' not in plain.read_text(encoding="utf-8")
    assert 'id="modes"' not in plain.read_text(encoding="utf-8")


def test_fits_have_intervals_and_correlations(tmp_path: Path) -> None:
    model = tmp_path / "model.yaml"
    text = (MODELS / "slider_crank.yaml").read_text()
    model.write_text(
        text
        + "fit:\n  data: {file: run.csv}\n  observe: {phi: {sigma: 1e-3}}\n"
        + "  parameters: {c: {min: 0}, phi': {}}\n"
    )
    made = lagcli.simulate(lagcli.load(MODELS / "slider_crank.yaml", set={"c": 0.2}), t_end=1.0)
    rows = "".join(
        f"{t!r},{q!r}\n" for t, q in zip(made.time.tolist(), made.q[:, 0].tolist(), strict=True)
    )
    (tmp_path / "run.csv").write_text("t,phi\n" + rows)
    text = page_of(tmp_path, "fit", str(model))
    assert "95 % interval (wald)" in text
    assert "Correlation of the errors" in text


def test_a_view_is_for_runs(tmp_path: Path) -> None:
    file = tmp_path / "modes.h5"
    chain = str(MODELS / "chain.yaml")
    assert run(["modes", chain, "--set", "N=1", "--equilibrium", "-o", str(file), "-q"]) == 0
    with pytest.raises(UsageError, match="contains its model"):
        lagcli.report(file, tmp_path / "x.html", model=chain)
