"""Tables of results as lines of text, and the quantities of states."""

from __future__ import annotations

from random import Random

from lagcli.analysis.output.tables import (
    Phrase,
    ResultColumn,
    ResultTable,
    TextColumn,
    eigenvalue_text,
    more,
    state_quantities,
)
from lagcli.analysis.output.text import entry, laid_out, listed, width


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


def table(random: Random) -> ResultTable:
    columns = [ResultColumn("Row", ["a", "bb", "ccc"], text=TextColumn("row", "  {:<5}"))]
    for i in range(random.randint(1, 9)):
        cells = [str(random.randrange(10**4)) for _ in range(3)]
        form = f"  {{:{random.choice('<>')}{random.randint(5, 15)}}}"
        columns.append(ResultColumn(f"c{i}", cells, text=TextColumn(f"head{i}", form)))
    return ResultTable(Phrase("made"), columns)


def test_columns_that_do_not_fit_are_below_with_the_names_of_their_rows() -> None:
    random = Random(4)
    for _ in range(50):
        made = table(random)
        with laid_out(1000):
            [whole] = made.parts()
        for columns in (60, 80, 120):
            with laid_out(columns):
                parts = made.parts()
                lines = made.lines()
            assert max(map(len, lines)) <= columns
            words = [[line.split() for line in part] for part in parts]
            for number, line in enumerate(whole):
                name, *cells = line.split()
                assert all(part[number][0] == name for part in words)
                assert [cell for part in words for cell in part[number][1:]] == cells
            if len(whole[0]) <= columns:
                assert lines == whole


def test_texts_have_80_columns_unless_they_are_laid_out() -> None:
    assert width() == 80
    with laid_out(60):
        assert width() == 60
    assert width() == 80


def test_a_name_stays_with_its_value_where_lines_break() -> None:
    forces = [f"{c} on {q} 1.25" for c, q in zip("abcdefgh", "stuvwxyz", strict=True)]
    for columns in range(40, 90):
        with laid_out(columns):
            lines = entry("λ b", listed(forces), 5)
        assert max(map(len, lines)) <= columns
        items = [x.strip() for line in lines for x in line[14:].split(",") if x.strip()]
        assert items == forces
