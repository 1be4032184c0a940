"""Constraints that events engage, and conditions that actions end."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.trajectory.trajectory import Trajectory

#: A mass that falls from 1 m, and what can be engaged.
FALL = """
coordinates: [y, x]
parameters: {g: 9.81}
T: (y'^2 + x'^2)/2
V: g*y
constraints:
  NAME: {expr: y SIGN HEIGHT, active: false}
events:
  EVENT
initial: {y: 1, y': 0, x: 0, x': 1}
simulation: {t_end: 0.6, samples: 7}
"""


def fall(event: str, height: float = 0.0, **options: Any) -> Trajectory:
    name, sign = ("floor", ">=") if "engage: floor" in event else ("pin", "=")
    if "engage" not in event:
        event += "\n  never: {when: t >= 10, engage: pin}"
    text = FALL.replace("NAME", name).replace("SIGN", sign).replace("HEIGHT", repr(height))
    text = text.replace("EVENT", event)
    return lagcli.simulate(lagcli.load_text(text), **options)


def kinds(found: Trajectory) -> tuple[str, ...]:
    assert found.events is not None
    return tuple(found.events.kinds)


def test_a_constraint_is_engaged_where_phi_vanishes_though_its_terms_do() -> None:
    """φ = y is there a rounding error of a height that is one of a fall from 1 m."""
    found = fall("catch: {when: y <= 0, engage: pin}")
    assert found.status == "completed", found.message
    assert kinds(found) == ("event", "engages")
    np.testing.assert_allclose(found.events.time, math.sqrt(2 / 9.81), atol=1e-9)
    np.testing.assert_allclose(found.q[-1, 0], 0, atol=1e-12)


@pytest.mark.parametrize(("closed", "met"), [(1e-9, False), (1e-6, True)])
def test_the_gap_that_counts_as_none_is_the_setting_closed(closed: float, met: bool) -> None:
    event = "catch: {when: y <= 0.5, set: {y: 0.50000001}, engage: pin}"
    found = fall(event, 0.5, closed=closed)
    assert found.status == ("completed" if met else "failed"), found.message
    if met:
        np.testing.assert_allclose(found.q[-1, 0], 0.5, atol=1e-12)
    else:
        assert found.message.startswith("`pin` cannot be engaged at t = 0.319275")
        assert "phi = 1e-08" in found.message


def test_a_contact_is_engaged_while_it_is_open_but_not_beyond_its_surface() -> None:
    found = fall("floor: {when: y <= 0.5, engage: floor}", 0.2)
    assert found.status == "completed", found.message
    assert kinds(found) == ("event", "engages", "impact", "closes")
    np.testing.assert_allclose(found.events.time[-1], math.sqrt(1.6 / 9.81), atol=1e-9)
    found = fall("floor: {when: y <= 0.5, engage: floor}", 0.7)
    assert found.status == "failed"
    assert "`floor` cannot be engaged" in found.message
    assert "phi = -0.2" in found.message


def test_a_condition_that_an_action_ends_by_a_rounding_error_stays_true() -> None:
    found = fall("lift: {when: y <= 0.5, set: {y: 0.5000000000000002}}")
    assert found.status == "completed", found.message
    assert kinds(found) == ("event",)
    np.testing.assert_allclose(found.q[-1, 0], 1 - 9.81 / 2 * 0.36, atol=1e-9)


def test_a_condition_that_an_action_ends_is_true_again_later() -> None:
    found = fall("lift: {when: y <= 0.5, set: {y: 0.51}, times: 5}")
    assert found.status == "completed", found.message
    assert kinds(found) == ("event",) * 5
    # each time it falls 1 cm, from the velocity of all falls before
    speeds = np.sqrt(2 * 9.81 * (0.5 + 0.01 * np.arange(5)))
    np.testing.assert_allclose(found.events.time, speeds / 9.81, atol=1e-9)
