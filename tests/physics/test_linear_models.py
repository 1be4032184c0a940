"""Linear models and modes against closed forms, published values, differences and simulations."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.analysis.linear.linear_model import LinearModel
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.engine.constraints.initial import consistent_state
from lagcli.errors import NumericalError

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"

#: With degrees of freedom, of all kinds: chains, loops, rheonomic, nonholonomic, quaternions.
SEVERAL = (
    *("slider_crank", "chain", "four_bar", "parallelogram", "bead_on_rotating_hoop"),
    *("chaplygin_sleigh", "rolling_disk", "heavy_top", "charged_pendulum", "andrews_squeezer"),
)


@pytest.mark.parametrize("count", [1, 5, 20])
def test_hanging_chain_has_the_zeros_of_laguerre_polynomials(count: int) -> None:
    # ω² = (g/a) x with L_N(x) = 0, a the length of a link; D. Bernoulli 1732
    values = {"N": str(count), "theta_0": "0 rad"}
    model = lagcli.load(MODELS / "chain.yaml", set=values)
    found = lagcli.modes(model)
    zeros = np.polynomial.laguerre.lagroots([0] * count + [1])
    squares = [mode.natural_frequency**2 for mode in found.modes]
    assert squares == pytest.approx(9.81 * count * zeros, rel=1e-10)
    assert all(mode.kind == "oscillation" and mode.damping_ratio == 0 for mode in found.modes)
    # λ_i = −(weight below)/(2 a), for masses 1/N and links 1/N
    expected = [-(count - i) / count * 9.81 / (2 / count) for i in range(count)]
    assert found.operating_point.point.multipliers == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("steady", [None, {"x'": 5.0}])
def test_whipple_bicycle_has_the_published_eigenvalues(steady: dict[str, float] | None) -> None:
    # Meijaard, Papadopoulos, Ruina, Schwab, Proc. R. Soc. A 463 (2007) 1955, table 2
    model = lagcli.load(ROOT / "tests" / "found" / "whipple_bicycle.yaml", set={"eps": "0"})
    found = lagcli.modes(model, steady=steady)
    assert found.operating_point.steady
    values = [mode.eigenvalue for mode in found.modes if mode.kind != "neutral"]
    published = [-0.322866429004, -0.775341882196 + 4.464867713788j, -14.078389692798]
    assert len(values) == 3
    for value, expected in zip(values, published, strict=True):
        assert abs(value - expected) < 1e-10 * abs(expected)


def test_sleigh_forgets_its_rotation_at_the_rate_of_the_closed_form() -> None:
    # m a v/(J + m a²): Neimark, Fufaev, Dynamics of Nonholonomic Systems, 1972
    model = lagcli.load(MODELS / "chaplygin_sleigh.yaml", set={"omega_0": "0"})
    found = lagcli.modes(model)
    *neutral, last = found.modes
    assert [mode.kind for mode in neutral] == ["neutral"] * 4
    assert last.eigenvalue == pytest.approx(-1.5 * 0.4 / (0.2 + 1.5 * 0.4**2), rel=1e-12)


def test_damped_oscillator_has_its_frequency_and_damping() -> None:
    text = (
        "coordinates: [x]\nparameters: {m: 2, c: 0.8, k: 50}\n"
        "T: m/2*x'^2\nV: k/2*x^2\nD: c/2*x'^2\ninitial: {x: 0, x': 0}\n"
    )
    (mode,) = lagcli.modes(lagcli.load_text(text)).modes
    assert mode.natural_frequency == pytest.approx(5.0, rel=1e-14)
    assert mode.damping_ratio == pytest.approx(0.8 / (2 * math.sqrt(100)), rel=1e-12)
    assert mode.frequency == pytest.approx(5 * math.sqrt(1 - 0.04**2) / (2 * math.pi), rel=1e-13)
    assert mode.time_constant == pytest.approx(2 * 2 / 0.8, rel=1e-12)


def at_deviation(local: LocalEquations, linear: LinearModel, x: np.ndarray) -> np.ndarray:
    """Return (q, v, a, λ) of the consistent state whose independent deviations are x."""
    point, tangent = linear.operating_point.point, linear.operating_point.tangent
    n = len(tangent.positions)
    q, v = point.q.copy(), point.v.copy()
    q += linear.position_shape @ x
    v += linear.velocity_shape @ x
    fixed_q, fixed_v = np.zeros((2, len(q)), bool)
    fixed_q[list(tangent.positions)] = True
    fixed_v[list(tangent.velocities)] = True
    assert len(x) == n + len(tangent.velocities)
    given = local.evaluator(point.p).state(point.t, q, v)
    start = consistent_state(local.system, given, fixed_q, fixed_v)
    rank = tangent.decomposition.rank
    found = local.moving(start.state, rank)
    return np.concatenate([found.q, found.v, found.a, found.multipliers])


@pytest.mark.parametrize("name", SEVERAL)
def test_matrices_are_the_derivatives_along_the_constraints(name: str) -> None:
    model = lagcli.load(MODELS / f"{name}.yaml", set={"N": "3"} if name == "chain" else {})
    linear = lagcli.linearize(model, outputs=list(model.outputs))
    local = LocalEquations(model)
    positions = list(linear.operating_point.tangent.positions)
    velocities = list(linear.operating_point.tangent.velocities)
    random = np.random.default_rng(3)
    nq, h = len(model.coordinates), 1e-5
    for _ in range(2):
        x = random.standard_normal(len(linear.states))
        x /= max(np.abs(linear.position_shape @ x).max(), np.abs(linear.velocity_shape @ x).max())
        steps = [at_deviation(local, linear, s * h * x) for s in (1, -1, 2, -2)]
        slope = (8 * (steps[0] - steps[1]) - (steps[2] - steps[3])) / (12 * h)
        dq, dv, da, multipliers = np.split(slope, [nq, 2 * nq, 3 * nq])
        # differences of fourth order: errors of some 1e-16/1e-5 of the values
        close: dict[str, float] = {"rtol": 1e-6, "atol": 1e-7 * max(1.0, np.abs(steps[0]).max())}
        np.testing.assert_allclose(linear.position_shape @ x, dq, **close)
        np.testing.assert_allclose(linear.velocity_shape @ x, dv, **close)
        if linear.operating_point.tangent.decomposition.rank == len(multipliers):  # it is unique
            np.testing.assert_allclose(linear.multiplier_shape @ x, multipliers, **close)
        rates = linear.A @ x
        np.testing.assert_allclose(rates[: len(positions)], dv[positions], **close)
        np.testing.assert_allclose(rates[len(positions) :], da[velocities], **close)


def test_inputs_and_outputs_are_derivatives_of_the_model() -> None:
    path, h = MODELS / "slider_crank.yaml", 1e-4
    linear = lagcli.linearize(
        lagcli.load(path, set={"tau": "0.3"}),
        inputs=["tau", "Q.psi"],
        outputs=["lambda.guide", "rod_tension", "phi''", "energy_total", "Qc.guide.psi"],
    )
    assert linear.states == ("phi", "phi'")

    def outputs(**initial: str) -> np.ndarray:
        tau = initial.pop("tau", "0.3")
        model = lagcli.load(path, set={"tau": tau}, set_initial=initial)
        run = lagcli.simulate(model, t_end=1e-9, samples=2)
        force = run.constraint_force_of("guide")[0, 1]
        values = (run.multipliers[0, 0], run.outputs["rod_tension"][0], run.a[0, 0])
        return np.array([*values, run.energy_total[0], force])

    by_angle = (outputs(phi=str(0.5 + h)) - outputs(phi=str(0.5 - h))) / (2 * h)
    by_rate = (outputs(phi_dot=str(12 + h)) - outputs(phi_dot=str(12 - h))) / (2 * h)
    by_torque = (outputs(tau="0.4") - outputs(tau="0.2")) / 0.2
    # central differences: h² times third derivatives
    assert linear.C[:, 0] == pytest.approx(by_angle, rel=1e-5)
    assert linear.C[:, 1] == pytest.approx(by_rate, rel=1e-5, abs=1e-8)
    assert linear.D[:, 0] == pytest.approx(by_torque, rel=1e-9, abs=1e-10)
    # a force on psi is one on phi, times ψ'/φ' of the mechanism
    ratio = linear.position_shape[1, 0]
    assert linear.B[1, 1] == pytest.approx(linear.B[1, 0] * ratio, rel=1e-12)


@pytest.mark.parametrize("name", ["slider_crank", "bead_on_rotating_hoop", "four_bar"])
def test_descriptor_form_has_the_eigenvalues_of_the_reduced_form(name: str) -> None:
    from scipy.linalg import eig

    model = lagcli.load(MODELS / f"{name}.yaml")
    reduced = lagcli.linearize(model, equilibrium=True)
    descriptor = lagcli.linearize(model, equilibrium=True, form="descriptor")
    assert len(descriptor.states) == 2 * len(model.coordinates) + len(model.constraints)
    alpha, beta = eig(descriptor.A, descriptor.E, right=False, homogeneous_eigvals=True)
    found = alpha[beta != 0] / beta[beta != 0]
    expected = np.linalg.eigvals(reduced.A)
    assert np.abs(expected).min() > 0.1
    for value in expected:
        # the pencil has index 3, so that its finite eigenvalues have lost digits
        assert np.abs(found - value).min() < 1e-6 * abs(value)


def test_descriptor_form_of_a_moving_frame_is_reported_to_hold_at_an_instant() -> None:
    model = lagcli.load(MODELS / "rolling_disk.yaml", set={"kick": "0"})
    assert lagcli.linearize(model).notes == ()
    (note,) = lagcli.linearize(model, form="descriptor").notes
    assert "the reduced form" in note


def test_multipliers_of_a_mode_are_those_of_a_small_motion() -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml", set_initial={"phi": "-1.5", "phi'": "0"})
    found = lagcli.modes(model, equilibrium=True)
    (mode,) = found.modes
    assert mode.kind == "oscillation"
    point, amplitude = found.operating_point.point, 1e-5
    start = {"phi": repr(float(point.q[0] + amplitude)), "phi'": "0"}
    run = lagcli.simulate(
        lagcli.load(MODELS / "slider_crank.yaml", set_initial=start),
        t_end=mode.period,
        samples=41,
        rtol=1e-12,
    )
    wave = np.exp(mode.eigenvalue * run.time)
    expected = point.multipliers + amplitude * np.real(np.outer(wave, mode.multipliers))
    # what is left is of second order in the amplitude
    assert np.abs(mode.multipliers).max() > 1.0
    assert np.abs(run.multipliers - expected).max() < 1e2 * amplitude**2
    motion = point.q + amplitude * np.real(np.outer(wave, mode.position))
    assert np.abs(run.q - motion).max() < 10 * amplitude**2


def test_state_of_a_run_is_where_the_run_is() -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml")
    linear = lagcli.linearize(model, at=0.1)
    run = lagcli.simulate(model, t_end=0.1, samples=2)
    assert linear.operating_point.point.q == pytest.approx(run.q[-1], rel=1e-12)
    assert not linear.operating_point.steady
    assert "at this instant only" in linear.notes[0]


#: Constraints that are dependent at the origin only: they touch there, or cross.
TOUCHING = {
    "a circle and its tangent": ("y = r - sqrt(r^2 - x^2)", "y = 0"),
    "a bowl and a cylinder": ("y = x^2 + z^2", "y = z^2"),
    "a saddle and its tangent plane": ("y = x^2 - z^2", "y = 0"),
}


@pytest.mark.parametrize("pair", TOUCHING)
def test_constraints_that_touch_have_no_linear_model(pair: str) -> None:
    first, second = TOUCHING[pair]
    model = lagcli.load_text(f"""\
