"""Arithmetic progressions of registers: operations that can be vectorized."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from lagcli.arrays import Indices, Numbers
from lagcli.engine.program.nodes import INDEXED, LONGEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

#: Minimum length of a vector, in operations: a shorter one takes as long as its parts.
SHORTEST = 8
#: Gain per element of a vector, with all operands in progression or one indexed; cost of a vector.
_SAVED, _SAVED_INDEXED = 0.1, 0.06
#: Largest distance, in the order of operands, of the first two elements of a progression.
_REACH = 4
#: Number of most common differences of which the best is used.
_CANDIDATES = 4
#: Odd numbers without a pattern, for hashing.
_MIXED = np.array(
    [0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xD6E8FEB86659FD93],
    dtype=np.uint64,
)
#: Largest number of progressions searched in one set.
_MOST = 60


def progressions(points: ArrayLike) -> tuple[list[list[int]], list[int]]:
    """Find points in arithmetic progression.

    Parameters
    ----------
    points : (n, k) array of integers
        The registers of k operands.

    Returns
    -------
    found : list of lists of int
        Indices of points; in some progressions, one of the coordinates is arbitrary.
    rest : list of int
        Indices of the points in no progression.
    """
    places = np.array(points, dtype=np.int64)
    left, again = _sorted(places)
    found: list[list[int]] = []
    while len(left) >= SHORTEST and len(found) < _MOST:
        best = _best_progressions(places[left])
        if not best:
            break
        found += [left[run].tolist() for run in best]
        left = np.delete(left, np.concatenate(best))
    if len(again) >= SHORTEST and found:
        more, rest = progressions(places[again])
        found += [again[run].tolist() for run in more]
        again = again[rest]
    return found, [*left.tolist(), *again.tolist()]


def _sorted(points: Numbers) -> tuple[Indices, Indices]:
    """Return the order of points, and of those already sorted."""
    order = np.lexsort(points.T[::-1])
    new = np.append(True, (points[order][1:] != points[order][:-1]).any(axis=1))
    return order[new], order[~new]


def _best_progressions(points: Numbers) -> list[Indices]:
    """Return the progressions with the most profitable step, as indices of points."""
    best: list[Indices] = []
    most, operands = 0.0, points.shape[1]
    for indexed in range(-1, operands if operands > 1 else 0):
        kept = points if indexed < 0 else np.delete(points, indexed, axis=1)
        order, _ = _sorted(kept)
        # numbers whose differences distinguish the steps
        keys = (kept[order].astype(np.uint64) * _MIXED[: kept.shape[1]]).sum(axis=1)
        for step in _commonsteps(keys):
            runs = [run for run in _runs(keys, step) if len(run) >= SHORTEST]
            covered = sum(map(len, runs))
            saved = (_SAVED if indexed < 0 else _SAVED_INDEXED) * covered - len(runs)
            if saved > most:
                best, most = [order[run] for run in runs], saved
                if indexed < 0 and 8 * covered > 7 * len(points):
                    return best
    return best


def _commonsteps(keys: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the most common differences of points that are not far apart."""
    gaps = [keys[reach:] - keys[:-reach] for reach in range(1, _REACH + 1)]
    steps, counts = np.unique(np.concatenate(gaps), return_counts=True)
    first = np.argsort(-counts, kind="stable")[:_CANDIDATES]
    return np.asarray(steps[first[counts[first] >= SHORTEST - 1]])


def _runs(keys: NDArray[np.uint64], step: np.uint64) -> Iterator[list[int]]:
    """Yield the longest progressions with a step, of two points at least."""
    order = np.argsort(keys)
    at = np.searchsorted(keys, keys + step, sorter=order) % len(keys)
    following = order[at]
    there = keys[following] == keys + step
    begins = there.copy()
    begins[following[there]] = False
    after = np.where(there, following, -1).tolist()
    for point in np.flatnonzero(begins).tolist():
        run = [point]
        while (point := after[point]) >= 0:
            run.append(point)
        yield run


def pieces(values: Sequence[int], longest: int = LONGEST) -> Iterator[Sequence[int]]:
    """Yield parts of equal lengths that are at most as long as a vector."""
    count = -(-len(values) // longest)
    ends = [len(values) * i // count for i in range(count + 1)]
    return (values[a:b] for a, b in pairwise(ends))


def steps(places: Sequence[int]) -> Sequence[int]:
    """Return the first register and the step, or the list of registers."""
    found = {b - a for a, b in pairwise(places)} or {1}
    return (places[0], *found) if len(found) == 1 else (0, INDEXED, *places)
