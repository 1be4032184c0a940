"""Curves of a run: their labels come from the result file, without its model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.equations.typesetting.notation import Notation
from lagcli.model.reading import shipped_models
from lagcli.pictures.curves import Catalogue
from lagcli.pictures.run_file import RunFile

GUIDED = """
coordinates: {x: m, phi: {unit: rad, latex: '\\vec{\\varphi}'}, x_1: m, x1: m}
parameters: {m: 1 kg, y_0: 1 m}
definitions: {y0: 2*y_0}
T: m/2*(x'^2 + x_1'^2 + x1'^2) + m*y0^2*phi'^2
V: 0
constraints: {guide: x + x_1 = 1}
outputs: {reach: x + y0}
initial: {x: 1, phi: 0, x_1: 0, x1: 0, x': 0, phi': 1, x_1': 0, x1': 0}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFile:
    path = tmp_path_factory.mktemp("curves") / "run.h5"
    made = lagcli.simulate(lagcli.load_text(GUIDED), t_end=0.1, samples=3)
    lagcli.write(made, path)
    return RunFile(str(path))


def test_labels_need_no_model(run: RunFile, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(RunFile, "model")
    tex, text = Catalogue(run, tex=True), Catalogue(run)
    assert [c.label for c in tex.of("v")[:2]] == [r"$\dot{x}$", r"$\dot{\vec{\varphi}}$"]
    assert [c.label for c in text.of("v")[:2]] == ["ẋ", "φ̇"]
    # x_1 and x1 would look the same
    assert [c.label for c in text.of("q")[2:]] == ["x_1", "x1"]
    assert [c.label for c in tex.of("multipliers")] == [r"$\lambda$"]
    assert [c.label for c in text.of("multipliers")] == ["λ"]
    assert [c.label for c in text.outputs()] == ["reach"]


def test_values_are_those_of_the_columns(run: RunFile) -> None:
    catalogue, block = Catalogue(run), next(iter(run.blocks(["q", "constraint_force_by"])))
    of_x, of_phi = catalogue.forces([("guide", "x"), ("guide", "phi")])
    assert of_x.place == (0,)
    assert np.array_equal(of_x.of(block), block["constraint_force_by"][:, 0])
    assert of_phi.place is None
    assert not of_phi.of(block).any()
    x = catalogue.of("q")[0]._replace(scale=2.0)
    assert np.array_equal(x.of(block), block["q"][:, 0] / 2)


@pytest.mark.parametrize("name", shipped_models())
def test_stored_names_are_written_as_those_of_the_model(name: str) -> None:
    model = lagcli.load(name)
    run = RunFile(lagcli.simulate(model, t_end=1e-3, samples=2))
    stored, known = run.notation, Notation(model)
    assert stored is not None
    assert stored.declared == known.declared
    for q in (*model.coordinate_names, *model.parameters):
        assert stored.text(q, 1) == known.text(q, 1)
        assert stored.latex(q, 2) == known.latex(q, 2)
        assert stored.mathml(q) == known.mathml(q)
    for c in model.constraint_names:
        assert stored.latex_multiplier(c) == known.latex_multiplier(c)


def test_results_without_names_are_labelled_as_typed(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    lagcli.write(lagcli.simulate(lagcli.load("pendulum_cartesian"), samples=3), path)
    run = RunFile(str(path))
    assert run.notation is None
    assert [c.label for c in Catalogue(run, tex=True).of("multipliers")] == ["lambda.rod"]
