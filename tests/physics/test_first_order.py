"""First-order coordinates, without inertia: closed forms, the matrix exponential and SciPy."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.linalg import solve
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lagcli
from lagcli.errors import ModelError, NumericalError

FOUND = Path(__file__).parents[1] / "found"
Gradient = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]

COUPLED = """
coordinates: [x, y]
parameters: {m: 2, k: 4, c: 3}
T: m/2*y'^2
V: k/2*x^2 + k/2*(y - x)^2
D: c/2*x'^2
initial: {x: 1, y: 0.5, x': {guess: 0}, y': 0}
simulation: {t_end: 2, samples: 21}
"""


def test_overdamped_spring_decays_exponentially() -> None:
    text = """
coordinates: [x]
parameters: {k: 4, c: 2, F: 3}
T: 0
V: k/2*x^2
D: c/2*x'^2
Q: {x: F}
initial: {x: 1, x': {guess: 0}}
"""
    run = lagcli.simulate(lagcli.load_text(text), t_end=2, samples=11)
    expected = 0.75 + 0.25 * np.exp(-2 * run.time)
    assert np.allclose(run.q[:, 0], expected, atol=1e-9)
    assert np.allclose(run.v[:, 0], -2 * (expected - 0.75), atol=1e-8)
    assert np.abs(run.multipliers).max() < 1e-12
    assert np.abs(run.energy_balance).max() < 1e-8


@pytest.mark.parametrize("options", [{}, {"method": "Taylor"}])
def test_maxwell_body_is_a_linear_system_of_third_order(options: dict[str, str]) -> None:
    run = lagcli.simulate(lagcli.load_text(COUPLED), **options)
    m, k, c = 2, 4, 3
    matrix = np.array([[-2 * k / c, k / c, 0], [0, 0, 1], [k / m, -k / m, 0]])
    exact = np.array([expm(matrix * t) @ [1, 0.5, 0] for t in run.time])
    assert np.allclose(run.q, exact[:, :2], atol=1e-8)
    assert np.allclose(run.v[:, 1], exact[:, 2], atol=1e-8)


def test_several_overdamped_particles_share_a_damper() -> None:
    """c (x' − y') = −k x and c (y' − x') + d y' = 0: the damper between x and y slides."""
    text = """
coordinates: [x, y]
parameters: {k: 4, c: 3, d: 2}
T: 0
V: k/2*x^2
D: c/2*(x' - y')^2 + d/2*y'^2
initial: {x: 1, y: 0, x': {guess: 0}, y': {guess: 0}}
"""
    run = lagcli.simulate(lagcli.load_text(text), t_end=1, samples=11)
    rate = 4 * (1 / 3 + 1 / 2)  # dampers in series
    x = np.exp(-rate * run.time)
    assert np.allclose(run.q[:, 0], x, atol=1e-9)
    assert np.allclose(run.q[:, 1], -2 / rate * (1 - x), atol=1e-9)


def test_equation_is_named_and_reported() -> None:
    model = lagcli.load_text(COUPLED)
    assert model.constraint_names == ("x.rate",)
    text = lagcli.render(lagcli.derive(model))
    assert "the equation of a first-order coordinate; its multiplier is 0" in text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("D: c/2*x'^2", "D: c/4*x'^4"), "is not linear in the velocities"),
        (("D: c/2*x'^2", "D: c/2*x'^2\nQ: {x: -lambda.h}"), "depends on multipliers"),
    ],
)
def test_balances_that_are_not_linear_are_rejected(change: tuple[str, str], words: str) -> None:
    text = COUPLED.replace("initial:", "constraints: {h: y = 0.5}\ninitial:")
    with pytest.raises(ModelError, match=words):
        lagcli.load_text(text.replace(*change))


def test_massless_coordinates_with_a_constraint_stay_as_they_are() -> None:
    text = COUPLED.replace("initial:", "constraints: {h: x = y}\ninitial:")
    assert lagcli.load_text(text).constraint_names == ("h",)


def test_vortices_turn_on_their_circle() -> None:
    """Equal vortices on an equilateral triangle of side a turn at 3 G/(2 π a²)."""
    run = lagcli.simulate(lagcli.load(FOUND / "vortices.yaml"))
    at = 2 * np.pi * np.arange(1, 4) / 3 - 3 / (2 * np.pi) * run.time[:, None]
    exact = np.hstack([np.cos(at), np.sin(at)]) / np.sqrt(3)
    assert np.abs(run.q - exact).max() < 1e-9
    assert np.abs(run.multipliers).max() < 1e-13
    assert np.abs(run.energy_balance).max() < 1e-12


