"""Equations → System: names, patterns, tapes in the order of their layouts, and scales."""

from __future__ import annotations

import numpy as np
from lowered import Lowered, lowered

import lagcli
from lagcli.engine.layout import ConstraintLayout, DynamicsLayout
from lagcli.engine.lowering.compiler import input_functions
from lagcli.engine.lowering.lower import lower
from lagcli.engine.tape.interpreter import ScalarTape


def model(text: str) -> Lowered:
    return lowered(lagcli.load_text(text))


PENDULUM = """
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1}
initial: {x: 1, y: 0, x': 0, y': 0}
"""
TWO = model("""
coordinates: [x, y, z]
parameters: {m: 2.0, k: 5.0}
T: m*(x'^2 + y'^2)/2 + z'^2
V: k*x^2/2 - y*sin(t)
Q: {z: -3*z'}
constraints:
  roll: x' - y*z' = 0
  bar: 2*x - 7*y = 1
initial: {x: {guess: 1}, y: {guess: 0}, z: 0, x': {guess: 0}, y': {guess: 0}, z': 0}
outputs: {pull: 2*lambda.bar, push: x''}
""")


def test_a_model_is_lowered_alike_each_time() -> None:
    equations = lagcli.derive(lagcli.load_text(PENDULUM))
    one, other = lower(equations), lower(equations)
    assert (one.dynamics, one.constraint, one.report) == (
        other.dynamics,
        other.constraint,
        other.report,
    )


def test_names_and_patterns_are_those_of_the_model() -> None:
    system, p = TWO
    assert (system.coordinates, system.constraints) == (("x", "y", "z"), ("roll", "bar"))
    assert (system.parameters, p) == (("m", "k"), (2.0, 5.0))
    assert system.holonomic == (1,)
    assert system.mass_pattern == ((0, 0), (1, 1), (2, 2))
    assert system.jacobian_pattern == ((0, 0), (0, 2), (1, 0), (1, 1))
    assert system.outputs == ("pull", "push")
    assert system.events is None


def test_tapes_have_the_inputs_and_outputs_of_their_layouts() -> None:
    system, p = TWO
    for tape, layout in ((system.dynamics, DynamicsLayout), (system.constraint, ConstraintLayout)):
        assert len(tape.outputs) == layout(system.counts).size
        assert (tape.inputs, tape.parameters) == (1 + 3 + 3 + 2, 2)
    assert system.report.inputs == 1 + 3 + 3 + 3 + 2 + 2
    assert len(system.report.outputs) == 5 + 2
    state = (0.5, 1.0, 2.0, 3.0, -1.0, -2.0, -3.0)
    out = ScalarTape(system.report)((*state, 7.0, 8.0, 9.0, 11.0, 13.0, *p))
    kinetic, potential = 2.0 * 5.0 / 2 + 9.0, 5.0 / 2 - 2 * np.sin(0.5)
    # T, V, energy, Q·v, −∂L/∂t, outputs
    np.testing.assert_allclose(
        out,
        [kinetic, potential, kinetic + potential, -27.0, -2.0 * np.cos(0.5), 26.0, 7.0],
        rtol=1e-14,
    )


def test_the_scale_of_a_constraint_is_the_sum_of_its_terms_magnitudes() -> None:
    system, p = model("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
constraints: {c: "(x - y)^2 - 3*x = 1"}
initial: {x: {guess: 1}, y: {guess: 0}, x': {guess: 0}, y': {guess: 0}}
""")
    x, y, u, v = 0.5, -0.25, 2.0, -3.0
    out = ScalarTape(system.constraint)((0.0, x, y, u, v, *p))
    at = ConstraintLayout(system.counts)
    np.testing.assert_allclose(out[at.position], [(x - y) ** 2 - 3 * x - 1])
    # |x| + |y| for the sum inside, or its terms written out, which are the same
    np.testing.assert_allclose(out[at.position_scale], [(abs(x) + abs(y)) ** 2 + 3 * abs(x) + 1])
    assert out[at.velocity_scale.start] >= abs(2 * (x - y) * (u - v) - 3 * u)


def test_coordinates_that_a_constraint_has_alike_have_one_unit() -> None:
    system, _ = model("""
coordinates: [a, b, c, d, x, y]
T: (a'^2 + b'^2 + c'^2 + d'^2 + x'^2 + y'^2)/2
constraints:
  unit: a^2 + b^2 + c^2 + d^2 = 1
  other: x + 2*y = 3
initial: {a: 1, b: 0, c: 0, d: 0, x: 1, y: 1, a': 0, b': 0, c': 0, d': 0, x': 0, y': 0}
""")
    assert system.same_unit == ((0, 1, 2, 3),)
    assert TWO.system.same_unit == ()


def test_derivatives_are_lowered_when_they_are_asked_for() -> None:
    system, p = TWO
    assert system.variation is not None
    tapes = system.variation()
    # G = f − M a + Bᵀλ: only the spring and the roll's λ y depend on positions
    assert tapes.force_position == ((0, 0), (2, 1))
    assert tapes.force_velocity == ((2, 2),)
    inputs = (0.5, 1.0, 2.0, 3.0, -1.0, -2.0, -3.0, 7.0, 8.0, 9.0, 11.0, 13.0, *p)
    found = ScalarTape(tapes.tape)(inputs)
    assert found[:3] == [-5.0, -11.0, -3.0]
    # ∂G_y/∂t of sin t, among the last: three forces, two rows, the power
    np.testing.assert_allclose(found[-6:-3], [0.0, np.cos(0.5), 0.0])


def test_functions_are_those_of_the_model_in_its_order_and_made_once() -> None:
    model = lagcli.load_text(
        "coordinates: [x]\nT: x'^2/2\ninitial: {x: 0, x': 0}\ninputs:\n"
        "  b: {times: [0, 500 ms], values: [1, 3]}\n"
        "  a: {times: [0, 1], values: [2, 4], interpolation: step, extend: hold}\n"
    )
    found = input_functions(model)
    assert [(f.name, f.degree) for f in found.functions] == [("b", 1), ("a", 0)]
    assert found.places() == {"b": (0, 1), "a": (3, 0)}
    # of b the origin, its value there and its slope; of a the origin and the value
    np.testing.assert_array_equal(found.pieces(np.array([0.25, 0.5])), [[0, 1, 4, 0, 2]] * 2)
    assert input_functions(model) is found
    assert input_functions(lagcli.load("atwood")).size == 0
