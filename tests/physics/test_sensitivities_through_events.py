"""Derivatives through impacts, friction, events and jumps of forces: closed forms, differences."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import lagcli
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.variants import Variants
from lagcli.trajectory.samples import Samples
from lagcli.trajectory.trajectory import Trajectory, joined

CONTACT = Path(__file__).parents[2] / "models" / "contact"
SAVED = json.loads((Path(__file__).parent / "sensitivities_through_events.json").read_text("utf-8"))
Array = NDArray[np.float64]

BLOCK = """
coordinates: [x]
parameters: {{m: 2, F: 3, t1: 0.7, k: 50, d: 0.5, v0: 1.5}}
T: m*x'^2/2
V: 0
Q: {{x: "{force}"}}
initial: {{x: 0, x': v0}}
"""


def of(found: Trajectory, name: str) -> tuple[Array, Array, Array]:
    """Return derivatives of q, v and λ with respect to one name."""
    k = found.sensitivity.index(name)
    assert found.dq is not None
    assert found.dv is not None
    assert found.dmultipliers is not None
    return found.dq[:, :, k], found.dv[:, :, k], found.dmultipliers[:, :, k]


def differences(model: Model, name: str, options: dict[str, object], part: float) -> list[Array]:
    """Return central differences of sixth order of runs: q, v, λ and times of what happens."""
    variants = Variants(model, SettingsOverrides(**options))
    known = {**model.parameter_values, **{k: x.value for k, x in model.initial.items()}}
    option = "set" if name in model.parameters else "set_initial"
    h = part * abs(known[name])

    def at(step: int) -> list[Array]:
        run = variants.varied(**{option: {name: f"{known[name] + step * h!r}*1"}})
        blocks: list[Samples] = []
        record = run.run(blocks.append)
        assert record.events is not None
        samples = joined(blocks)
        return [samples.q, samples.v, samples.multipliers, record.events.time]

    total = [0.0] * 4
    for step, weight in {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}.items():
        both = zip(total, at(step), at(-step), strict=True)
        total = [x + weight * (above - below) / h for x, above, below in both]
    return total  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("file", "names", "end", "part"),
    [
        ("bouncing_ball", ("h",), 1.5, 1e-4),
        ("block_on_incline", ("mu",), 0.2, 1e-4),
        ("clutch", ("M_c", "t_1"), 3.9, 1e-4),
        ("particle_on_sphere", ("theta_0",), 1.1, 1e-4),
        ("rope_pendulum", ("v0",), 1.9, 1e-4),
        ("stick_slip_belt", ("F_s",), 1.5, 1e-4),
        pytest.param("bouncing_ball", ("e", "g"), 2.5, 1e-4, marks=pytest.mark.slow),
        pytest.param("block_on_incline", ("A", "v0"), 0.29, 1e-4, marks=pytest.mark.slow),
        pytest.param("sliding_ladder", ("theta0", "l"), 0.9, 1e-4, marks=pytest.mark.slow),
        pytest.param("stick_slip_belt", ("F_k", "k", "v_b"), 2.0, 1e-4, marks=pytest.mark.slow),
        pytest.param("woodpecker", ("mu", "e"), 0.15, 1e-5, marks=pytest.mark.slow),
        pytest.param("slider_crank_friction", ("mu", "l"), 1.0, 1e-4, marks=pytest.mark.slow),
        pytest.param("rocking_block", ("h", "b"), 1.3, 1e-4, marks=pytest.mark.slow),
    ],
)
def test_central_differences_of_runs(
    file: str, names: tuple[str, ...], end: float, part: float
) -> None:
    model = lagcli.load(CONTACT / f"{file}.yaml")
    options: dict[str, object] = {"rtol": 1e-11, "t_end": end, "samples": 8}
    for name in names:  # one by one: parameters that follow others do so only if not named
        found = lagcli.simulate(model, sensitivity=(name,), **options)
        assert found.status == "completed"
        assert found.warnings == ()
        assert found.events is not None
        expected = differences(model, name, options, part)
        actual = [*of(found, name), found.events.dtime[:, 0]]
        for which, (x, y) in enumerate(zip(actual, expected, strict=True)):
            assert np.isfinite(x).all()
            scale = max(float(np.abs(y).max(initial=0.0)), 1e-6)
            np.testing.assert_allclose(x, y, atol=1e-7 * scale, err_msg=f"{name} {which}")


@pytest.mark.parametrize("case", SAVED["cases"], ids=lambda case: case["model"])
def test_saved_derivatives_of_an_independent_program(case: dict[str, Any]) -> None:
    """See the file for their source; each is relative to the largest of its kind."""
    model = lagcli.load(CONTACT / f"{case['model']}.yaml")
    found = lagcli.simulate(
        model, rtol=1e-11, t_end=case["end"], samples=5, sensitivity=tuple(case["names"])
    )
    assert found.warnings == ()
    assert found.events is not None
    np.testing.assert_allclose(found.events.time, case["events"], rtol=1e-9)
    own = {key: getattr(found, key) for key in ("dq", "dv", "dmultipliers")}
    for key, x in {**own, "dtime": found.events.dtime}.items():
        y = np.array(case[key]).reshape(x.shape)
        np.testing.assert_allclose(x, y, atol=1e-7 * max(np.abs(y).max(), 1e-6), err_msg=key)


def test_times_and_heights_of_a_bouncing_ball_in_closed_form() -> None:
    model = lagcli.load(CONTACT / "bouncing_ball.yaml")
    found = lagcli.simulate(model, rtol=1e-12, t_end=2.6, samples=14, sensitivity=("h", "g", "e"))
    h, g, e = 1.0, 9.81, 0.8
    assert found.events is not None
    assert set(found.events.kinds) == {"impact"}
    n = np.arange(len(found.events))
    # t_n = √(2 h/g) (1 + 2 e + … + 2 e^(n−1))
    fall = np.sqrt(2 * h / g)
    factor = 1 + 2 * np.array([sum(e**k for k in range(1, i + 1)) for i in n])
    slope = 2 * np.array([sum(k * e ** (k - 1) for k in range(1, i + 1)) for i in n])
    expected = np.array([fall * factor / (2 * h), -fall * factor / (2 * g), fall * slope])
    assert len(n) >= 4
    np.testing.assert_allclose(found.events.time, fall * factor, rtol=1e-10)
    np.testing.assert_allclose(found.events.dtime.T, expected, rtol=1e-9)
    # between impacts y = v (t − t_n) − g (t − t_n)²/2 with v = e^n √(2 g h)
    for t, dq in zip(found.time, found.dq[:, 0], strict=True):  # type: ignore[index]
        k = int(np.searchsorted(found.events.time, t, side="right")) - 1
        if k < 0:
            continue
        since, v = t - found.events.time[k], e ** (k + 1) * np.sqrt(2 * g * h)
        dv = np.array([v / (2 * h), v / (2 * g), (k + 1) * v / e])
        direct = np.array([0.0, -(since**2) / 2, 0.0])
        np.testing.assert_allclose(
            dq, dv * since + direct - (v - g * since) * expected[:, k], atol=1e-8
        )


def test_the_distance_at_which_coulomb_friction_stops_a_block() -> None:
    model = lagcli.load_text("""
coordinates: {x: m, y: m}
parameters: {m: 2 kg, mu: 0.3, g: 9.81 m/s^2, v0: 4 m/s}
T: m*(x'^2 + y'^2)/2
V: m*g*y
constraints: {floor: {expr: y >= 0, friction: mu, slip: x'}}
initial: {x: 0, y: 0, x': v0, y': 0}
""")
    found = lagcli.simulate(model, t_end=2, samples=9, sensitivity=("mu", "v0", "g", "m"))
    mu, g, v0 = 0.3, 9.81, 4.0
    assert found.events is not None
    # x = v0²/(2 μ g) from t = v0/(μ g) on
    last = found.dq[-1, 0]  # type: ignore[index]
    expected = [-(v0**2) / (2 * mu**2 * g), v0 / (mu * g), -(v0**2) / (2 * mu * g**2), 0.0]
    np.testing.assert_allclose(last, expected, atol=1e-8)
    times = [-v0 / (mu**2 * g), 1 / (mu * g), -v0 / (mu * g**2), 0.0]
    np.testing.assert_allclose(found.events.dtime[-1], times, atol=1e-9)
    np.testing.assert_allclose(found.dv[-1], 0.0, atol=1e-12)  # type: ignore[index]
    # it bears N = m g, and slips with μ m g before
    assert found.dmultipliers is not None
    np.testing.assert_allclose(found.dmultipliers[-1, 0], [0, 0, 2.0, 9.81], atol=1e-9)
    np.testing.assert_allclose(found.dmultipliers[2, 1], [-2 * g, 0, -2 * mu, -mu * g], atol=1e-9)


def test_a_mass_that_a_spring_throws_back() -> None:
    model = lagcli.load_text(BLOCK.format(force="-k*max(x - d, 0)"))
    found = lagcli.simulate(
        model, rtol=1e-12, t_end=2, samples=3, sensitivity=("k", "d", "v0", "m")
    )
    m, k, d, v = 2.0, 50.0, 0.5, 1.5
    # x = 2 d − v (t − π √(m/k)) after the contact
    turn = np.pi * np.sqrt(m / k)
    expected = [-v * turn / (2 * k), 2.0, -(2 - turn), v * turn / (2 * m)]
    np.testing.assert_allclose(found.dq[-1, 0], expected, rtol=1e-9)  # type: ignore[index]
    assert found.time[-1] > d / v + turn


@pytest.mark.parametrize("force", ["if(t < t1, F, 0)", "F*(1 - step(t - t1))"])
def test_the_instant_at_which_a_force_ends(force: str) -> None:
    model = lagcli.load_text(BLOCK.format(force=force))
    found = lagcli.simulate(model, t_end=2, samples=12, sensitivity=("t1", "F"))
    t, t1, rate = found.time, 0.7, 3 / 2
    after = np.maximum(t - t1, 0)
    dq, dv, _ = of(found, "t1")
    np.testing.assert_allclose(dq[:, 0], rate * after, atol=1e-9)
    np.testing.assert_allclose(dv[:, 0], rate * (t > t1), atol=1e-9)
    dq, _, _ = of(found, "F")
    np.testing.assert_allclose(dq[:, 0], (t**2 - after**2) / 4, atol=1e-9)


def test_a_force_that_jumps_at_a_place() -> None:
    model = lagcli.load_text(BLOCK.format(force="-F*step(x - d)"))
    found = lagcli.simulate(model, rtol=1e-12, t_end=1, samples=3, sensitivity=("d", "F", "v0"))
    # x = v t − F/(2 m) (t − d/v)²
    d, v, F, m, t = 0.5, 1.5, 3.0, 2.0, 1.0
    since = t - d / v
    expected = [F / m * since / v, -(since**2) / (2 * m), t - F / m * since * d / v**2]
    np.testing.assert_allclose(found.dq[-1, 0], expected, rtol=1e-9)  # type: ignore[index]


def test_the_time_at_which_an_event_stops_a_run() -> None:
    model = lagcli.load_text("""
coordinates: [y]
parameters: {m: 1, g: 9.81, h: 2}
T: m*y'^2/2
V: m*g*y
events: {ground: {when: y <= 0, stop: true}}
initial: {y: h, y': 0}
""")
    found = lagcli.simulate(model, t_end=5, sensitivity=("h", "g"))
    assert found.status == "stopped-by-event"
    assert found.events is not None
    t = np.sqrt(2 * 2 / 9.81)
    np.testing.assert_allclose(found.events.dtime[-1], [t / 4, -t / (2 * 9.81)], rtol=1e-8)


def test_a_ball_in_a_wind_that_a_table_gives() -> None:
    """m v' = u − c |v| v − m g: kinks of the drag and of the table, and a floor."""
    text = """
coordinates: [y]
parameters: {c: 0.3}
inputs:
  u: {times: [0, 0.3, 0.7, 1], values: [0, 3, -2, 0], interpolation: linear, extend: periodic}
T: y'^2/2
V: 9.81*y
Q: {y: u - c*abs(y')*y'}
constraints:
  floor: {expr: y >= 0, restitution: 0.5}
initial: {y: 0.3, y': 0}
simulation: {t_end: 0.6, samples: 4}
"""
    found = lagcli.simulate(lagcli.load_text(text), sensitivity=["c"])
    above, below = (
        lagcli.simulate(lagcli.load_text(text, set={"c": f"{c!r}"}), rtol=1e-12).q
        for c in (0.3 + 1e-5, 0.3 - 1e-5)
    )
    np.testing.assert_allclose(found.dq[:, :, 0], (above - below) / 2e-5, rtol=0, atol=1e-7)


def test_an_event_sets_velocities_and_parameters() -> None:
    model = lagcli.load_text("""
coordinates: [x]
parameters: {m: 2, F: 3, d: 0.6, r: 0.4}
T: m*x'^2/2
V: 0
Q: {x: F}
events: {wall: {when: x >= d, set: {x': -r*x', F: 2*F}}}
initial: {x: 0, x': 0}
""")
    t = 1.2
    found = lagcli.simulate(model, rtol=1e-12, t_end=t, samples=2, sensitivity=("d", "F", "r"))
    m, F, d, r = 2.0, 3.0, 0.6, 0.4
    v, at = np.sqrt(2 * F * d / m), np.sqrt(2 * m * d / F)
    # x = d − r v (t − t*) + F/m (t − t*)² with v = √(2 F d/m), t* = √(2 m d/F)
    s = t - at
    slope = -r * v + 2 * F / m * s
    by_d = 1 - r * v / (2 * d) * s - slope * at / (2 * d)
    by_F = -r * v / (2 * F) * s + s**2 / m + slope * at / (2 * F)
    np.testing.assert_allclose(found.dq[-1, 0], [by_d, by_F, -v * s], rtol=1e-9)  # type: ignore[index]


@pytest.mark.parametrize("law", ["poisson", "newton"])
@pytest.mark.parametrize(("mu", "rolls"), [(0.05, False), (0.6, True)])
def test_the_impact_of_a_spinning_ball(law: str, mu: float, rolls: bool) -> None:
    """It slips through the impact, or ends it rolling: 2/7 of the slip goes into the spin."""
    model = lagcli.load_text(
        f"""
coordinates: [x, y, phi]
parameters: {{m: 6, r: 0.1, g: 9.81, mu: {mu}, e: 0.5, u: 1, h: 0.3}}
T: m/2*(x'^2 + y'^2) + m*r^2/5*phi'^2
V: m*g*y
constraints: {{lane: {{expr: y >= r, restitution: e, friction: mu, slip: x' + r*phi'}}}}
initial: {{x: 0, y: h + r, phi: 0, x': u, y': 0, phi': 0}}
"""
    )
    options = {"rtol": 1e-12, "t_end": 0.3, "samples": 2, "impacts": law}
    names = ("mu", "e", "u", "h")
    found = lagcli.simulate(model, sensitivity=names, **options)  # type: ignore[arg-type]
    e, h, v = 0.5, 0.3, np.sqrt(2 * 9.81 * 0.3)
    # x'⁺ = u − μ (1 + e) v, or u − 2/7 u
    expected = [-(1 + e) * v, -mu * v, 1.0, -mu * (1 + e) * v / (2 * h)]
    if rolls:
        expected = [0.0, 0.0, 5 / 7, 0.0]
    np.testing.assert_allclose(found.dv[-1, 0], expected, atol=1e-10)  # type: ignore[index]


def test_derivatives_end_where_a_sequence_of_impacts_does() -> None:
    found = lagcli.simulate(
        lagcli.load(CONTACT / "bouncing_ball.yaml"), samples=21, sensitivity=("e",), rtol=1e-7
    )
    (note,) = found.warnings
    assert "derivatives by `e` end at t = 4.063" in note
    assert "infinitely many impacts of `floor`" in note
    lost = np.isnan(found.dq[:, 0, 0])  # type: ignore[index]
    np.testing.assert_array_equal(lost, found.time > 4.0637)


def test_a_grazed_ceiling_has_no_derivative() -> None:
    # y = v t − g t²/2 just reaches v²/(2 g) = 1
    model = lagcli.load_text("""
coordinates: [y]
parameters: {g: 10, v: 20^0.5, top: 1}
T: y'^2/2
V: g*y
constraints: {ceiling: {expr: y <= top - 2e-13, restitution: 0.5}}
initial: {y: 0, y': v}
""")
    found = lagcli.simulate(model, t_end=0.8, samples=9, sensitivity=("v",))
    assert found.events is not None
    assert "impact" in found.events.kinds
    (note,) = found.warnings
    assert "derivatives by `v` end at t = 0.447" in note
    assert "`ceiling` is only touched" in note
    assert np.isnan(found.dq[-1]).all()  # type: ignore[index]
    assert np.isfinite(found.dq[0]).all()  # type: ignore[index]


def test_events_at_once_have_no_derivative_where_their_order_decides() -> None:
    # both balls reach the floor at once; a bar makes the order matter
    model = lagcli.load_text("""
coordinates: [y, a]
parameters: {g: 9.81, h: 1, w: 0.2}
T: y'^2/2 + a'^2/6
V: g*y
constraints:
  left: {expr: y - a >= 0, restitution: 0.5}
  right: {expr: y + a >= 0, restitution: 0.5}
initial: {y: h, a: 0, y': 0, a': 0}
""")
    found = lagcli.simulate(model, t_end=0.6, samples=4, sensitivity=("h", "a"))
    (note,) = found.warnings
    assert "derivatives by `a` end" in note
    assert "their order decides" in note
    assert np.isfinite(found.dq[-1, :, 0]).all()  # type: ignore[index]
    assert np.isnan(found.dq[-1, :, 1]).all()  # type: ignore[index]


def test_a_body_that_rests_has_no_derivative_by_its_height() -> None:
    model = lagcli.load_text("""
coordinates: [x, y]
parameters: {g: 9.81}
T: (x'^2 + y'^2)/2
V: g*y
constraints: {floor: y >= 0}
initial: {x: 0, y: 0, x': 1, y': 0}
""")
    found = lagcli.simulate(model, t_end=1, samples=2, sensitivity=("x'", "y"))
    (note,) = found.warnings
    assert "derivatives by `y` end at t = 0" in note
    assert "`floor` holds there only for this value" in note
    np.testing.assert_allclose(found.dq[-1, :, 0], [1, 0], atol=1e-12)  # type: ignore[index]


JUMPS = """
coordinates: [x]
parameters: {{c: 0.5, m: {mass}}}
T: m*x'^2/2
V: 0
Q: {{x: "{force}"}}
initial: {{x: 0, x': {speed}}}
simulation: {{t_end: 1, samples: 2}}
"""


@pytest.mark.parametrize(
    ("force", "mass", "speed", "slope"),
    [
        # x' = 1 until x = c at t = c, then 1 − (t − c)
        ("if(x > c, -m, 0)", 1e-6, 1.0, 1.0),
        ("if(x > c, -m, 0)", 1e6, 1.0, 1.0),
        # x'' = 2 c until x' = −√½ at t₁ = (0.851 − √½)/(2 c), then c: ∂x'/∂c = t − t₁ + t₁
        ("m*c*(floor(2*x'^2) + 1)", 1.0, -0.851, 1.0),
    ],
)
def test_forces_that_jump_at_any_size(force: str, mass: float, speed: float, slope: float) -> None:
    model = lagcli.load_text(JUMPS.format(force=force, mass=mass, speed=speed))
    run = lagcli.simulate(model, sensitivity=["c"])
    assert run.dv[-1, 0, 0] == pytest.approx(slope, rel=1e-8)


@pytest.mark.parametrize("switches", ["events: {far: {when: y >= 100, stop: true}}", ""])
def test_entries_of_the_jacobian_that_the_elimination_does_without(switches: str) -> None:
    """Compare a point on a curve with its motion along y, by the energy."""
    model = lagcli.load_text(
        f"""
coordinates: [x, y]
parameters: {{m: 1.3}}
T: (m*x'^2 + y'^2)/2
V: 0
constraints: {{c: "-2.3*x - exp(y) = -3"}}
initial: {{x: {{guess: 0.5}}, y: 0.5, x': {{guess: 0}}, y': 0.5}}
simulation: {{t_end: 1, samples: 9, rtol: 1e-12}}
{switches}
"""
    )
    run = lagcli.simulate(model, sensitivity=["m"])

    def along(m: float) -> NDArray[np.float64]:
        start = 1 + m * (np.exp(0.5) / 2.3) ** 2

        def rate(_: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
            return 0.5 * np.sqrt(start / (1 + m * (np.exp(y) / 2.3) ** 2))

        times = np.linspace(0, 1, 9)
        y = solve_ivp(rate, (0, 1), [0.5], "DOP853", times, rtol=1e-13, atol=1e-14).y[0]
        return np.array([-np.exp(y) / 2.3 * rate(0, y), rate(0, y)]).T

    step = 1e-3
    expected = (along(1.3 + step) - along(1.3 - step)) / (2 * step)
    np.testing.assert_allclose(run.dv[..., 0], expected, atol=1e-8)  # that of the difference