coordinates: [x, y, z]
parameters: {{r: 2, k: 3}}
T: (x'^2 + y'^2 + z'^2)/2
V: k/2*x^2 + y + 2*z^2
constraints: {{first: "{first}", second: "{second}"}}
initial: {{x: 0, y: 0, z: 0, x': 0, y': 0, z': 0}}
""")
    for analysis in (lagcli.modes, lagcli.linearize):
        with pytest.raises(NumericalError, match="singular configuration, where `first`, `second`"):
            analysis(model)
    (found,) = lagcli.equilibrium(model).equilibria
    assert found.stability.verdict == "undecided"
    assert not len(found.stability.eigenvalues)


def test_constraints_that_are_dependent_everywhere_have_one() -> None:
    """A bead in a bowl that is given twice, once by its square root; ω² = k + 2 and 4 + 2."""
    model = lagcli.load_text("""\
coordinates: [x, y, z]
parameters: {k: 3}
T: (x'^2 + y'^2 + z'^2)/2
V: k/2*x^2 + y + 2*z^2
constraints: {bowl: y = x^2 + z^2, again: exp(y) = exp(x^2 + z^2)}
initial: {x: 0, y: 0, z: 0, x': 0, y': 0, z': 0}
""")
    squares = [mode.natural_frequency**2 for mode in lagcli.modes(model).modes]
    assert squares == pytest.approx([5, 6], rel=1e-12)
    assert lagcli.equilibrium(model).equilibria[0].stability.verdict == "stable"


def test_a_linear_model_next_to_a_singular_configuration_says_so() -> None:
    model = lagcli.load(ROOT / "tests/found/singular_start.yaml")
    assert any("next to a singular" in note for note in lagcli.linearize(model).notes)


@pytest.mark.parametrize("x", [0.3, 0.45, 0.6])
def test_a_curved_row_takes_no_part_in_the_dependence_of_others(x: float) -> None:
    """A bead on z = x²/2 in a plane that is given twice: its share in the sum is rounding errors.

    At rest, L = (2 + x²) x'²/2 - k/2 x² gives δx'' = d/dx (-k x/(2 + x²)) δx.
    """
    model = lagcli.load_text(f"""\
coordinates: [x, y, z]
parameters: {{k: 3}}
T: (x'^2 + y'^2 + z'^2)/2
V: k/2*x^2
constraints: {{plane: x = y, bowl: z = x^2/2, again: 7/16*x = 7/16*y}}
initial: {{x: {x}, y: {{guess: 0}}, z: {{guess: 0}}, x': 0, y': {{guess: 0}}, z': {{guess: 0}}}}
""")
    linear = lagcli.linearize(model)
    expected = -3 * (2 - x**2) / (2 + x**2) ** 2
    np.testing.assert_allclose(linear.A, [[0, 1], [expected, 0]], rtol=1e-12, atol=1e-12)
