"""Power series of a motion against derivatives that SymEngine takes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import symengine as se

import lagcli
from lagcli.engine.compiled_engine import Integration
from lagcli.engine.elimination import order_at
from lagcli.engine.expansion import NotAnalytic
from lagcli.engine.interpreter import ScalarTape
from lagcli.engine.run import Request
from lagcli.engine.series import Series, depending_on_time, expand
from lagcli.engine.system import System, compile_system
from lagcli.engine.unrolling import unroll
from lagcli.equations.lagrange import derive
from lagcli.model.functions import FUNCTIONS

T = se.Symbol("t")
START = 0.3


TEXT = """
coordinates: [x]
parameters: {{a: 0.7, b: -1.3}}
T: x'^2/2
Q: {{x: "{force}"}}
initial: {{x: 0.4, x': 0.2}}
"""


def system(force: str) -> System:
    return compile_system(derive(lagcli.load_text(TEXT.format(force=force))))


def core_at(what: System, q: list[float], v: list[float]) -> Any:
    """Return the core at a state, ready for Taylor's method."""
    request = Request(
        q=np.array(q),
        v=np.array(v),
        rank=len(what.constraints),
        t_start=START,
        t_end=1.0,
        times=np.array([1.0]),
        rtol=1e-9,
        atol=1e-10,
        method="Taylor",
        formulation="projection",
        alpha=None,
        beta=None,
        max_step=math.inf,
        max_steps=10,
        timeout=None,
        through_singular=False,
    )
    integration = Integration(what, request, lambda block: None, None)
    assert not integration.methods.refused
    return integration.core


def coefficients(what: System, q: list[float], v: list[float]) -> np.ndarray:
    return core_at(what, q, v).series()


def derivatives(force: se.Basic, count: int) -> list[float]:
    """Return x, x', x'', … at the start over factorials, for x'' = force(t)."""
    values = [0.4, 0.2]
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


def test_motion_stays_on_the_constraint() -> None:
    pendulum = compile_system(derive(lagcli.load_text(PENDULUM)))
    found = coefficients(pendulum, [0.6, -0.8], [1.6, 1.2])
    order = found.shape[1]
    phi = sum(np.convolve(q, q)[:order] for q in found[:2])
    size = sum(np.convolve(np.abs(q), np.abs(q))[:order] for q in found[:2])
    assert np.abs(phi[1:] / size[1:]).max() < 1e-13
    # q' = v, and E is constant
    orders = np.arange(1, order)
    np.testing.assert_allclose(found[:2, 1:] * orders, found[2:4, :-1], rtol=1e-14)
    energy = sum(np.convolve(v, v)[:order] for v in found[2:4]) / 2 + 9.81 * found[1]
    assert np.abs(energy[1:] / (size[1:] * 9.81)).max() < 1e-11


SPRUNG = """
coordinates: [x, y, z]
parameters: {c: 2.0}
T: (1 + x^2)*x'^2/2 + x'*y'*cos(z) + y'^2 + (2 + sin(x*y))*z'^2/2 + y'*z'/4
V: c*x^2/2 + y*z
constraints: {line: "x + y*z = 1 + sin(t)/5"}
initial: {x: 0.5, y: 0.5, z: {guess: 1}, x': 0.1, y': 0.3, z': {guess: 0}}
"""


def test_energy_where_the_mass_matrix_varies_and_a_constraint_works() -> None:
    what = compile_system(derive(lagcli.load_text(SPRUNG)))
    # on the constraint at START, as is its rate
    x, y, u, v = 0.5, 0.5, 0.1, 0.3
    z = (1 + math.sin(START) / 5 - x) / y
    w = (math.cos(START) / 5 - u - v * z) / y
    found = coefficients(what, [x, y, z], [u, v, w])
    order = found.shape[1]

    def times(*factors: np.ndarray) -> np.ndarray:
        product = factors[0]
        for factor in factors[1:]:
            product = np.convolve(product, factor)[:order]
        return product

    def sine_and_cosine(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s, c = np.zeros(order), np.zeros(order)
        s[0], c[0] = math.sin(a[0]), math.cos(a[0])
        rate = a * np.arange(order)
        for k in range(1, order):
            s[k] = (rate[1 : k + 1] * c[:k][::-1]).sum() / k
            c[k] = -(rate[1 : k + 1] * s[:k][::-1]).sum() / k
        return s, c

    x, y, z, u, v, w, work = found
    time = np.zeros(order)
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


def test_accelerations_that_are_alike_or_do_not_change() -> None:
    text = """
coordinates: [x, y, z]
parameters: {g: 9.81}
T: (x'^2 + y'^2 + z'^2)/2
V: g*(x + y)
initial: {x: 0, y: 0, z: 0, x': 1, y': 2, z': 3}
"""
    found = coefficients(
        compile_system(derive(lagcli.load_text(text))), [0.1, 0.2, 0.3], [1.0, 2.0, 3.0]
    )
    expected = np.zeros_like(found)
    expected[:3, 0], expected[3:6, 0] = [0.1, 0.2, 0.3], [1.0, 2.0, 3.0]
    expected[:3, 1], expected[:2, 2], expected[3:5, 1] = [1.0, 2.0, 3.0], -9.81 / 2, -9.81
    np.testing.assert_allclose(found, expected, rtol=1e-15)


def test_coordinate_without_inertia() -> None:
    # it is eliminated together with its constraint; x'' = −2 x
    text = """
coordinates: [x, y]
T: x'^2/2
V: y
constraints: {c: y = x^2}
initial: {x: 0.4, y: 0.16, x': 0, y': 0}
"""
    what = compile_system(derive(lagcli.load_text(text)))
    found = coefficients(what, [0.4, 0.16], [0.0, 0.0])
    orders = np.arange(0, found.shape[1], 2)
    expected = [0.4 * (-2.0) ** (k // 2) / math.factorial(k) for k in orders]
    np.testing.assert_allclose(found[0, ::2], expected, rtol=1e-13)
    square = np.convolve(found[0], found[0])[: found.shape[1]]
    np.testing.assert_allclose(found[1], square, rtol=1e-12, atol=1e-17)


def program(text: str) -> Series:
    """Return the program for a model, eliminated as at its start."""
    what = compile_system(derive(lagcli.load_text(text)))
    state = [START, *[0.6] * len(what.coordinates), *[0.2] * len(what.coordinates)]
    plan = order_at(what, [ScalarTape(what.dynamics)((*state, *what.parameters))])
    return expand(what, unroll(what, plan), 10, ())


def test_numbers_that_stay_the_same_are_found_once() -> None:
    found = program(TEXT.format(force="a*x*(b + x)"))
    assert found.steady == found.numbers > 1
    # of a pendulum, the factors of its matrix at each state are numbers, too
    found = program(PENDULUM)
    assert 0 < found.steady < found.numbers


def test_elimination_needs_no_convolutions() -> None:
    # x² and y² of the velocities; a x, a y, λ x and λ y
    assert program(PENDULUM).convolutions == 6


@pytest.mark.parametrize("force", ["abs(x)", "max(x, 0)", "x*sign(x)", "floor(t)"])
def test_kinks_and_jumps_have_no_series(force: str) -> None:
    what = system(force)
    plan = order_at(what, [ScalarTape(what.dynamics)((START, 0.4, 0.2, *what.parameters))])
    with pytest.raises(NotAnalytic):
        expand(what, unroll(what, plan), 10, ())


def test_constraints_that_work_are_those_that_move() -> None:
    def of(constraint: str) -> Any:
        text = PENDULUM.replace("x^2 + y^2 = 1", constraint)
        return depending_on_time(compile_system(derive(lagcli.load_text(text))))

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
