"""Settings made complete: defaults, engine and method."""

from __future__ import annotations

import math

import pytest

from lagcli.errors import UsageError
from lagcli.settings import resolve as resolving
from lagcli.settings.methods import FORMULATIONS, METHODS, methods_of
from lagcli.settings.resolve import resolve
from lagcli.settings.settings import SettingsOverrides


def test_without_a_level_there_are_the_defaults() -> None:
    settings = resolve()
    assert (settings.t_start, settings.t_end, settings.samples) == (0.0, 10.0, 1001)
    assert (settings.method, settings.engine) == ("auto", "compiled")
    assert settings.max_step == settings.timeout == math.inf
    assert settings.times is settings.dt is settings.atol is settings.alpha is None


def test_the_last_sample_time_is_the_end() -> None:
    settings = resolve(SettingsOverrides(times=(0.5, 2.0)), SettingsOverrides(t_end=9.0))
    assert (settings.t_end, settings.samples) == (2.0, None)


def test_a_value_out_of_its_range_is_rejected() -> None:
    with pytest.raises(UsageError, match="no method `rk45`; did you mean `RK45`"):
        resolve(SettingsOverrides(method="rk45"))
    with pytest.raises(UsageError, match="t_end 10 is not after t_start 20"):
        resolve(SettingsOverrides(t_start=20.0))


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("method", METHODS.values(), ids=lambda m: m.name)
def test_an_engine_is_chosen_that_has_what_is_asked_for(method, formulation: str) -> None:
    having = [e for e, known in method.formulations.items() if formulation in known]
    given = SettingsOverrides(method=method.name, formulation=formulation)
    if having:
        assert resolve(given).engine == having[0]
    else:
        with pytest.raises(UsageError, match=f"{method.name} has no Baumgarte stabilization"):
            resolve(given)


@pytest.mark.parametrize("engine", ["compiled", "scipy"])
@pytest.mark.parametrize("method", METHODS)
def test_an_engine_that_lacks_the_method_is_reported(method: str, engine: str) -> None:
    given = SettingsOverrides(method=method, engine=engine)
    if method in methods_of(engine):
        assert resolve(given).engine == engine
    else:
        with pytest.raises(UsageError, match=f"(has no method|has) {method}; "):
            resolve(given)


def test_auto_is_dop853_where_there_is_nothing_to_choose(monkeypatch: pytest.MonkeyPatch) -> None:
    assert resolve(SettingsOverrides(formulation="baumgarte")).method == "DOP853"
    assert resolve(SettingsOverrides(engine="scipy")).method == "DOP853"
    monkeypatch.setattr(resolving, "compiled_available", lambda: False)
    settings = resolve()
    assert (settings.engine, settings.method) == ("scipy", "DOP853")
