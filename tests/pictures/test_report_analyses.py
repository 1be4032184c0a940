"""Pages of analyses: what was found, with its numbers, light and dark."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import lagcli
from lagcli.cli.app import run
from lagcli.errors import UsageError

MODELS = Path(__file__).parents[2] / "models"
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
    text = page_of(tmp_path, "equilibrium", str(MODELS / "pendulum_cartesian.yaml"), "--all")
    assert text.index("stable") < text.index("unstable")
    assert "−4.905" in text
    assert "N/m" in text


def test_branches_have_a_diagram_and_bifurcations(tmp_path: Path) -> None:
    hoop = str(MODELS / "bead_on_rotating_hoop.yaml")
    text = page_of(tmp_path, "equilibrium", hoop, "--along", "Omega=2:4")
    assert "branch point" in text
    # Ω² = g/R
    assert "3.1320919526" in text


def test_linear_models_have_matrices(tmp_path: Path) -> None:
    text = page_of(tmp_path, "linearize", str(MODELS / "slider_crank.yaml"), "--input", "tau")
    assert "ẋ = A x + B u" in text
    assert '<span class="name">tau</span>' in text


def test_comparisons_have_a_row_for_each_run(tmp_path: Path) -> None:
    text = page_of(tmp_path, "compare", str(MODELS / "pendulum_cartesian.yaml"), "--t-end", "1")
    for formulation in ("projection", "baumgarte", "index1", "ggl"):
        assert formulation in text


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
    with pytest.raises(UsageError, match="holds its model"):
        lagcli.report(file, tmp_path / "x.html", model=chain)
