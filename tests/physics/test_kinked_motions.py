"""Models with kinks and jumps, whose branches are frozen within a step: closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from random_cases import some

import lagcli
from lagcli.engine.integrate.run import Integration
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare
from lagcli.trajectory.trajectory import Trajectory


def particle(forces: str, start: str = "x: 1, x': 0", **parameters: float) -> str:
    """Return a model of a particle of mass 1 along x, or along x and y."""
    names = "x, y" if "y:" in start else "x"
    squares = "x'^2 + y'^2" if "y:" in start else "x'^2"
    given = ", ".join(f"{k}: {v!r}" for k, v in parameters.items())
    return (
        f"coordinates: [{names}]\nparameters: {{{given}}}\nT: ({squares})/2\n{forces}\n"
        f"initial: {{{start}}}\n"
    )


def run(text: str, times: list[float], **options: object) -> Trajectory:
    settings = SettingsOverrides(times=tuple(times), rtol=1e-10, **options)
    return lagcli.simulate(lagcli.load_text(text), settings)


def evaluations_as_it_is(text: str, **options: object) -> tuple[int, int]:
    """Return the evaluations of a run with frozen branches, and of one without."""
    simulation = prepare(lagcli.load_text(text), SettingsOverrides(**options))
    record = simulation.run(lambda samples: None)
    plain = Integration(simulation.system, simulation.request, lambda block: None, None).run()
    assert (record.status, plain.status) == ("completed", "completed")
    return record.counts["evaluations"], plain.evaluations


def test_bilinear_oscillator_has_the_period_of_both_halves() -> None:
    text = particle('V: "if(x > 0, k1, k2)*x^2/2"', "x: 0, x': 1", k1=100.0, k2=1600.0)
    period = math.pi * (1 / 10 + 1 / 40)
    found = run(text, [0, 7 * period, 7.5 * period, 20 * period])
    assert found.status == "completed"
    # 20 periods to the tolerance
    np.testing.assert_allclose(found.q[[1, 3], 0], 0, atol=3e-9)
    np.testing.assert_allclose(found.v[[1, 3], 0], 1, rtol=1e-8)
    into = 7.5 * period - 7 * period - 0  # 0.625 of the first half
    expected = math.sin(10 * into) / 10
    assert found.q[2, 0] == pytest.approx(expected, rel=1e-7)
    assert found.counts["kinks"] in (39, 40)


def test_frozen_branches_take_fewer_evaluations() -> None:
    spring = particle('V: "if(x > 0, 100, 1600)*x^2/2"', "x: 0, x': 1")
    frozen, plain = evaluations_as_it_is(spring, t_end=20.0, rtol=1e-9)
    assert plain > 1.8 * frozen
    backlash = (
        "coordinates: [a, b]\nT: (a'^2 + b'^2/2)/2\ndefinitions:\n  gap: a - b\n"
        "  torque: 4000*(max(gap - 0.01, 0) + min(gap + 0.01, 0)) "
        "+ 2*if(abs(gap) > 0.01, gap', 0)\n"
        "Q: {a: 2*cos(4*t) - torque, b: torque - 1.5*b'}\n"
        "initial: {a: 0, b: 0, a': 0, b': 0}\n"
    )
    frozen, plain = evaluations_as_it_is(backlash, t_end=5.0, rtol=1e-9)
    assert plain > 3 * frozen


def test_backlash_with_a_linear_spring() -> None:
    """A particle between two springs with play: free flight and half a period of each."""
    text = particle('V: "k/2*max(abs(x) - d, 0)^2"', "x: 0, x': 1", k=400.0, d=0.5)
    free, half = 0.5, math.pi / 20
    period = 2 * (2 * free + half)
    found = run(text, [0, free, free + half / 2, 10 * period, 10 * period + 0.2])
    # after ten periods, forty changes
    np.testing.assert_allclose(found.q[:, 0], [0, 0.5, 0.55, 0, 0.2], atol=2e-9)
    np.testing.assert_allclose(found.v[[0, 1, 3, 4], 0], 1, rtol=1e-9)


def test_coulomb_oscillator_loses_amplitude_in_each_half_cycle_and_sticks() -> None:
    """It stops at the first turning point with |x| below F/k."""
    # written so that it is no row that limits a force
    text = particle("V: k/2*x^2\nQ: {x: \"if(x' > 0, -F, if(x' < 0, F, 0))\"}", k=100.0, F=12.0)
    turn = math.pi / 10
    found = run(text, [0, turn, 2 * turn, 3 * turn, 4 * turn, 4])
    np.testing.assert_allclose(found.q[:, 0], [1, -0.76, 0.52, -0.28, 0.04, 0.04], atol=1e-9)
    assert found.v[-1, 0] == 0
    assert found.a[-1, 0] == pytest.approx(0, abs=1e-12)
    assert np.abs(found.residual_equation).max() < 1e-10
    lost = 12.0 * (1 + 2 * (0.76 + 0.52 + 0.28) + 0.04)
    assert found.energy_balance[-1] == pytest.approx(0, abs=1e-8 * lost)
    assert found.counts["kinks"] == 4


def test_dry_friction_written_with_sign_is_a_row() -> None:
    text = particle("V: k/2*x^2\nQ: {x: -F*sign(x')}", k=100.0, F=12.0)
    turn = math.pi / 10
    found = run(text, [0, turn, 2 * turn, 3 * turn, 4 * turn, 4])
    np.testing.assert_allclose(found.q[:, 0], [1, -0.76, 0.52, -0.28, 0.04, 0.04], atol=1e-9)
    assert found.multipliers[-1, 0] == pytest.approx(4.0, abs=1e-7)  # it balances the spring
    assert found.events is not None
    assert found.events.counts() == {"x.sign": {"slips": 3, "sticks": 1}}
    # what slides on two surfaces at once as forces does not stop here
    pair = particle(
        "V: 50*(x - y)^2\nQ: {x: -10*sign(x'), y: -8*sign(y')}",
        "x: 0.1, y: 0, x': 0.001, y': -0.001",
    )
    held = run(pair, [0, 1, 2])
    assert held.status == "completed"
    np.testing.assert_allclose(held.v[-1], 0, atol=1e-14)


def test_stuck_until_the_force_exceeds_friction() -> None:
    text = particle('Q: {x: "3*t - if(x\' > 0, 6, -6)"}', "x: 0, x': 0")
    found = run(text, [0, 1, 2, 3, 4])
    expected = [0.5 * max(t - 2, 0) ** 3 for t in range(5)]
    np.testing.assert_allclose(found.q[:, 0], expected, atol=1e-9)


def test_outputs_on_a_surface_are_those_of_the_force_that_acts() -> None:
    """The relay's mean force is x = x'' there, and its power x'' x'."""
    relay = "-if(x' + x > 0, 10, -10)"
    outputs = f'outputs: {{u: "{relay}", twice: "2*({relay}) + x"}}'
    text = particle(f'Q: {{x: "{relay}"}}\n{outputs}')
    found = run(text, [0, 0.05, 1, 1.5, 3])
    np.testing.assert_allclose(found.outputs["u"][:2], -10)
    np.testing.assert_allclose(found.outputs["u"][2:], found.a[2:, 0], rtol=1e-9)
    np.testing.assert_allclose(found.outputs["twice"][2:], 3 * found.q[2:, 0], rtol=1e-6)
    np.testing.assert_allclose(found.power_applied, found.a[:, 0] * found.v[:, 0], rtol=1e-9)


def test_outputs_with_the_sign_of_dry_friction_are_its_force() -> None:
    text = particle(
        "V: k/2*x^2\nQ: {x: -F*sign(x')}\n"
        "outputs: {friction: -F*sign(x'), opposite: 3*sign(-x'), power: -F*sign(x')*x'}",
        k=100.0,
        F=12.0,
    )
    turn = math.pi / 10
    found = run(text, [0, turn / 2, 1.5 * turn, 4])
    np.testing.assert_allclose(found.outputs["friction"], [12, 12, -12, 4], rtol=1e-7)
    np.testing.assert_allclose(found.outputs["friction"], found.multipliers[:, 0], rtol=1e-14)
    np.testing.assert_allclose(found.outputs["opposite"], found.multipliers[:, 0] / 4, rtol=1e-14)
    np.testing.assert_allclose(found.outputs["power"], found.power_friction, atol=1e-12)
    # no friction: its sign is that of the velocity
    none = run(text.replace("12.0", "0.0"), [0, turn / 2, 1.5 * turn])
    assert none.outputs["opposite"].tolist()[1:] == [3, -3]


def test_slides_on_a_surface_of_position_and_velocity() -> None:
    """Relay control reaches x' + x = 0, and follows it: x = x1 exp(t1 - t)."""
    text = particle('Q: {x: "-if(x\' + x > 0, 10, -10)"}')
    reached = -1 + math.sqrt(1.2)
    found = run(text, [0, 0.05, 1, 3])
    first = 1 - 5 * reached**2
    np.testing.assert_allclose(found.q[:2, 0], [1, 1 - 5 * 0.05**2], rtol=1e-12)
    expected = [first * math.exp(reached - t) for t in (1, 3)]
    np.testing.assert_allclose(found.q[2:, 0], expected, rtol=1e-8)
    np.testing.assert_allclose(found.v[2:, 0], np.negative(expected), rtol=1e-8)
    np.testing.assert_allclose(found.a[2:, 0], expected, rtol=1e-6)
    assert np.abs(found.residual_equation).max() < 1e-10


