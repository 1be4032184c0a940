"""Errors at the start and in a run show the author's text and its place in the model file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.engine.system import State
from lagcli.equations.derivation.lagrange import derive
from lagcli.errors import NumericalError
from lagcli.model.loader import load_text
from lagcli.simulations.undefined import undefined_expression

HEAD = "coordinates: [x, y]\nparameters: {m: 1, k: 2, l: 1, z: 0}\n"
TAIL = "initial: {x: 0, x': 0, y: 0, y': 0}\n"


def problem(body: str, tail: str = TAIL, head: str = HEAD):
    """Return the diagnostic of a model that has no start."""
    with pytest.raises(NumericalError) as caught:
        lagcli.simulate(load_text(head + body + tail, "m.yaml"), t_end=0.1)
    (found,) = caught.value.diagnostics
    assert str(caught.value) == found.render()
    return found


def marked(found) -> str:
    where = found.location
    return where.text[where.column - 1 : where.column - 1 + where.length]


@pytest.mark.parametrize(
    ("body", "text", "place", "line"),
    [
        ("T: m/2*(x'^2 + y'^2)\nV: k*log(x)\n", "log(x)", "in `V` has", 4),
        ("T: m/2*(x'^2 + y'^2)\nV: >\n  k*y +\n  m*1/x\n", "m*1/x", "in `V` has", 6),
        (
            "definitions:\n  h: x + log(y)\nT: m/2*(x'^2 + y'^2)\nV: k*h\n",
            *("log(y)", "in the definition `h`, which `V` uses, has", 4),
        ),
        (
            "definitions:\n  r: [x, 1/y]\nT: m/2*(x'^2 + y'^2)\nV: dot(r, r)\n",
            *("1/y", "in the definition `r`, which `V` uses, has", 4),
        ),
        ("T: m/2*(x'^2 + y'^2)\nQ: {x: sqrt(-1 - y)}\n", "sqrt(-1 - y)", "in the force on `x`", 4),
        ("T: m/2*(x'^2 + y'^2)\nD: x'^2/y\n", "x'^2/y", "in `D` has", 4),
        (
            "inputs: {u: {times: [0, 1], values: [-1, 1]}}\n"
            "T: m/2*(x'^2 + y'^2)\nQ: {x: y + log(u)}\n",
            *("log(u)", "in the force on `x`", 5),
        ),
        # of cases only the one that is taken matters
        (
            "T: m/2*(x'^2 + y'^2)\nV: if(x > 1, log(x - 2), log(y)) + y\n",
            *("log(y)", "in `V` has", 4),
        ),
    ],
)
def test_undefined_expressions_are_shown_as_written(body, text, place, line) -> None:
    found = problem(body)
    assert f"`{text}` {place}" in found.message
    assert marked(found) == text
    assert found.location.line == line
    assert found.help


@pytest.mark.parametrize(
    ("body", "text"),
    [
        # V = k/2 (|r| − l)² is finite at r = 0, its derivative is not
        (
            "definitions: {d: 'sqrt(x^2 + y^2)'}\nT: x'^2 + y'^2\nV: k/2*(d - l)^2\n",
            "sqrt(x^2 + y^2)",
        ),
        ("definitions: {r: '[x, y]'}\nT: x'^2 + y'^2\nV: k*norm(r)\n", "norm(r)"),
        # φ̈ needs the second derivative, which x^(3/2) has not at 0
        ("T: x'^2 + y'^2\nV: 0\nconstraints: {c: y = x^1.5}\n", "x^1.5"),
        # the rate of a definition
        ("definitions: {s: sqrt(x)}\nT: s'^2 + y'^2\nV: 0\n", "sqrt(x)"),
    ],
)
def test_undefined_derivatives_name_what_is_differentiated(body, text) -> None:
    found = problem(body)
    assert f"the derivative of `{text}` in" in found.message
    assert "**" not in found.message
    assert marked(found) == text


def test_members_of_families_are_named() -> None:
    found = problem(
        "definitions:\n  d[i = 2..3]: sqrt((x[i] - x[i-1])^2)\nT: sum(x[i]'^2, i = 1..3)\n"
        "V: k*sum(d[i], i = 2..3)\n",
        "initial: {'x[1]': 0, 'x[2]': 1, 'x[3]': 1, \"x[1..3]'\": 0}\n",
        "coordinates: {'x[1..3]': m}\nparameters: {k: 1}\n",
    )
    assert "in the definition `d[3]`, which `V` uses," in found.message
    assert "x[2] = 1, x[3] = 1" in found.message
    assert marked(found) == "sqrt((x[i] - x[i-1])^2)"


def test_a_run_that_reaches_an_undefined_value_names_the_line() -> None:
    text = HEAD + "T: (x'^2 + y'^2)/2\nV: x*log(2 - x)\n" + TAIL.replace("x': 0", "x': 100")
    message = lagcli.simulate(load_text(text), t_end=1).message
    assert "`log(2 - x)` in `V` has no finite value at" in message or "singular" in message
    assert "**" not in message


def test_a_run_with_branches_names_the_line_too() -> None:
    text = HEAD + "T: (x'^2 + y'^2)/2\nV: 0\nQ: {x: \"abs(x) + sqrt(0.5 - t)\"}\n" + TAIL
    found = lagcli.simulate(load_text(text), t_end=1)
    assert found.status == "failed"
    assert "`sqrt(0.5 - t)` in the force on `x` has no finite value at t = 0.5" in found.message


def test_a_force_of_multipliers_without_a_value_is_named() -> None:
    text = (
        "coordinates: [x, y]\nT: (x'^2 + y'^2)/2\nV: 9*y\nQ: {x: sqrt(lambda.floor - 10)}\n"
        "constraints:\n  floor: y = 0\ninitial: {x: 0, y: 0, x': 1, y': 0}\n"
    )
    found = lagcli.simulate(load_text(text), t_end=1)
    assert found.status == "failed"
    assert "`sqrt(lambda.floor - 10)` in the force on `x`" in found.message
    assert "(line 4 of the model)" in found.message


def test_zero_mass_names_energy_parameter_and_place() -> None:
    found = problem("T: m/2*x'^2 + z/2*y'^2\nV: x\n")
    assert "`T` gives `y` no inertia (`z` is 0)" in found.message
    assert (found.location.path, found.location.line, found.location.column) == ("m.yaml", 3, 4)
    assert "--set z=1" in found.help
    assert [note.split()[0] for note, _ in found.notes] == ["`y`", "`z`"]
    assert [place.line for _, place in found.notes] == [1, 2]


def test_a_start_that_is_not_reached_has_a_place() -> None:
    tail = "initial: {x: {guess: 3}, x': 0, y: 0, y': 0}\n"
    body = "T: x'^2 + y'^2\nV: 0\nconstraints:\n  c: x^2 + 1 + 1e-3*x = 0\n"
    with pytest.raises(lagcli.errors.LagcliError) as caught:
        lagcli.simulate(load_text(HEAD + body + tail, "m.yaml"))
    (found,) = caught.value.diagnostics
    assert found.location.line == 6


def test_json_has_the_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from lagcli.cli.app import run

    model = tmp_path / "m.yaml"
    model.write_text(HEAD + "T: m/2*(x'^2 + y'^2)\nV: k*log(x)\n" + TAIL, encoding="utf-8")
    assert run(["simulate", str(model), "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert found["status"] == "failed"
    (entry,) = found["diagnostics"]
    assert (entry["file"], entry["line"], entry["column"]) == (str(model), 4, 6)


@pytest.mark.parametrize(
    ("x", "clause"),
    [
        (-1.0, "`log(x)` in `V` has no finite value at x = -1"),
        (0.5, "`sqrt(x - 1)` in the force on `y` has no"),
        (1.0, "the derivative of `sqrt(x - 1)`"),
    ],
)
def test_any_state_may_be_asked_about(x: float, clause: str) -> None:
    equations = derive(load_text(HEAD + "T: x'^2 + y'^2\nV: log(x)\nQ: {y: sqrt(x - 1)}\n" + TAIL))
    state = State(0.0, np.array([x, 0.0]), np.zeros(2), (1.0, 2.0, 1.0, 0.0))
    found = undefined_expression(equations, state)
    assert clause in found.clause
    assert found.with_line.endswith("of the model)")


def test_known_functions_of_time_have_values_there() -> None:
    inputs = "inputs: {u: {times: [0, 1], values: [1, 2], interpolation: cubic, extend: hold}}\n"
    found = problem("T: m/2*(x'^2 + y'^2)\nV: u*log(x)\n", head=HEAD + inputs)
    assert marked(found) == "log(x)"
    found = problem("T: m/2*(x'^2 + y'^2)\nV: y*log(u - 1)\n", head=HEAD + inputs)
    assert marked(found) == "log(u - 1)"
