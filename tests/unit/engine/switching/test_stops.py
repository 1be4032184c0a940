"""What contacts say that end a run: these words are promised."""

import numpy as np

from lagcli.engine.switching import stops
from lagcli.engine.switching.contacts import contact_motions
from lagcli.engine.switching.switching import SwitchedRow
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
