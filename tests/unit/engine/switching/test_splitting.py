"""A System without its rows that switch, and these rows."""

import numpy as np

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.lower import lower
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.lagrange import derive

SYSTEM = lower(
    derive(
        lagcli.load_text(
            """
coordinates: {x: m, y: m, z: m}
parameters: {m: 2 kg, g: 9.81 m/s^2, mu: 0.3}
T: m/2*(x'^2 + y'^2 + z'^2)
V: m*g*y
constraints:
  floor: {expr: y - x^2 >= 0, friction: mu, slip: x'}
  wire: x*z = 1
  guide: {expr: z - y = 0, friction: mu, slip: y'}
initial: {x: 1, y: 1, z: 1, x': 0, y': 0, z': 0}
"""
        )
    )
)
SPLIT = SplitSystem(SYSTEM)
P = (2.0, 9.81, 0.3)
Q, V = np.array([1.1, 1.3, 0.7]), np.array([0.2, -0.4, 0.5])


def names(rows: tuple[int, ...]) -> list[str]:
    return [SYSTEM.constraints[k] for k in rows]


def test_rows() -> None:
    # the guide always holds, but its force limits friction
    assert names(SPLIT.rows) == ["floor", "floor.slip", "guide.slip", "guide"]
    assert names(SPLIT.base) == ["wire"]
    assert SPLIT.places == [0, -1, -1, 1]


def test_the_fixed_system_is_that_of_the_other_constraints() -> None:
    whole, fixed = Evaluator(SYSTEM, P), Evaluator(SPLIT.fixed, P)
    d, e = whole.dynamics(0.1, Q, V), fixed.dynamics(0.1, Q, V)
    base = list(SPLIT.base)
    np.testing.assert_array_equal(e.mass_matrix, d.mass_matrix)
    np.testing.assert_array_equal(e.forcing, d.forcing)
    np.testing.assert_array_equal(e.jacobian, d.jacobian[base])
    np.testing.assert_array_equal(e.rhs, d.rhs[base])
    assert e.power == d.power
    c = fixed.constraints(0.1, Q, V)
    np.testing.assert_allclose(c.position, [Q[0] * Q[2] - 1])
    assert SPLIT.fixed.switching is None


def test_where_all_constraints_hold_the_fixed_system_has_the_tapes_of_the_whole() -> None:
    text = """
coordinates: {x: m, y: m}
T: (x'^2 + y'^2)/2
constraints: {rod: x^2 + y^2 = 1}
events: {flat: {when: y <= 0, stop: true}}
initial: {x: 0, y: 1, x': 0, y': 0}
"""
    system = lower(derive(lagcli.load_text(text)))
    fixed = SplitSystem(system).fixed
    assert fixed.dynamics is system.dynamics
    assert fixed.constraint is system.constraint
    assert fixed.events is None


def test_functions_of_the_rows() -> None:
    d = Evaluator(SYSTEM, P).dynamics(0.1, Q, V)
    found = ScalarTape(SPLIT.functions)((0.1, *Q, *V, *P))
    entries = len(SPLIT.pattern)
    np.testing.assert_allclose(found[:2], [Q[1] - Q[0] ** 2, Q[2] - Q[1]])
    jacobian = np.zeros((4, 3))
    for (i, j), x in zip(SPLIT.pattern, found[2 : 2 + entries], strict=True):
        jacobian[i, j] = x
    rows = list(SPLIT.rows)
    np.testing.assert_array_equal(jacobian, d.jacobian[rows])
    np.testing.assert_array_equal(found[2 + entries : 6 + entries], [0] * 4)  # b_0
    np.testing.assert_array_equal(found[6 + entries : 10 + entries], d.rhs[rows])


def test_derivatives_are_those_of_the_constraints_that_hold() -> None:
    assert SYSTEM.variation is not None
    assert SPLIT.fixed.variation is not None
    whole, fixed = SYSTEM.variation(), SPLIT.fixed.variation()
    a, multiplier = [0.3, 0.1, -0.2], 1.7
    forces = [0.0] * len(SYSTEM.constraints)
    forces[SPLIT.base[0]] = multiplier
    x = ScalarTape(whole.tape)((0.1, *Q, *V, *a, *forces, *P))
    y = ScalarTape(fixed.tape)((0.1, *Q, *V, *a, multiplier, *P))
    assert len(y) == len(fixed.tape.outputs)
    count = len(whole.force_position) + len(whole.force_velocity)
    np.testing.assert_array_equal(y[:count], x[:count])
    places = [(SPLIT.base[i], j) for i, j in fixed.rhs_position]
    first = [count + whole.rhs_position.index(place) for place in places]
    np.testing.assert_array_equal(y[count : count + len(places)], [x[i] for i in first])
    assert y[-1] == x[-1]