def test_charge_without_mass_spirals_inwards() -> None:
    """(c + i B) z' = −k z."""
    run = lagcli.simulate(lagcli.load(FOUND / "lowest_landau.yaml"))
    exact = np.exp(-run.time / (0.1 + 2j))
    assert np.abs(run.q[:, 0] + 1j * run.q[:, 1] - exact).max() < 1e-9
    assert np.abs(run.energy_balance).max() < 1e-9


SPIN = """
coordinates: [theta, phi]
parameters: {S: 1.5, b: 0.8}
L: S*cos(theta)*phi' - b*S*cos(theta)
initial: {theta: 0.7, phi: 0.2, theta': {guess: 0}, phi': {guess: 0}}
"""


def test_spin_precesses_about_the_field() -> None:
    """∂L/∂θ = −S sin θ (φ' − b) = 0: the rate is b, whatever the angle."""
    run = lagcli.simulate(lagcli.load_text(SPIN), t_end=10, samples=21)
    assert np.abs(run.q - np.stack([0.7 + 0 * run.time, 0.2 + 0.8 * run.time], 1)).max() < 1e-12


@pytest.mark.parametrize(
    "gauge", ["B*x*y'", "-B*y*x'", "B*(x*y' - y*x')/2", "B*x*y' + x*x'*cos(y) - x^2/2*sin(y)*y'"]
)
def test_total_derivatives_in_l_change_nothing(gauge: str) -> None:
    text = f"""
coordinates: [x, y]
parameters: {{B: 2}}
L: {gauge} - (x^2 + 3*y^2)/2
initial: {{x: 1, y: 0, x': {{guess: 0}}, y': {{guess: 0}}}}
"""
    run = lagcli.simulate(lagcli.load_text(text), t_end=3, samples=7)
    rate = np.sqrt(3) / 2
    assert np.abs(run.q[:, 0] - np.cos(rate * run.time)).max() < 1e-9
    assert np.abs(run.q[:, 1] - np.sin(rate * run.time) / np.sqrt(3)).max() < 1e-9


def test_charges_are_coupled_to_a_mass() -> None:
    """L = ½ m(x) X'² + B x y' + g x X' + h X y' − V: x and y are first-order, X has inertia."""
    text = """
coordinates: [x, y, X]
parameters: {B: 2, g: 0.3, h: 0.4, k: 1.5}
L: (1 + x^2/5)*X'^2/2 + B*x*y' + g*x*X' + h*X*y' - k/2*(x^2 + y^2 + X^2) - x*y*X/3
initial: {x: 1, y: 0.2, X: -0.4, X': 0.5, x': {guess: 0}, y': {guess: 0}}
simulation: {t_end: 5, samples: 11, rtol: 1e-10}
"""
    model = lagcli.load_text(text)
    run = lagcli.simulate(model)

    def rates(_: float, state: np.ndarray) -> list[float]:
        x, y, place, speed = state
        b, g, h, k = 2, 0.3, 0.4, 1.5
        dy = (k * x + y * place / 3 - x * speed**2 / 5 - g * speed) / b
        dx = -(k * y + x * place / 3 + h * speed) / b
        force = h * dy - k * place - x * y / 3 - g * dx - 2 * x * dx * speed / 5
        return [dx, dy, speed, force / (1 + x**2 / 5)]

    given = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "t_eval": run.time}
    exact = solve_ivp(rates, (0, 5), [1, 0.2, -0.4, 0.5], **given)
    assert np.abs(run.q - exact.y[:3].T).max() < 1e-8
    assert np.abs(run.v[:, 2] - exact.y[3]).max() < 1e-8
    assert np.ptp(run.energy_total) < 1e-9
    kinds = {c.name: c.kind for c in model.constraints}
    assert kinds == {"x.rate": "nonlinear", "y.rate": "nonholonomic"}  # in X', not in x' and y'


