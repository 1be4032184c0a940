"""Every place that reads a unit reads all of them alike: right, or refused with the reason."""

from __future__ import annotations

import math
import random
import re
from pathlib import Path

import numpy as np
import pytest
from random_cases import seeds, some

from lagcli.errors import LagcliError
from lagcli.model.expression.dimension import COHERENT
from lagcli.model.expression.unit_table import units
from lagcli.model.expression.units import commensurable, read_unit, si_notation
from lagcli.model.loader import load, load_text
from lagcli.model.model import Model
from lagcli.sweeps.plan.vary import Drawn, read_vary
from tests.support.written_units import REFUSED, WRITTEN

MODEL = """
coordinates: {{x: m}}
parameters: {{m: 1 kg, p: {parameter}}}
{more}
T: m/2*x'^2
initial: {{x: 0, x': 0}}
outputs: {{o: p*x}}
"""


#: Parameters with the names of units.
NAMED: dict[str, float] = {}


def model(parameter: str = "1 {unit}", unit: str = "1", more: str = "", **given: object) -> Model:
    text = MODEL.format(parameter=parameter.format(unit=unit), more=more.format(unit=unit))
    return load_text(beside(text), **given)  # type: ignore[arg-type]


def beside(text: str) -> str:
    """Return the text of a model with the parameters of `NAMED` too."""
    declared = "".join(f", {name}: {value}" for name, value in NAMED.items())
    return re.sub(r"(?m)^(parameters: \{.*)\}$", rf"\1{declared}}}", text)


def parameter(unit: str, folder: Path) -> float:
    return model("3 {unit}", unit).parameters["p"].value


def field(unit: str, folder: Path) -> float:
    return model("{{value: 3, unit: '{unit}'}}", unit).parameters["p"].value


def option(unit: str, folder: Path) -> float:
    return model("2", unit, set={"p": f"3 {unit}"}).parameters["p"].value


def varied(form: str):
    def place(unit: str, folder: Path) -> float:
        found = read_vary(f"p={form.format(unit=unit)}", model("2", unit))
        if isinstance(found, Drawn):
            return found.distribution.a
        return float(found.rows(np.arange(1))[0, 0])

    return place


def header(brackets: str):
    def place(unit: str, folder: Path) -> float:
        (folder / "values.csv").write_text(f"p {brackets[0]}{unit}{brackets[1]}\n3\n")
        found = read_vary(f"@{folder / 'values.csv'}", model("2", unit))
        assert not isinstance(found, Drawn)
        return float(found.rows(np.arange(1))[0, 0])

    return place


def table(unit: str, folder: Path) -> float:
    (folder / "table.csv").write_text(f"t;u [{unit}]\n0;3\n1;3\n")
    path = folder / "model.yaml"
    more = "inputs: {u: {file: table.csv, column: u, interpolation: linear, extend: hold}}"
    path.write_text(beside(MODEL.format(parameter="1", more=more)))
    return load(path).inputs["u"].data.values[0]


def listed(unit: str, folder: Path) -> float:
    more = (
        "inputs:\n  u:\n    times: [0, 1]\n    values: ['3 {unit}', '4 {unit}']\n    extend: hold"
    )
    return model("1", unit, more).inputs["u"].data.values[0]


def tolerated(unit: str, coordinate: str) -> dict[str, float]:
    """Return the tolerances of a model with a coordinate that has a unit of results."""
    text = f"""
coordinates: {{x: '{coordinate}'}}
parameters: {{m: 1}}
T: m/2*x'^2
initial: {{x: 0, x': 0}}
simulation: {{atol: {{x: '3 {unit}'}}}}
"""
    return load_text(beside(text)).settings.atol  # type: ignore[return-value]


def tolerance(unit: str, folder: Path) -> float:
    try:
        coordinate = si_notation(unit)
    except ValueError:
        coordinate = "m"  # the unit is refused
    return tolerated(unit, coordinate)["x"]


PLACES = {
    "parameter": parameter,
    "field unit": field,
    "--set": option,
    "--vary list": varied("3 {unit}, 4 {unit}"),
    "--vary list, one unit": varied("3, 4 {unit}"),
    "--vary grid": varied("3:5:1 {unit}"),
    "--vary linspace": varied("linspace(3 {unit}, 4 {unit}, 5)"),
    "--vary normal": varied("normal(3 {unit}, 0.1 {unit})"),
    "--vary normal, one unit": varied("normal(3, 0.1) {unit}"),
    "--vary range": varied("3 {unit}..4 {unit}"),
    "--vary table": header("[]"),
    "--vary table, parentheses": header("()"),
    "table of an input": table,
    "list of an input": listed,
    "tolerance": tolerance,
}

