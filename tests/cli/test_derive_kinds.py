"""lagcli derive --kind, --independent, --solve: formats, errors and exit statuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lagcli.cli.app import run
from lagcli.model.expression.grammar import parse
from lagcli.simulations.start import find_start

MODELS = Path(__file__).parents[2] / "models"
CRANK = str(MODELS / "slider_crank_textbook.yaml")
DISK = str(MODELS / "rolling_disk.yaml")


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert run(["derive", *arguments]) == 0
    return capsys.readouterr().out


def test_the_second_kind_alone(capsys) -> None:
    text = printed(capsys, CRANK, "--kind", "second", "--independent", "phi")
    assert "ψ̇ = r φ̇ cos(φ)/(l cos ψ) = r φ̇ cos(φ)/√(l² − r² sin² φ)" in text
    assert "½ m {r² φ̇² + r² sin² φ [φ̇ + r φ̇ cos(φ)/√(l² − r² sin² φ)]²} − m g r sin φ" in text
    assert "λ" not in text


def test_kinds_are_compared(capsys) -> None:
    text = " ".join(printed(capsys, CRANK, "--kind", "first,second,maggi").split())
    assert "First kind: 3 equations in 2 coordinates and 1 multiplier, 14 terms." in text
    assert "Second kind: 1 equation in 1 coordinate, 22 terms." in text
    assert "Maggi's equations: 1 equation and 1 constraint in 2 coordinates" in text


@pytest.mark.parametrize(
    ("name", "form"),
    [
        *(("slider_crank_textbook", form) for form in ("text", "latex", "markdown", "json")),
        ("parallelogram", "json"),
        ("car_axis", "latex"),
        pytest.param("chain", "text", marks=pytest.mark.slow),
    ],
)
def test_every_format(capsys, form: str, name: str) -> None:
    model = str(MODELS / f"{name}.yaml")
    size = ("--set", "N=4") if name == "chain" else ()
    text = printed(
        capsys, model, "--kind", "first,second,maggi", "--solve", "--steps", "-f", form, *size
    )
    if form == "json":
        content = json.loads(text)
        assert {"partition", "second", "maggi", "solved", "steps"} <= set(content)
    elif form == "latex":
        assert text.count("{") == text.count("}")
        assert "[U+" not in text
    else:
        assert "Maggi" in text


def test_json_can_be_read(capsys) -> None:
    content = json.loads(
        printed(capsys, CRANK, "--kind", "first,second,maggi", "--solve", "--json")
    )
    assert content["kinds"] == ["first", "second", "maggi"]
    assert content["partition"]["independent"] == ["phi"]
    (psi,) = content["second"]["dependent"]
    assert psi["coordinate"] == "psi"
    assert psi["sine"]["text"] == "r*sin(phi)/l"
    assert psi["cosine"]["text"] == "sqrt(l^2 - r^2*sin(phi)^2)/l"
    assert [x["unknown"] for x in content["solved"]["first"]] == ["lambda.guide", "phi''", "psi''"]

    def formulas(value):
        if isinstance(value, dict) and "text" in value:
            yield value["text"]
        elif isinstance(value, dict):
            for x in value.values():
                yield from formulas(x)
        elif isinstance(value, list):
            for x in value:
                yield from formulas(x)

    found = list(formulas([content[x] for x in ("partition", "second", "maggi", "solved")]))
    assert len(found) > 15
    for text in found:
        parse(text)


def test_what_is_not_short_is_reported(capsys) -> None:
    text = printed(capsys, DISK, "--solve")
    assert "The closed form is omitted: it is long." in text
    redundant = " ".join(printed(capsys, str(MODELS / "parallelogram.yaml"), "--solve").split())
    assert "λ is not unique, because constraints are redundant" in redundant


WRONG = [
    ((CRANK, "--kind", "third"), "there is no kind `third`; known are first, second, maggi"),
    ((CRANK, "--kind", "second", "--independent", "chi"), "there is no coordinate `chi`"),
    ((CRANK, "--independent", "phi,psi"), "use for instance --independent phi"),
    ((DISK, "--kind", "second"), "use --kind maggi"),
    ((DISK, "--kind", "maggi", "--independent", "x,y,z"), "do not determine"),
]


@pytest.mark.parametrize(("arguments", "said"), WRONG, ids=[x[1] for x in WRONG])
def test_wrong_arguments(capsys, arguments, said: str) -> None:
    assert run(["derive", *arguments]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("options", [("--steps",), ("--kind", "first,second,maggi")])
def test_the_start_is_found_once(capsys, monkeypatch, options) -> None:
    found = []

    def find(*arguments):
        found.append(arguments)
        return find_start(*arguments)

    monkeypatch.setattr("lagcli.simulations.start.find_start", find)
    printed(capsys, CRANK, *options)
    assert len(found) == 1


def test_without_a_consistent_start_there_is_the_first_kind_only(capsys, tmp_path) -> None:
    model = tmp_path / "apart.yaml"
    model.write_text(
        "coordinates: [x]\nT: x'^2/2\nconstraints: {a: x^2 + 1}\n"
        "initial: {x: {guess: 1}, x': {guess: 0}}\n"
    )
    assert run(["derive", str(model), "--steps"]) == 0
    shown = capsys.readouterr()
    assert "x² + 1" in shown.out
    assert shown.err.startswith("note: independent coordinates and the second kind are omitted: ")
    assert run(["derive", str(model), "--steps", "--quiet"]) == 0
    assert not capsys.readouterr().err
    assert run(["derive", str(model), "--kind", "second"]) in (2, 3)
    assert "error" in capsys.readouterr().err


def test_branches_within_conditions_of_branches_are_solved(tmp_path, capsys) -> None:
    """SymPy writes nested conditions in a form that SymEngine cannot read."""
    path = tmp_path / "branches.yaml"
    path.write_text(
        "coordinates: [x, y]\nparameters: {m: 1.3, k: 2}\nT: m/2*x'^2 + m/2*y'^2\n"
        "V: if(if(x < y, k, 2*k) > x, x^2, y)*x\n"
        "Q: {x: 'if(k < x and if(x < 1, y, x) > y, x, 0)'}\n"
        'constraints: {c: "x^2 + y = 1"}\n'
        "initial: {x: 0.5, x': 0.1, y: {guess: 0.75}, y': {guess: 0}}\n"
    )
    text = printed(capsys, str(path), "--solve")
    assert "2 if(k < x and y < if(x < 1, y, x), x, 0)" in text.split("Solved for the unknowns")[1]
