"""The table of methods and the core agree."""

from __future__ import annotations

from lagcli.engine.core import run
from lagcli.settings.methods import FORMULATIONS, METHODS


def test_the_core_has_the_methods_that_are_declared() -> None:
    assert set(run.METHODS) == set(METHODS)


def test_every_formulation_has_a_method() -> None:
    assert {name for method in METHODS.values() for name in method.formulations} == {*FORMULATIONS}
