"""What contacts say that end a run: these words are promised."""

import numpy as np

from lagcli.engine.core.contact_problem import ContactLaw, ContactProblem, ContactSolution
from lagcli.engine.lowering import lower
from lagcli.engine.switching import stops
from lagcli.engine.switching.switching import SwitchedRow
from lagcli.equations.derivation.lagrange import derive
from lagcli.model.loader import load_text
from tests.support.contact_problems import contact_motions
from tests.support.switching_models import BALL
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
    assert str(stops.endless(0.5, system, [], ["`floor impacts`"])) == (
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


def test_rows_that_jam() -> None:
    slipping = [SwitchedRow(1, limit=0, normal=0)]
    assert stops.jamming(1e-6, slipping)
    assert not stops.jamming(0.5, slipping)
    assert not stops.jamming(1e-6, [])
