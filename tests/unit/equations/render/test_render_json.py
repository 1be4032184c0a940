"""The derivation as JSON: complete, and every formula reads back to its expression."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from functools import partial

import pytest
import symengine as se
from formula_values import MODELS, equations_of, model_of, number, point, size
from shipped import PATHS, WRITTEN, every_model

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.render import render
from lagcli.equations.simplification.arrange import Arranger
from lagcli.equations.typesetting.text import grammar_text
from lagcli.functions import FUNCTIONS
from lagcli.model.expression.functions import apply
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tensors import Sized
from lagcli.model.names.building import build
from lagcli.model.names.namespace import Allowed, Namespace
from lagcli.model.names.scope import Scope

TOLERANCE = 1e-12  # rounding of some hundred terms


def read(text: str, equations: Equations) -> se.Basic:
    """Build an expression from text, by the loader's own grammar."""
    model = equations.model
    names = Namespace(
        coordinates=model.coordinate_names,
        constraints=model.constraint_names,
        parameters={name: partial(se.Symbol, name) for name in model.parameters},
        definitions={name: partial(Sized, d.value, 1) for name, d in model.definitions.items()},
        inputs={name: x.smoothness for name, x in model.inputs.items()},
    )
    return build(parse(text), Scope(names, "the test", Allowed.ACCELERATIONS)).value


def assert_same(text: str, expression: se.Basic, equations: Equations, seed: int = 8) -> None:
    found = read(text, equations)
    at = point(equations, random.Random(seed))
    try:
        wanted = number(expression, at)
    except RuntimeError:
        return
    scale = max(size(expression, at), size(found, at), 1e-300)
    if not expression.atoms(se.Piecewise):
        scale = max(scale, size(se.expand(expression), at))
    assert abs(number(found, at) - wanted) <= TOLERANCE * scale, text


@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_formulas_read_back(name):
    e = equations_of(PATHS[name])
    content = json.loads(render(e, "json"))
    names = list(e.model.coordinate_names)
    for key, expression in (
        ("kinetic", e.kinetic),
        ("potential", e.potential),
        ("lagrangian", e.lagrangian),
    ):
        assert_same(content[key]["text"], expression, e)
    assert {(i, j) for i, j, _ in content["mass_matrix"]} == {
        (i, j) for i, row in enumerate(e.mass_matrix) for j in row
    }
    for i, j, formula in content["mass_matrix"]:
        assert_same(formula["text"], e.mass_matrix[i][j], e)
    for i, name in enumerate(names):
        assert_same(content["forcing"][i]["text"], e.forcing[i], e)
        assert_same(content["applied_forces"][i]["text"], e.applied_forces[i], e)
        equation = content["equations"][i]
        assert equation["coordinate"] == name
        assert_same(equation["lhs"]["text"], e.momentum_rates[i] - e.gradient[i], e)
        reaction = [
            m * c.row[i] for m, c in zip(e.multipliers, e.constraints, strict=True) if i in c.row
        ]
        assert_same(equation["rhs"]["text"], se.Add(e.applied_forces[i], *reaction), e)
    assert len(content["constraints"]) == len(e.constraints)
    for entry, c in zip(content["constraints"], e.constraints, strict=True):
        assert entry["name"] == c.constraint.name
        assert entry["kind"] == c.constraint.kind
        assert entry["rheonomic"] is c.rheonomic
        assert_same(entry["expression"]["text"], c.constraint.expression, e)
        assert_same(entry["drift"]["text"], c.drift, e)
        assert_same(entry["gamma"]["text"], c.rhs, e)
        assert [j for j, _ in entry["row"]] == sorted(c.row)
        for j, formula in entry["row"]:
            assert_same(formula["text"], c.row[j], e)
            assert entry["variation"][names[j]] == formula


def test_schema():
    e = equations_of(next(p for p in MODELS if p.stem == "slider_crank_textbook"))
    content = json.loads(render(e, "json", steps=True))
    assert content["schema"] == "lagcli-derivation-2"
    assert list(content) == [
        *("schema", "name", "title", "description", "numeric", "coordinates", "parameters"),
        *("inputs", "form", "abbreviations", "constraints", "events"),
        *(
            "rank",
            "degrees_of_freedom",
            "redundant",
            "kinetic",
            "potential",
            "lagrangian",
            "mass_matrix",
            "forcing",
        ),
        *("applied_forces", "equations", "sign_convention"),
        *("kinds", "partition", "steps"),
    ]
    assert content["degrees_of_freedom"] == 1
    assert (content["form"], content["abbreviations"]) == ("written-out", [])
    assert content["parameters"] == {"m": 1.0, "r": 0.1, "l": 0.3, "g": 9.81}
    assert content["coordinates"][0] == {
        "name": "phi",
        "unit": "rad",
        "description": "angle of the crank above the horizontal",
        "latex": r"\varphi",
    }
    assert content["constraints"][0]["variation"]["psi"]["text"] == "-l*cos(psi)"
    titles = [step["title"] for step in content["steps"]]
    assert titles[:3] == ["Coordinates: k = 2", "Parameters", "Definitions"]
    first = content["steps"][2]
    assert first["lines"][0]["latex"].startswith("x_{A} = ")


@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_numeric_formulas_hold_the_parameters(name):
    e = equations_of(PATHS[name])
    content = json.loads(render(e, "json", numeric=True))
    assert content["numeric"] is True
    at = point(e, random.Random(8)) | e.model.parameter_values
    parameters = {se.Symbol(name) for name in e.model.parameters}
    for i, q in enumerate(e.q):
        found = read(content["forcing"][i]["text"], e)
        assert not found.free_symbols & parameters
        scale = max(size(e.forcing[i], at), size(se.expand(e.forcing[i]), at), 1e-300)
        assert abs(number(found, at) - number(e.forcing[i], at)) <= 1e-11 * scale, q


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_every_function_of_the_grammar_reads_back(name):
    function = FUNCTIONS[name]
    equations = model_of("x y", "m/2*(x'^2 + y'^2)")
    x, y = equations.q
    arguments = [x, y][: max(function.fewest, 1 if function.most == 1 else 2)]
    for expression in (
        apply(name, *arguments),
        3 * apply(name, *[a / 2 for a in arguments]) ** 2 - x,
    ):
        text = grammar_text(Arranger(equations.model).arrange(expression))
        for seed in range(3):
            assert_same(text, expression, equations, seed)


@pytest.mark.parametrize(
    "text",
    [
        "x^(-1)",
        "-x^2",
        "(x + y)^(1/2)*x",
        "x/(y*m)",
        "1/3*x - 2/7",
        "2^x^2",
        "(2^x)^y",
        "x - (y - m)",
        "m*(x - y)/(x + 3)",
        "(x/y)^3",
        "-(x + y)*m/2",
        "pi*x*1e-7",
    ],
)
def test_precedence(text):
    equations = model_of("x y", "m/2*(x'^2 + y'^2)")
    expression = read(text, equations)
    assert_same(grammar_text(Arranger(equations.model).arrange(expression)), expression, equations)


def test_heavy_packages_stay_out():
    code = (
        "import sys, lagcli.equations.render as r; from lagcli.model.loader import load;"
        "from lagcli.equations.derivation.lagrange import derive;"
        f"e = derive(load({str(MODELS[-1])!r}));"
        "[r.render(e, f, steps=True) for f in r.FORMATS];"
        "found = {'sympy', 'scipy', 'matplotlib'} & set(sys.modules);"
        "assert not found, found"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=MODELS[0].parents[1])
