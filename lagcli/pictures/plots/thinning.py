"""Thinning of long runs for drawing that preserves all peaks."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array, Indices


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