ROD = """
coordinates: [x1, y1, x2, y2]
parameters: {l: 2, c: 0.3, s: 0.5}
T: 0
V: -x1*y1' - 1.5*x2*y2' + x1^2/2 + 0.6*y1^2 + x2^2/2 + y2^2/2
D: c/2*(x1'^2 + y1'^2 + x2'^2 + y2'^2)
Q: {x1: s*(y2 - y1), y1: s*(x1 - x2), x2: s*(y1 - y2), y2: s*(x2 - x1)}
constraints: {rod: (x1 - x2)^2 + (y1 - y2)^2 = l^2}
initial:
  x1: -0.9
  y1: 0
  x2: {guess: 1}
  y2: 0.5
  x1': {guess: 0}
  y1': {guess: 0}
  x2': {guess: 0}
  y2': {guess: 0}
simulation: {t_end: 8, samples: 17}
"""


def _on_a_rod(q: np.ndarray, c: float = 0.3, s: float = 0.5) -> np.ndarray:
    """Return v and λ of [A − c, bᵀ; b, 0] (v, λ) = (∂V/∂q − Q, 0)."""
    x1, y1, x2, y2 = q
    row = 2 * np.array([x1 - x2, y1 - y2, x2 - x1, y2 - y1])
    matrix = np.zeros((5, 5))
    matrix[0, 1], matrix[1, 0], matrix[2, 3], matrix[3, 2] = 1, -1, 1.5, -1.5
    matrix[:4, :4] -= c * np.eye(4)
    matrix[4, :4] = matrix[:4, 4] = row
    torque = s * np.array([y2 - y1, x1 - x2, y1 - y2, x2 - x1, 0])
    return solve(matrix, np.array([x1, 1.2 * y1, x2, y2, 0]) - torque)


@pytest.mark.parametrize("options", [{}, {"method": "Radau"}, {"formulation": "baumgarte"}])
def test_multiplier_of_a_rod_between_vortices(options: dict[str, str]) -> None:
    """The rod turns, and with it each coordinate by which the others could be expressed."""
    run = lagcli.simulate(lagcli.load_text(ROD), **options)
    given = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "t_eval": run.time}
    exact = solve_ivp(lambda _, q: _on_a_rod(q)[:4], (0, 8), run.q[0], **given).y.T
    assert np.abs(run.q - exact).max() < 1e-8
    forces = np.array([_on_a_rod(q)[4] for q in exact])
    assert np.abs(run.multipliers[:, 0] - forces).max() < 1e-7
    assert np.abs(run.multipliers[:, 1:]).max() < 1e-10
    gaps = exact[:, :2] - exact[:, 2:]
    assert gaps[:, 0].min() < 0 < gaps[:, 0].max()  # it has been vertical
    assert run.freedom["redundant"] == []


@pytest.mark.parametrize(
    ("wire", "gradient"),
    [
        ("x + y/2 = 1", lambda x, y: (0 * x + 1, 0 * y + 0.5)),
        ("x^2 + y^2 = 1", lambda x, y: (2 * x, 2 * y)),
        ("sin(x)*y + x = 0.5", lambda x, y: (y * np.cos(x) + 1, np.sin(x))),
    ],
)
def test_damped_vortex_on_a_wire(wire: str, gradient: Gradient) -> None:
    """c s' = −dV/ds along the wire, and λ balances the force across it."""
    text = f"""
coordinates: [x, y]
parameters: {{c: 0.5}}
L: x*y' - x^2/2 - y
D: c/2*(x'^2 + y'^2)
constraints: {{wire: {wire}}}
initial: {{x: {{guess: 0.6}}, y: 0.7, x': {{guess: 0}}, y': {{guess: 0}}}}
simulation: {{t_end: 1, samples: 5}}
"""
    run = lagcli.simulate(lagcli.load_text(text))
    (x, y), (u, v), force = run.q.T, run.v.T, run.multipliers[:, 0]
    b = np.stack(gradient(x, y), 1)
    assert np.abs((b * run.v).sum(axis=1)).max() < 1e-12
    assert np.abs(v - 0.5 * u - x + force * b[:, 0]).max() < 1e-10
    assert np.abs(-u - 0.5 * v - 1 + force * b[:, 1]).max() < 1e-10
    along = np.stack([-b[:, 1], b[:, 0]], 1) / np.linalg.norm(b, axis=1)[:, None]
    slope = along[:, 0] * x + along[:, 1]
    assert np.abs(0.5 * (along * run.v).sum(axis=1) + slope).max() < 1e-10
    assert np.abs(slope).max() > 0.3


