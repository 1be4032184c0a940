"""Grouping of curves by scale, so that all are visible."""

from __future__ import annotations

from collections.abc import Sequence

#: Curves whose largest magnitudes differ by more than this factor are drawn separately.
_RATIO = 20.0
#: More curves than this form a family, which is not divided.
_FAMILY = 10
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
    if len(largest) > _FAMILY:
        return [list(range(len(largest)))]
    zero = ROUNDING * max(largest, default=0.0)
    groups: list[list[int]] = []
    for i in sorted(range(len(largest)), key=lambda i: -largest[i]):
        if not groups or zero < largest[i] < largest[groups[-1][0]] / _RATIO:
            groups.append([])
        groups[-1 if largest[i] > zero else 0].append(i)
    return sorted(map(sorted, groups))
