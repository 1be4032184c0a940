"""Derivatives of the motion and of λ, against closed forms and central differences of runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import lagcli
from lagcli.model.model import Model
from lagcli.simulations.variants import Variants
from lagcli.trajectory.samples import Samples
from lagcli.trajectory.trajectory import joined

MODELS = Path(__file__).parents[2] / "models"
Array = NDArray[np.float64]


def motion(samples: Samples) -> Array:
    return np.concatenate([samples.q, samples.v, samples.multipliers], axis=1)


def derivatives(samples: Samples, place: int) -> Array:
    assert samples.dq is not None
    assert samples.dv is not None
    assert samples.dmultipliers is not None
    parts = samples.dq, samples.dv, samples.dmultipliers
    return np.concatenate([x[:, :, place] for x in parts], axis=1)


def differences(model: Model, name: str, options: dict[str, object]) -> Array:
    """Return central differences of sixth order of runs: their error is of the order of h⁶."""
    from lagcli.settings.settings import SettingsOverrides

    variants = Variants(model, SettingsOverrides(**options))
    known = {**model.parameter_values, **{k: x.value for k, x in model.initial.items()}}
    value, option = known[name], "set" if name in model.parameters else "set_initial"

    def at(x: float) -> Array:
        # as an expression, the number is in SI
        run = variants.varied(**{option: {name: f"{x!r}*1"}})
        blocks: list[Samples] = []
        run.run(blocks.append)
        return motion(joined(blocks))

    h = 1e-3 * (abs(value) or 1.0)
    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    return sum(w * (at(value + k * h) - at(value - k * h)) for k, w in weights.items()) / h


@pytest.mark.parametrize(
    ("file", "names", "end"),
    [
        ("slider_crank", ("l", "r", "c", "phi", "phi'"), 1.0),
        ("pendulum_cartesian", ("g", "l", "theta_0"), 2.0),
        ("rolling_disk", ("g", "r"), 1.0),
        ("heavy_top", ("a",), 0.1),
        ("car_axis", ("L_0",), 1.0),
    ],
)
def test_central_differences_of_runs(file: str, names: tuple[str, ...], end: float) -> None:
    model = lagcli.load(MODELS / f"{file}.yaml")
    options = {"rtol": 1e-12, "t_end": end, "samples": 11}
    found = lagcli.simulate(model, sensitivity=names, **options)
    assert found.status == "completed"
    for place, name in enumerate(names):
        expected = differences(model, name, options)
        nq = len(found.coordinates)
        for part in (slice(nq), slice(nq, 2 * nq), slice(2 * nq, None)):
            # of the largest of q, v or λ: the differences have the error of runs over 1e-3
            scale = np.abs(expected[:, part]).max(initial=1e-12)
            error = np.abs(derivatives(found, place) - expected)[:, part].max(initial=0.0)
            assert error < 1e-7 * scale, (name, part)


def test_an_oscillator_in_closed_form() -> None:
    model = lagcli.load_text("""
