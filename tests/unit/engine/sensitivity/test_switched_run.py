"""Runs with derivatives through actions, impacts and kinks: closed forms, differences of runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.arrays import Array
from lagcli.engine.contract import Block, IntegrationRequest
from lagcli.engine.core import run as core_run
from lagcli.engine.lowering.lower import lower
from lagcli.engine.sensitivity import switched_run
from lagcli.engine.sensitivity.integration import Derivatives
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.sensitivity.switched_run import Loss, SwitchedProblem, arranged, why_lost
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.system import State
from lagcli.engine.tape.differentiation import directional
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.settings.settings import SettingsOverrides, resolve
from tests.support.switching_models import BALL, BLOCK

MODEL = """
coordinates: [x]
parameters: {k: 9, e: 0.5, c: 0.3}
T: x'^2/2
V: k*x^2/2
Q: {x: -c*x'}
constraints: {wall: {expr: x >= -0.5, restitution: e}}
initial: {x: 1, x': 0}
"""
PENDULUM = """
coordinates: [x, y]
parameters: {{g: 10, l: 1, k: 0.7, t1: 0.4}}
T: (x'^2 + y'^2)/2
V: g*y
constraints: {{rod: x^2 + y^2 = l^2}}
events:
  change: {{when: t >= t1, {action}}}
initial: {{x: l, y: 0, x': 0, y': {{guess: 0}}}}
"""
TWO = """
coordinates: [a, b]
parameters: {J: 2, w: 3, t1: 0.5, c: 0.2}
T: J*a'^2/2 + b'^2/2
V: 0
Q: {a: -c*a'}
constraints: {clutch: {expr: a' = b', active: false}}
events: {close: {when: a >= t1, engage: clutch}}
initial: {a: 0, b: 0, a': w, b': 0}
"""
HEADER = """
coordinates: [x, y]
parameters: {m: 2, F: 6, s: 0.5, mu: 0.4, g: 10}
T: m*(x'^2 + y'^2)/2
V: m*g*y
"""


def checked(text: str, names: tuple[str, ...], allowed: float = 1e-7) -> None:
    model = lagcli.load_text(text)
    options = {"t_end": 0.9, "samples": 4, "rtol": 1e-11}
    found = lagcli.simulate(model, sensitivity=names, **options)  # type: ignore[arg-type]
    assert not any("derivatives" in warning for warning in found.warnings)
    for k, name in enumerate(names):
        value, expected = model.parameter_values[name], [0.0, 0.0]
        h = 1e-3 * value
        for step, weight in {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}.items():
            for side in (1, -1):
                other = lagcli.load_text(text, set={name: f"{value + side * step * h!r}"})
                run = lagcli.simulate(other, **options)  # type: ignore[arg-type]
                expected[0] += side * weight / h * run.q
                expected[1] += side * weight / h * run.v
        for x, y in zip((found.dq, found.dv), expected, strict=True):
            assert x is not None
            np.testing.assert_allclose(
                x[:, :, k], y, atol=allowed * np.abs(y).max(initial=1e-3), err_msg=name
            )


@pytest.mark.parametrize(
    "action",
    [
        "impulse: {x: k*x, y: t}",
        "set: {x': -k*x', y': -k*y'}",
        "set: {x': -k*x'}",
        "set: {g: 3*k*g}",
        "set: {x: k, g: 3*k*g}",
        "release: rod",
    ],
)
def test_actions_on_a_constraint(action: str) -> None:
    checked(PENDULUM.format(action=action), ("k", "t1", "l"))


def test_engagement_takes_velocities_together() -> None:
    checked(TWO, ("J", "w", "t1", "c"))


def test_impacts_in_sequence_and_at_once() -> None:
    text = """
coordinates: [x, y]
parameters: {m: 2, e: 0.6, u: 1.5, d: 0.5}
T: m*x'^2/2 + y'^2/2
V: 0
constraints:
  hit: {expr: y - x >= 0, restitution: e}
  wall: {expr: y <= d, restitution: e}
initial: {x: 0, y: 0.2, x': u, y': 0}
"""
    checked(text, ("m", "e", "u", "d"))
    # the second body rests at the wall: both contacts take part
    checked(text.replace("y: 0.2", "y: d"), ("e", "u"))


def test_samples_of_several_blocks_have_their_own_derivatives() -> None:
    model = lagcli.load_text(MODEL)
    many = lagcli.simulate(model, t_end=1, samples=5001, sensitivity=("k",))
    few = lagcli.simulate(model, t_end=1, samples=11, sensitivity=("k",))
    assert many.dq is not None
    assert few.dq is not None
    np.testing.assert_allclose(many.dq[::500], few.dq, atol=1e-9)


def test_sample_at_an_instant_is_that_of_afterwards() -> None:
    model = lagcli.load_text(MODEL.replace("Q: {x: -c*x'}", "Q: {x: 'if(t < c, 0, 20)'}"))
    found = lagcli.simulate(model, times=[0, 0.3, 0.35], sensitivity=("c",))
    assert found.dv is not None
    # the later the force begins, the slower: −20
    assert found.dv[0, 0, 0] == 0.0
    assert found.dv[1, 0, 0] == pytest.approx(-20.0)


def test_motion_that_slides_on_a_surface() -> None:
    model = lagcli.load_text("""
coordinates: [x]
parameters: {F: 4, c: 1}
T: x'^2/2
V: 0
Q: {x: "-F*(2*step(x' + c*x) - 1)"}
initial: {x: 1, x': 1}
""")
    found = lagcli.simulate(model, t_end=3, samples=8, sensitivity=("F",), rtol=1e-11)
    assert found.warnings == ()
    assert found.dq is not None
    assert found.dv is not None
    # x = 1 + t − F t²/2 reaches x' + x = 0 at t = 1/2, and goes on as x = exp(1/2 − t)
    t = found.time[2:]
    np.testing.assert_allclose(found.q[2:, 0], np.exp(0.5 - t), rtol=1e-10)
    np.testing.assert_allclose(found.dq[2:, 0, 0], -np.exp(0.5 - t) / 8, rtol=1e-9)
    np.testing.assert_allclose(found.dv[2:, 0, 0], np.exp(0.5 - t) / 8, rtol=1e-9)


def test_motion_that_leaves_a_surface() -> None:
    # x' = 0 as long as |w t| < F; the force of the other side is w t − F afterwards
    model = lagcli.load_text("""
coordinates: [x, y]
parameters: {F: 2, w: 3}
T: (x'^2 + y'^2)/2
V: 0
Q: {x: "w*t - F*(2*step(x' + y) - 1)"}
initial: {x: 0, y: 0, x': -1, y': 0}
""")
    found = lagcli.simulate(model, t_end=2, samples=2, sensitivity=("F", "w"), rtol=1e-12)
    assert found.warnings == ()
    # −1 + F t + w t²/2 = 0 at t*, then rest up to F/w, then w s³/6 with s = t − F/w
    F, w = 2.0, 3.0
    stop = (-F + np.sqrt(F**2 + 2 * w)) / w
    s = 2 - F / w
    assert found.dq is not None
    by_F = stop**2 / 2 - s**2 / 2
    by_w = stop**3 / 6 + s**3 / 6 + F / w * s**2 / 2
    np.testing.assert_allclose(found.dq[-1, 0], [by_F, by_w], rtol=1e-8)


@pytest.mark.parametrize(
    ("rest", "time", "slopes"),
    [
        # x = F t²/(2 m) reaches s
        (
            "Q: {x: F}\nevents: {e: {when: x >= s, record: x}}\n"
            "initial: {x: 0, y: 0, x': 0, y': 0}",
            (2 * 2 * 0.5 / 6) ** 0.5,
            {"F": -0.5 / 6, "s": 0.5 / 0.5, "m": 0.5 / 2},
        ),
        # a = F t/m reaches s
        (
            "Q: {x: F*t}\nevents: {e: {when: \"x'' >= s\", stop: true}}\n"
            "initial: {x: 0, y: 0, x': 0, y': 0}",
            0.5 * 2 / 6,
            {"F": -1 / 6, "s": 1 / 0.5, "m": 1 / 2},
        ),
        # the floor bears m g − F t
        (
            "Q: {y: F*t}\nconstraints: {floor: y >= 0}\ninitial: {x: 0, y: 0, x': 0, y': 0}",
            2 * 10 / 6,
            {"F": -1 / 6, "g": 1 / 10, "m": 1 / 2},
        ),
        # sticks until F t = μ m g
        (
            "Q: {x: F*t}\nconstraints: {floor: {expr: y >= 0, friction: mu, slip: x'}}\n"
            "initial: {x: 0, y: 0, x': 0, y': 0}",
            0.4 * 2 * 10 / 6,
            {"F": -1 / 6, "g": 1 / 10, "m": 1 / 2, "mu": 1 / 0.4},
        ),
    ],
)
def test_times_in_closed_form(rest: str, time: float, slopes: dict[str, float]) -> None:
    found = lagcli.simulate(
        lagcli.load_text(HEADER + rest), t_end=4, samples=3, sensitivity=tuple(slopes)
    )
    assert found.events is not None
    assert found.events.time[0] == pytest.approx(time, rel=1e-9)
    expected = [time * x for x in slopes.values()]
    np.testing.assert_allclose(found.events.dtime[0], expected, rtol=1e-7)


def test_two_functions_that_always_vanish_together_are_no_conflict() -> None:
    found = lagcli.simulate(
        lagcli.load_text(
            HEADER + "constraints: {floor: {expr: y >= 0, restitution: 0.5}}\n"
            "events: {hit: {when: y <= 0, set: {x': 2*x'}}}\n"
            "initial: {x: 0, y: 1, x': 1, y': 0}"
        ),
        t_end=0.6,
        samples=2,
        sensitivity=("y", "g"),
    )
    assert found.warnings == ()
    assert found.events is not None
    fall = (2 / 10) ** 0.5
    np.testing.assert_allclose(found.events.dtime, [[fall / 2, -fall / 20]] * 2, rtol=1e-8)


def test_forces_that_are_shared_have_no_time() -> None:
    text = """
coordinates: [x, y, phi]
parameters: {m: 2, g: 10, F: 8, mu: 0.3, a: 0.2}
T: m*(x'^2 + y'^2)/2 + phi'^2/2
V: m*g*y
Q: {x: F*t}
constraints:
  left: {expr: y - a*phi >= 0, friction: {static: 1.3*mu, kinetic: mu}, slip: x'}
  right: {expr: y + a*phi >= 0, friction: {static: 1.3*mu, kinetic: mu}, slip: x'}
initial: {x: 0, y: 0, phi: 0, x': 0, y': 0, phi': 0}
"""
    found = lagcli.simulate(lagcli.load_text(text), t_end=1.2, samples=5, sensitivity=("F", "a"))
    (note,) = found.warnings
    # 1.3 μ m g = F t
    assert "derivatives by `F`, `a` end at t = 0.975" in note
    assert "`left.slip` shares its force with others" in note
    assert found.dmultipliers is not None
    # each bears half of m g; which corner bears the friction is open
    np.testing.assert_allclose(found.dmultipliers[2, [0, 2]], 0.0, atol=1e-12)
    assert np.isnan(found.dmultipliers[2, [1, 3], 0]).all()


def test_dop853_takes_the_steps_whatever_the_method() -> None:
    model = lagcli.load_text(MODEL)
    names = ("k", "e", "c")
    exact = lagcli.simulate(model, t_end=1, samples=5, sensitivity=names, rtol=1e-12)
    for method in ("Radau", "Taylor", "auto"):
        found = lagcli.simulate(
            model, t_end=1, samples=5, sensitivity=names, method=method, rtol=1e-8
        )
        assert found.options["method"] == switched_run.METHOD == "DOP853"
        scale = np.abs(exact.dq).max()
        np.testing.assert_allclose(found.dq, exact.dq, atol=1e-6 * scale)


def test_derivatives_are_zero_where_nothing_depends_on_a_parameter() -> None:
    text = MODEL.replace("c: 0.3", "c: 0.3, unused: 2")
    found = lagcli.simulate(lagcli.load_text(text), t_end=1, sensitivity=("unused",))
    assert found.events is not None
    assert (found.dq == 0).all()
    assert (found.events.dtime == 0).all()


def test_the_parameters_are_the_last_inputs() -> None:
    system = lower(lagcli.derive(lagcli.load_text(BALL)))
    tape, state = system.dynamics, 1 + 2 * len(system.coordinates)
    rng = np.random.default_rng(3)
    x, p = rng.uniform(1, 2, state), rng.uniform(1, 2, tape.inputs - state)
    dx, dp = rng.normal(size=len(x)), rng.normal(size=len(p))
    slopes = ScalarTape(arranged(directional(tape), state))((*x, *dx, *dp, *p))
    run, h = ScalarTape(tape), 1e-6
    above, below = (np.array(run((*(x + side * h * dx), *(p + side * h * dp)))) for side in (1, -1))
    np.testing.assert_allclose(slopes, (above - below) / (2 * h), atol=1e-7)


def test_conditions_of_events_without_actions_do_not_decide() -> None:
    text = BALL.replace("stop: true", "record: x") + "simulation: {t_end: 2}\n"
    for model, decides in ((BALL, True), (text, False)):
        split = SplitSystem(lower(lagcli.derive(lagcli.load_text(model))))
        parameters = np.zeros((1, len(split.system.parameters)))
        found = switched_run.directional_programs(split, None, parameters)
        assert found.decides == (decides,)


#: Kinds of watched functions: the gap of a contact, the force of a row, a condition.
GAP, STICK, TIME = 0, 2, 9


@pytest.mark.parametrize(
    ("reason", "culprits", "words"),
    [
        (Loss.GRAZES, [(GAP, 0)], "`floor` is only touched, without a rate"),
        (Loss.SHARES, [(STICK, 1)], "`floor.slip` shares its force with others"),
        (Loss.COINCIDE, [(GAP, 0), (TIME, 0)], "`floor` and `tick` occur simultaneously"),
        (Loss.CLOSE_TOGETHER, [(GAP, 0)], "contacts close simultaneously there, `floor` among"),
        (Loss.RESTS, [(GAP, 0)], "infinitely many impacts of `floor` end there"),
        (Loss.ONLY_HERE, [(GAP, 0)], "`floor` holds there only for this value"),
        (Loss.WITHIN_TOLERANCE, [(GAP, 0)], "`floor` holds from there on within a tolerance"),
        (Loss.UNKNOWN, [], "they have no finite value"),
    ],
)
def test_each_reason_names_its_culprits(
    reason: Loss, culprits: list[tuple[int, int]], words: str
) -> None:
    split = SplitSystem(lower(lagcli.derive(lagcli.load_text(BLOCK))))
    assert why_lost(split, None, reason, culprits).startswith(words)


STOPPING_BALL = """
coordinates: [y]
parameters: {g: 10}
T: y'^2/2
V: g*y
constraints: {floor: {expr: y >= 0, restitution: 0.5}}
initial: {y: 1, y': 0}
"""


def test_one_problem_has_many_runs() -> None:
    model = lagcli.load_text(STOPPING_BALL)
    system = lower(lagcli.derive(model))
    settings = resolve(SettingsOverrides(t_end=0.7, method="Taylor"), model.settings)
    problem = SwitchedProblem(system, ("g",), np.array([10.0]))
    blocks: list[tuple[Block, Derivatives]] = []
    for g in (10.0, 5.0):
        times = np.array([0.0, 0.2, 0.7])
        request = IntegrationRequest(
            State(0.0, np.ones(1), np.zeros(1), (g,)),
            0,
            settings,
            times,
            0.0,
        )
        blocks.clear()
        nothing = StartDerivatives(np.zeros((1, 1)), np.zeros((1, 1)))
        run = problem.integrate(request, nothing, np.array([[10.0]]), lambda *x: blocks.append(x))
        assert run.status == "completed"
        assert run.methods == ("DOP853",)
        ((block, found),) = blocks
        np.testing.assert_allclose(found.q[1], -(0.2**2) / 2, rtol=1e-8)
        if run.events:
            fall = (2 / g) ** 0.5
            # with respect to g / 10, over 10
            np.testing.assert_allclose(run.events[0].dtime, -fall / (2 * g), rtol=1e-8)
        assert len(block.time) == 3


def test_a_path_near_a_singular_configuration_has_room_for_the_derivatives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """States inside steps, which the core writes with their derivatives, ended beyond the array."""
    made: list[tuple[int, Array]] = []

    class Guarded:
        """NumPy, with arrays that are followed by known numbers."""

        def __getattr__(self, name: str) -> Any:
            return getattr(np, name)

        def empty(self, shape: int | tuple[int, ...]) -> Array:
            count = int(np.prod(shape))
            whole = np.full(count + 64, 7.0)
            made.append((count, whole))
            return whole[:count].reshape(shape)

    monkeypatch.setattr(core_run, "np", Guarded())
    run = lagcli.simulate(
        lagcli.load_text("""
coordinates: [phi, psi]
parameters: {r: 1, l: 1.0001, J: 1}
T: J*phi'^2/2 + psi'^2/20
constraints: {guide: r*sin(phi) = l*sin(psi)}
events: {turn: {when: phi > 1, record: true}}
initial: {phi: 0.5, phi': 1, psi: {guess: 0.5}, psi': {guess: 1}}
"""),
        sensitivity=("J", "l"),
        t_end=1.5,
        samples=4,
    )
    assert run.status == "completed"
    assert len(made) > 1  # the samples, and states inside steps
    for count, whole in made:
        assert (whole[count:] == 7.0).all()
