"""Names of members of families, and their ranges in messages."""

from __future__ import annotations

import pytest

from lagcli.model.names.members import family_of, format_members, indices_of, with_indices


def test_indices_fill_the_brackets_in_order() -> None:
    assert with_indices("Qc.rod[].x[]", (2, 3)) == "Qc.rod[2].x[3]"
    assert with_indices("y", ()) == "y"
    assert with_indices("u[,]", (1, 2)) == "u[1,2]"
    assert with_indices("r[].x", (4,)) == "r[4].x"


def test_a_member_has_an_index_and_a_family() -> None:
    assert (indices_of("x[-3]"), family_of("x[-3]")) == ((-3,), "x[]")
    assert (indices_of("x"), family_of("x")) == ((), "x")
    assert (indices_of("u[2,-3]"), family_of("u[2,-3]")) == ((2, -3), "u[,]")
    assert (indices_of("r[2].x"), family_of("r[2].x")) == ((2,), "r[].x")


@pytest.mark.parametrize(
    ("indices", "shown"),
    [
        ((3, 1, 2), "`x[1..3]`"),
        ((0, 2, 3, 9), "`x[0]`, `x[2..3]`, `x[9]`"),
        ((-1, 0, 5), "`x[-1..0]`, `x[5]`"),
        (range(0, 12, 2), "`x[0]`, `x[2]`, `x[4]`, `x[6]`, …"),
    ],
)
def test_members_are_shown_as_ranges(indices, shown: str) -> None:
    assert format_members("x", [f"x[{k}]" for k in indices]) == shown


def test_members_with_two_indices_are_shown_as_ranges() -> None:
    assert format_members("u", ["u[1,2]", "u[2,2]", "u[1,3]", "u[2,3]"]) == "`u[1..2, 2..3]`"
