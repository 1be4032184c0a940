"""The `fit` block of model files, and its errors."""

from __future__ import annotations

import math

import pytest

import lagcli
from lagcli.errors import ModelError
from lagcli.model.model import FitBlock

MODEL = """
coordinates: {phi: rad, x: m}
parameters: {m: 2 kg, l: 30 cm, N: 3, a[1..N]: 1}
T: m*(x'^2 + l^2*phi'^2)/2 + sum(a[i]*x'^2, i = 1..N)
V: m*9.81*x
constraints: {rope: x = l*phi}
initial: {phi: 0.1, x: {guess: 0}, phi': 0, x': {guess: 0}}
outputs: {height: l*sin(phi)}
fit:
"""
DATA = "  data: {file: run.csv, time: T}\n"
OBSERVE = "  observe: {phi: {column: enc, sigma: 1 mrad}, lambda.rope: {sigma: 0.5}}\n"
FOUND = "  parameters: {m: {min: 0.1, max: 5}, l: {max: 50 cm}, phi_dot: }\n"


def block(text: str) -> FitBlock:
    found = lagcli.load_text(MODEL + text).fit
    assert found is not None
    return found


def test_what_is_measured_observed_and_to_be_found() -> None:
    found = block(DATA + OBSERVE + FOUND)
    (data,) = found.data
    assert (data.path, data.time, data.set, data.initial) == ("run.csv", "T", {}, {})
    phi, force = found.observed
    assert (phi.name, phi.column, phi.sigma, phi.sigma_given) == ("phi", "enc", 1e-3, "mrad")
    assert (force.name, force.column, force.sigma_given) == ("lambda.rope", "lambda.rope", None)
    assert [(x.name, x.low, x.high) for x in found.fitted] == [
        ("m", 0.1, 5.0),
        ("l", -math.inf, 0.5),
        ("phi'", -math.inf, math.inf),
    ]


def test_experiments_with_values_of_their_own() -> None:
    data = "  data:\n    - {file: a.csv}\n    - {file: b.csv, set: {l: 20 cm}, initial: {phi: 1}}\n"
    found = block(data + "  observe: {height: h}\n  parameters: {m: {}}\n")
    assert [x.time for x in found.data] == ["t", "t"]
    assert (found.data[1].set, found.data[1].initial) == ({"l": "20 cm"}, {"phi": "1"})
    assert str(found.observed[0].expression) == "l*sin(phi)"


def test_expressions_and_columns_of_all_runs_are_observed() -> None:
    found = block(
        DATA + "  observe: {phi'': {column: a, sigma: 1}, energy_kinetic: {sigma: 2},"
        " x - l*phi': {sigma: 3}}\n" + FOUND
    )
    assert [str(x.expression) for x in found.observed] == ["phi''", "energy_kinetic", "x - l*phi'"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("  5\n", "`fit` must be a mapping"),
        (DATA + OBSERVE, "`fit` has no `parameters`"),
        ("  data: {time: t}\n" + OBSERVE + FOUND, "`data` has no `file`"),
        ("  data: run.csv\n" + OBSERVE + FOUND, "`data` must be a mapping"),
        (DATA + "  observe: {psi: enc}\n" + FOUND, "psi"),
        (DATA + "  observe: {phi: {sigma: 1}, x: xx}\n" + FOUND, "`x` has no `sigma`"),
        (DATA + "  observe: {phi: {sigma: 0}}\n" + FOUND, "must be greater than 0"),
        (DATA + "  observe: {phi: {unit: furlong/}}\n" + FOUND, "furlong"),
        (DATA + "  observe: {phi: {columm: 1}}\n" + FOUND, "no field `columm`"),
        (DATA + OBSERVE + "  parameters: {k: {}}\n", "`k`, which is not a parameter"),
        (DATA + OBSERVE + "  parameters: {m: 3}\n", "must be a mapping"),
        (DATA + OBSERVE + "  parameters: {m: {min: 3, max: 2}}\n", "is not below `max`"),
        (DATA + OBSERVE + "  parameters: {l: {min: 3}}\n", "has no unit"),
        (DATA + OBSERVE + "  parameters: {phi: {min: 5 m}}\n", "in m, and its value in rad"),
        (DATA + OBSERVE + "  parameters: {x': {max: 5 m}}\n", "in m, and its value in m/s"),
        (DATA + OBSERVE + "  parameters: {phi': {}, phi_dot: {}}\n", "named twice"),
        ("  data: {file: a.csv, set: {m: 3}}\n" + OBSERVE + FOUND, "a.csv fixes it"),
    ],
)
def test_errors_point_to_the_place(text: str, said: str) -> None:
    with pytest.raises(ModelError) as caught:
        block(text)
    (diagnostic, *_) = caught.value.diagnostics
    assert said in diagnostic.message
    assert diagnostic.location is not None
    assert diagnostic.location.line >= MODEL.count("\n")
