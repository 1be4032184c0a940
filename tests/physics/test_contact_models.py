"""The shipped models with contacts, friction and events, against closed forms.

The values are those of the textbooks and papers that the models name: see also the cases of
`tests/physics/test_contact_cases.py`.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.equations.render import render
from lagcli.settings.settings import SettingsOverrides
from lagcli.trajectory.trajectory import Trajectory

MODELS = Path(__file__).parents[2] / "models" / "contact"
NAMES = sorted(path.stem for path in MODELS.glob("*.yaml"))


@cache
def run(name: str) -> Trajectory:
    return lagcli.simulate(lagcli.load(name))


def last(name: str, column: str) -> float:
    trajectory = run(name)
    names = list(trajectory.coordinates)
    values = trajectory.v if column.endswith("'") else trajectory.q
    return float(values[-1, names.index(column.rstrip("'"))])


@pytest.mark.parametrize("name", NAMES)
def test_contact_model_says_what_it_is(name: str) -> None:
    text = (MODELS / f"{name}.yaml").read_text(encoding="utf-8")
    model = lagcli.load(name)
    head = text.split("\nname:")[0]
    assert all(line.startswith("#") for line in head.splitlines())
    for part in ("# Shows:", "# lambda.", "# Try:"):
        assert part in head
    assert model.name == name
    assert model.description
    assert model.view
    assert model.settings.rtol == 1e-9
    assert model.units.throughout
    assert model.units.findings == ()


@pytest.mark.parametrize("name", NAMES)
def test_contact_model_is_derived_in_all_formats(name: str) -> None:
    equations = lagcli.derive(lagcli.load(name))
    for format_ in ("text", "latex", "markdown", "json"):
        assert render(equations, format_)


@pytest.mark.parametrize("name", NAMES)
def test_contact_model_completes_and_its_energy_balances(name: str) -> None:
    """Through impacts, sticking, engagement and events: to 1e-9 of the energy's scale."""
    # the tolerances of one SciPy step are met less closely
    settings = SettingsOverrides(rtol=1e-9)
    trajectory = lagcli.simulate(lagcli.load(name), settings)
    stopped = name in ("sliding_ladder", "particle_on_sphere")
    expected = "stopped-by-event" if stopped else "completed"
    assert trajectory.status == expected, trajectory.message
    # energies of potentials are known up to a constant
    size = max(np.abs(trajectory.energy_total).max(), np.ptp(trajectory.energy_kinetic))
    assert np.abs(trajectory.energy_balance).max() <= 1e-9 * size
    log = trajectory.events
    if log is not None and "impact" in log.kinds and name != "newtons_cradle":
        # the balance is one of large changes
        assert log.loss.sum() > 0.01 * size


def test_energy_balances_through_an_engagement() -> None:
    """Two masses are joined while one moves: half of the energy is lost at once."""
    model = lagcli.load_text("""
coordinates: {x: m, y: m}
parameters: {m: 2 kg, k: 50 N/m, F: 3 N}
T: m/2*(x'^2 + y'^2)
V: k/2*x^2
Q: {y: F}
constraints:
  joint: {expr: x' = y', active: false}
events:
  join: {when: t >= 0.1, engage: joint}
  part: {when: t >= 0.5, release: joint}
initial: {x: 0, x': 4, y: 0, y': 0}
simulation: {t_end: 1, samples: 101}
""")
    trajectory = lagcli.simulate(model, SettingsOverrides(rtol=1e-11))
    assert np.abs(trajectory.energy_balance).max() <= 1e-9 * 16
    log = trajectory.events
    assert log is not None
    v = 4 * math.cos(5 * 0.1), 1.5 * 0.1  # ω = √(k/m) = 5/s
    lost = 2 / 4 * (v[0] - v[1]) ** 2  # of the reduced mass
    assert float((log.loss - log.supplied - log.work).sum()) == pytest.approx(lost, rel=1e-9)


# tolerances: rtol 1e-9, amplified by impacts and the run's length


def test_the_ball_rests_at_the_end() -> None:
    assert last("bouncing_ball", "y") == pytest.approx(0, abs=1e-9)
    assert run("bouncing_ball").multipliers[-1, 0] == pytest.approx(2 * 9.81)


def test_the_block_stands_at_the_end() -> None:
    assert last("rocking_block", "phi") == pytest.approx(0, abs=1e-7)
    # 2.786038987 s: the series of half swings
    trajectory = run("rocking_block")
    before = trajectory.time < 2.78
    assert np.abs(trajectory.v[~before & (trajectory.time > 2.79), 2]).max() < 1e-6


def test_the_belt_lets_go_at_static_friction() -> None:
    model = lagcli.load("stick_slip_belt")
    trajectory = lagcli.simulate(model, times=[0, 0.39, 0.4])
    np.testing.assert_allclose(trajectory.q[:, 0], [0, 0.078, 0.08], atol=1e-9)
    found = run("stick_slip_belt")
    assert found.multipliers.max() <= 8 * (1 + 1e-9)


def test_an_event_that_only_records_lets_the_belt_slip_on() -> None:
    found = lagcli.simulate(lagcli.load("stick_slip_belt"), t_end=1.0)
    assert found.status == "completed"
    counts = found.events.counts()
    assert counts["belt"]["slips"] == counts["slips"]["event"] == 1