def test_slides_while_another_branch_changes() -> None:
    """Stuck to a belt, whose speed halves when the force on another particle changes."""
    forces = 'Q: {x: "-if(x\' > if(y > 1, 1, 2), 5, -5)", y: 0}'
    found = run(particle(forces, "x: 0, y: 0, x': 0, y': 1"), [0, 0.4, 0.9, 1.2, 2])
    # it accelerates by 5 up to 2 in 0.4 s, and brakes by 5 from t = 1 to 1.2
    np.testing.assert_allclose(found.v[:, 0], [0, 2, 2, 1, 1], atol=1e-9)
    np.testing.assert_allclose(found.q[:, 0], [0, 0.4, 1.4, 1.9, 2.7], atol=1e-9)


def test_jumps_of_time_are_ends_of_steps() -> None:
    found = run(particle('Q: {x: "if(t < 1, 1, -1)"}', "x: 0, x': 0"), [0, 1, 2, 3])
    np.testing.assert_allclose(found.q[:, 0], [0, 0.5, 1, 0.5], atol=1e-13)
    assert found.a[1, 0] == -1


def test_stairs() -> None:
    """A force that falls by 1 at each whole number: parabolas, by energy."""
    found = run(particle("Q: {x: 2 - floor(x)}", "x: 0, x': 0"), [0, 1, 1.8])
    speed = math.sqrt(4 + 2)  # at x = 2, beyond which there is no force
    time = 1 + (math.sqrt(6) - 2) / 1
    assert found.q[1, 0] == pytest.approx(1, abs=1e-12)
    assert found.q[2, 0] == pytest.approx(2 + speed * (1.8 - time), abs=1e-9)


