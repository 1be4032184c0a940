"""Large systems: matrices of named entries with the engine's values, bounded in length and time."""

from __future__ import annotations

import json
import random
import re
import shutil
import subprocess
import time
from collections import Counter
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
import symengine as se
from formula_values import MODELS, model_of

from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.lower import lower
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.kinds import projected
from lagcli.equations.presentation.matrices import (
    PARTS,
    Abbreviations,
    Matrices,
    abbreviate,
    without_single_uses,
)
from lagcli.equations.presentation.overview import in_matrices
from lagcli.equations.render import render
from lagcli.equations.typesetting.nodes import Node, Symbol, children, sum_of
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula
from lagcli.model.expression.algebra import constant_value
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tensors import Sized
from lagcli.model.loader import load, load_text
from lagcli.model.names.building import build
from lagcli.model.names.namespace import Namespace
from lagcli.model.names.scope import Scope

FOUND = Path(__file__).parents[3] / "found"
WHIPPLE = FOUND / "whipple_bicycle.yaml"
SHIPPED = {path.stem: path for path in MODELS}


@cache
def system(path: Path):
    return derive(load(path))


class Reader:
    """Evaluates the text of a JSON derivation by the grammar, abbreviations in their order."""

    def __init__(self, equations, content, at):
        self.at = {se.Symbol(name): se.RealDouble(x) for name, x in at.items()}
        model = equations.model
        self.names = Namespace(
            coordinates=model.coordinate_names,
            constraints=model.constraint_names,
            parameters={name: partial(se.Symbol, name) for name in model.parameters},
        )
        self.names.definitions = {}
        for entry in content["abbreviations"]:
            value = self(entry["text"])
            self.names.definitions[entry["name"]] = partial(Sized, se.RealDouble(value), 1)

    def __call__(self, text: str) -> float:
        built = build(parse(text), Scope(self.names, "the test")).value
        return float(built.xreplace(self.at).n(53, real=True))


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(WHIPPLE, marks=pytest.mark.slow),
        *(FOUND / "bennett.yaml", SHIPPED["rolling_disk"], SHIPPED["parallelogram"]),
    ],
    ids=lambda p: p.stem,
)
def test_named_entries_have_the_engine_s_values(path, monkeypatch) -> None:
    monkeypatch.setattr("lagcli.equations.render.json.in_matrices", lambda f, full: True)
    equations = system(path)
    content = json.loads(render(equations, "json"))
    assert content["form"] == "matrices"
    evaluator = Evaluator(lower(equations), tuple(equations.model.parameter_values.values()))
    source = random.Random(9)
    for _ in range(2):
        q, v = (np.array([source.uniform(-0.6, 0.6) for _ in equations.q]) for _ in "qv")
        t = source.uniform(0, 1)
        at = {"t": t, **equations.model.parameter_values}
        at |= {s.name: x for s, x in zip((*equations.q, *equations.v), (*q, *v), strict=True)}
        read = Reader(equations, content, at)
        engine = evaluator.dynamics(t, q, v)
        mass = np.zeros_like(engine.mass_matrix)
        for i, j, formula in content["mass_matrix"]:
            mass[i, j] = read(formula["text"])
        forcing = np.array([read(x["text"]) for x in content["forcing"]])
        jacobian = np.zeros_like(engine.jacobian)
        for i, c in enumerate(content["constraints"]):
            for j, formula in c["row"]:
                jacobian[i, j] = read(formula["text"])
        gamma = np.array([read(c["gamma"]["text"]) for c in content["constraints"]])
        for found, wanted in (
            (mass, engine.mass_matrix),
            (forcing, engine.forcing),
            (jacobian, engine.jacobian),
            (gamma, engine.rhs),
        ):
            # rounding of some thousand operations
            np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-11 * abs(wanted).max())


