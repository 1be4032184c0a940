"""Initial states of pages for values set by hand against those of `simulate`, without a browser."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import NamedTuple

import numpy as np
import pytest
from live import Live
from random_cases import FUZZ_COUNT, some
from shipped import PATHS

import lagcli
from lagcli.errors import LagcliError
from lagcli.model.model import Model
from lagcli.simulations.resources import settable_parameters
from lagcli.simulations.simulation import prepare, simulate

#: Guesses that the constraints change, friction, whose constraint holds from the start on,
#: dependent constraints, and a quaternion by its components.
CHOSEN = ("slider_crank", "slider_crank_friction", "parallelogram", "heavy_top")
#: Of the largest coordinate; where only a double root satisfies a constraint, that of it.
TOLERANCE, OF_DOUBLE_ROOT = 1e-11, 1e-7


class Case(NamedTuple):
    """Parameters in SI, and initial values with whether they are guesses."""

    parameters: dict[str, float]
    initial: dict[str, tuple[float, bool]]


def starts_of(model: Model, cases: list[Case], folder: Path) -> Iterator[tuple[Case, str, float]]:
    """Yield cases, who refuses them (page, simulate, both), and how far the starts are apart."""
    live = Live(model, folder)
    made = live.run([live.case(*case) | {"times": [0.0]} for case in cases])
    for case, found in zip(cases, made, strict=True):
        values = {name: f"{x!r}*1" for name, x in case.parameters.items()}
        initial = {
            name: f"{{guess: {x!r}*1}}" if guess else f"{x!r}*1"
            for name, (x, guess) in case.initial.items()
        }
        refused, away = {"page"} if "error" in found else set(), 0.0
        try:
            changed = lagcli.load_text(model.text, model.path, values, initial, model.data)
            state = prepare(changed).start.state
        except LagcliError:
            refused.add("simulate")
        if not refused:
            expected = np.concatenate([state.q, state.v])
            away = np.abs(np.array(found["state"]) - expected).max()
            away /= np.abs(expected).max() or 1.0
        yield case, "both" if len(refused) == 2 else "".join(refused), away


def random_cases(model: Model, count: int, random: Random) -> list[Case]:
    """Return changes of a parameter and of some initial values by up to a tenth.

    Parameters become smaller: coefficients of restitution are at most 1.
    """

    def near(x: float) -> float:
        return x + 0.1 * random.uniform(-1, 1) * (abs(x) or 0.3)

    cases = []
    for _ in range(count):
        known = sorted(settable_parameters(model))
        known = random.sample(known, min(len(known), random.randint(0, 1)))
        less = 1 - 0.1 * random.random()
        parameters = {name: less * model.parameters[name].value for name in known}
        names = random.sample(sorted(model.initial), min(len(model.initial), random.randint(1, 3)))
        initial = {
            name: (near(start.value), not start.fixed or random.random() < 0.4)
            for name in names
            for start in [model.initial[name]]
        }
        cases.append(Case(parameters, initial))
    return cases


def check(model: Model, cases: list[Case], folder: Path) -> int:
    """Compare starts; return how many there are."""
    count = 0
    for case, refused, away in starts_of(model, cases, folder):
        assert refused in ("", "both"), (refused, case)
        assert away < OF_DOUBLE_ROOT, case
        count += not refused and away < TOLERANCE
    return count


@pytest.mark.parametrize("count", some([6, 20], 1))
@pytest.mark.parametrize("name", CHOSEN)
def test_a_page_starts_where_simulate_does(name: str, count: int, tmp_path: Path) -> None:
    model = lagcli.load(name)
    cases = random_cases(model, count, Random(7))
    if name == "heavy_top":
        random = Random(3)
        free = [*"XYZ", "e0'", "e1'", "e2'", "e3'"]
        places = {name: (model.initial[name].value, True) for name in free}
        for e in [of_quaternion("e{}", random).initial for _ in range(10)]:
            cases.append(Case({}, {name: (x, False) for name, (x, _) in e.items()} | places))
    assert check(model, cases, tmp_path) >= len(cases) // 3


@pytest.mark.fuzz
@pytest.mark.parametrize("name", PATHS)
def test_every_page_starts_where_simulate_does(name: str, tmp_path: Path) -> None:
    model = lagcli.load(name)
    assert check(model, random_cases(model, FUZZ_COUNT, Random(11)), tmp_path)


#: Links whose guess is far from the ends' places: steps of least length by M alone lead to another
#: state, many turns away.
CLOSED_CHAIN = """
coordinates: ["q[1..N]"]
parameters: {N: 40, l: 0.1, m: 0.1, g: 9.81, w: 2.0}
definitions:
  X[0]: 0
  Y[0]: 0
  X[i = 1..N]: X[i-1] + l*sin(q[i])
  Y[i = 1..N]: Y[i-1] - l*cos(q[i])
