"""Numbers in streams that must not be taken for others."""

from __future__ import annotations

import random

import numpy as np
import pytest

from lagcli.engine.program.nodes import INDEXED, LINE, LONGEST, VECTOR, Slots
from lagcli.engine.tape.operations import Op
from lagcli.engine.taylor.series_nodes import SeriesOp


def test_operations_on_vectors_are_no_other_operations() -> None:
    for operations in (Op, SeriesOp):
        assert not {VECTOR + op for op in operations} & set(operations)


def test_no_step_is_taken_for_a_list() -> None:
    # streams are int32; a step between places, which are not negative, is larger
    assert np.iinfo(np.int32).min == INDEXED < -np.iinfo(np.int32).max


def test_vectors_are_whole_batches_of_eight() -> None:
    assert LONGEST % 8 == 0


@pytest.mark.parametrize("seed", range(10))
def test_places_in_use_never_overlap(seed: int) -> None:
    draw = random.Random(seed)
    memory, held, used = Slots(13), [], set(range(13))
    for _ in range(200):
        if held and draw.random() < 0.5:
            at, size = held.pop(draw.randrange(len(held)))
            places = list(range(at, at + size))
            draw.shuffle(places)
            for place in places:  # a vector is free when all its places are
                memory.release(place)
            used.difference_update(places)
        else:
            size = draw.choice((1, 1, 2, 8, 9, 30))
            at = memory.take(size)
            assert size == 1 or at % LINE == 0
            assert used.isdisjoint(range(at, at + size))
            assert at + size <= memory.end
            used.update(range(at, at + size))
            held.append((at, size))
    for at, size in held:
        for place in range(at, at + size):
            memory.release(place)
    # all that was taken is one free interval, but for what lines of the cache leave between
    free = sum(stop - start for start, stop in zip(memory.starts, memory.stops, strict=True))
    assert free >= memory.end - 13 - LINE * len(memory.starts)
    assert len(memory.starts) <= 3


def test_a_vector_is_free_when_its_last_place_is() -> None:
    memory = Slots(0)
    first = memory.take(3)
    memory.release(first)
    memory.release(first + 2)
    assert memory.take(3) == LINE  # the second place is in use
    memory.release(first + 1)
    assert memory.take(8) == first


def test_neighbours_that_are_free_join() -> None:
    memory = Slots(0)
    one, two, three = (memory.take(8) for _ in range(3))
    for at in (one, three, two):
        for place in range(at, at + 8):
            memory.release(place)
    assert memory.take(24) == one
    assert memory.end == 24


def test_single_places_fill_the_first_gap() -> None:
    memory = Slots(0)
    places = [memory.take(1) for _ in range(4)]
    assert places == [0, 1, 2, 3]
    memory.release(1)
    assert memory.take(1) == 1
    assert memory.take(1) == 4