def test_abbreviations_keep_the_names_of_definitions_and_avoid_names_of_the_model() -> None:
    x, y, z = map(se.Symbol, ("x", "y", "z_1"))
    root = se.sqrt(1 - (x * y + z) ** 2)
    given = [root * se.sin(x), root + (x * y + z) ** 3, (x * y + z) * root]
    found = abbreviate(given, ("x", "y", "z_1"), {x * y + z: "nz"})
    assert next(iter(found.named)) == "nz"
    assert not any(name.startswith("z_") for name in found.named)
    values = {}
    for name, value in found.named.items():
        values[se.Symbol(name)] = value.xreplace(values)
    for wanted, short in zip(given, found.expressions, strict=True):
        assert se.expand(short.xreplace(values) - wanted) == 0


def test_conditions_have_no_names() -> None:
    """SymEngine makes symbols of those that are used twice."""
    x, y = se.symbols("x y")
    small = se.And(x < y, x > 2 * y)
    given = [
        se.Piecewise((se.sin(x) * y, x < y), (y * sign, se.true)) + se.sin(x * y) ** k
        for k, sign in enumerate((1, 2, 3, 4, 5))
    ]
    given += [se.Piecewise((x**k, small), (se.sin(x * y), se.true)) for k in range(1, 6)]
    found = abbreviate(given, ("x", "y"))
    assert "sin(x*y)" in map(str, found.named.values())
    assert not any("True ==" in str(e) or "== True" in str(e) for e in found.expressions)
    values: dict[se.Basic, se.Basic] = {}
    for name, value in found.named.items():
        values[se.Symbol(name)] = value.xreplace(values)
    assert [e.xreplace(values) for e in found.expressions] == given


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bennett", pytest.param("armx5", marks=pytest.mark.slow)])
def test_no_abbreviation_is_used_once(name: str) -> None:
    equations = system(FOUND / f"{name}.yaml")
    text = render(equations, "text", width=100)
    names = Counter(re.findall("z[₀-₉]+", text))
    assert len(names) > 100
    assert min(names.values()) > 2, "its definition, and two uses"
    lowered = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")
    numbers = sorted(int(x[1:].translate(lowered)) for x in names)
    assert numbers == list(range(1, len(names) + 1))
    # written out, the entries are those without abbreviations
    matrices = Matrices(Formulas(equations))
    rng = random.Random(7)
    free = {s for x in matrices.entries.values() for s in x.free_symbols}
    values = {s: se.RealDouble(rng.uniform(0.5, 1.5)) for s in sorted(free, key=str)}
    for short, value in matrices.short.named.items():
        values[se.Symbol(short)] = value.xreplace(values)
    for entry, short in zip(matrices.entries.values(), matrices.short.expressions, strict=True):
        exact = float(entry.xreplace(values))
        assert float(short.xreplace(values)) == pytest.approx(exact, rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_whipple_bicycle_is_readable() -> None:
    began = time.process_time()
    equations = derive(load(WHIPPLE))
    text = render(equations, "text")
    assert time.process_time() - began < 20
    assert len(text.splitlines()) <= 420
    for part in ("nz  = Z · n", "M q̈ = p + ℬᵀ λ", "Abbreviations", "M[x, x]", "p[δ]", "--full"):
        assert part in text
    assert "√(1)" not in text
    written = Counter(re.findall(r"z[₀-₉]+", text))
    assert set(written) == set(re.findall(r"(z[₀-₉]+) = ", text))
    assert min(written.values()) > 2  # one is the definition


LONG = ("net_rods", "stewart", "beam40", "bricard_a04", "bricard_tilted", "whipple_bicycle")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "steps"),
    [
        ("bennett", False),
        pytest.param("ring100", False, marks=pytest.mark.slow),
        *(pytest.param(name, s, marks=pytest.mark.slow) for name in LONG for s in (False, True)),
    ],
)
def test_length_is_bounded(name, steps) -> None:
    equations = system(FOUND / f"{name}.yaml")
    began = time.process_time()
    text = render(equations, "text", steps=steps)
    assert time.process_time() - began < 20
    assert len(text.splitlines()) <= 420
    assert "--full" in text