@pytest.mark.parametrize(
    ("lagrangian", "rest"),
    [
        ("x*y' - (x^2 + y^2)/2", "constraints: {wire: x + y = 1}"),
        ("x*y' + y*z' + x*z*x' - (x^2 + y^2 + 2*z^2)/2", ""),
    ],
)
def test_an_odd_number_of_velocities_is_not_determined(lagrangian: str, rest: str) -> None:
    names = "xyz" if "z" in lagrangian else "xy"
    values = ", ".join(f"{q}: {{guess: 0.3}}, {q}': {{guess: 0}}" for q in names)
    text = f"coordinates: [{', '.join(names)}]\nL: {lagrangian}\n{rest}\ninitial: {{{values}}}\n"
    with pytest.raises(NumericalError, match="the equations do not determine their velocities"):
        lagcli.simulate(lagcli.load_text(text), t_end=1)


def test_fixed_velocity_that_contradicts_is_an_error() -> None:
    text = (FOUND / "lowest_landau.yaml").read_text().replace("x': {guess: 0}", "x': 0.3")
    with pytest.raises(ModelError, match="the fixed initial values violate"):
        lagcli.simulate(lagcli.load_text(text.replace("y': {guess: 0}", "y': 0.3")))


def test_error_of_the_work_does_not_limit_the_steps() -> None:
    """A pair of vortices moves uniformly; its kinetic energy and its work are zero."""
    text = """
coordinates: [x0, y0, x1, y1]
T: 0
V: -0.947*x0'*y0 + 1.087*x1'*y1 + 0.0819161738572115*log((-x0 + x1)^2 + (-y0 + y1)^2)
initial:
  {x0: 0.275, y0: 0.504, x1: 1.89, y1: 0.745,
   x0': {guess: 0}, y0': {guess: 0}, x1': {guess: 0}, y1': {guess: 0}}
"""
    run = lagcli.simulate(lagcli.load_text(text), t_end=2, samples=3)
    assert run.counts["steps"] < 20


def test_conserved_quantities_of_vortices() -> None:
    """Linear and angular impulse, and the energy, in spite of the rows x.rate."""
    text = """
coordinates: [x, y, u, w]
L: (x*y' - y*x')/2 + u*w' - w*u' + log((x - u)^2 + (y - w)^2)
initial:
  {x: 0, y: 0, u: 1, w: 0.5,
   x': {guess: 0}, y': {guess: 0}, u': {guess: 0}, w': {guess: 0}}
"""
    checked = lagcli.check(lagcli.load_text(text))
    found = {x.kind: x for x in checked.conserved.quantities}
    assert set(found) == {"momentum", "jacobi"}
    assert sum(x.kind == "momentum" for x in checked.conserved.quantities) >= 3
    assert checked.integrability.constraints == {}
    assert checked.rank.not_unique == ()


def test_linear_model_is_that_of_the_typed_equations() -> None:
    """c (x1' − …) as a matrix: M v = −K q has the eigenvalues of −M⁻¹K."""
    random = np.random.default_rng(4)
    for _ in range(4):
        b, c = random.uniform(1, 2), random.uniform(0, 0.5)
        k = random.uniform(0.5, 2, 2)
        text = f"""
coordinates: [x, y]
L: {b}*x*y' - {k[0]}/2*x^2 - {k[1]}/2*y^2
D: {c}/2*(x'^2 + y'^2)
initial: {{x: 1, y: 0, x': {{guess: 0}}, y': {{guess: 0}}}}
"""
        linear = lagcli.linearize(lagcli.load_text(text), equilibrium=True)
        exact = np.linalg.inv([[c, -b], [b, c]]) @ -np.diag(k)
        assert np.allclose(linear.A, exact, atol=1e-12)


def test_observer_is_in_equilibrium_where_its_equations_are() -> None:
    model = lagcli.load(FOUND / "obs.yaml")
    found = lagcli.equilibrium(model).equilibria[0]
    assert np.abs(found.operating_point.point.q).max() < 1e-12
    assert found.stability.verdict == "asymptotically stable"
    modes = lagcli.modes(model, equilibrium=True)
    assert max(mode.eigenvalue.real for mode in modes.modes) < 0