def test_a_continuous_kink_at_rest_begins_on_the_side_of_the_motion() -> None:
    """Quadratic drag in a fall from rest: v = tanh t."""
    found = run(particle("Q: {x: -1 - abs(x')*x'}", "x: 0, x': 0"), [0, 1, 2])
    np.testing.assert_allclose(found.v[:, 0], -np.tanh([0, 1, 2]), rtol=1e-9)
    np.testing.assert_allclose(found.q[:, 0], -np.log(np.cosh([0, 1, 2])), atol=1e-9)


def test_a_power_beside_a_kink_is_evaluated_where_it_is_defined() -> None:
    """A Hertzian contact: no step looks at a power of a negative depth."""
    text = particle('V: 9.81*x\nQ: {x: "1e4*max(-x, 0)^1.5"}', "x: 0.1, x': 0")
    found = run(text, [0, 2])
    assert found.status == "completed"
    assert np.abs(found.energy_balance).max() < 1e-8


def test_other_methods() -> None:
    text = particle('V: "if(x > 0, 100, 1600)*x^2/2"', "x: 0, x': 1")
    period = math.pi * (1 / 10 + 1 / 40)
    for method in ("Radau", "Rodas5P", "Taylor"):
        found = run(text, [0, 3 * period], method=method)
        assert found.v[-1, 0] == pytest.approx(1, rel=1e-6)
        assert found.counts["kinks"] in (5, 6)
        assert found.options["method"] == method
    drag = particle("V: 50*x^2\nQ: {x: -0.1*abs(x')*x'}")
    explicit, series = (run(drag, [0, 5], method=method) for method in ("DOP853", "Taylor"))
    np.testing.assert_allclose(series.q[-1], explicit.q[-1], rtol=1e-8)
    assert series.counts["evaluations"] < explicit.counts["evaluations"] / 4
    # a branch that is not frozen has no power series
    hertz = particle('V: 9.81*x\nQ: {x: "1e4*max(-x, 0)^1.5"}', "x: 0.1, x': 0")
    found = run(hertz, [0, 0.5], method="Taylor")
    assert "kinks or jumps have no power series" in found.message
    assert found.options["method"] == "DOP853"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            particle(
                'V: 50*(x - y)^2\nQ: {x: "if(x\' > 0, -10, 10)", y: "if(y\' > 0, -8, 8)"}',
                "x: 0.1, y: 0, x': 0.001, y': -0.001",
            ),
            "2 surfaces (`x'`; `y'`) and push onto them from both sides: write each `sign` of",
        ),
        (
            particle('Q: {x: "if(x\' > 0, 1, -1)"}', "x: 0, x': 0"),
            "two motions are possible: the forces jump at a surface of `x'`",
        ),
        (
            particle("V: 9.81*y\nconstraints: {v: y = abs(x)}", "x: 0.1, y: 0.1, x': 0, y': 0"),
            "a constraint has a corner at t = 0.20192751",
        ),
    ],
)
def test_motions_that_do_not_continue_in_one_way(text: str, message: str) -> None:
    found = run(text, [0, 1, 2])
    assert found.status == "failed"
    assert message in found.message


