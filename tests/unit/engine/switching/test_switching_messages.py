"""Messages for runs with contacts that stop."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import lagcli
from lagcli.engine.core.status import Status
from lagcli.engine.lowering import lower
from lagcli.engine.switching.messages import no_end, refusal
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.equations.derivation.lagrange import derive

SYSTEM = lower(
    derive(
        lagcli.load_text("""
coordinates: {x: m, y: m}
T: x'^2 + y'^2
constraints:
  floor: {expr: y >= 0, friction: 0.3, slip: x'}
  wall: x >= 0
events: {lift: {when: y <= 0.5, set: {y: 1}}}
initial: {x: 1, y: 1, x': 0, y': 0}
""")
    )
)
CORE = SimpleNamespace(t=0.25, contacts=np.array([[0.0, 0.0, 0.4]] * 3), gained=0.01234)


@pytest.mark.parametrize(
    ("status", "impacts", "message"),
    [
        (Status.GAINS, "newton", "an impact at t = 0.25 s would gain 0.0123 J (Newton's law"),
        (
            Status.GAINS,
            "sequential",
            "an impact at t = 0.25 s would gain 0.0123 J (sequential",
        ),
        (
            Status.JAMMED,
            "poisson",
            "the force at `floor` grows without bound while it slides",
        ),
        (
            Status.TWO_MODES,
            "poisson",
            "two motions are possible at `floor` at t = 0.25 s",
        ),
        (Status.NO_MODE, "poisson", "no motion is possible at `floor` at t = 0.25 s (Painlevé)"),
        (Status.NO_IMPACT, "poisson", "the impact at t = 0.25 s has no solution"),
    ],
)
def test_refusals_name_the_contact(status: Status, impacts: str, message: str) -> None:
    assert refusal(SplitSystem(SYSTEM), status, CORE, impacts).startswith(message)


def test_events_without_an_end_are_listed_once() -> None:
    log = [
        SimpleNamespace(time=0.1, occurrence="opens", which=0),
        *[
            SimpleNamespace(time=0.25, occurrence="event", which=0),
            SimpleNamespace(time=0.25, occurrence="closes", which=0),
        ]
        * 3,
    ]
    message = no_end(SYSTEM, 0.25, log)  # type: ignore[arg-type]
    assert message == "events do not end at t = 0.25 s: `lift`, `floor closes`"
