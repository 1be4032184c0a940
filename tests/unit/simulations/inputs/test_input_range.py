"""Tables of inputs that do not last as long as the run."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.errors import ModelError
from lagcli.simulations.inputs.input_range import check_input_range

MODEL = """
coordinates: [x]
inputs:
  u: {{times: [1, 2, 3], values: [0, 1, 0]{extend}}}
T: x'^2/2
Q: {{x: u}}
initial: {{x: 0, x': 0}}
"""


def model(extend: str = ""):
    return lagcli.load_text(MODEL.format(extend=extend))


def test_runs_within_the_table() -> None:
    check_input_range(model(), 1.0, 3.0)
    check_input_range(model(), 1.0 - 1e-13, 3.0 + 1e-13)  # rounding


@pytest.mark.parametrize(
    ("start", "end", "message", "remedy"),
    [
        (0.0, 3.0, "begins at t = 1 s, after the start of the run, t = 0 s", "--t-start 1"),
        (1.0, 4.0, "ends at t = 3 s, before the end of the run, t = 4 s", "--t-end 3"),
    ],
)
def test_runs_beyond_the_table(start: float, end: float, message: str, remedy: str) -> None:
    with pytest.raises(ModelError) as error:
        check_input_range(model(), start, end)
    (found,) = error.value.diagnostics
    assert message in found.message
    assert remedy in found.help
    assert found.location.line == 4


def test_tables_that_are_extended_have_no_end() -> None:
    check_input_range(model(", extend: hold"), 0.0, 9.0)
    check_input_range(model(", extend: periodic"), 0.0, 9.0)
