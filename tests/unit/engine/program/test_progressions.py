"""Progressions: points at equal distances among others, and how they are written."""

from __future__ import annotations

import itertools
import random

import pytest

from lagcli.engine.program.nodes import INDEXED
from lagcli.engine.program.progressions import LONGEST, SHORTEST, pieces, progressions, steps


def test_progressions_are_found_between_others() -> None:
    one = [(10 + 3 * i, 500 - i) for i in range(40)]
    other = [(11 + 3 * i, 900 + 2 * i) for i in range(25)]
    single = [(7, 7), (1000, 3), (1001, 77)]
    points = [*one, *other, *single]
    random.Random(1).shuffle(points)
    found, rest = progressions(points)
    runs = sorted([points[i] for i in run] for run in found)
    assert runs == [one, other]
    assert sorted(points[i] for i in rest) == sorted(single)


def test_one_operand_may_lie_anywhere() -> None:
    draw = random.Random(2)
    points = [(100 + 2 * i, draw.randrange(10**6), 50) for i in range(64)]
    found, rest = progressions(points)
    assert [[points[i] for i in run] for run in found] == [points]
    assert rest == []


def test_equal_points_are_no_progression() -> None:
    found, rest = progressions([(3, 4)] * 2000)
    assert found == []
    assert sorted(rest) == [*range(2000)]


@pytest.mark.parametrize("length", [1, 8, LONGEST, LONGEST + 1, 5 * LONGEST - 3])
def test_pieces_are_no_longer_than_vectors(length: int) -> None:
    found = list(pieces(range(length)))
    assert [*itertools.chain.from_iterable(found)] == [*range(length)]
    assert max(map(len, found)) <= LONGEST
    assert min(map(len, found)) >= min(length, LONGEST // 2)


@pytest.mark.parametrize("seed", range(10))
def test_every_point_is_found_once(seed: int) -> None:
    draw = random.Random(seed)
    points = [(draw.randrange(60), draw.randrange(60)) for _ in range(200)]
    found, rest = progressions(points)
    assert sorted([*itertools.chain.from_iterable(found), *rest]) == [*range(200)]
    for run in found:
        assert len(run) >= SHORTEST
        # in each coordinate but one, at most, equal steps
        columns = zip(*(points[i] for i in run), strict=True)
        assert sum(len({b - a for a, b in itertools.pairwise(c)}) > 1 for c in columns) <= 1


def test_fewer_points_than_a_vector_is_worth_are_left() -> None:
    points = [(i, 5 * i) for i in range(SHORTEST - 1)]
    assert progressions(points) == ([], [*range(SHORTEST - 1)])


def test_points_that_occur_twice_make_two_progressions() -> None:
    found, rest = progressions([(i, 5 * i) for i in range(2 * SHORTEST)] * 2)
    assert ([len(run) for run in found], rest) == ([2 * SHORTEST] * 2, [])


@pytest.mark.parametrize(
    ("places", "expected"),
    [
        ([7, 9, 11], (7, 2)),
        ([7, 7, 7], (7, 0)),
        ([9, 8], (9, -1)),
        ([4], (4, 1)),
        ([1, 2, 4], (0, INDEXED, 1, 2, 4)),
    ],
)
def test_places_are_written_by_first_and_step_or_one_by_one(
    places: list[int], expected: tuple[int, ...]
) -> None:
    assert tuple(steps(places)) == expected
