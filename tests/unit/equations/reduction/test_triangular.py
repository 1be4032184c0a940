"""Block triangular form: each block needs only earlier ones."""

from __future__ import annotations

import random

import pytest

from lagcli.equations.reduction.triangular import triangular_blocks


def test_a_triangular_system_has_blocks_of_one() -> None:
    blocks = triangular_blocks([{0, 1}, {0}, {0, 1, 2}])
    assert [(b.rows, b.columns) for b in blocks] == [((1,), (0,)), ((0,), (1,)), ((2,), (2,))]


def test_a_loop_is_one_block() -> None:
    blocks = triangular_blocks([{0, 1}, {1, 2}, {2, 0}, {3, 1}])
    assert [set(b.columns) for b in blocks] == [{0, 1, 2}, {3}]


@pytest.mark.parametrize("seed", range(20))
def test_random_systems(seed: int) -> None:
    source = random.Random(seed)
    size = source.randrange(1, 9)
    order = list(range(size))
    source.shuffle(order)
    # a permuted diagonal makes it structurally regular
    rows = [{order[i], *(source.sample(range(size), source.randrange(2)))} for i in range(size)]
    known: set[int] = set()
    for block in triangular_blocks(rows):
        assert len(block.rows) == len(block.columns)
        needed = set().union(*(rows[i] for i in block.rows))
        assert needed <= known | set(block.columns)
        known |= set(block.columns)
    assert known == set(range(size))


def test_a_singular_structure_is_rejected() -> None:
    with pytest.raises(ValueError, match="singular"):
        triangular_blocks([{0}, {0}])