def test_full_is_whole() -> None:
    equations = system(FOUND / "ring100.yaml")
    text = render(equations, "text", full=True)
    assert "--full" not in text
    assert all(f"  {q}:" in text for q in ("x₅₇", "y₉₉"))
    assert all(f"  rod[{k}]:" in text for k in range(1, 101))


def test_shipped_models_are_written_out() -> None:
    for path in MODELS[::5]:
        formulas = Formulas(system(path))
        assert not in_matrices(formulas), path
        text = render(system(path), "text")
        hint = "Families are written with an index; --full writes out each member."
        assert text.count("--full") == text.count(hint) == (re.search("…, N", text) is not None)


def test_formats_choose_the_same_form(monkeypatch) -> None:
    for module in ("presentation.overview", "presentation.assembly", "render.json"):
        monkeypatch.setattr(
            f"lagcli.equations.{module}.in_matrices", lambda f, full=False: not full
        )
    equations = system(SHIPPED["rolling_disk"])
    text, latex, markdown, data = (
        render(equations, form) for form in ("text", "latex", "markdown", "json")
    )
    # `z` is a coordinate of the disk
    named = Matrices(Formulas(equations)).short.named
    count = sum(name.startswith("s_") for name in named)
    assert count >= 5
    assert len(re.findall(r"s[₀-₉]+ = ", text)) == count
    assert len(re.findall(r"\$s_\{\d+\} = ", latex)) == count
    assert len(re.findall(r"\$s_\{\d+\} = ", markdown)) == count
    assert json.loads(data)["form"] == "matrices"
    assert json.loads(render(equations, "json", full=True))["form"] == "written-out"
    for shown in (latex, markdown):
        assert r"M \, \ddot{q}" in shown


def test_all_parts_are_there() -> None:
    equations = system(SHIPPED["rolling_disk"])
    entries = Matrices(Formulas(equations), PARTS).formulas_of()
    assert {part for part, _, _ in entries} >= {"M", "f", "B", "gamma", "expression", "energy"}


# √(sin² a + cos² a)


def test_rotation_about_a_unit_axis_holds_no_root_of_one() -> None:
    equations = system(FOUND / "rotaxis.yaml")
    for form in ("text", "latex", "markdown", "json"):
        shown = render(equations, form, steps=True)
        assert not re.search(r"√\(1\)|sqrt\(1\)|\\sqrt\{1\}|1²|1\^\{?2", shown), shown
    # the moment of inertia about the axis is m (l cos lam)² + J
    assert "[m l² cos²(lam) + J] q̈" in render(equations, "text")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("sin(a)^2 + cos(a)^2", 1),
        ("3*sin(a)^2*cos(b)^2 + 3*sin(a)^2*sin(b)^2 + 3*cos(a)^2", 3),
        ("(sin(a)^2 + cos(a)^2)^3/4", "1/4"),
        ("sin(2*a)^2 + cos(2*a)^2 - 1", 0),
        ("sin(a)^2 + 2*cos(a)^2", None),
        ("sin(a)^2 + cos(b)^2", None),
        ("x^2*sin(a)^2 + x^2*cos(a)^2", None),
        ("x", None),
    ],
)
def test_hidden_constants(text, value) -> None:
    found = constant_value(se.sympify(text))
    assert found == (None if value is None else se.sympify(value))


def test_roots_of_hidden_constants_are_numbers_in_formulas() -> None:
    equations = model_of("x y", "m*(x'^2 + y'^2)/sqrt(4*sin(x)^2 + 4*cos(x)^2)")
    text = render(equations, "text", steps=True)
    assert "√" not in text.split("Partial derivatives with respect to the velocities")[1]


# LaTeX is compiled where it is installed

needs_latex = pytest.mark.skipif(shutil.which("pdflatex") is None, reason="needs pdflatex")


def compile_latex(latex: str, folder: Path) -> None:
    (folder / "m.tex").write_text(latex, encoding="utf-8")
    command = [
        "pdflatex",
        "-interaction=nonstopmode",
        "-halt-on-error",
        "-no-shell-escape",
        "m.tex",
    ]
    done = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:]


