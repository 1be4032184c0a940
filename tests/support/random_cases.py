"""Random cases, of which the suite runs a few."""

from __future__ import annotations

import os
from typing import Any

import pytest

#: Mutants, or random models, that each long test (marked ``fuzz``, run by ``make fuzz``) tries.
FUZZ_COUNT = int(os.environ.get("LAGCLI_FUZZ_COUNT", "1000"))


def seeds(few: int, many: int) -> list[Any]:
    """Return seeds as parameters; those beyond a few are slow: `make bench` runs them."""
    return [pytest.param(x, marks=[] if x < few else [pytest.mark.slow]) for x in range(many)]
