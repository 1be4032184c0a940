"""Random cases, of which the suite runs a few."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import pytest

#: Mutants, or random models, that each long test (marked ``fuzz``, run by ``make fuzz``) tries.
FUZZ_COUNT = int(os.environ.get("LAGCLI_FUZZ_COUNT", "1000"))


def some(values: Iterable[Any], few: int) -> list[Any]:
    """Return values as parameters; those beyond a few are slow: `make bench` runs them."""
    cases = list(values)
    return cases[:few] + [pytest.param(x, marks=pytest.mark.slow) for x in cases[few:]]


def seeds(few: int, many: int) -> list[Any]:
    """Return seeds as parameters; those beyond a few are slow: `make bench` runs them."""
    return some(range(many), few)