coordinates: [x]
parameters: {m: 2, k: 18, x_0: 0.5}
T: m*x'^2/2
V: k*x^2/2
initial: {x: x_0, x': 0}
""")
    found = lagcli.simulate(model, t_end=5, samples=51, rtol=1e-12, sensitivity=("k", "m", "x_0"))
    t, w = found.time, 3.0
    swing = 0.5 * np.sin(w * t) * t  # x = x_0 cos ωt, ω = √(k/m)
    assert found.dq is not None
    np.testing.assert_allclose(found.dq[:, 0, 0], -swing * w / (2 * 18), atol=1e-10)
    np.testing.assert_allclose(found.dq[:, 0, 1], swing * w / (2 * 2), atol=1e-10)
    np.testing.assert_allclose(found.dq[:, 0, 2], np.cos(w * t), atol=1e-10)


@pytest.mark.parametrize("order", ["r: point, e: quaternion", "e: quaternion, r: point"])
@pytest.mark.parametrize("fixed", ["[0, 0, w]", "[0, {guess: 0}, w]"])
def test_a_spinning_body_in_closed_form(order: str, fixed: str) -> None:
    """A spin about a principal axis: e = (cos ωt/2, 0, 0, sin ωt/2), and z = (g/ω) t."""
    model = lagcli.load_text(f"""
coordinates: {{{order}}}
parameters: {{w: 1.5, g: 2}}
T: body(2, diag(1, 2, 3), r, e)
initial: {{e: 1, e': {fixed}, r: 0, r': [0, 0, g/w]}}
""")
    found = lagcli.simulate(model, t_end=2, samples=11, rtol=1e-12, sensitivity=("w",))
    t, names = found.time, found.coordinates
    zero, half = np.zeros(11), 1.5 * found.time / 2
    expected = {
        **{"e.0": -np.sin(half) * t / 2, "e.1": zero, "e.2": zero, "e.3": np.cos(half) * t / 2},
        **{"r.x": zero, "r.y": zero, "r.z": -2 / 1.5**2 * t},
    }
    assert found.dq is not None
    np.testing.assert_allclose(found.dq[:, :, 0].T, [expected[q] for q in names], atol=1e-9)


def test_an_angular_velocity_that_a_constraint_completes_turns_with_the_body() -> None:
    """e' = G(e) ω/2 with ω = (0.5, 2, −1), of which ω_y is not given, and e = rot_x(a)."""
    model = lagcli.load_text("""
coordinates: {e: quaternion}
parameters: {a: 0.8, b: 0.5, w: 2}
T: dot(omega(e), diag(1, 2, 3)*omega(e))/2
constraints: {drive: omega(e).y = w}
initial: {e: rot_x(a), e': [b, {guess: 0}, -1]}
""")
    found = lagcli.simulate(model, t_end=0.1, samples=2, sensitivity=("a", "b", "w"))
    c, s = np.cos(0.4), np.sin(0.4)
    # 2 e' = (−s ω_x, c ω_x, c ω_y − s ω_z, c ω_z + s ω_y)
    by_a = np.array([-c * 0.5, -s * 0.5, -s * 2 - c * (-1), -s * (-1) + c * 2]) / 4
    expected = np.array([by_a, [-s / 2, c / 2, 0, 0], [0, 0, c / 2, s / 2]]).T
    assert found.dv is not None
    np.testing.assert_allclose(found.dv[0], expected, atol=1e-12)


def test_the_force_of_a_rope_in_closed_form() -> None:
    """Atwood's machine: λ is the rope's force, of magnitude 2 m₁ m₂ g/(m₁ + m₂)."""
    model = lagcli.load_text("""
coordinates: [y, z]
parameters: {m_1: 2, m_2: 3, g: 9.81}
T: m_1*y'^2/2 + m_2*z'^2/2
V: m_1*g*y + m_2*g*z
constraints: {rope: y + z = 0}
initial: {y: 0, z: 0, y': 0, z': 0}
""")
    found = lagcli.simulate(model, t_end=1, samples=11, sensitivity=("m_1", "m_2", "g"))
    assert found.dmultipliers is not None
    expected = [2 * 9 * 9.81 / 25, 2 * 4 * 9.81 / 25, 2 * 6 / 5]
    np.testing.assert_allclose(found.dmultipliers[:, 0], np.tile(expected, (11, 1)), rtol=1e-10)
    # y'' = (m₂ − m₁) g/(m₁ + m₂)
    assert found.dq is not None
    slope = -2 * 3 * 9.81 / 25 * found.time**2 / 2
    np.testing.assert_allclose(found.dq[:, 0, 0], slope, atol=1e-10)


def test_parameters_and_initial_values_that_follow_others_are_in_the_derivative() -> None:
    text = """
coordinates: [x]
parameters: {a: 3, k: a^2}
T: x'^2/2
V: k*x^2/2
initial: {x: 2*a, x': 0}
"""
    found = lagcli.simulate(lagcli.load_text(text), t_end=2, samples=21, sensitivity=("a",))
    t = found.time
    # x = 2 a cos(a t)
    expected = 2 * np.cos(3 * t) - 6 * t * np.sin(3 * t)
    assert found.dq is not None
    np.testing.assert_allclose(found.dq[:, 0, 0], expected, atol=1e-7)


@pytest.mark.parametrize("mass", [1.0, 1.3, 1e-3, 1e6])
def test_a_parameter_that_does_not_matter_costs_no_steps(mass: float) -> None:
    """The mass of a skate: its motion has no derivative but rounding errors, λ has λ/m."""
    model = lagcli.load(MODELS / "knife_edge_incline.yaml", set={"m": mass})
    found = lagcli.simulate(model, sensitivity=("m",), max_steps=1000)
    assert found.dq is not None
    assert found.dv is not None
    assert found.dmultipliers is not None
    assert np.abs(found.dq * mass).max() < 1e-10
    assert np.abs(found.dv * mass).max() < 1e-10
    slope, size = found.dmultipliers[:, :, 0] * mass, np.abs(found.multipliers).max()
    np.testing.assert_allclose(slope, found.multipliers, atol=1e-9 * size)


def test_derivatives_lie_on_the_linearized_constraints() -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml")
    found = lagcli.simulate(model, sensitivity=("l",))
    phi, psi = found.q.T
    assert found.dq is not None
    s = found.dq[:, :, 0]
    # r sin φ = l sin ψ, differentiated by l
    residual = 0.1 * np.cos(phi) * s[:, 0] - 0.3 * np.cos(psi) * s[:, 1] - np.sin(psi)
    # far below the run's tolerance of 1e-9, at which the derivatives drift without projection
    np.testing.assert_allclose(residual, 0.0, atol=1e-11 * np.abs(s).max())


def test_a_start_that_the_guesses_decide_has_the_derivative_of_the_search() -> None:
    model = lagcli.load_text("""
coordinates: [x, y, z]
parameters: {l: 1.3, g: 9.81, x0: 0.7}
T: (x'^2 + y'^2 + z'^2)/2
V: g*z
constraints: {sphere: x^2 + y^2 + z^2 = l^2}
initial: {x: {guess: x0}, y: {guess: 0.5*l}, z: {guess: -1}, x': {guess: 0.3*l}, y': 0.2,
          z': {guess: 0}}
""")
    options = {"rtol": 1e-12, "t_end": 0.5, "samples": 3}
    found = lagcli.simulate(model, sensitivity=("l", "x0"), **options)
    for place, name in enumerate(("l", "x0")):
        expected = differences(model, name, options)
        np.testing.assert_allclose(
            derivatives(found, place), expected, atol=1e-7 * np.abs(expected).max()
        )


def test_stiff_motion_is_differentiated_by_an_implicit_method() -> None:
    """A bead on a wire with a damper: v = g/c (1 − e^{−ct}), c = 10⁴, over many time constants."""
    model = lagcli.load_text("""
coordinates: [x, y]
parameters: {c: 1.0e4, g: 9.81}
T: (x'^2 + y'^2)/2
V: g*y
Q: {y: -c*y'}
constraints: {wire: x = 0}
initial: {x: 0, y: 0, x': 0, y': 0}
""")
    found = lagcli.simulate(model, t_end=10, samples=5, rtol=1e-8, sensitivity=("c",))
    assert "Radau" in str(found.options["method"])
    t, c, g = found.time[1:], 1e4, 9.81
    assert found.dq is not None
    # y = −g/c (t − (1 − e^{−ct})/c)
    expected = g / c**2 * t - 2 * g / c**3
    np.testing.assert_allclose(found.dq[1:, 1, 0], expected, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "names"),
    [
        ("pendulum_cartesian", ("m", "l")),
        ("slider_crank", ("m", "l")),
        ("chain", ("l", "g")),
        ("heavy_top", ("a", "m")),
        ("andrews_squeezer", ("m_1", "m_2")),
    ],
)
def test_two_parameters_cost_at_most_three_runs(file: str, names: tuple[str, ...]) -> None:
    """CPU time from the model to its samples, measured in pairs and interleaved."""
    import statistics
    import time

    from lagcli.settings.settings import SettingsOverrides
    from lagcli.simulations.simulation import prepare

    model = lagcli.load(MODELS / f"{file}.yaml")

    def seconds(sensitivity: tuple[str, ...]) -> float:
        began = time.process_time()
        settings = SettingsOverrides(sensitivity=sensitivity) if sensitivity else None
        prepare(model, settings).run(lambda samples: None)
        return time.process_time() - began

    seconds(names)  # imports
    ratio = statistics.median(seconds(names) / seconds(()) for _ in range(9))
    print(f"{file}: {len(names)} parameters cost {ratio:.2f} times the run")
    assert ratio < 3.0
