"""Numbers of options, with and without a unit."""

import math

import pytest
import typer

from lagcli.cli.quantities import NumberIn, NumbersIn, real


@pytest.mark.parametrize(
    ("unit", "text", "value"),
    [
        ("s", "0.5", 0.5),
        ("s", "500ms", 0.5),
        ("s", "7 ms", 0.007),
        ("s", " 2.5 min ", 150.0),
        ("s", "1e-3h", 3.6),
        ("s", "-5 ms", -0.005),
        ("s", "20 1/Hz", 20.0),
        ("s", "1e999999999 s", math.inf),
        ("s", "1e308 h", math.inf),
        ("s", "-1e308 h", -math.inf),
        ("s", "1e-999999999 s", 0.0),
        ("1/s", "10 Hz", 10.0),
    ],
)
def test_quantities(unit: str, text: str, value: float) -> None:
    assert NumberIn(unit)(text) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "'' is not a number, as in 2 or '2 s'"),
        ("abc", "'abc' is not a number, as in 2 or '2 s'"),
        ("1_0", "'1_0' is not a number, as in 2 or '2 s'"),
        ("٠.١", "'٠.١' is not a number, as in 2 or '2 s'"),
        ("5m", "'5m' is in m, but must be in s"),
        ("5 rad/s", "'5 rad/s' is in rad/s, but must be in s"),
        ("2h30", "'2h30': `h30` is not a unit"),
        ("5 M", "'5 M': `M` is not a unit"),
    ],
)
def test_wrong_quantities(text: str, message: str) -> None:
    with pytest.raises(typer.BadParameter) as caught:
        NumberIn("s")(text)
    assert caught.value.message.startswith(message)


@pytest.mark.parametrize("text", ["", "x", "1_0e-7", "١e-6", "3 s"])
def test_spellings_of_python_alone_are_no_numbers(text: str) -> None:
    with pytest.raises(ValueError, match=r"could not convert|is not a number"):
        real(text)
    assert real(" -1e-6") == -1e-6


def test_quantities_are_separated_by_commas() -> None:
    assert NumbersIn("s")("0.1,200 ms,1 s") == [0.1, 0.2, 1.0]
    with pytest.raises(typer.BadParameter):
        NumbersIn("s")("0.1,,1")
