"""Conserved quantities: names, formulas, and how parameters stand for numbers."""

from __future__ import annotations

import lagcli
from lagcli.equations.symmetry.conserved import (
    conserved_quantities,
    generalized,
    named_quantities,
)
from lagcli.equations.symmetry.linear import monitored_symmetries

ROPE = """
coordinates: [u, phi]
parameters: {m: 2, J: 0.3, R: 0.25}
T: m/2*u'^2 + J/2*phi'^2
constraints: {rope: u = R*phi}
initial: {u: 0, phi: {guess: 0}, u': 1, phi': {guess: 0}}
"""


def test_numbers_are_written_by_parameters_where_it_holds_for_all() -> None:
    equations = lagcli.derive(lagcli.load_text(ROPE))
    turning, energy = conserved_quantities(equations).quantities
    assert turning.in_momenta == "4*p_phi + p_u"
    general = generalized(equations, turning)
    assert general.general
    assert general.in_momenta == "p_phi/R + p_u"
    assert general.name == turning.name == "J_1"
    assert energy.name == "energy"


def test_the_energy_is_not_monitored_twice() -> None:
    equations = lagcli.derive(lagcli.load_text(ROPE))
    assert [q.name for q in named_quantities(equations, monitored_symmetries(equations))] == ["J_1"]


def test_a_quantity_that_vanishes_is_none() -> None:
    """A massless coordinate that nothing depends on moves freely, without momentum."""
    text = ROPE.replace("J/2*phi'^2", "0*phi'^2").replace("u = R*phi", "u = 0.1*t")
    quantities = conserved_quantities(lagcli.derive(lagcli.load_text(text))).quantities
    assert [q.in_momenta for q in quantities] == ["h - p_u/10"]  # and not p_phi = 0


def test_unit_quaternions_turn_by_half_of_their_rate() -> None:
    text = """
coordinates: [e0, e1, e2, e3]
parameters: {J: 0.4}
T: 2*J*(e0'^2 + e1'^2 + e2'^2 + e3'^2)
constraints: {unit: e0^2 + e1^2 + e2^2 + e3^2 = 1}
initial: {e0: 1, e1: 0, e2: 0, e3: 0, e0': 0, e1': 0.1, e2': 0, e3': 0.5}
"""
    quantities = conserved_quantities(lagcli.derive(lagcli.load_text(text))).quantities
    # so(4): six rotations of the planes
    assert len(quantities) == 7
    assert "e0*p_e1/2 - e1*p_e0/2" in {q.in_momenta for q in quantities}


def test_fields_that_vanish_on_the_constraints_are_left_out() -> None:
    """x - y and z - w are held: the rotation of the plane of both says nothing."""
    text = """
coordinates: [x, y, z, w]
T: x'^2/2 + y'^2/2 + z'^2/2 + w'^2/2
V: x + y + (z + w)^2
constraints: {one: x - y = 0, two: z - w = 0}
initial: {x: 0, y: {guess: 0}, z: 1, w: {guess: 0}, x': 0, y': {guess: 0}, z': 0, w': {guess: 0}}
"""
    quantities = conserved_quantities(lagcli.derive(lagcli.load_text(text))).quantities
    assert [q.in_momenta for q in quantities] == ["h"]


def test_fields_that_vanish_on_a_sum_of_constraints_are_left_out() -> None:
    """The middle of a bar at x = l/2 cos a, its end at l cos a: x2 = 2 x1 without any angle.

    In the plane of x1 and y3 a rotation is a symmetry, but both vanish: nothing is conserved.
    """
    text = """
coordinates: [x1, x2, y3, a, z]
T: (x1'^2 + 4*x2'^2 + y3'^2 + a'^2 + z'^2)/2
V: z^2 + cos(a)
constraints:
  one: x1 = 2*cos(a)
  two: x2 = 4*cos(a)
  three: y3 + x1 = 2*cos(a)
initial: {x1: {guess: 1}, x2: {guess: 2}, y3: {guess: 0}, a: 1, z: 1,
  x1': {guess: 0}, x2': {guess: 0}, y3': {guess: 0}, a': 1, z': 0}
"""
    quantities = conserved_quantities(lagcli.derive(lagcli.load_text(text))).quantities
    assert [q.in_momenta for q in quantities] == ["h"]
