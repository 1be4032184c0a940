"""Thinning of curves, and curves that can be seen beside each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from lagcli.pictures.selection import by_family, evenly, scale_groups, thin
from lagcli.pictures.style import CONSTRAINT_COLORS, PALETTE, constraint_colors, family_colors


def envelope(x: np.ndarray, y: np.ndarray, edges: np.ndarray) -> list[tuple[float, float]]:
    """Return the range of a polyline's samples in each column."""
    column = np.searchsorted(edges, x, side="right")
    return [
        (y[column == k].min(), y[column == k].max())
        for k in range(len(edges) + 1)
        if (column == k).any()
    ]


def test_short_curves_stay() -> None:
    x = np.arange(10.0)
    assert np.array_equal(thin(x, x, 5), np.arange(10))


@settings(deadline=None)
@given(
    hnp.arrays(np.float64, st.integers(100, 400), elements=st.floats(-1e6, 1e6)),
    st.integers(1, 20),
)
def test_each_column_keeps_its_range(y: np.ndarray, columns: int) -> None:
    x = np.linspace(0, 1, len(y))
    kept = thin(x, y, columns)
    assert kept[0] == 0
    assert kept[-1] == len(y) - 1
    assert np.all(np.diff(kept) > 0)
    assert len(kept) <= 2 + columns * 5
    edges = np.linspace(0, 1, columns + 1)[1:-1]
    assert envelope(x, y, edges) == envelope(x[kept], y[kept], edges)


def test_a_single_peak_among_a_million_stays_in_each_curve() -> None:
    x = np.linspace(0, 10, 10**6)
    curves = np.stack((np.sin(x), np.cos(x)), axis=1)
    curves[123_456, 0], curves[654_321, 1] = 7.0, -8.0
    kept = thin(x, curves, 800)
    assert {123_456, 654_321} <= set(kept)
    assert len(kept) < 800 * 6 + 2


def test_gaps_stay_gaps() -> None:
    x = np.linspace(0, 1, 1000)
    y = np.sin(x)
    y[400:600] = np.nan
    kept = thin(x, y, 50)
    assert np.isnan(y[kept]).any()
    assert np.nanmax(y[kept]) == np.nanmax(y)
    assert np.nanmin(y[kept]) == np.nanmin(y)


def test_samples_that_crowd_at_one_end() -> None:
    x = np.concatenate(([0.0], 1 + np.linspace(0, 1e-6, 1000)))
    y = np.random.default_rng(3).normal(size=1001)
    kept = thin(x, y, 100)
    assert y[kept].max() == y.max()
    assert len(kept) < 20


def test_at_one_time_all_stay() -> None:
    assert len(thin(np.zeros(100), np.arange(100.0), 5)) == 100


@pytest.mark.parametrize(("count", "most"), [(0, 5), (1, 5), (5, 5), (6, 5), (10**6, 300)])
def test_evenly(count: int, most: int) -> None:
    kept = evenly(count, most)
    assert len(kept) == min(count, most)
    if count:
        assert kept[0] == 0
        assert kept[-1] == count - 1
        assert np.ptp(np.diff(kept)) <= 1 if len(kept) > 1 else True


@pytest.mark.parametrize(
    ("largest", "groups"),
    [
        ([], []),
        ([1.0, 2.0], [[0, 1]]),
        ([1.0, 100.0, 3.0], [[0, 2], [1]]),
        ([1.0, 19.0, 300.0], [[0], [1, 2]]),  # by the largest of each group
        ([1e-12, 1.0, 0.0], [[0, 1, 2]]),  # zero except for rounding
        ([1.0] * 10 + [1e6], [list(range(11))]),  # a family stays together
    ],
)
def test_groups(largest: list[float], groups: list[list[int]]) -> None:
    assert scale_groups(largest) == groups


def members(family: str, count: int, after: str = "") -> list[str]:
    return [f"{family}[{i + 1}]{after}" for i in range(count)]


def test_large_families_are_groups_of_their_own() -> None:
    x, y = members("x", 5), members("y", 4)
    assert by_family(["a", "b", *x[:3]], 6) == [[0, 1, 2, 3, 4]]
    mixed = [name for pair in zip(x, [*y, "a"], strict=True) for name in pair]
    assert by_family(mixed, 6) == [[0, 2, 4, 6, 8], [1, 3, 5, 7], [9]]
    assert by_family([*members("x", 4), *members("x", 4, "'")], 6) == [[0, 1, 2, 3], [4, 5, 6, 7]]


def luminance(color: str) -> float:
    """Return the relative luminance (WCAG 2.2)."""
    parts = [int(color[n : n + 2], 16) / 255 for n in (1, 3, 5)]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_colours_of_large_families() -> None:
    assert family_colors(["a", *members("x", len(PALETTE))]) == {}
    colors = family_colors(["a", *members("x", 20)])
    assert list(colors) == members("x", 20)
    assert len(set(colors.values())) == 20
    for color in colors.values():
        for page in (1.0, luminance("#16191d")):  # light and dark
            high, low = sorted((page, luminance(color)), reverse=True)
            assert (high + 0.05) / (low + 0.05) > 2.5
    # of constraints, others keep the colours of their places
    constraints = constraint_colors(["a", *members("rod", 20)])
    assert constraints["a"] == CONSTRAINT_COLORS[0]
    assert constraints["rod[20]"] == colors["x[20]"]
