"""Layouts: parts follow each other without gaps, with the lengths that the counts give."""

from __future__ import annotations

from itertools import pairwise

import pytest

from lagcli.engine.layout import (
    Blocks,
    ConstraintLayout,
    Counts,
    DynamicsLayout,
    Layout,
    RatesLayout,
    SampleLayout,
    UnrolledLayout,
    inputs_of,
)

COUNTS = Counts(nq=3, nc=2, nh=1, nm=7, nb=5)


@pytest.mark.parametrize(
    ("layout", "lengths"),
    [
        (SampleLayout, {"t": 1, "q": 3, "v": 3, "a": 3, "multipliers": 2, "work": 1}),
        (DynamicsLayout, {"mass_matrix": 7, "forcing": 3, "jacobian": 5, "rhs": 2, "power": 1}),
        (
            ConstraintLayout,
            {"position": 1, "jacobian": 5, "drift": 2, "position_scale": 1, "velocity_scale": 2},
        ),
    ],
)
def test_parts_have_the_lengths_of_what_they_hold(
    layout: type[Layout], lengths: dict[str, int]
) -> None:
    made = layout(COUNTS)
    numbers = list(range(100))
    assert {name: len(numbers[getattr(made, name)]) for name in layout.parts()} == lengths
    assert made.size == sum(lengths.values())


@pytest.mark.parametrize("layout", [SampleLayout, UnrolledLayout, RatesLayout])
def test_parts_follow_each_other(layout: type[Layout]) -> None:
    made = layout(COUNTS)
    slices = [getattr(made, name) for name in layout.parts()]
    assert slices[0].start == 0
    assert all(one.stop == next_.start for one, next_ in pairwise(slices))


def test_extended_layouts_begin_like_those_they_extend() -> None:
    for extended, given in ((UnrolledLayout, DynamicsLayout), (RatesLayout, ConstraintLayout)):
        assert list(extended.parts())[: len(given.parts())] == list(given.parts())
        one, other = extended(COUNTS), given(COUNTS)
        assert all(getattr(one, name) == getattr(other, name) for name in given.parts())
    rates = RatesLayout(COUNTS)
    assert rates.velocity == slice(11, 13)


def test_the_last_part_of_an_unrolled_elimination_is_open() -> None:
    layout = UnrolledLayout(COUNTS)
    assert layout.solution == slice(18, 18 + COUNTS.unknowns)
    assert list(range(30))[layout.others] == [*range(25, 30)]


def test_a_system_without_constraints_has_empty_parts() -> None:
    layout = SampleLayout(Counts(nq=1, nc=0))
    assert (layout.multipliers, layout.work, layout.size) == (slice(4, 4), slice(4, 5), 5)


BLOCKS = Blocks(Counts(nq=2, nc=1, nh=1, nm=4, nb=2), 2)


def test_blocks_follow_each_other() -> None:
    assert Counts(nq=6, nc=3, nh=3, nm=12, nb=6) == BLOCKS.total
    assert [BLOCKS.coordinates(k) for k in range(3)] == [slice(0, 2), slice(2, 4), slice(4, 6)]
    assert BLOCKS.constraints(2) == slice(2, 3)


def test_inputs_are_time_coordinates_velocities_and_parameters() -> None:
    q, v, p = inputs_of(BLOCKS, 2)
    assert [0, *q, *v, *p] == list(range(1 + 6 + 6 + 2))
    assert len(q) == len(v) == 6
