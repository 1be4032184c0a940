"""Series of a and λ from one factorization, against mpmath and against the equations themselves."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from kkt_systems import whole
from lowered import Lowered, lowered
from pendulum_by_hand import G, pendulum_system
from series_values import coefficients

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.elimination import order_at
from lagcli.engine.linear.unrolling import unroll
from lagcli.engine.tape.arithmetic import Arithmetic
from lagcli.engine.taylor.expansion import SeriesExpansion
from lagcli.engine.taylor.linear_series import LinearSystem

ORDER = 5


def solution(case: Lowered, state: np.ndarray) -> np.ndarray:
    """Return the series of a and λ, (unknowns, orders), for those of t, q and v."""
    system, p = case
    nq = system.counts.nq
    q, v = state[1 : 1 + nq, 0], state[1 + nq :, 0]
    plan = order_at(system, [Evaluator(system, p).entries(state[0, 0], q, v)])
    tape = unroll(system, plan)
    builder = Arithmetic(tape.inputs, tape.parameters, tape.rhs_inputs)
    outputs = builder.extend(tape)
    expansion = SeriesExpansion(builder, range(1 + 2 * nq))
    unknowns = LinearSystem(expansion, system, outputs).solve()
    inputs = [*state[:, 0], *p]
    inputs += [0.0] * (tape.inputs - len(inputs))
    return np.array(coefficients(expansion, unknowns, dict(enumerate(state)), inputs))


def polynomials(seed: int, nq: int) -> np.ndarray:
    """Return series of t, q and v: any, they need not be those of a motion."""
    state = np.random.default_rng(seed).uniform(-0.5, 0.5, (1 + 2 * nq, ORDER + 1))
    state[0] = 0.0
    state[0, :2] = 0.3, 1.0
    return state


def test_a_pendulum_by_hand() -> None:
    state = polynomials(1, 2)
    state[1:3, 0] = 0.6, -0.8

    def exact(t: mpmath.mpf) -> list[mpmath.mpf]:
        x, y, u, v = (mpmath.polyval([mpmath.mpf(c) for c in s[::-1]], t) for s in state[1:])
        multiplier = (2 * G * y - 2 * (u**2 + v**2)) / (4 * (x**2 + y**2))
        return [2 * x * multiplier, 2 * y * multiplier - G, multiplier]

    found = solution(Lowered(pendulum_system(), (G,)), state)
    with mpmath.workdps(40):
        for i, series in enumerate(found):
            expected = mpmath.taylor(lambda t, i=i: exact(t)[i], 0, ORDER)
            np.testing.assert_allclose(series, [float(c) for c in expected], rtol=1e-11)


VARYING = """
coordinates: [x, y, phi]
parameters: {m: 2.0}
T: m*(x'^2 + y'^2)/2 + phi'^2*(1 + x^2)/2 + x'*sin(phi)*phi'
V: 9.81*m*y + cos(2*t)*phi
Q: {x: -x'*y}
constraints:
  rod: x^2 + y^2 = (2 + sin(t)/2)^2
  wheel: x' + cos(phi)*y' = t*phi'
initial: {x: {guess: 1}, y: {guess: 1}, phi: 0, x': {guess: 0}, y': {guess: 0}, phi': {guess: 0}}
"""


@pytest.mark.parametrize("seed", range(3))
def test_the_series_solve_the_equations_beside_the_state(seed: int) -> None:
    """K(h) x(h) = r(h) but for terms of the next order in h."""
    case = lowered(lagcli.load_text(VARYING))
    evaluator = Evaluator(*case)
    state = polynomials(seed, 3)
    state[1:3, 0] += 1.5
    unknowns = solution(case, state)
    errors = []
    for h in (0.04, 0.02):
        powers = h ** np.arange(ORDER + 1)
        t, *now = state @ powers
        d = evaluator.dynamics(t, np.array(now[:3]), np.array(now[3:]))
        x = np.linalg.solve(whole(d.mass_matrix, d.jacobian), np.concatenate([d.forcing, d.rhs]))
        x[3:] *= -1
        errors.append(np.abs(unknowns @ powers - x).max() / np.abs(x).max())
    assert errors[0] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(2 ** (ORDER + 1), rel=0.25)