@needs_latex
@pytest.mark.slow
def test_latex_of_the_bicycle_compiles(tmp_path) -> None:
    compile_latex(render(system(WHIPPLE), "latex"), tmp_path)


@needs_latex
@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [*MODELS, *(p for p in sorted(FOUND.glob("*.yaml")) if p.stem not in ("absnh", "armx5"))],
    ids=lambda p: p.stem,
)
@pytest.mark.parametrize("steps", [False, True])
def test_latex_compiles(path, steps, tmp_path) -> None:
    compile_latex(render(system(path), "latex", steps=steps), tmp_path)


def test_letters_of_the_theory_give_way_to_names_of_the_model():
    """Beside names M, B, f, gamma and c, the matrices and vectors of the law have other letters."""
    text = """\
coordinates: {x: m, y: m, phi: rad}
parameters: {M: 1 kg, B: 1 m, f: 2 N, gamma: 1 1/s, c: 1 m}
T: M/2*(x'^2 + y'^2 + B^2*phi'^2)
V: f*x*sin(gamma*t)
constraints: {rod: x^2 + y^2 = B^2, skate: x'*sin(phi) = y'*cos(phi)}
initial: {x: B, y: 0, phi: 0, x': {guess: 0}, y': {guess: 0}, phi': 0}
"""
    f = Formulas(derive(load_text(text)))
    write = TextFormula(Notation(f.model)).text
    law, *others = Matrices(f).steps()
    assert [[write(x) for x in line.sides] for line in law.lines] == [
        ["ℳ q̈", "p + ℬᵀ λ"],
        ["ℬ q̈", "η"],
    ]
    assert "ℳ is symmetric" in law.remark
    matrices = {"Mass matrix ℳ", "Forces p", "Constraint matrix ℬ", "Right side η"}
    assert matrices <= {step.title for step in others}
    entries = {
        write(line.sides[0]).split("[")[0]
        for step in others
        if step.title in matrices
        for line in step.lines
    }
    assert entries == {"ℳ", "p", "ℬ", "η"}
    (line,) = projected(f)
    assert [write(x) for x in line.sides] == ["Jᵀ ℳ J q̈", "Jᵀ (p − ℳ d)"]
    said = render(f.equations, "text")
    assert "b_iβ = ∂h_β/∂qᵢ   for holonomic constraints" in said  # φ and f are taken
    assert "b_iβ = ∂ψ_β/∂q̇ᵢ   for nonholonomic constraints" in said


def test_letters_of_the_theory_where_they_are_free():
    f = Formulas(system(SHIPPED["four_bar"]))
    write = TextFormula(Notation(f.model)).text
    first, second = Matrices(f).steps()[0].lines
    assert [write(x) for x in first.sides] == ["M q̈", "f + Bᵀ λ"]
    assert [write(x) for x in second.sides] == ["B q̈", "γ"]


def test_abbreviations_are_written_in_the_order_of_their_numbers() -> None:
    f = Formulas(derive(load(SHIPPED["pendulum_cartesian"])))
    first, second, third = map(se.Symbol, ("z_1", "z_2", "z_3"))
    f.in_order(("z_1", "z_2", "z_3"))
    f.arrange(third * second)  # what was arranged before does not matter
    names = [x.name for x in children(f.arrange(third * second * first)) if isinstance(x, Symbol)]
    assert names == ["z_1", "z_2", "z_3"]


def test_formulas_of_abbreviations_that_occur_in_two_are_not_arranged() -> None:
    x, y, z, s = map(se.Symbol, ("x", "y", "z_1", "z_2"))
    arranged: list[se.Basic] = []

    def arrange(e: se.Basic) -> Node:
        arranged.append(e)
        return sum_of((1, Symbol(str(part))) for part in e.free_symbols)

    given = Abbreviations({"z_1": x + y, "z_2": x - y}, (z * x + z, y + z, s * x))
    found = without_single_uses(given, arrange)
    assert z * x + z not in arranged
    assert found == Abbreviations({"z_1": x + y}, (z * x + z, y + z, (x - y) * x))
