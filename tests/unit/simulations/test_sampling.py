"""Sample times and absolute tolerances that follow from settings."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.errors import UsageError
from lagcli.settings.settings import Settings
from lagcli.simulations.sampling import absolute_tolerances, sample_times


@pytest.mark.parametrize(
    ("settings", "times"),
    [
        ({"t_start": 0.0, "t_end": 1.0, "samples": 5}, [0, 0.25, 0.5, 0.75, 1]),
        ({"t_start": 2.0, "t_end": 3.0, "samples": 3}, [2, 2.5, 3]),
        ({"t_start": 0.0, "t_end": 1.0, "samples": 1}, [1]),  # where the motion ends
        ({"t_start": 0.0, "t_end": 1.0, "dt": 0.25}, [0, 0.25, 0.5, 0.75, 1]),
        ({"times": (0.5, 0.75, 4.0), "t_start": 0.5, "t_end": 4.0}, [0.5, 0.75, 4]),
    ],
)
def test_sample_times(settings: dict, times: list[float]) -> None:
    np.testing.assert_array_equal(sample_times(Settings(**settings)), times)


def test_times_from_a_start_are_rounded_once() -> None:
    by_step = sample_times(Settings(t_start=-61.2, t_end=10.8, dt=1.8))
    by_number = sample_times(Settings(t_start=-61.2, t_end=10.8, samples=41))
    expected = [round(1.8 * k, 1) for k in range(-34, 7)]
    assert by_step.tolist() == by_number.tolist() == expected
    odd = sample_times(Settings(t_start=-np.pi, t_end=np.pi, samples=3))
    assert odd.tolist() == [-np.pi, 0.0, np.pi]


@pytest.mark.parametrize(("dt", "end"), [(0.1, 0.3), (0.1, 0.7), (1 / 3, 1.0), (0.001, 2.002)])
def test_steps_of_dt_never_pass_the_end(dt: float, end: float) -> None:
    # 3 · 0.1 is 0.30000000000000004 in doubles
    times = sample_times(Settings(t_start=0.0, t_end=end, dt=dt))
    assert times[-1] == end
    assert (np.diff(times) > 0).all()
    np.testing.assert_allclose(np.diff(times), dt, rtol=1e-9)


def test_tolerances_by_name_stand_in_the_order_of_the_state() -> None:
    given = {"y'": 1e-3, "x": 1e-6}
    np.testing.assert_array_equal(
        absolute_tolerances(given, ("x", "y")), [1e-6, 0, 0, 1e-3, 0]
    )  # x, y, x', y', work
    assert absolute_tolerances(1e-9, ("x",)) == 1e-9
    assert absolute_tolerances(None, ("x",)) == 0.0


@pytest.mark.parametrize(
    "settings",
    [
        {"t_start": 1e15, "t_end": 1e15 + 1, "samples": 101},
        {"t_start": 1e6, "t_end": 1e6 + 1e-6, "dt": 1e-11},
        {"t_start": 0.0, "t_end": 5e-324, "samples": 3},
    ],
)
def test_times_that_are_not_distinct_are_an_error(settings: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="are not distinct times"):
        sample_times(Settings(**settings))


def test_the_distance_of_times_is_the_cause() -> None:
    """Doubles near 1e6 are 2⁻³³ apart."""
    with pytest.raises(UsageError, match=r"those near 1000000 s are 1\.2e-10 s apart"):
        sample_times(Settings(t_start=1e6, t_end=1e6 + 1e-9, samples=101))


@pytest.mark.parametrize("name", ["z", "x_dot", "x''"])
def test_a_tolerance_of_nothing_is_an_error(name: str) -> None:
    with pytest.raises(UsageError, match=f"atol names `{name}`"):
        absolute_tolerances({"x": 1e-6, name: 1e-6}, ("x", "y"))
