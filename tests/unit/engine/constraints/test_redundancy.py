"""Sets of constraints that depend on each other."""

from __future__ import annotations

import numpy as np
from lowered import lowered

import lagcli
from lagcli.engine.constraints.redundancy import dependent_sets
from lagcli.engine.state import State


def sets(constraints: str, rank: int) -> list[tuple[list[int], int]]:
    """Return the sets of linear constraints on four coordinates."""
    names = "wxyz"
    initial = ", ".join(f"{n}: {{guess: 1}}, {n}': {{guess: 0}}" for n in names)
    system, p = lowered(
        lagcli.load_text(f"""
coordinates: [w, x, y, z]
T: (w'^2 + 100*x'^2 + y'^2 + z'^2)/2
constraints: {constraints}
initial: {{{initial}}}
""")
    )
    state = State(0.0, np.array([0.5, 1.0, 2.0, 3.0]), np.zeros(4), p)
    return dependent_sets(system, state, rank, range(len(system.constraints)))


def test_constraints_are_grouped_by_what_they_depend_on() -> None:
    found = sets(
        "{a: x = 1, b: y = 2, c: 1000*x = 1000, d: w = 0.5, e: y + z = 5, f: z = 3}", rank=4
    )
    assert found == [([0, 2], 1), ([1, 4, 5], 1)]  # d stands alone


def test_a_set_may_have_more_than_one_too_many() -> None:
    assert sets("{a: x + y = 3, b: 2*x + 2*y = 6, c: x = 1, d: y = 2}", rank=2) == [
        ([0, 1, 2, 3], 2)
    ]


def test_independent_constraints_have_none() -> None:
    assert sets("{a: x = 1, b: x + y = 3}", rank=2) == []
