"""Events and impacts within a step: roots of polynomials, grazing impacts, given times."""

import numpy as np
import pytest

from lagcli.model.loader import load_text
from tests.support.contact_cases import ContactRun, run_contact

CUBIC = """
coordinates: {x: m}
T: x'^2/2
Q: {x: 6*t - 12}
events:
  zero: {when: x = 0}
  rises: {when: x >= 0}
initial: {x: -6, x': 11}
simulation: {times: [0, 4]}
"""

GRAZING = """
coordinates: {x: m, y: m}
parameters: {depth: 1e-6}
T: (x'^2 + y'^2)/2
constraints:
  hump: {expr: y + x^2 >= depth, restitution: 0}
initial: {x: -1, y: 0, x': 1, y': 0}
simulation: {times: [0, 2]}
"""


def run(text: str, **settings: object) -> ContactRun:
    return run_contact(load_text(text), **settings)


def test_all_three_roots_of_a_cubic_within_a_step() -> None:
    """(t − 1)(t − 2)(t − 3), of SciPy's issue 9228: x = 0 both ways, x ≥ 0 twice."""
    found = run(CUBIC)
    times = [x.time for x in found.entries("event", "zero")]
    np.testing.assert_allclose(times, [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(
        [x.time for x in found.entries("event", "rises")], [1, 3], atol=1e-12
    )


@pytest.mark.parametrize("depth", [1e-4, 1e-8, 1e-12])
def test_grazing_impacts(depth: float) -> None:
    """A particle that passes over a parabola too low by so little."""
    model = load_text(GRAZING, set={"depth": depth})
    found = run_contact(model)
    (impact,) = found.entries("impact")
    root = np.sqrt(depth)
    # the condition of the root is 1/(2 √depth)
    assert impact.time == pytest.approx(1 - root, abs=1e-14 / root + 1e-12)
    model = load_text(GRAZING, set={"depth": -depth})
    assert not run_contact(model).outcome.events


def test_times_are_landed_on_exactly() -> None:
    text = CUBIC.replace("zero: {when: x = 0}", "at: {when: t >= 0.7}")
    (event,) = run(text).entries("event", "at")
    assert event.time == 0.7
    assert event.q[0] == pytest.approx((0.7 - 1) * (0.7 - 2) * (0.7 - 3), abs=1e-13)


def test_a_model_without_contacts_is_not_switched() -> None:
    plain = run(CUBIC.split("events:")[0] + "initial: {x: -6, x': 11}\nsimulation: {times: [0, 4]}")
    assert plain.system.switching is None
    assert plain.outcome.modes == ()
