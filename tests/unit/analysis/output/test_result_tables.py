"""Tables of results as lines of text, and the quantities of states."""

from __future__ import annotations

from lagcli.analysis.output.tables import (
    Phrase,
    ResultColumn,
    ResultTable,
    TextColumn,
    eigenvalue_text,
    more,
    state_quantities,
)


def test_text_has_the_columns_that_ask_for_it() -> None:
    table = ResultTable(
        Phrase("Shown on pages"),
        (
            ResultColumn("Mode", [1, 2], text=TextColumn("mode", "{:>4}")),
            ResultColumn("Only on pages", [1.0, 2.0]),
            ResultColumn("Ratio", [1 / 3, ""], digits=3, text=TextColumn("ratio", " {:>6}")),
            ResultColumn("Own", [1.0, 2.0], text=TextColumn("own", "  {}", ["one", "two"])),
        ),
    )
    assert table.lines() == ["mode  ratio  own", "   1  0.333  one", "   2         two"]


def test_eigenvalues_stand_for_their_pair() -> None:
    assert eigenvalue_text(-2.0 + 0j) == "-2"
    assert eigenvalue_text(3j) == "± 3i"
    assert eigenvalue_text(-0.5 + 3j) == "-0.5 ± 3i"


def test_states_have_velocities_and_multipliers_that_any_of_them_has() -> None:
    units = {"x": "m", "n": "1", "lambda.rod": "N"}
    still = {"q": {"x": 1.0, "n": 0.0}, "v": {"x": 0.0, "n": 0.0}, "multipliers": {}}
    moving = {"q": {"x": 2.0, "n": 0.0}, "v": {"x": 0.0, "n": 3.0}, "multipliers": {"rod": 4.0}}
    found = [(x.name, x.unit, x.values) for x in state_quantities([still, moving], units)]
    assert found == [
        ("x", "m", [1.0, 2.0]),
        ("n", "1", [0.0, 0.0]),
        ("n'", "1/s", [0.0, 3.0]),
        ("lambda.rod", "N", ["", 4.0]),
    ]


def test_what_is_left_out_is_counted() -> None:
    assert more(3, 3) == []
    assert [x.text for x in more(5, 3)] == ["And 2 more in the file."]
