"""Scales of curves: which can be seen beside each other."""

from __future__ import annotations

from collections.abc import Sequence

#: Curves whose largest magnitudes differ by more than this factor are drawn apart.
_RATIO = 20.0
#: More curves are a family, which stays together.
_FAMILY = 10
#: Of the largest of all: what is 0 but for errors of the integration.
ROUNDING = 1e-9


def scale_groups(largest: Sequence[float]) -> list[list[int]]:
    """Group curves of one unit by their size, so that none is too small to be seen.

    Parameters
    ----------
    largest : sequence of float
        The largest magnitude of each curve.

    Returns
    -------
    list of list of int
        The places of the curves of each group, in order. Curves that are 0 but for errors are
        with the largest ones.
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
