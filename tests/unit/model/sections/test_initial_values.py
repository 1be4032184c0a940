"""Initial values: fixed, guessed, with units, for members of families."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.errors import ModelError
from lagcli.model.sections.initial import guess_or
from lagcli.model.yaml.source import Mapping, Scalar, Source

MODEL = """
coordinates: {{x: m, phi: rad, "p[1..3]": m}}
parameters: {{l: 2 m, N: 3}}
T: x'^2 + phi'^2 + sum(p[i]'^2, i = 1..3)
initial: {{x: {x}, phi: 0, "p[i = 1..3]": {p}, x': 0, phi': 0, "p[i = 1..3]'": 0}}
"""


def initial(x: str = "0", p: str = "0", **options: dict[str, str]):
    return lagcli.load_text(MODEL.format(x=x, p=p), **options).initial


@pytest.mark.parametrize(
    ("text", "value", "fixed"),
    [
        ("5 cm", 0.05, True),
        ("l/4", 0.5, True),
        ("{guess: 3*l}", 6.0, False),
        ("{guess: 7 mm}", 0.007, False),
    ],
)
def test_values(text: str, value: float, fixed: bool) -> None:
    found = initial(text)["x"]
    assert (found.value, found.fixed) == (value, fixed)


def test_members_of_a_family() -> None:
    found = initial(p="{guess: i*l/N}")
    assert [found[f"p[{i}]"].value for i in (1, 2, 3)] == pytest.approx([2 / 3, 4 / 3, 2])
    assert not any(found[f"p[{i}]"].fixed for i in (1, 2, 3))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{}", "the initial value of `x` is empty"),
        ("{guess: }", "has no value"),
        ("{guss: 1}", "has no field `guss`"),
        ("phi", "phi"),  # a coordinate is no number
        ("t", "t"),
    ],
)
def test_values_that_are_none(text: str, message: str) -> None:
    with pytest.raises(ModelError) as error:
        initial(text)
    assert message in str(error.value)


def test_values_of_the_command_line_may_be_guesses() -> None:
    assert initial("1", set_initial={"x": "{guess: 3 cm}"})["x"].fixed is False
    assert initial("{guess: 1}", set_initial={"x": "3 cm"})["x"].fixed is True
    source = Source("{guess: 3}", "--set-initial")
    node = guess_or(Scalar(source, (0, 0), (0, 10), " {guess: 3} "))
    assert isinstance(node, Mapping)
    plain = Scalar(source, (0, 0), (0, 1), "3")
    assert guess_or(plain) is plain
