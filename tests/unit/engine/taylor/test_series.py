"""Power series of a motion against derivatives that SymEngine takes."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import mpmath
import numpy as np
import pytest
import symengine as se
from kkt_systems import whole
from lowered import Lowered, lowered
from pendulum_by_hand import G as GRAVITY
from pendulum_by_hand import pendulum_system
from series_values import coefficients as series_coefficients
from tape_values import in_known_functions

import lagcli
from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.run import Integration
from lagcli.engine.linear.elimination import order_at, unroll
from lagcli.engine.system import State
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import LINE, Op
from lagcli.engine.tape.series_operations import SeriesOp
from lagcli.engine.tape.tape import Arithmetic
from lagcli.engine.taylor import series
from lagcli.engine.taylor.expansion import NotAnalytic, SeriesExpansion
from lagcli.engine.taylor.series import (
    LinearSystem,
    SeriesProgram,
    depending_on_time,
    expand,
    factored,
)
from lagcli.equations.derivation.lagrange import derive
from lagcli.functions import FUNCTIONS
from lagcli.settings.settings import SettingsOverrides, resolve

T = se.Symbol("t")
START = 0.3


TEXT = """
coordinates: [x]
parameters: {{a: 0.7, b: -1.3}}
T: x'^2/2
Q: {{x: "{force}"}}
initial: {{x: 0.4, x': 0.2}}
"""


def system_of(text: str) -> Lowered:
    return lowered(lagcli.load_text(text))


def system(force: str) -> Lowered:
    return system_of(TEXT.format(force=force))


def core_at(what: Lowered, q: list[float], v: list[float]) -> Any:
    """Return the core at a state, ready for Taylor's method."""
    request = IntegrationRequest(
        state=State(START, np.array(q), np.array(v), what.p),
        rank=len(what.system.constraints),
        settings=resolve(SettingsOverrides(t_start=START, t_end=1.0, method="Taylor")),
        times=np.array([1.0]),
        atol=1e-10,
    )
    integration = Integration(what.system, request, lambda block: None, None)
    assert not integration.methods.refused
    return integration.core


def coefficients(what: Lowered, q: list[float], v: list[float]) -> np.ndarray:
    return core_at(what, q, v).series()


def derivatives(force: se.Basic, count: int) -> list[float]:
    """Return x, x', x'', … at the start over factorials, for x'' = force(t)."""
    values, force = [0.4, 0.2], in_known_functions(force)
    for _ in range(count):
        values.append(float(force.subs({T: START})))
        force = force.diff(T)
    return [x / math.factorial(k) for k, x in enumerate(values)]


#: Each of the functions, with arguments whose own series do not end.
ARGUMENT = "(0.3 + 0.2*t + 0.1*sin(t))"
KINKED = {"abs", "fabs", "cbrt", "sign", "step", "floor", "ceil"}
FORCES = [
    *(
        f"{name}({ARGUMENT})"
        for name, function in sorted(FUNCTIONS.items())
        if function.fewest == 1 and name not in KINKED | {"acosh", "hypot", "min", "max"}
    ),
    f"hypot({ARGUMENT}, t)",
    f"acosh(1 + {ARGUMENT})",
    f"atan2({ARGUMENT}, cos(t))",
    f"atan2({ARGUMENT}, a)",
    f"atan2(a, {ARGUMENT})",
    f"{ARGUMENT}^a",
    f"a^{ARGUMENT}",
    f"{ARGUMENT}^cos(t)",
    f"{ARGUMENT}^-3",
    f"{ARGUMENT}^(5/2)",
    f"1/{ARGUMENT} + a/(b + {ARGUMENT}) + sin(t)/{ARGUMENT}",
    f"a*(b - a*{ARGUMENT})*(b + sin(t)) - (t - a)*(t + b)/a",
    f"t*{ARGUMENT}*sin(t) + {ARGUMENT}*cos(t) - a*{ARGUMENT} + sin(t)*cos(t)^2",
    "a",
    "b*t",
]


@pytest.mark.parametrize("force", FORCES)
def test_functions(force: str) -> None:
    found = coefficients(system(force), [0.4], [0.2])[0]
    equations = derive(lagcli.load_text(TEXT.format(force=force)))
    expression = equations.applied_forces[0].subs({"a": 0.7, "b": -1.3})
    expected = derivatives(expression, 12)
    # each order loses some digits of the last: of what the coefficients of such a radius are
    size = np.maximum.accumulate(np.abs(expected)[::-1])[::-1]
    assert np.abs(found[: len(expected)] - expected).max() <= 1e-13 * max(1.0, size.max())
    np.testing.assert_allclose(found[: len(expected)], expected, rtol=1e-9, atol=1e-14)


def test_motion_that_depends_on_itself() -> None:
    # x'' = −x: sine and cosine
    found = coefficients(system("-x"), [0.4], [0.2])
    signs = [1, 1, -1, -1]
    for k, x in enumerate(found[0]):
        part = [0.4, 0.2][k % 2] * signs[k % 4] / math.factorial(k)
        assert x == pytest.approx(part, rel=1e-13)
    # and W' = −x x': W = (x(0)² − x²)/2
    square = np.convolve(found[0], found[0])[: found.shape[1]]
    np.testing.assert_allclose(found[2, 1:], -0.5 * square[1:], rtol=1e-12, atol=1e-17)


PENDULUM = """
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1}
initial: {x: 1, y: 0, x': 0, y': 0}
"""


ON_ROD = [0.6, -0.8], [1.6, 1.2]


def test_motion_stays_on_the_constraint() -> None:
    pendulum = system_of(PENDULUM)
    found = coefficients(pendulum, *ON_ROD)
    order = found.shape[1]
    phi = sum(np.convolve(q, q)[:order] for q in found[:2])
    size = sum(np.convolve(np.abs(q), np.abs(q))[:order] for q in found[:2])
    assert np.abs(phi[1:] / size[1:]).max() < 1e-13
    # q' = v, and E is constant
    orders = np.arange(1, order)
    np.testing.assert_allclose(found[:2, 1:] * orders, found[2:4, :-1], rtol=1e-14)
    energy = sum(np.convolve(v, v)[:order] for v in found[2:4]) / 2 + 9.81 * found[1]
    assert np.abs(energy[1:] / (size[1:] * 9.81)).max() < 1e-11


def times(*factors: np.ndarray) -> np.ndarray:
    """Return a product of series, up to the order of the shortest."""
    product, order = factors[0], min(map(len, factors))
    for factor in factors[1:]:
        product = np.convolve(product, factor)[:order]
    return product


def sine_and_cosine(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    s, c = np.zeros_like(a), np.zeros_like(a)
    s[0], c[0] = math.sin(a[0]), math.cos(a[0])
    rate = a * np.arange(len(a))
    for k in range(1, len(a)):
        s[k] = (rate[1 : k + 1] * c[:k][::-1]).sum() / k
        c[k] = -(rate[1 : k + 1] * s[:k][::-1]).sum() / k
    return s, c


SPRUNG = """
coordinates: [x, y, z]
parameters: {c: 2.0}
T: (1 + x^2)*x'^2/2 + x'*y'*cos(z) + y'^2 + (2 + sin(x*y))*z'^2/2 + y'*z'/4
V: c*x^2/2 + y*z
constraints: {line: "x + y*z = 1 + sin(t)/5"}
initial: {x: 0.5, y: 0.5, z: {guess: 1}, x': 0.1, y': 0.3, z': {guess: 0}}
"""


def test_energy_where_the_mass_matrix_varies_and_a_constraint_works() -> None:
    what = system_of(SPRUNG)
    # on the constraint at START, as is its rate
    x, y, u, v = 0.5, 0.5, 0.1, 0.3
    z = (1 + math.sin(START) / 5 - x) / y
    w = (math.cos(START) / 5 - u - v * z) / y
    found = coefficients(what, [x, y, z], [u, v, w])
    x, y, z, u, v, w, work = found
    time = np.zeros_like(x)
    time[:2] = START, 1.0
    residual = x + times(y, z) - sine_and_cosine(time)[0] / 5
    assert np.abs(residual[1:]).max() < 1e-12
    energy = (
        (times(u, u) + times(x, x, u, u)) / 2
        + times(u, v, sine_and_cosine(z)[1])
        + times(v, v)
        + times(w, w)
        + times(sine_and_cosine(times(x, y))[0], w, w) / 2
        + times(v, w) / 4
        + times(x, x)
        + times(y, z)
    )
    size = np.maximum.accumulate(np.abs(found).max(axis=0)[::-1])[::-1]
    # the constraint does all the work; projection counts it, as it depends on time
    assert np.abs(work[1:]).max() > 1e-3
    assert (np.abs(energy - work)[1:] <= 1e-11 * np.maximum(1.0, size[1:])).all()


COUPLED = """
coordinates: [x, y]
parameters: {a: 0.7, b: 1.3}
T: x'^2/2 + x'*y'*sin(y)/2 + y'^2*(1 + cos(x)^2)
V: b*y
Q: {y: a*x}
initial: {x: 0.3, y: 0.2, x': 0.4, y': -0.5}
"""


def test_equations_hold_where_masses_are_coupled() -> None:
    # M a = f of the series themselves, all orders of it
    x, y, u, w = found = coefficients(system_of(COUPLED), [0.3, 0.2], [0.4, -0.5])[:4]
    orders = np.arange(1, len(x))
    du, dw = orders * u[1:], orders * w[1:]
    (sin_x, cos_x), (sin_y, cos_y) = sine_and_cosine(x), sine_and_cosine(y)
    one = np.eye(len(orders))[0]
    first = times(sin_y, dw) / 2 + times(cos_y, w, w)[:-1] / 2
    first += du + 2 * times(cos_x, sin_x, w, w)[:-1]
    second = times(sin_y, du) / 2 + 2 * (dw + times(cos_x, cos_x, dw))
    second += 1.3 * one - 4 * times(cos_x, sin_x, u, w)[:-1] - 0.7 * x[:-1]
    size = np.abs(found[2:, :-1]).max(axis=0) * orders
    assert (np.abs(first) <= 1e-11 * size).all()
    assert (np.abs(second) <= 1e-11 * size).all()


def test_accelerations_that_are_alike_or_do_not_change() -> None:
    text = """
coordinates: [x, y, z]
parameters: {g: 9.81}
T: (x'^2 + y'^2 + z'^2)/2
V: g*(x + y)
initial: {x: 0, y: 0, z: 0, x': 1, y': 2, z': 3}
"""
    found = coefficients(system_of(text), [0.1, 0.2, 0.3], [1.0, 2.0, 3.0])
    expected = np.zeros_like(found)
    expected[:3, 0], expected[3:6, 0] = [0.1, 0.2, 0.3], [1.0, 2.0, 3.0]
    expected[:3, 1], expected[:2, 2], expected[3:5, 1] = [1.0, 2.0, 3.0], -9.81 / 2, -9.81
    np.testing.assert_allclose(found, expected, rtol=1e-15)


DRIVEN = """
coordinates: [x, y, z]
parameters: {a: 0.7}
T: z'^2/2 + x'*y'*cos(z)
constraints: {first: x = a*t^2/2, second: y = t}
initial: {x: 0, y: 0, z: 0.4, x': 0, y': 1, z': 0.3}
"""


def test_accelerations_that_are_numbers() -> None:
    # x'' = a and y'' = 0, so z'' = −a t sin z; x and y have no inertia
    q, v = [0.7 * START**2 / 2, START, 0.4], [0.7 * START, 1.0, 0.3]
    found = coefficients(system_of(DRIVEN), q, v)
    z, u = se.symbols("z u")
    expression = u
    for k in range(1, 12):
        expected = float(expression.subs({z: 0.4, u: 0.3, T: START})) / math.factorial(k)
        assert found[2, k] == pytest.approx(expected, rel=1e-10)
        change = expression.diff(T) + expression.diff(z) * u
        expression = change - expression.diff(u) * 0.7 * T * se.sin(z)
    assert found[0] == pytest.approx([q[0], v[0], 0.35, *np.zeros(len(found[0]) - 3)], abs=1e-15)
    # what the drives' forces do is all that the energy changes by
    h = 0.05
    after = [np.polyval(c[::-1], h) for c in found]
    energy = [y[5] ** 2 / 2 + y[3] * y[4] * math.cos(y[2]) for y in ([*q, *v], after)]
    assert after[6] == pytest.approx(energy[1] - energy[0], rel=1e-11)


def test_coordinate_without_inertia() -> None:
    # it is eliminated together with its constraint; x'' = −2 x
    text = """
coordinates: [x, y]
T: x'^2/2
V: y
constraints: {c: y = x^2}
initial: {x: 0.4, y: 0.16, x': 0, y': 0}
"""
    found = coefficients(system_of(text), [0.4, 0.16], [0.0, 0.0])
    orders = np.arange(0, found.shape[1], 2)
    expected = [0.4 * (-2.0) ** (k // 2) / math.factorial(k) for k in orders]
    np.testing.assert_allclose(found[0, ::2], expected, rtol=1e-13)
    square = np.convolve(found[0], found[0])[: found.shape[1]]
    np.testing.assert_allclose(found[1], square, rtol=1e-12, atol=1e-17)


def program(what: Lowered, q: list[float], v: list[float]) -> SeriesProgram:
    """Return the program for a model, eliminated as at a state."""
    system, p = what
    plan = order_at(system, [ScalarTape(system.dynamics)((START, *q, *v, *p))])
    return expand(system, unroll(system, plan), 10, ())


def test_numbers_that_stay_the_same_are_found_once() -> None:
    found = program(system("a*x*(b + x)"), [0.4], [0.2])
    assert found.invariant == found.numbers > 1
    # of a pendulum, the factors of its matrix at each state are numbers, too
    found = program(system_of(PENDULUM), *ON_ROD)
    assert 0 < found.invariant < found.numbers


def test_rows_begin_where_lines_of_the_cache_do() -> None:
    for force in ("a", "a*x*(b + x)", "a*sin(x) + b*x + x/3 + x^2/7 + x^3/11 + a*b*x^4"):
        assert program(system(force), [0.4], [0.2]).state[0] % LINE == 0


def test_elimination_needs_no_convolutions() -> None:
    # x² and y² of the velocities; a x, a y, λ x and λ y
    assert program(system_of(PENDULUM), *ON_ROD).convolutions == 6


SPRING = """
coordinates: [x, y, z, w]
parameters: {k: 3.0, c: 0.2}
definitions: {s: "sqrt((x - z)^2 + (y - w)^2)"}
T: (x'^2 + y'^2 + z'^2 + w'^2)/2
V: k/2*(s - 1)^2
D: c/2*s'^2
initial: {x: 1, y: 0.5, z: -0.5, w: 0.2, x': 0.1, y': 0.2, z': 0.3, w': -0.4}
"""


def test_common_factors_are_multiplied_once(monkeypatch: pytest.MonkeyPatch) -> None:
    what, state = system_of(SPRING), ([1.0, 0.5, -0.5, 0.2], [0.1, 0.2, 0.3, -0.4])
    short, found = program(what, *state), coefficients(what, *state)
    monkeypatch.setattr(series, "factored", lambda e, results: e.wanted(results))
    long, expected = program(what, *state), coefficients(what, *state)
    # s² 2, s, 1/s, s' 3, along both axes: damping 2, spring 2, over s 2; the power 3
    assert short.convolutions == 16
    assert long.convolutions > 24
    size = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected) <= 1e-12 * size).all()


@pytest.mark.parametrize("force", ["abs(x)", "max(x, 0)", "x*sign(x)", "floor(t)"])
def test_kinks_and_jumps_have_no_series(force: str) -> None:
    with pytest.raises(NotAnalytic):
        program(system(force), [0.4], [0.2])


def test_constraints_that_work_are_those_that_move() -> None:
    def of(constraint: str) -> Any:
        text = PENDULUM.replace("x^2 + y^2 = 1", constraint)
        return depending_on_time(system_of(text).system)

    assert of("x^2 + y^2 = 1") == []
    assert of("x^2 + y^2 = (1 + t/10)^2") == [0]


def test_long_programs_keep_their_order() -> None:
    # more operations than are put in order at a time
    many = " + ".join(f"sin({k}*x)*cos({k + 1}*x)" for k in range(1, 650))
    found = coefficients(system(many), [0.4], [0.2])[0]
    x = 0.4
    force = sum(math.sin(k * x) * math.cos((k + 1) * x) for k in range(1, 650))
    slope = sum(
        k * math.cos(k * x) * math.cos((k + 1) * x)
        - (k + 1) * math.sin(k * x) * math.sin((k + 1) * x)
        for k in range(1, 650)
    )
    assert found[2] == pytest.approx(force / 2, rel=1e-11)
    assert found[3] == pytest.approx(slope * 0.2 / 6, rel=1e-10)


def test_what_is_not_finite_leaves_nothing_behind() -> None:
    core = core_at(system("sqrt(x)"), [0.4], [0.2])
    before = core.series()
    core.move(START, np.array([-1.0, 0.2, 0.0]), 0)
    assert np.isnan(core.series()).all()
    core.move(START, np.array([0.4, 0.2, 0.0]), 0)
    np.testing.assert_array_equal(core.series(), before)


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
    rows = range(len(system.constraints))
    unknowns = LinearSystem(expansion, system, outputs, rows).solve()
    inputs = [*state[:, 0], *p]
    inputs += [0.0] * (tape.inputs - len(inputs))
    return np.array(series_coefficients(expansion, unknowns, dict(enumerate(state)), inputs))


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
        multiplier = (2 * GRAVITY * y - 2 * (u**2 + v**2)) / (4 * (x**2 + y**2))
        return [2 * x * multiplier, 2 * y * multiplier - GRAVITY, multiplier]

    found = solution(Lowered(pendulum_system(), (GRAVITY,)), state)
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


#: Registers: series, and a number.
F, G, A, B, C, S = range(6)


class Sums:
    """Emits sums of products, in this order."""

    def __init__(self) -> None:
        self.builder = Arithmetic(6, 1)

    def of(self, *products: tuple[int, ...]) -> int:
        """Return the register of a sum."""
        made = []
        for first, *others in products:
            made.append(first)
            for x in others:
                made[-1] = self.builder.emit(Op.MUL, made[-1], x)
        total = made[0]
        for x in made[1:]:
            total = self.builder.emit(Op.ADD, total, x)
        return total

    def operations(self, *results: int) -> Counter[SeriesOp]:
        """Return how many operations of each kind are left."""
        expansion = SeriesExpansion(self.builder, range(5))
        expansion.expand(results)
        return Counter(SeriesOp(op) for op, _, _ in factored(expansion, results))


def test_common_factors_are_taken_out() -> None:
    sums = Sums()
    found = sums.operations(sums.of((F, A), (S, F, B), (G, C)))
    assert found == {SeriesOp.SUM: 2, SeriesOp.MUL: 2}


def test_the_most_common_factor_is_taken_out_first() -> None:
    sums = Sums()
    # f (a + b + c) + g (a + b), not a (f + g) + b (f + g) + f c
    found = sums.operations(sums.of((F, A), (F, B), (F, C), (G, A), (G, B)))
    assert found == {SeriesOp.SUM: 4, SeriesOp.MUL: 2}


def test_common_factors_are_taken_out_inside_brackets() -> None:
    sums = Sums()
    # f (g a) + f (g b) = f (g (a + b))
    found = sums.operations(sums.of((F, sums.of((G, A))), (F, sums.of((G, B)))))
    assert (found[SeriesOp.SUM], found[SeriesOp.MUL]) == (1, 2)


def test_brackets_are_the_same_in_whatever_order() -> None:
    sums = Sums()
    found = sums.operations(sums.of((F, A), (F, B)), sums.of((G, B), (G, A)))
    assert found == {SeriesOp.SUM: 1, SeriesOp.MUL: 2, SeriesOp.SCALE: 2}


def test_products_that_are_used_elsewhere_stay() -> None:
    sums = Sums()
    product = sums.of((F, A))
    found = sums.operations(sums.of((F, A), (F, B)), sums.of((product, C)))
    assert found == {SeriesOp.SUM: 1, SeriesOp.MUL: 3}