def test_only_the_last_ball_leaves() -> None:
    np.testing.assert_allclose(run("newtons_cradle").v[-1], [0, 0, 1], atol=1e-12)


def test_the_block_on_the_incline_sticks_and_slips() -> None:
    # roots of closed forms in 40 digits
    times = [0, 0.020635854861870856, 0.036910866090545188, 0.20231267409693817]
    trajectory = lagcli.simulate(lagcli.load("block_on_incline"), times=times)
    expected = [0, 0.0044949802502367365, 0.0057985247511570226, -0.014629593083626859]
    np.testing.assert_allclose(trajectory.q[:, 0], expected, rtol=1e-7)


def test_the_rope_catches_the_mass() -> None:
    assert last("rope_pendulum", "x") == pytest.approx(0.71352661477900480, abs=1e-7)
    assert last("rope_pendulum", "y") == pytest.approx(-0.70062812532898912, abs=1e-7)


def test_the_ladder_leaves_the_wall_and_falls_flat() -> None:
    trajectory = run("sliding_ladder")
    names = list(trajectory.coordinates)
    # afterwards x' is constant
    assert last("sliding_ladder", "x'") == pytest.approx(1.6472237712215788, rel=1e-8)
    leaves = np.arcsin(2 / 3 * np.sin(np.radians(70)))
    held = trajectory.multipliers[:, 1] > 0
    theta = trajectory.q[:, names.index("theta")]
    assert (held == (theta > leaves)).all()


def test_the_crank_stops_by_friction() -> None:
    # two independent codes
    assert last("slider_crank_friction", "phi") == pytest.approx(4.6630185461, abs=1e-8)
    assert last("slider_crank_friction", "phi'") == pytest.approx(-1.046725578, abs=1e-7)


def test_the_clutch_locks_and_is_released() -> None:
    assert last("clutch", "a'") == pytest.approx(76.293631367682813, rel=1e-9)
    assert last("clutch", "b'") == pytest.approx(31.238218011892221, rel=1e-9)


def test_appell_and_hamels_particle() -> None:
    expected = {"x": 1.4772, "y": 1.9696, "z": -2.924, "x'": 2.6544, "z'": -8.848}
    for column, value in expected.items():
        assert last("appell_hamel", column) == pytest.approx(value, rel=1e-9)
    assert run("appell_hamel").multipliers[-1, 0] == pytest.approx(0.44349005424954792)


def test_the_woodpecker_comes_down_step_by_step() -> None:
    trajectory = run("woodpecker")
    # 19.445 mm in each period of 0.145976 s, Glocker's limit cycle
    t, y = trajectory.time, trajectory.q[:, 0]
    period = 0.145976065144
    fall = np.interp(0.3 + period, t, y) - np.interp(0.3, t, y)
    assert math.isclose(fall, -0.019445379, rel_tol=1e-2)


def test_the_particle_leaves_the_sphere_at_two_thirds() -> None:
    trajectory = lagcli.simulate(lagcli.load("particle_on_sphere"))
    (r, theta), t = trajectory.q.T, trajectory.time
    touches = trajectory.multipliers[:, 0] > 0
    assert (touches == (np.cos(theta) > 2 / 3)).all()
    start = math.tan(math.radians(5) / 4)
    left = math.log(math.tan(math.acos(2 / 3) / 4) / start) / math.sqrt(9.81)
    assert t[touches][-1] < left < t[~touches][0]
    # the angle itself, at the instant
    log = trajectory.events
    assert log is not None
    (leaves,) = (i for i, name in enumerate(log.names) if name == "leaves")
    assert log.time[leaves] == pytest.approx(left, abs=1e-9)
    for cosine in log.recorded("cos_theta"):
        assert cosine[leaves] == pytest.approx(2 / 3, abs=1e-9)
    for force in log.recorded("normal_force"):
        assert force[leaves] == pytest.approx(0, abs=1e-8)
    # before, the closed form
    grows = np.exp(math.sqrt(9.81) * t[touches])
    np.testing.assert_allclose(theta[touches], 4 * np.arctan(start * grows), atol=1e-8)
    normal = 9.81 * (3 * np.cos(theta[touches]) - 2)
    np.testing.assert_allclose(trajectory.multipliers[touches, 0], normal, atol=1e-7)
    # then a parabola, from x = √5/3 and z = 2/3 with v² = 2/3 g R
    speed = math.sqrt(9.81 * 2 / 3)
    x = math.sqrt(5) / 3 + speed * 2 / 3 * (t - left)
    z = 2 / 3 - speed * math.sqrt(5) / 3 * (t - left) - 9.81 / 2 * (t - left) ** 2
    np.testing.assert_allclose((r * np.sin(theta))[~touches], x[~touches], atol=1e-7)
    np.testing.assert_allclose((r * np.cos(theta))[~touches], z[~touches], atol=1e-7)


def test_slip_that_grows_from_rest_is_no_event_by_rounding() -> None:
    """For some 1e-9 s the speed of a slip is as small as its rounding error."""
    model = lagcli.load(
        "block_on_incline",
        set={"mu": 0.28325771231896574, "v0": 0.8084373077513198},
        set_initial={"n": 0.1398398547380813},
    )
    trajectory = lagcli.simulate(model)
    assert trajectory.status == "completed", trajectory.message