def test_equilibria_of_random_observers() -> None:
    """m x'' = −k x − d x' + u + w, u = −f·z, z' = A z + b u + g (x − z₁) + h."""
    random = np.random.default_rng(7)
    for _ in range(10):
        n = int(random.integers(2, 5))
        a = random.uniform(-1, 1, (n, n)) - 2 * np.eye(n)
        b, f, g, h = random.uniform(-1, 1, (4, n))
        stiffness, w = random.uniform(2, 4), random.uniform(-1, 1)
        z = [f"z{i}" for i in range(n)]
        u = " - ".join(["0", *(f"{f[i]}*{z[i]}" for i in range(n))])
        rates = [
            " + ".join([f"{a[i, j]}*{z[j]}" for j in range(n)])
            + f" + {b[i]}*({u}) + {g[i]}*(x - z0) + {h[i]}"
            for i in range(n)
        ]
        squares = " + ".join(f"{s}'^2" for s in z)
        guesses = ", ".join(f"{s}: 0, {s}': {{guess: 0}}" for s in z)
        forces = "".join(f"  {s}: {rate}\n" for s, rate in zip(z, rates, strict=True))
        text = f"""
coordinates: [x, {", ".join(z)}]
T: x'^2/2
V: {stiffness}/2*x^2
D: ({squares})/2
Q:
  x: {u} + {w} - 0.5*x'
{forces}
initial: {{x: 0, x': 0, {guesses}}}
"""
        matrix, right = np.zeros((n + 1, n + 1)), np.concatenate([[-w], -h])
        matrix[0, 0], matrix[0, 1:] = -stiffness, -f
        matrix[1:, 1:], matrix[1:, 0] = a - np.outer(b, f), g
        matrix[1:, 1] -= g
        found = lagcli.equilibrium(lagcli.load_text(text)).equilibria[0]
        assert np.allclose(found.operating_point.point.q, solve(matrix, right), atol=1e-10)


@pytest.mark.parametrize(
    ("lagrangian", "initial", "steady"),
    [
        ("B*x*y' - k/2*(x^2 + y^2)", "x: 1, y: 0", False),  # circles
        ("B*x*y' - k/2*(x^2 + y^2)", "x: 0, y: 0", True),
        ("B*x*y' - k/2*((x - 0.3)^2 + (y - 0.1)^2)", "x: 0.3, y: 0.1", True),
        ("B*x*y' + k*x", "x: 1, y: 0", True),  # drifts at a constant velocity
        ("B*x*y' + m/2*z'^2 - k/2*(x^2 + y^2)", "x: 1, y: 0, z: 0, z': 1", False),
        ("B*x*y' + m/2*z'^2 - k/2*(x^2 + y^2)", "x: 0, y: 0, z: 0, z': 1", True),
    ],
)
def test_a_start_is_steady_where_first_order_velocities_are_constant(
    lagrangian: str, initial: str, steady: bool
) -> None:
    """With no other velocities, all of which the equations determine, nothing else tells."""
    names = "x, y, z" if "z" in lagrangian else "x, y"
    text = f"""
coordinates: [{names}]
parameters: {{B: 2, k: 1.3, m: 1}}
L: {lagrangian}
initial: {{{initial}, x': {{guess: 0}}, y': {{guess: 0}}}}
"""
    model = lagcli.load_text(text)
    assert lagcli.check(model).steady is steady
    notes = lagcli.modes(model).linear_model.notes
    assert any("at this instant only" in note for note in notes) is not steady


def test_units_of_conserved_quantities_of_vortices() -> None:
    """Where values of parameters stand in a quantity as numbers, its terms ∂L/∂q' have its unit."""
    text = """
coordinates: {x: m, y: m, u: m, w: m}
parameters: {rho: 1 kg/m^2, G: 2 m^2/s, H: 1 m^2/s, d: 1 m}
L: rho*(G*x*y' + H*u*w') + rho*G*H/(4*pi)*log(((x - u)^2 + (y - w)^2)/d^2)
initial:
  {x: 0.5, y: 0, u: -0.5, w: 0,
   x': {guess: 0}, y': {guess: 0}, u': {guess: 0}, w': {guess: 0}}
"""
    checked = lagcli.check(lagcli.load_text(text))
    units = {q.name: checked.conserved_units.get(q.name) for q in checked.conserved.quantities}
    assert units["J_1"] == "kg*m/s"  # of the symbol rho*G*x + rho*H*u
    assert units["J_2"] == "kg*m/s"  # -2*y - w, in which 2 is rho*G
    assert units["J_3"] == "kg*m^2/s"  # -(2*y + w)^2/4
    assert units["jacobi"] == "J"
