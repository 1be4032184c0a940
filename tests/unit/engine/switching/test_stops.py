"""What contacts say that end a run: these words are promised."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import lagcli
from lagcli.engine.core.contact_problem import ContactLaw, ContactProblem, ContactSolution
from lagcli.engine.core.status import Status
from lagcli.engine.event_entries import EntryCounts, EventEntries
from lagcli.engine.lowering.lower import lower
from lagcli.engine.switching import stops
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.switching.stops import refusal
from lagcli.equations.derivation.lagrange import derive
from lagcli.model.loader import load_text
from lagcli.simulations.simulation import prepare
from tests.support.contact_cases import run_contact
from tests.support.contact_problems import contact_motions
from tests.support.switching_models import BALL, KANE
from tests.unit.engine.switching.test_contacts import klein, painleve

ROD = np.arctan(2)


def test_energy_gained() -> None:
    assert str(stops.gains_energy(0.25, ["floor"], 0.040743904, "newton", True, True)) == (
        "an impact at `floor` would gain 0.04074 J (Newton's law with friction) at t = 0.25 s:"
        " use `impacts: poisson`"
    )
    assert str(stops.gains_energy(0.25, ["left", "right"], 0.5, "poisson", True, False)) == (
        "an impact at `left`, `right` would gain 0.5 J (Poisson's law with different coefficients"
        " of restitution) at t = 0.25 s: give its contacts the same `restitution`"
    )


def test_a_law_is_not_advised_where_it_is_in_use() -> None:
    for law in ("poisson", "newton", "sequential"):
        found = str(stops.gains_energy(0.25, ["floor"], 0.5, law, True, True))
        assert "use `impacts: " in found
        assert f"use `impacts: {law}`" not in found


def test_friction_of_redundant_guides() -> None:
    """Three guides of a rigid body share a force in many ways, whatever μ is."""
    rows = np.array([[1.0, -0.3], [1.0, 0.0], [1.0, 0.3], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    matrix = rows @ np.diag([1.0, 50.0]) @ rows.T
    matrix[3:, 3:] = 1.0
    slopes = np.zeros((6, 6))
    slopes[[3, 4, 5], [0, 1, 2]] = 1e-6
    laws = np.array([ContactLaw.FREE] * 3 + [ContactLaw.FORWARD] * 3)
    nothing = np.zeros(6)
    problem = ContactProblem(matrix, nothing, laws, nothing, nothing, slopes, slopes)
    names = ["left", "mid", "right", "left.slip", "mid.slip", "right.slip"]
    shares = [np.array([1.0, 2.0, 3.0, 0, 0, 0]), np.array([2.0, 0.0, 4.0, 0, 0, 0])]
    motions = [ContactSolution(x, nothing, np.ones(6, dtype=int)) for x in shares]
    assert str(stops.two_motions(0.5, names, problem, motions)) == (
        "the friction at `left`, `mid`, `right` is not determined at t = 0.5 s: these constraints"
        " are redundant, and friction depends on how they share the force (lambda.left = 1,"
        " lambda.mid = 2, lambda.right = 3, or lambda.left = 2, lambda.mid = 0, lambda.right = 4);"
        " remove redundant constraints, or their friction"
    )


def test_events_without_end_are_named() -> None:
    system = lower(derive(load_text(BALL)))
    assert str(stops.endless(0.5, system, EventEntries(EntryCounts()), ["`floor impacts`"])) == (
        "events do not end at t = 0.5 s: `floor impacts`"
    )


def test_two_motions() -> None:
    problem = painleve(ROD, 1.6, 6.0)
    found = stops.two_motions(0.0, ["tip", "tip.slip"], problem, contact_motions(problem))
    assert str(found) == (
        "two motions are possible at `tip` at t = 0 s: it slides backwards (lambda = 19.6553), or"
        " it opens (tip'' = 6.28969); mu = 1.6 is beyond the bound 1.333 here (Painlevé); reduce"
        " the friction, or give the bodies some compliance"
    )


def test_no_motion() -> None:
    problem = painleve(ROD, 1.6, 0.0)
    found = stops.no_motion(0.0, ["tip", "tip.slip"], problem, ())
    assert str(found) == (
        "no motion is possible at `tip` at t = 0 s; mu = 1.6 is beyond the bound 1.333 here"
        " (Painlevé); reduce the friction, or give the bodies some compliance"
    )


def test_jamming_in_a_guide() -> None:
    problem = klein(2.0, -6.0)
    found = stops.two_motions(0.0, ["rough", "rough.slip"], problem, contact_motions(problem))
    assert str(found).startswith("2 solutions for the friction at `rough` at t = 0 s: jamming (")
    assert "beyond the bound 1.155" in str(found)


#: Painlevé's rod: half length 0.5 m, tan θ = 2, whose tip slides backwards.
ROD_MODEL = """
coordinates: [x, y, theta]
parameters: {m: 1, l: 0.5, g: 9.81, mu: 1.6, theta0: 1.1071487177940904, rate: 6}
definitions:
  x_A: x - l*cos(theta)
  y_A: y - l*sin(theta)
