"""Missing lines between equally spaced samples."""

from __future__ import annotations

import random

import numpy as np
import pytest

from lagcli.results.csv.gaps import Gaps


def warning(time: np.ndarray, cuts: list[int]) -> str | None:
    gaps = Gaps()
    for block in np.split(time, cuts):
        gaps.add(block)
    return gaps.warning()


@pytest.mark.parametrize("seed", range(200))
def test_lines_removed_at_random_are_found(seed: int) -> None:
    rng = random.Random(seed)
    count = rng.randrange(60, 2000)
    start, spacing = rng.choice([0.0, -3.7, 1e5]), 10 ** rng.uniform(-4, 2)
    time = rng.choice(
        [np.linspace(start, start + spacing * count, count), start + spacing * np.arange(count)]
    )
    cuts = sorted(rng.randrange(count) for _ in range(rng.randrange(4)))
    assert warning(time, cuts) is None
    removed = rng.randrange(1, count - 2)
    said = warning(np.delete(time, removed), cuts)
    before, after = time[removed - 1], time[removed + 1]
    assert said is not None
    assert said.startswith(f"samples may be missing between t = {before:g} and {after:g} s: others")
    two = warning(np.delete(time, [removed, (removed + count // 2) % (count - 3) + 1]), cuts)
    assert two is not None


@pytest.mark.parametrize(
    "time",
    [
        [],
        [0.0],
        [0.0, 1.0],
        [0.0, 0.1, 0.25, 0.5, 0.9],
        [*np.arange(50.0), 49.3],  # an end between two samples
        [0.0, 1.0, 2.0, 4.0, 8.0, 16.0],
        np.geomspace(1, 100, 80),
        np.cumsum(np.random.default_rng(0).uniform(0.5, 1.5, 100)),
    ],
)
def test_other_times_have_no_gaps(time: list[float]) -> None:
    for cuts in ([], [1], [2, 3]):
        assert warning(np.array(time), cuts) is None