#: First the places that are read by different code; the others are read as one of these.
OF_EACH_READER = ("parameter", "--set", "--vary grid", "table of an input")
SOME = some(sorted(PLACES, key=lambda x: x not in OF_EACH_READER), len(OF_EACH_READER))


@pytest.mark.parametrize("place", SOME)
def test_units_have_the_same_value_everywhere(place: str, tmp_path: Path) -> None:
    wrong = {}
    for unit, factor, _ in WRITTEN:
        if place == "--vary table, parentheses" and "(" in unit:
            continue
        found = PLACES[place](unit, tmp_path)
        if abs(found - 3 * factor) > 1e-12 * abs(factor):
            wrong[unit] = found
    assert not wrong


@pytest.mark.parametrize("place", SOME)
def test_units_are_units_beside_parameters_of_their_names(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A unit follows the number; in a product of parameters, an operator does."""
    words = {x for unit, _, _ in WRITTEN for x in re.findall(r"[A-Za-z_]+[2-9]?", unit)}
    for name in sorted(words - {"m", "t"}):
        monkeypatch.setitem(NAMED, name, 7.5)
    assert {"N", "g", "kg", "s", "mm4", "kgm2", "in"} <= NAMED.keys()
    test_units_have_the_same_value_everywhere(place, tmp_path)


@pytest.mark.parametrize("place", SOME)
def test_what_is_refused_is_refused_everywhere_with_the_reason(place: str, tmp_path: Path) -> None:
    wrong = {}
    for unit, reason in REFUSED:
        try:
            wrong[unit] = PLACES[place](unit, tmp_path)
        except LagcliError as error:
            text = str(error)
            if not re.search(reason, text):
                wrong[unit] = text
    assert not wrong


def test_tolerances_have_the_dimension_of_their_coordinate() -> None:
    rng = random.Random(4)
    for unit, _, _ in WRITTEN:
        other = rng.choice(WRITTEN)[2]
        if commensurable(unit, other):
            assert tolerated(unit, other)["x"] > 0
        else:
            with pytest.raises(LagcliError, match=r"<text>:6:\d+: .* but must be (in|a number)"):
                tolerated(unit, other)


@pytest.mark.parametrize("seed", seeds(100, 300))
def test_random_products_and_quotients_in_any_notation(seed: int) -> None:
    """Factors and dimensions are those of the parts, and SI notation is read as SI."""
    rng = random.Random(seed)
    names = [name for name in units() if name not in ("1", "lb", "oz", "pound", "pounds", "min")]
    factor, exponents = 1.0, [0] * 7

    def product(count: int, sign: int) -> str:
        nonlocal factor, exponents
        parts = []
        for _ in range(count):
            name, n = rng.choice(names), rng.choice([1, 1, 1, 2, 3, -1, -2])
            unit = units()[name]
            raised = [f"^{n}", f"**{n}", str(n).translate(_RAISED)]
            if n > 1 and name[-1].isalpha():
                raised.append(str(n))
            meters = name == "ms" or (n < 0 and name[:1] == "m" and name[1:] in COHERENT)
            written = f"({name})" if meters and n != 1 else name  # not meters by a power
            if meters:
                raised = raised[:3]
            parts.append(written + ("" if n == 1 else rng.choice(raised)))
            factor *= float(unit.factor) ** (sign * n)
            exponents = [
                x + sign * n * y for x, y in zip(exponents, unit.dimension[:7], strict=True)
            ]
        return rng.choice(["*", "·", " "]).join(parts)

    text = product(rng.randint(1, 3), 1)
    if rng.random() < 0.5:
        text += f"/({product(rng.randint(1, 2), -1)})"
    if re.match(r"(°|deg(rees?)?)[ *·][CF]\b", text):
        return  # a temperature, perhaps
    found = read_unit(text)
    assert math.isclose(found.factor, factor, rel_tol=1e-12)
    assert list(found.dimension[:7]) == exponents
    si = read_unit(si_notation(text))
    assert si.factor == 1
    assert list(si.dimension[:7]) == exponents


_RAISED = str.maketrans("-123", "⁻¹²³")