def test_models_without_kinks_are_not_frozen() -> None:
    simulation = prepare(lagcli.load_text(particle("V: 50*x^2")), SettingsOverrides(t_end=1.0))
    assert not simulation.system.has_kinks
    record = simulation.run(lambda samples: None)
    assert "kinks" not in record.counts
    plain = Integration(
        simulation.system, simulation.request._replace(), lambda block: None, None
    ).run()
    assert record.counts["evaluations"] == plain.evaluations


@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Radau", "Rodas5P"])
@pytest.mark.parametrize("power", [1, 2, 3])
def test_forces_that_begin_at_rest(method: str, power: int) -> None:
    """A mass at rest until max(t - t1, 0)^n acts on it: x = (t - t1)^(n + 2)/((n + 1)(n + 2))."""
    model = lagcli.load_text(
        f"coordinates: [x]\nT: x'^2/2\nQ: {{x: 'max(t - 0.06, 0)^{power}'}}\n"
        "initial: {x: 0, x': 0}\n"
    )
    run = lagcli.simulate(model, t_end=2.0, samples=3, method=method)
    expected = 1.94 ** (power + 2) / ((power + 1) * (power + 2))
    assert run.q[-1, 0] == pytest.approx(expected, rel=1e-7)
    assert run.status == "completed"


@pytest.mark.parametrize("rtol", [1e-8, 1e-9, 1e-10, 1e-12])
def test_a_body_that_a_jump_of_its_brake_holds_stops_once(rtol: float) -> None:
    """The brake's force is given by a table, so that no row holds the body: it rests on x1' = 0."""
    model = lagcli.load_text("""
coordinates: [x1, x2]
inputs:
  F: {times: [0, 0.3, 0.7, 1.1, 1.6, 3], values: [1, 9, 8, 9, 7, 8], interpolation: linear}
T: x1'^2/2 + 0.7*x2'^2/2
V: 5*(x1 - x2)^2/2
Q: {x1: "-F*sign(x1')"}
events:
  stops: {when: "x1' = 0", record: [x1]}
initial: {x1: 0, x1': 1.3, x2: 0.1, x2': 0.3}
simulation: {t_end: 3, samples: 7}
""")
    run = lagcli.simulate(model, rtol=rtol)
    assert run.status == "completed", run.message
    assert run.events is not None
    assert len(run.events.time) == 1  # the spring never pulls with more than F
    assert np.abs(run.v[1:, 0]).max() < 1e-12


