"""Values of the run in the names of results."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.cli.output_name import resolve_name
from lagcli.errors import UsageError

MODEL = lagcli.load_text("""
coordinates: [x, "p[1..2]"]
parameters: {m: 2, n: 3, k: 0.1}
T: m*x'^2/2 + n*sum(p[i]'^2, i = 1..2)
V: k*x^2
initial: {x: 0.25, "x'": -1.5, "p[i = 1..2]": i, "p[i = 1..2]'": 10*i}
""")


@pytest.mark.parametrize(
    ("template", "expected"),
    [
        ("run.h5", "run.h5"),
        ("run_{m}.h5", "run_2.h5"),
        ("{k}", "0.1"),
        ("{ x }_{x'}_{x_dot:.2f}", "0.25_-1.5_-1.50"),
        ("{p[2]}_{p_dot[2]}_{p[1]'}", "2_20_10"),
        ("{m:03d}_{k:05.1f}_{k:+.0e}", "002_000.1_+1e-01"),
        ("{{m}}_{n}", "{m}_3"),
    ],
)
def test_names_in_braces_denote_values(template: str, expected: str) -> None:
    assert resolve_name(template, MODEL) == expected


@pytest.mark.parametrize(
    ("template", "message"),
    [
        ("run_{q}.h5", "`q` is neither a parameter nor an initial value"),
        ("run_{}.h5", "no name between the braces"),
        ("run_{m.h5", "`{` at character 5 has no matching brace"),
        ("run}.h5", "`}` at character 4 has no matching brace"),
        ("{k:d}", "k = 0.1 is not whole"),
        ("{m:/>9}", "`/>9` is not a number format"),
        ("{m: 9}", "is not a number format"),
    ],
)
def test_other_braces_are_errors(template: str, message: str) -> None:
    with pytest.raises(UsageError, match=r"^-o ") as error:
        resolve_name(template, MODEL)
    assert message in str(error.value)