T: >-
  sum(m/2*((X[i-1]' + X[i]')^2/4 + (Y[i-1]' + Y[i]')^2/4) + m*l^2/24*q[i]'^2, i = 1..N)
V: sum(m*g*(Y[i-1] + Y[i])/2, i = 1..N)
constraints:
  endx: X[N] = w
  endy: Y[N] = 0
initial:
  q[i = 1..N]: {guess: 0.3 + 2.2*i/N + 0.3*sin(i)}
  q[1..N]': {guess: 0}
simulation: {t_end: 0.01, samples: 2}
"""


def test_a_page_of_a_closed_chain_starts_where_simulate_does(tmp_path: Path) -> None:
    model = lagcli.load_text(CLOSED_CHAIN)
    near = [Case({"g": 9.81 * (1 + 1e-9)}, {}), Case({"w": 2.1}, {}), Case({"l": 0.11}, {})]
    far = [Case({}, {"q[7]": (x, True)}) for x in (-3.0, 0.1, 5.0)]
    assert check(model, [*near, *far], tmp_path) == 6


# quaternions


def of_quaternion(name: str, random: Random) -> Case:
    """Return another orientation: four fixed components, guesses, or both."""
    e = np.array([random.gauss(0, 1) for _ in range(4)])
    e /= math.sqrt(e @ e)
    guessed = random.choice([0.0, 0.5, 1.0])
    parts = {name.format(i): (float(x), random.random() < guessed) for i, x in enumerate(e)}
    return Case({}, parts)


TURNING = """\
coordinates: {{e: quaternion}}
parameters: {{A: 1 kg*m^2, B: 2 kg*m^2, C: 3 kg*m^2, alpha: 0.3, w0: 2 rad/s, s: 0.2}}
T: 1/2*dot(omega(e), [[A,0,0],[0,B,0],[0,0,C]]*omega(e))
{constraints}
initial: {{e: {e}, e': {omega}}}
simulation: {{t_end: 0.5}}
"""
ORIENTATIONS = (
    "1",
    "rot_x(30 deg)*rot_z(alpha)",
    "{guess: [0.9, 0.3, 0.1, 0.2]}",
    "[{guess: 0.9}, 0.1, {guess: 0.3}, 0.1]",
)
VELOCITIES = ("[1, 2, 3]", "[w0, {guess: 1}, 2]", "{guess: [0.1, w0, 3]}")
CONSTRAINTS = (
    "",
    "constraints: {tip: 'dot([0, 0, 1], e*[1, 0, 0]) = s'}",
    "constraints: {roll: 'dot([0, 1, 0], omega(e)) = 1'}",
)


def turning(random: Random) -> Model:
    """Return a body that turns by an angular velocity, fixed or guessed, maybe constrained."""
    while True:
        text = TURNING.format(
            constraints=random.choice(CONSTRAINTS),
            e=random.choice(ORIENTATIONS),
            omega=random.choice(VELOCITIES),
        )
        model = lagcli.load_text(text)
        try:
            prepare(model)
        except LagcliError:  # the constraint contradicts what is fixed
            continue
        return model


def turned(random: Random) -> Case:
    """Return another orientation, at times with a parameter or a rate, which ends the hold of ω."""
    case = of_quaternion("e.{}", random)
    if random.random() < 0.3:
        case.parameters[random.choice(["alpha", "w0", "B"])] = random.uniform(0.1, 0.9)
    if random.random() < 0.2:
        case.initial[f"e.{random.randrange(4)}'"] = random.gauss(0, 1), random.random() < 0.5
    return case


def test_an_angular_velocity_holds_where_the_orientation_is_set(tmp_path: Path) -> None:
    """Components set by hand: the rates follow, as they do with `--set-initial`."""
    model = lagcli.load_text(TURNING.format(constraints="", e="1", omega="[1, 2, 3]"))
    live = Live(model, tmp_path)
    half = math.sqrt(0.5)
    case = Case({}, {f"e.{i}": (x, False) for i, x in enumerate((half, 0.0, half, 0.0))})
    [made] = live.run([live.case(*case)])
    values = {name: f"{x!r}*1" for name, (x, _) in case.initial.items()}
    expected = simulate(lagcli.load_text(model.text, model.path, {}, values))
    found = live.quantities(made)
    np.testing.assert_allclose(found["q"], expected.q, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found["v"], expected.v, rtol=0, atol=1e-6)
    # e' = e (0, ω) / 2
    rates = np.array([-2.0, 4.0, 2.0, 2.0]) * half / 2
    np.testing.assert_allclose(made["state"][4:], rates, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("orientation", "case"),
    [
        ("{guess: 1}", Case({}, {f"e.{i}": (0.0, True) for i in range(4)})),
        ("{guess: [s, 0, 0, 0]}", Case({"s": 0.0}, {})),
    ],
)
def test_a_quaternion_of_zeros_is_no_orientation(
    orientation: str, case: Case, tmp_path: Path
) -> None:
    """The page lost the angular velocity, as `simulate` did: its rates are 0 there."""
    model = lagcli.load_text(TURNING.format(constraints="", e=orientation, omega="[1, 2, 3]"))
    [(_, refused, _)] = starts_of(model, [case], tmp_path)
    assert refused == "both"


@pytest.mark.parametrize(
    "count", [2, pytest.param(max(1, FUZZ_COUNT // 10), marks=pytest.mark.fuzz)]
)
def test_turning_bodies_start_where_simulate_does(count: int, tmp_path: Path) -> None:
    random, found = Random(5), 0
    for _ in range(count):
        found += check(turning(random), [turned(random) for _ in range(12)], tmp_path)
    assert found > 4 * count