@pytest.mark.parametrize("rtol", [1e-9, 1e-11, 1e-12, 1e-13])
def test_a_controller_that_slides_converges_at_its_rate_at_any_tolerance(rtol: float) -> None:
    """On s + 0.3 s' = 0.13, s = 0.13 + c exp(-t/0.3), whatever the motion of the support is.

    Rounding errors of the surface's rate stopped runs at tight tolerances.
    """
    model = lagcli.load_text("""
coordinates: [x, z]
T: 0.4*x'^2 + 0.7*z'^2
V: 15.8*(z - x)^2
Q: {z: "-19.74*sign(z - x - 0.13 + 0.3*(z' - x'))"}
constraints: {support: x = 0.32*(1 - cos(3.022*t))}
initial: {x: {guess: 0}, x': {guess: 0}, z: 0, z': 0}
""")
    run = lagcli.simulate(model, t_end=1, rtol=rtol, times=[0, 0.1, 0.3, 0.6, 1])
    assert run.status == "completed", run.message
    s, rate = run.q[1:, 1] - run.q[1:, 0], run.v[1:, 1] - run.v[1:, 0]
    assert s + 0.3 * rate == pytest.approx(0.13, abs=1e-10)
    expected = (s[0] - 0.13) * np.exp(-(run.time[1:] - 0.1) / 0.3)
    assert s - 0.13 == pytest.approx(expected, abs=max(10 * rtol, 1e-11))


@pytest.mark.parametrize("method", some(["DOP853", "Radau", "Taylor", "Rodas5P"], 2))
@pytest.mark.parametrize("restitution", [0.0, 0.6])
@pytest.mark.parametrize(
    ("side", "force", "above"),
    [
        (1, "sign(y)", 1),
        (-1, "sign(y)", -1),
        (1, "if(y > 0, 1, -1)", 1),
        (-1, "if(y < 0, -1, 2)", -1),
        (1, "floor(5*y)", 0),
        (-1, "ceil(5*y)", 0),
        (1, "if(y' > 0, 1, -2)", 1),
    ],
)
def test_a_closed_contact_has_the_forces_of_the_side_to_which_it_opens(
    side: int, force: str, above: float, restitution: float, method: str
) -> None:
    """A force jumps where the floor, or the ceiling, is. Rounding errors of y chose it before."""
    model = lagcli.load_text(f"""
coordinates: [x, y, z]
T: 0.65*(x'^2 + y'^2) + z'^2/2
V: {side}*6.4*y + 30*(x - z)^2
Q: {{y: "-2*({force})", x: "9*sin(3.4*t)"}}
constraints:
  plane: {{expr: "{side}*y >= 0", restitution: {restitution}, friction: 0.3, slip: x'}}
initial: {{x: 0, y: {0.3 * side}, z: 0, x': 0.41, y': 0, z': 0}}
simulation: {{t_end: 2, samples: 21}}
""")
    for rtol in (1e-9, 1e-11):
        result = lagcli.simulate(model, rtol=rtol, method=method, max_steps=20000)
        assert result.status == "completed", result.message
        pressing = result.multipliers[:, 0] != 0
        assert pressing[-5:].all()
        assert result.multipliers[pressing, 0] == pytest.approx(6.4 + 2 * side * above, rel=1e-9)


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_a_body_that_comes_to_rest_in_a_notch_is_an_error(method: str) -> None:
    """Both sides push onto x = 0, which bears no force: the body crosses it without end."""
    model = lagcli.load_text(
        "coordinates: [x]\nT: 0.85*x'^2\nV: 59*x^2 + 7.6*abs(x)\n"
        "constraints: {friction: {expr: x' = 0, limit: 5.9}}\n"
        "initial: {x: 0.13, x': -0.14}\n"
    )
    result = lagcli.simulate(model, t_end=20, samples=2, method=method, max_steps=100_000)
    assert result.status == "failed"
    assert "do not end" in result.message
    assert "a branch of `x`" in result.message
