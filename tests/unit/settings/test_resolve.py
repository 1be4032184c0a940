"""Settings made complete: defaults, method and formulation."""

from __future__ import annotations

import math

import pytest

from lagcli.errors import UsageError
from lagcli.settings.methods import FORMULATIONS, METHODS
from lagcli.settings.resolve import resolve
from lagcli.settings.settings import SettingsOverrides


def test_without_a_level_there_are_the_defaults() -> None:
    settings = resolve()
    assert (settings.t_start, settings.t_end, settings.samples) == (0.0, 10.0, 1001)
    assert settings.method == "auto"
    assert settings.max_step == settings.timeout == math.inf
    assert settings.times is settings.dt is settings.atol is settings.alpha is None


def test_the_last_sample_time_is_the_end() -> None:
    settings = resolve(SettingsOverrides(times=(0.5, 2.0)), SettingsOverrides(t_end=9.0))
    assert (settings.t_end, settings.samples) == (2.0, None)


def test_a_value_out_of_its_range_is_rejected() -> None:
    with pytest.raises(UsageError, match="no method `radau`; did you mean `Radau`"):
        resolve(SettingsOverrides(method="radau"))
    with pytest.raises(UsageError, match="t_end 10 is not after t_start 20"):
        resolve(SettingsOverrides(t_start=20.0))


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("method", METHODS.values(), ids=lambda m: m.name)
def test_a_formulation_that_the_method_lacks_is_reported(method, formulation: str) -> None:
    given = SettingsOverrides(method=method.name, formulation=formulation)
    if formulation in method.formulations:
        assert resolve(given).method == method.name
    else:
        with pytest.raises(UsageError, match=f"{method.name} has no Baumgarte stabilization"):
            resolve(given)


def test_auto_is_dop853_where_there_is_nothing_to_choose() -> None:
    assert resolve(SettingsOverrides(formulation="baumgarte")).method == "DOP853"
    assert resolve(SettingsOverrides(formulation="index1")).method == "auto"
