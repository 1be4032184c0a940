"""Settings: their declaration, their ranges, and levels over levels."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest

from lagcli.errors import UsageError
from lagcli.settings.methods import FORMULATIONS, METHODS
from lagcli.settings.settings import DEFAULTS, Settings, SettingsOverrides, resolve


def messages(**values: Any) -> list[str]:
    return [str(problem) for problem in SettingsOverrides(**values).problems()]


def test_a_setting_that_is_not_given_is_none() -> None:
    given = SettingsOverrides(t_end=2.0, rtol=None)
    assert (given.t_end, given.rtol, given.times) == (2.0, None, None)
    assert given.as_dict() == {"t_end": 2.0}


def test_an_unknown_setting_is_rejected() -> None:
    with pytest.raises(UsageError, match="no setting `tend`; did you mean `t_end`"):
        SettingsOverrides(tend=1)


def test_settings_do_not_change() -> None:
    with pytest.raises(AttributeError):
        SettingsOverrides(t_end=1.0).t_end = 2.0  # type: ignore[misc]


def test_settings_can_be_sent_to_another_process() -> None:
    given = SettingsOverrides(times=(0.5, 1.0), method="Radau")
    assert pickle.loads(pickle.dumps(given)).as_dict() == given.as_dict()


def test_a_higher_level_fills_its_gaps_from_a_lower_one() -> None:
    low = SettingsOverrides(t_end=5.0, samples=11, rtol=1e-6)
    both = SettingsOverrides(dt=0.1).over(low)
    assert both.as_dict() == {"t_end": 5.0, "dt": 0.1, "rtol": 1e-6}
    # sample times say when the run ends
    assert SettingsOverrides(times=[0.5, 1]).over(low).as_dict() == {
        "times": (0.5, 1.0),
        "rtol": 1e-6,
    }


@pytest.mark.parametrize("name", DEFAULTS.as_dict())
def test_defaults_are_in_range(name: str) -> None:
    assert not messages(**{name: getattr(DEFAULTS, name)})


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"t_end": -1}, "t_end -1 is not after t_start 0; give a later t_end"),
        ({"t_end": math.inf}, "t_end must be a finite number, not inf"),
        ({"t_end": "2"}, "t_end must be a number, not '2'"),
        ({"samples": 0}, "samples must lie between 1 and 10^8, not 0"),
        ({"samples": 2.5}, "samples must be a whole number, not 2.5"),
        ({"dt": 0.0}, "dt must be greater than 0, not 0"),
        ({"dt": 1e-9, "t_end": 1.0}, "dt gives more than 10^8 samples"),
        ({"dt": 0.1, "samples": 3}, "samples and dt contradict each other"),
        ({"times": ()}, "times must hold at least one time"),
        ({"times": (1.0, 1.0)}, "times must increase"),
        ({"times": (-1.0, 1.0)}, "times begin before t_start 0"),
        ({"times": (1.0, 3.0), "t_end": 2}, "times go beyond t_end 2: the last one is 3"),
        (
            {"times": (0.1, 0.1 + 0.2), "t_end": 0.3},
            "times go beyond t_end 0.3: the last one is 0.30000000000000004",
        ),
        ({"t_end": 1e-300}, "a run of 1e-300 s is shorter than steps can be, 1e-290 s"),
        ({"rtol": 1e-20}, "rtol must lie between 1e-13 and 0.1, not 1e-20"),
        ({"atol": 0.0}, "atol must be greater than 0, not 0"),
        ({"atol": {"x": -1.0}}, "atol of `x` must be greater than 0, not -1"),
        ({"method": "rk45"}, "there is no method `rk45`"),
        ({"alpha": -1.0}, "alpha must not be negative, not -1"),
        ({"max_steps": True}, "max_steps must be a whole number, not True"),
        ({"through_singular": "yes"}, "through_singular must be true or false, not 'yes'"),
    ],
)
def test_what_is_out_of_range_is_reported(values: dict[str, Any], message: str) -> None:
    assert messages(**values) == [message]


def test_numbers_of_numpy_are_numbers() -> None:
    assert not messages(t_end=np.float64(1), samples=np.int64(3), times=None)
    assert SettingsOverrides(times=np.linspace(0, 1, 3)).times == (0.0, 0.5, 1.0)


def test_times_that_are_no_numbers_are_rejected() -> None:
    with pytest.raises(UsageError, match="times must be numbers, not 'abc'"):
        SettingsOverrides(times="abc")


def test_the_record_of_a_run_has_no_limits_that_are_not_set() -> None:
    settings = Settings(t_start=0.0, max_step=math.inf, timeout=5.0, alpha=None)
    assert settings.as_dict() == {"t_start": 0.0, "timeout": 5.0}


@pytest.mark.parametrize(("dt", "count"), [(0.1, 11), (0.3, 4), (0.25, 5), (2.0, 1)])
def test_samples_of_a_spacing_are_counted(dt: float, count: int) -> None:
    assert Settings(t_start=0.0, t_end=1.0, dt=dt).sample_count == count


def test_without_a_level_there_are_the_defaults() -> None:
    settings = resolve()
    assert (settings.t_start, settings.t_end, settings.samples) == (0.0, 10.0, 1001)
    assert settings.method == "auto"
    assert settings.max_step == settings.timeout == math.inf
    assert settings.times is settings.dt is settings.atol is settings.alpha is None


def test_the_last_sample_time_is_the_end() -> None:
    settings = resolve(SettingsOverrides(times=(0.5, 2.0)), SettingsOverrides(t_end=9.0))
    assert (settings.t_end, settings.samples) == (2.0, None)


def test_a_later_end_that_is_given_is_the_end() -> None:
    settings = resolve(SettingsOverrides(times=(0.5, 2.0), t_end=9.0))
    assert settings.t_end == 9.0
    settings = resolve(SettingsOverrides(t_end=9.0), SettingsOverrides(times=(0.5, 2.0)))
    assert (settings.times, settings.t_end) == ((0.5, 2.0), 9.0)


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
