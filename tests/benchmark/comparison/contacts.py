"""The cost of contacts, events and kinks, measured alternately with a comparison.

Both sides of a row run in this process one after the other, so that what else the machine does
falls on both alike; the ratio is the median of the ratios of all turns.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

from scipy.integrate import solve_ivp

import lagcli
from comparison.cases import MODELS
from lagcli.engine.contract import Outcome
from lagcli.engine.integrate.engine import switches
from lagcli.engine.integrate.run import Integration
from lagcli.engine.integrate.switching_run import SwitchingIntegration
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import Simulation, prepare

Found = TypeVar("Found")

BOUNCES = 10_000
BALL = """
coordinates: {y: m}
parameters: {m: 2 kg, g: 9.81 m/s^2, h: 1 m}
T: m/2*y'^2
V: m*g*y
constraints:
  floor: {expr: y >= 0, restitution: 1}
initial: {y: h, y': 0}
"""
BILINEAR = """
coordinates: [x]
T: x'^2/2
V: "if(x > 0, 100, 1600)*x^2/2"
initial: {x: 0, x': 1}
"""
BACKLASH = """
coordinates: [a, b]
T: (a'^2 + b'^2/2)/2
definitions:
  gap: a - b
  torque: 4000*(max(gap - 0.01, 0) + min(gap + 0.01, 0)) + 2*if(abs(gap) > 0.01, gap', 0)
Q: {a: 2*cos(4*t) - torque, b: torque - 1.5*b'}
initial: {a: 0, b: 0, a': 0, b': 0}
"""
#: What never happens, by the model that it is added to.
IDLE = {
    "pendulum_cartesian": ("y >= -10*l", "y >= 10*l", 10.0),
    "chain": ("y[N] + 1000*l >= 0", "y[N] >= 1000*l", 2.0),
}


@dataclass(frozen=True)
class Cost:
    """One row: both sides, their ratio, and whether that is what it should be.

    Parameters
    ----------
    title, other : str
        What is measured, and what it is compared with; empty for a lone time.
    ours, theirs : float
        Medians; s, or evaluations.
    unit : "s" or "evaluations"
    ratio : float
        Of ``theirs`` to ``ours``, or the other way round, as ``goal`` says; NaN for a lone time.
    goal : str
    met : bool
    remark : str
    """

    title: str
    other: str
    ours: float
    theirs: float
    unit: str
    ratio: float
    goal: str
    met: bool
    remark: str = ""


def measure_contacts(turns: int, say: Callable[[str], None] = lambda text: None) -> Iterator[Cost]:
    """Measure all rows.

    Parameters
    ----------
    turns : int
        How often both sides run.
    say : callable
        Takes what is being done.
    """
    say("contacts: bouncing ball")
    yield bouncing_ball(turns)
    say("contacts: woodpecker")
    yield woodpecker(turns)
    for name in IDLE:
        for kind in ("contact", "event"):
            say(f"contacts: idle {kind}, {name}")
            yield idle(name, kind, 5 * turns)
    for title, text, goal in (
        ("bilinear spring, 20 s", BILINEAR, 1.0),
        ("drive with backlash, 5 s", BACKLASH, 3.0),
    ):
        say(f"contacts: {title}")
        yield kinks(title, text, goal)


def bouncing_ball(turns: int, bounces: int = BOUNCES) -> Cost:
    """Measure an elastic ball beside `solve_ivp`, restarted at each terminal event."""
    period = 2 * math.sqrt(2 / 9.81)
    ours = _prepared(BALL, t_end=bounces * period, max_steps=10**7)
    exact, errors = (bounces - 0.5) * period, [0.0, 0.0]
    pairs = []
    _run(ours)  # makes all ready
    for _ in range(turns):
        first, found = _run(ours)
        times = [entry.time for entry in found.events if entry.occurrence == "impact"]
        assert len(times) == bounces
        errors[0] = abs(times[-1] - exact)
        second, last = _seconds(lambda: _by_events(bounces))
        errors[1] = abs(last - exact)
        pairs.append((first, second))
    return _cost(
        f"bouncing ball, {bounces} impacts, rtol 1e-9",
        "SciPy's `solve_ivp` (DOP853), a terminal event and a restart for each impact",
        pairs,
        "at least 100 times faster",
        lambda ratio: ratio >= 100,
        remark=f"errors of the last impact's time {errors[0]:.0e} s and {errors[1]:.0e} s",
    )


def _by_events(bounces: int) -> float:
    """Return the time of the last of so many impacts."""

    def rate(_t: float, y: list[float]) -> list[float]:
        return [y[1], -9.81]

    def height(_t: float, y: list[float]) -> float:
        return y[0]

    height.terminal, height.direction = True, -1  # type: ignore[attr-defined]
    t, y = 0.0, [1.0, 0.0]
    for _ in range(bounces):
        found = solve_ivp(rate, (t, t + 2), y, "DOP853", events=height, rtol=1e-9, atol=1e-9)
        assert found.status == 1
        t, y = float(found.t[-1]), [0.0, -float(found.y[1, -1])]
    return t


def woodpecker(turns: int) -> Cost:
    """Measure 10 s of the shipped woodpecker."""
    simulation = _prepared((MODELS / "contact" / "woodpecker.yaml").read_text(), t_end=10.0)
    taken = [_run(simulation)[0] for _ in range(turns + 1)][1:]
    seconds = statistics.median(taken)
    return Cost(
        "woodpecker, 10 s", "", seconds, math.nan, "s", math.nan, "under 0.1 s", seconds < 0.1
    )


def idle(name: str, kind: str, turns: int) -> Cost:
    """Measure a model with a contact or an event that never happens, beside the model without."""
    contact, condition, t_end = IDLE[name]
    text = (MODELS / f"{name}.yaml").read_text(encoding="utf-8")
    if kind == "contact":
        more = text.replace("constraints:\n", f"constraints:\n  idle: {contact}\n", 1)
    else:
        more = f'{text}\nevents:\n  idle: {{when: "{condition}", stop: true}}\n'
    assert more != text
    numbers = {"N": 100} if name == "chain" else {}
    ours, plain = (_prepared(x, numbers, t_end=t_end) for x in (more, text))
    pairs = []
    for turn in range(turns + 1):
        both = [ours, plain] if turn % 2 else [plain, ours]
        taken = [_run(x)[0] for x in both]
        pairs.append(tuple(taken if turn % 2 else taken[::-1]))
    title = f"idle {kind}, {'chain of 100' if numbers else 'pendulum'}, {t_end:g} s"
    return _cost(
        title, "the same without it", pairs[1:], "at most 1.1 times", lambda x: x <= 1.1, own=True
    )


def kinks(title: str, text: str, goal: float) -> Cost:
    """Count the evaluations of a run with frozen branches, and of one that steps over kinks."""
    t_end = float(title.split()[-2])
    simulation = _prepared(text, t_end=t_end, rtol=1e-9)
    ours = _run(simulation)[1].evaluations
    plain = Integration(simulation.system, simulation.request, lambda block: None, None).run()
    assert plain.status == "completed"
    ratio = plain.evaluations / ours
    return Cost(
        f"{title}, rtol 1e-9",
        "branches not fixed within a step",
        ours,
        plain.evaluations,
        "evaluations",
        ratio,
        f"at least {goal:g} times fewer" if goal > 1 else "fewer",
        ratio >= goal,
    )


def _prepared(text: str, numbers: dict[str, float] | None = None, **settings: object) -> Simulation:
    given = SettingsOverrides(**{"method": "DOP853", **settings})
    return prepare(lagcli.load_text(text, set=numbers or {}), given)


def _run(simulation: Simulation) -> tuple[float, Outcome]:
    """Integrate; return the seconds without what prepares and writes, and the outcome."""
    system, request = simulation.system, simulation.request
    kind = SwitchingIntegration if switches(system) else Integration
    integration = kind(system, request, lambda block: None, None)
    seconds, found = _seconds(integration.run)
    assert found.status == "completed", found.message
    return seconds, found


def _seconds(action: Callable[[], Found]) -> tuple[float, Found]:
    began = time.process_time()
    found = action()
    return time.process_time() - began, found


def _cost(
    title: str,
    other: str,
    pairs: list[tuple[float, ...]],
    goal: str,
    met: Callable[[float], bool],
    own: bool = False,
    remark: str = "",
) -> Cost:
    """Return a row of times; ``own``: the ratio is of our time to the other."""
    ours, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
    ratio = statistics.median(a / b if own else b / a for a, b in pairs)
    return Cost(title, other, ours, theirs, "s", ratio, goal, met(ratio), remark)
