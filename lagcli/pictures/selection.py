"""What is drawn of many samples and curves: thinning that keeps peaks, groups of similar size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.model.names.members import family_of


def thin(x: Array, values: Array, columns: int) -> Indices:
    """Return the indices of samples that draw the same curves as all samples.

    The axis of x is divided into columns of equal width, such as those of the pixels. For each
    column and each curve, the first, the last, the smallest and the largest sample are kept: a
    curve drawn through these covers the same pixels. Gaps are preserved: of consecutive values that
    are not finite, the first sample of each column is kept.

    Parameters
    ----------
    x : (nt,) array
        Nondecreasing: the time.
    values : (nt,) or (nt, n) array
        One or several curves as functions of x.
    columns : int
        At least 1.

    Returns
    -------
    (m,) array of int
        Increasing; all samples if there are no more than requested, and never more than 2 + columns
        (2 + 3 n).
    """
    values = np.asarray(values, dtype=np.float64)
    curves = values[:, None] if values.ndim == 1 else values
    count = len(x)
    if count <= 4 * columns or not x[-1] > x[0]:
        return np.arange(count)
    edges = np.searchsorted(x, np.linspace(x[0], x[-1], columns + 1)[:-1])
    starts = np.unique(edges)
    kept = [starts, np.append(starts[1:], count) - 1]
    for curve in curves.T:
        finite = np.isfinite(curve)
        if finite.all():
            kept += [_first(curve, starts, np.minimum), _first(curve, starts, np.maximum)]
            continue
        kept.append(_first((~finite).astype(np.float64), starts, np.maximum))
        kept.append(_first(np.where(finite, curve, np.inf), starts, np.minimum))
        kept.append(_first(np.where(finite, curve, -np.inf), starts, np.maximum))
    return np.unique(np.concatenate(kept))


def _first(curve: Array, starts: Indices, extreme: np.ufunc) -> Indices:
    """Return the first index of each column's extreme value."""
    best = extreme.reduceat(curve, starts)
    widths = np.diff(np.append(starts, len(curve)))
    places = np.flatnonzero(curve == np.repeat(best, widths))
    columns = np.searchsorted(starts, places, side="right") - 1
    _, first = np.unique(columns, return_index=True)
    return places[first]


def evenly(count: int, most: int) -> Indices:
    """Return at most a number of ``count`` indices, evenly spaced, including the first and the
    last.

    Parameters
    ----------
    count, most : int
        ``most`` is at least 2.

    Returns
    -------
    (m,) array of int
        Increasing.
    """
    if count <= most:
        return np.arange(count)
    return np.unique(np.round(np.linspace(0, count - 1, most)).astype(np.intp))


#: Number of curves up to which a plot of a page draws all, and the number of those that it draws
#: of more.
_ALL, _SOME = 24, 12


def drawn(count: int) -> Indices:
    """Return which curves of a plot of a page are drawn: all, or some of many, evenly spaced.

    Parameters
    ----------
    count : int

    Returns
    -------
    (m,) array of int
        Increasing, with the first and the last.
    """
    return evenly(count, count if count <= _ALL else _SOME)


#: Curves whose largest magnitudes differ by more than this factor are drawn separately.
RATIO = 20.0
#: More curves than this form a family, which is not divided.
FAMILY = 10
#: Curves below this part of the largest are 0 except for integration errors.
ROUNDING = 1e-9


def scale_groups(largest: Sequence[float]) -> list[list[int]]:
    """Group curves of one unit by their size, so that none is too small to be visible.

    Parameters
    ----------
    largest : sequence of float
        The largest magnitude of each curve.

    Returns
    -------
    list of list of int
        The indices of the curves of each group, in order. Curves that are 0 except for errors are
        grouped with the largest ones.
    """
    if len(largest) > FAMILY:
        return [list(range(len(largest)))]
    zero = ROUNDING * max(largest, default=0.0)
    groups: list[list[int]] = []
    for i in sorted(range(len(largest)), key=lambda i: -largest[i]):
        if not groups or zero < largest[i] < largest[groups[-1][0]] / RATIO:
            groups.append([])
        groups[-1 if largest[i] > zero else 0].append(i)
    return sorted(map(sorted, groups))


#: Least number of members of a family that is drawn by itself.
_LARGE = 4


def by_family(names: Sequence[str], most: int) -> list[list[int]]:
    """Group curves by large families, if there are more than a legend distinguishes.

    Parameters
    ----------
    names : sequence of str
    most : int
        Number up to which all curves are one group.

    Returns
    -------
    list of list of int
        The indices of the curves of each large family, then those of the others.
    """
    if len(names) <= most:
        return [list(range(len(names)))]
    families: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        families.setdefault(family_of(name), []).append(i)
    large = [x for x in families.values() if len(x) >= _LARGE]
    rest = [i for x in families.values() if len(x) < _LARGE for i in x]
    return [*large, rest] if rest else large


_Item = TypeVar("_Item")

#: Larger values would overflow the differences and margins of an axis.
_LARGEST = 1e300


def drawable(values: Array) -> Array:
    """Return values with NaN, which leaves a gap, for those too large for an axis."""
    with np.errstate(invalid="ignore"):
        large = np.abs(values) > _LARGEST
    return np.where(large, np.nan, values) if large.any() else values


def chosen(names: Sequence[str], most: int, few: int | None = None) -> list[int]:
    """Return the indices of a limited number of names: of each family the first ones and the last.

    Parameters
    ----------
    names : sequence of str
        Names; members of families are x[1], x[2], ….
    most : int
        Number up to which all names are returned.
    few : int, optional
        Approximate number that is returned otherwise; ``most`` by default.
    """
    if len(names) <= most:
        return list(range(len(names)))
    few = most if few is None else few
    families: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        families.setdefault(name.partition("[")[0], []).append(i)
    share = max(2, few // len(families))
    places = [i for f in families.values() for i in (f if len(f) <= share else _ends(f, share))]
    places = sorted(places)
    return places if len(places) <= most else _ends(places, few)


def elided(places: Sequence[int], items: Sequence[_Item], dots: _Item) -> list[_Item]:
    """Return items with ellipses where their indices have gaps."""
    shown: list[_Item] = []
    for n, item in enumerate(items):
        if n and places[n] > places[n - 1] + 1:
            shown.append(dots)
        shown.append(item)
    return shown


def _ends(places: list[int], most: int) -> list[int]:
    return [*places[: most - 1], places[-1]]