T: m/2*(x'^2 + y'^2) + m*l^2/6*theta'^2
V: m*g*y
constraints:
  tip: {expr: y_A >= 0, friction: mu, slip: x_A'}
initial:
  x: 0
  y: l*sin(theta0)
  theta: theta0
  theta': rate
  x': -1 - l*sin(theta0)*rate
  y': l*cos(theta0)*rate
"""

#: Klein's: two masses in guides, of which one is rough, with a rod between them.
KLEIN = """
coordinates: [x1, y1, x2, y2]
parameters: {m: 1, L: 1, phi: 60 deg, mu: 1.2, w: 0, P: 6, v: 1}
T: m/2*(x1'^2 + y1'^2) + m/2*(x2'^2 + y2'^2)
Q: {x2: P}
constraints:
  rough: {expr: y1 = 0, friction: mu + w*t, slip: x1'}
  smooth: y2 = L*sin(phi)
  rod: (x2 - x1)^2 + (y2 - y1)^2 = L^2
initial: {x1: 0, y1: 0, x2: L*cos(phi), y2: L*sin(phi), x1': v, x2': v, y1': 0, y2': 0}
"""

FALL = """
coordinates: {y: m}
parameters: {m: 1, g: 9.81}
T: m/2*y'^2
V: m*g*y
constraints:
  floor: {expr: y >= 0, restitution: 0.5}
events:
  EVENT
initial: {y: 1, y': 0}
"""
PIN = FALL.replace("events:", "  pin: {expr: y = 0.3, active: false}\nevents:")
AT_FLOOR, AT_HALF = math.sqrt(2 / 9.81), math.sqrt(0.8 / 9.81)
JAM = (2 / math.sqrt(3) - 0.8) / 5


@pytest.mark.parametrize(
    ("text", "changes", "message"),
    [
        (
            ROD_MODEL,
            {},
            "two motions are possible at `tip` at t = 0 s: it opens (tip'' = 6.28969), or it slides"
            " backwards (lambda = 19.6553); mu = 1.6 is beyond the bound 1.333 here (Painlevé);"
            " reduce the friction, or give the bodies some compliance",
        ),
        (
            ROD_MODEL,
            {"rate": 0},
            "no motion is possible at `tip` at t = 0 s; mu = 1.6 is beyond the bound 1.333 here"
            " (Painlevé); reduce the friction, or give the bodies some compliance",
        ),
        (
            KLEIN,
            {},
            "no motion is possible at `rough` at t = 0 s; mu = 1.2 is beyond the bound 1.155 here"
            " (Painlevé); reduce the friction, or give the bodies some compliance",
        ),
        (
            KLEIN,
            {"P": -6},
            "2 solutions for the friction at `rough` at t = 0 s: jamming (lambda = 2.54809,"
            " lambda = -132.452); mu = 1.2 is beyond the bound 1.155 here (Painlevé); reduce the"
            " friction",
        ),
        (
            KLEIN,
            {"mu": 0.8, "w": 5, "v": 100},
            f"lambda.rough grows without bound while it slides (dynamic jam) at t = {JAM:.9g} s;"
            " the motion beyond is not determined",
        ),
        (
            KANE + "simulation: {impacts: newton}\n",
            {},
            "an impact at `floor` would gain 0.04074 J (Newton's law with friction) at t = 0 s:"
            " use `impacts: poisson`",
        ),
        (
            PIN.replace("EVENT", "catch: {when: y <= 0.6, engage: pin}"),
            {},
            f"`pin` cannot be engaged at t = {AT_HALF:.9g} s, phi = 0.3 m: engage it where phi ="
            " 0, or set the coordinates in the same event",
        ),
        (
            FALL.replace("EVENT", "move: {when: y <= 0.6, set: {y: -0.1}}"),
            {},
            f"an event violates `floor` by 0.1 m at t = {AT_HALF:.9g} s: set coordinates that"
            " satisfy it",
        ),
        (
            FALL.replace("EVENT", "kick: {when: floor impacts, set: {y': -1}}"),
            {},
            f"events do not end at t = {AT_FLOOR:.9g} s: `floor impacts`, `kick`",
        ),
    ],
)
def test_what_ends_a_run(text: str, changes: dict[str, float], message: str) -> None:
    model = load_text(text, set=changes)
    found = run_contact(model, rtol=1e-6, t_end=0.5)
    assert found.outcome.status == "failed"
    assert found.outcome.message == message


def test_an_impact_without_a_solution_names_its_contacts() -> None:
    text = FALL.replace("EVENT", "stop: {when: y <= 0.6, stop: true}")
    split = SplitSystem(prepare(load_text(text)).system)
    core = SimpleNamespace(t=0.25, struck=[0], contacts=np.zeros((3, 1)))
    found = refusal(split, Status.NO_IMPACT, core, "newton", [])
    assert str(found) == (
        "no velocities after the impact at t = 0.25 s satisfy the law of impacts at `floor`; choose"
        " another one with `impacts`"
    )


@pytest.mark.parametrize("when", ["x >= 9", "x'' >= 9", None])
@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Radau", "Rodas5P"])
def test_a_gap_without_a_value_ends_the_run(when: str | None, method: str) -> None:
    """Also where only the step's end shows it; samples before that are those of the motion."""
    event = f"events: {{e: {{when: {when}}}}}\n" if when else ""
    run = lagcli.simulate(
        lagcli.load_text(
            "coordinates: [x, y]\nT: (x'^2 + y'^2)/2\nV: 0.1*y\n"
            "constraints: {floor: {expr: y >= -sqrt(1 - x)}}\n"
            f"initial: {{x: 0, y: 1, x': 1, y': 0}}\n{event}"
        ),
        t_end=3,
        samples=121,
        method=method,  # type: ignore[arg-type]
    )
    assert run.status == "failed"
    assert "`sqrt(1 - x)` in constraint `floor` has no finite value at x = 1." in run.message
    assert run.time[-1] > 0.5
    np.testing.assert_allclose(run.q[:, 0], run.time, rtol=0, atol=1e-12)
