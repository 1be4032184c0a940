"""Formulas of the kinds in JSON are parsed to their expressions, at the initial state."""

from __future__ import annotations

import json
from functools import partial as bound
from itertools import chain
from pathlib import Path

import pytest
import symengine as se

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.reduction.partition import number
from lagcli.equations.reduction.second_kind import Maggi, second_kind
from lagcli.equations.render import render
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tensors import Sized
from lagcli.model.loader import load
from lagcli.model.names.building import build
from lagcli.model.names.namespace import Allowed, Namespace
from lagcli.model.names.scope import Scope
from lagcli.simulations.partition import partition

MODELS = Path(__file__).parents[4] / "models"


class Reader:
    """Evaluates formulas in the model's grammar, with abbreviations."""

    def __init__(self, found, abbreviations):
        model = found.equations.model
        self.values = dict(found.values)
        self.symbols = Namespace(
            coordinates=model.coordinate_names,
            constraints=model.constraint_names,
            parameters={name: bound(se.Symbol, name) for name in model.parameters},
            definitions={name: bound(Sized, d.value, 1) for name, d in model.definitions.items()},
            inputs={name: x.smoothness for name, x in model.inputs.items()},
        )
        for x in abbreviations:
            value = self(x["text"])
            self.values[se.Symbol(x["name"])] = value
            self.symbols.parameters[x["name"]] = bound(se.Symbol, x["name"])

    def __call__(self, text: str) -> float:
        return number(
            build(parse(text), Scope(self.symbols, "the test", Allowed.ACCELERATIONS)).value,
            self.values,
        )


@pytest.mark.parametrize(
    "name", ["slider_crank", "slider_crank_textbook", "four_bar", "car_axis", "heavy_top", "atwood"]
)
def test_second_kind(name: str) -> None:
    found = partition(derive(load(MODELS / f"{name}.yaml")))
    # not at rest, where many terms vanish
    found.values.update({v: 0.3 + 0.1 * i for i, v in enumerate(found.equations.v)})
    content = json.loads(render(found.equations, "json", kinds=("second",), partition=found))
    second, written = second_kind(found), content["second"]
    read = Reader(found, written["abbreviations"])
    for formula, expression in (
        *([(written["lagrangian"], second.lagrangian)] if written["lagrangian"] else []),
        *zip(written["forcing"], second.forcing, strict=True),
        *zip(chain(*written["mass_matrix"]), chain(*second.mass_matrix), strict=True),
        *zip(written["velocities"].values(), second.rates.values(), strict=True),
    ):
        wanted = number(expression, found.values)
        # rounding of some hundred terms that cancel in part
        assert read(formula["text"]) == pytest.approx(wanted, rel=1e-9, abs=1e-9), formula["text"]


@pytest.mark.parametrize("name", ["slider_crank", "rolling_disk", "chaplygin_sleigh", "four_bar"])
def test_maggi(name: str) -> None:
    found = partition(derive(load(MODELS / f"{name}.yaml")))
    content = json.loads(render(found.equations, "json", kinds=("maggi",), partition=found))
    maggi, written = Maggi(found), content["maggi"]
    read = Reader(found, written["abbreviations"])
    for i, k, formula in written["null_space"]:
        wanted = number(found.null_space[i][k], found.values)
        assert read(formula["text"]) == pytest.approx(wanted, rel=1e-12, abs=1e-12)
    for formula, expression in zip(written["forcing"], maggi.forcing, strict=True):
        wanted = number(expression, found.values)
        assert read(formula["text"]) == pytest.approx(wanted, rel=1e-9, abs=1e-9)
