"""The registry of methods says what the engines have."""

from __future__ import annotations

import inspect

import scipy.integrate

from lagcli.engine.core import binding
from lagcli.settings.methods import METHODS, methods_of


def test_the_compiled_engine_has_the_methods_declared_as_compiled() -> None:
    assert set(binding.METHODS) == set(methods_of("compiled"))


def test_scipy_has_the_methods_declared_as_its() -> None:
    base = scipy.integrate.OdeSolver
    for name in methods_of("scipy"):
        solver = getattr(scipy.integrate, name)
        assert inspect.isclass(solver)
        assert issubclass(solver, base)
        order = getattr(solver, "error_estimator_order", None)
        assert order in (None, METHODS[name].error_order)
