"""How many mutants the long tests (marked ``fuzz``, run by ``make fuzz``) try."""

from __future__ import annotations

import os

import pytest

#: Tests that read it when they are collected can take it from the environment in the same way.
VARIABLE = "LAGCLI_FUZZ_COUNT"


@pytest.fixture(scope="session")
def fuzz_count() -> int:
    """Return how many mutants, or random models, each long test tries."""
    return int(os.environ.get(VARIABLE, "1000"))
