"""Random cases, of which the suite runs a few."""

from __future__ import annotations

from typing import Any

import pytest


def seeds(few: int, many: int) -> list[Any]:
    """Return seeds as parameters; those beyond a few are slow: `make bench` runs them."""
    return [pytest.param(x, marks=[] if x < few else [pytest.mark.slow]) for x in range(many)]
