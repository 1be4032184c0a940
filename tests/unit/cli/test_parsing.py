"""Command lines: words of options and arguments, their values, and errors."""

import math
import random
from enum import StrEnum
from getopt import GetoptError, gnu_getopt
from typing import Annotated, Literal

import pytest

from lagcli.cli.options import with_settings
from lagcli.cli.parameters import Argument, Command, Option, parameters_of
from lagcli.cli.parsing import CommandLineError, split, values
from lagcli.cli.quantities import NumberIn, WrongNumber
from lagcli.settings.settings import SettingsOverrides


class Colour(StrEnum):
    red = "red"
    blue = "blue"


def command(
    file: Annotated[str, Argument(metavar="FILE", help="")],
    names: Annotated[list[str] | None, Argument(metavar="[NAME…]", help="")] = None,
    output: Annotated[str | None, Option("--output", "-o", help="")] = None,
    width: Annotated[int, Option("-w", "--width", help="", least=1, most=9)] = 5,
    rtol: Annotated[float | None, Option(help="")] = None,
    set_: Annotated[list[str] | None, Option("--set", help="")] = None,
    *,
    mode: Annotated[Literal["a", "b"], Option(help="")] = "a",
    colour: Annotated[Colour | None, Option(help="")] = None,
    no_x: Annotated[bool, Option("--no-x", "-x", help="")] = False,
    quiet: Annotated[bool, Option("--quiet", "-q", help="")] = False,
) -> None:
    """Do nothing."""


PARAMETERS = parameters_of(command)
DEFAULTS = {
    **{"names": None, "output": None, "width": 5, "rtol": None, "set_": None, "mode": "a"},
    **{"colour": None, "no_x": False, "quiet": False},
}


def parsed(*words: str) -> dict[str, object]:
    return values(*split(words, PARAMETERS), PARAMETERS)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("f", {}),
        ("f a b", {"names": ["a", "b"]}),
        ("--rtol 1e-6 f", {"rtol": 1e-6}),
        ("f --rtol=-2", {"rtol": -2.0}),
        ("f --rtol -2", {"rtol": -2.0}),
        ("f -o -q", {"output": "-q"}),
        ("f -orun.h5 -q", {"output": "run.h5", "quiet": True}),
        ("f -qxo run.h5", {"output": "run.h5", "quiet": True, "no_x": True}),
        ("f -o=run", {"output": "=run"}),
        ("f --output=a=b", {"output": "a=b"}),
        ("f --output=", {"output": ""}),
        ("f -w3 --width 4", {"width": 4}),
        ("f --set a=1 --set b=2", {"set_": ["a=1", "b=2"]}),
        ("f --mode b --colour blue", {"mode": "b", "colour": Colour.blue}),
        ("-q -- f -q --set", {"quiet": True, "names": ["-q", "--set"]}),
        ("f -", {"names": ["-"]}),
    ],
)
def test_values(line: str, expected: dict[str, object]) -> None:
    assert parsed(*line.split(" ")) == {"file": "f", **DEFAULTS, **expected}


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", "Missing argument 'FILE'."),
        ("f --widht 1", "No such option: --widht (Possible options: --width)"),
        ("f --zzz=1", "No such option: --zzz"),
        ("f -qz", "No such option: -z"),
        ("f -o", "Option '-o' requires an argument."),
        ("f --quiet=1", "Option '--quiet' does not take a value."),
        ("f -w 0", "Invalid value for '-w' / '--width': 0 is not in the range 1<=x<=9."),
        ("f -w x", "Invalid value for '-w' / '--width': 'x' is not a valid int range."),
        ("f --rtol x", "Invalid value for '--rtol': 'x' is not a valid float."),
        ("f -w 1_0", "Invalid value for '-w' / '--width': '1_0' is not a valid int range."),
        ("f -w ٣", "Invalid value for '-w' / '--width': '٣' is not a valid int range."),
        ("f --rtol 1_0e-7", "Invalid value for '--rtol': '1_0e-7' is not a valid float."),
        ("f --rtol ١e-6", "Invalid value for '--rtol': '١e-6' is not a valid float."),
        ("f --mode c", "Invalid value for '--mode': 'c' is not one of 'a', 'b'."),
        ("--colour green", "Invalid value for '--colour': 'green' is not one of 'red', 'blue'."),
    ],
)
def test_errors(line: str, message: str) -> None:
    with pytest.raises(CommandLineError) as caught:
        parsed(*line.split())
    assert str(caught.value) == message


def test_required_options_and_too_many_arguments() -> None:
    def strict(
        shell: Annotated[Colour, Argument(metavar="SHELL", help="")],
        output: Annotated[str, Option("--output", "-o", help="")],
    ) -> None: ...

    own = parameters_of(strict)
    with pytest.raises(CommandLineError, match=r"^Missing option '--output' / '-o'\.$"):
        values({}, ["red"], own)
    with pytest.raises(CommandLineError, match=r"'SHELL'\. Choose from:\n\tred,"):
        values({}, [], own)
    with pytest.raises(CommandLineError, match=r"^Got unexpected extra argument\(s\) \(a b\)$"):
        values({"output": ["x"]}, ["red", "a", "b"], own)


