"""Curves that can be seen beside each other."""

from __future__ import annotations

import pytest

from lagcli.pictures.scale_groups import scale_groups


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