def test_options_of_a_program_end_at_its_command() -> None:
    assert split(["-q", "run", "-x", "--", "-q"], PARAMETERS, mixed=False) == (
        {"quiet": []},
        ["run", "-x", "--", "-q"],
    )


@pytest.mark.parametrize("seed", range(4))
def test_words_are_split_as_by_gnu_getopt(seed: int) -> None:
    """Compare random lines with `getopt`, which abbreviates options: none is a beginning here."""
    rng = random.Random(seed)
    long = [f.removeprefix("--") + "=" * (not p.is_switch) for p in PARAMETERS for f in p.flags]
    names = {f: p.name for p in PARAMETERS for f in p.flags}
    words = ["f", "-", "--", "-q", "-x", "-qx", "-o", "-w1", "-qofile", "-o=1", "-xqw", "-z", "-qz"]
    words += ["--quiet", "--no-x", "--output", "--output=", "--set=a=b", "--rtol", "--bad", "--q=1"]
    words = [w for w in words if w != "--q=1"] + ["--quiet=1", "", "--bad=2", "-é"]
    compared = 0
    for _ in range(400):
        line = rng.choices(words, k=rng.randrange(6))
        try:
            found, rest = gnu_getopt(line, "o:w:xq", [x for x in long if len(x) > 2])
        except GetoptError:
            with pytest.raises(CommandLineError):
                split(line, PARAMETERS)
            continue
        expected: dict[str, list[str]] = {}
        for flag, text in found:
            expected.setdefault(names[flag], []).extend(
                [text] * (names[flag] not in ("quiet", "no_x"))
            )
        assert split(line, PARAMETERS) == (expected, rest), line
        compared += bool(line)
    assert compared > 50


def test_parameters_are_read_from_annotations() -> None:
    found = {p.name: p for p in PARAMETERS}
    assert found["rtol"].flags == ("--rtol",)
    assert found["file"].required
    assert not found["names"].required
    assert found["names"].many
    assert not found["output"].many
    assert found["colour"].choices == ("red", "blue")
    assert found["quiet"].is_switch


def test_help_page(monkeypatch: pytest.MonkeyPatch) -> None:
    from lagcli.cli.help import misuse, page

    monkeypatch.setenv("COLUMNS", "60")

    def draw(
        file: Annotated[str, Argument(metavar="FILE", help="Result file.")],
        out: Annotated[str, Option("--output", "-o", metavar="FILE", help="Picture to write.")],
        width: Annotated[int, Option("--width", help="Columns.", least=1)] = 80,
        mode: Annotated[Literal["narrow", "wide", "full"], Option(help="Size.")] = "wide",
        fast: Annotated[bool, Option("--fast", help="Quickly, with " + "words " * 9)] = False,
    ) -> None: ...

    drawn = Command("lagcli draw", "Draw.\n\nSecond.", parameters_of(draw), draw)
    assert (
        page(drawn)
        == """\
Usage: lagcli draw [OPTIONS] {FILE}

  Draw.

  Second.

Arguments:
  FILE  Result file.  [required]

Options:
  -o, --output FILE          Picture to write.  [required]
  --width <int range>        Columns.  [default: 80; x>=1]
  --mode <narrow|wide|full>  Size.  [default: wide]
  --fast                     Quickly, with words words
                             words words words words words
                             words words
  -h, --help                 Show this message and exit."""
    )
    assert misuse(drawn, "Wrong.") == (
        "Usage: lagcli draw [OPTIONS] {FILE}\nTry 'lagcli draw --help' for help.\n\nError: Wrong."
    )


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
    with pytest.raises(WrongNumber) as caught:
        NumberIn("s")(text)
    assert str(caught.value).startswith(message)


def test_settings_may_be_given_in_other_units() -> None:
    @with_settings("t_end", "times", "alpha", "rtol")
    def command(settings: SettingsOverrides) -> None:
        pass

    own = command.parameters  # type: ignore[attr-defined]
    words = ["--t-end", "2 min", "--times", "0.1,200 ms,1 s", "--alpha=10 Hz"]
    given = values(*split(words, own), own)
    expected = {"t_end": 120.0, "times": [0.1, 0.2, 1.0], "alpha": 10.0, "rtol": None}
    assert given == expected


def test_an_option_may_have_a_unit() -> None:
    def command(
        start: Annotated[float | None, Option("--from", unit="s", help="")] = None,
    ) -> None: ...

    own = parameters_of(command)
    assert values(*split(["--from", "20 ms"], own), own) == {"start": 0.02}
    with pytest.raises(CommandLineError, match=r"'--from': '2 kg' is in kg, but must be in s\.$"):
        values(*split(["--from", "2 kg"], own), own)
