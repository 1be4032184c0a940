"""Equilibria, branches and linear models with contacts, limits and friction, by closed forms."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.analysis.equilibria.diagram import follow_equilibria
from lagcli.analysis.equilibria.equilibrium import Equilibrium
from lagcli.analysis.linear.mode_motion import mode_motion
from lagcli.arrays import Array
from lagcli.errors import NumericalError, UsageError

CONTACT = Path(__file__).parents[2] / "models" / "contact"

#: A ladder on a rough floor against a smooth wall.
LADDER = """
name: ladder
coordinates: [x, y, th]
parameters: {m: 10, l: 4, g: 9.81, mu: 0.4, th0: 1.1}
definitions: {x_A: x - l/2*cos(th), y_A: y - l/2*sin(th), x_B: x + l/2*cos(th)}
T: m/2*(x'^2 + y'^2) + m*l^2/24*th'^2
V: m*g*y
constraints:
  floor: {expr: y_A >= 0, friction: mu, slip: x_A'}
  wall: {expr: x_B <= 0}
initial: {th: th0, x: -l/2*cos(th0), y: l/2*sin(th0), x': 0, y': 0, th': 0}
"""

#: A pendulum that a torque M turns against a stop at the angle b.
STOPPED = """
name: stopped
coordinates: [a]
parameters: {m: 2, g: 9.81, l: 0.7, M: 5, b: 0.35}
T: m/2*l^2*a'^2
V: -m*g*l*cos(a)
Q: {a: M}
constraints: {stop: {expr: a <= b, restitution: 0.3}}
initial: {a: 0.1, a': 0}
"""

#: Two masses, one above the other, with a spring; the lower one on the floor.
STACK = """
name: stack
coordinates: [x, y]
parameters: {m1: 2, m2: 3, g: 9.81, k: 100, c: 0}
T: m1/2*x'^2 + m2/2*y'^2
V: m1*g*x + m2*g*y + k/2*(y - x - 1)^2
D: c/2*(y' - x')^2
constraints: {floor: {expr: x >= 0, restitution: 0.3}, ceiling: {expr: y <= 2}}
initial: {x: 0, y: 0.9, x': 0, y': 0}
simulation: {t_end: 2}
"""

#: A block on a belt; the spring also presses it onto the belt as it moves: V has k_xy x y.
PRESSED = """
name: pressed
coordinates: [x, y]
parameters: {m: 2, g: 9.81, k: 80, kxy: 60, mu: 0.3, v_b: 0.5, x0: 0, c: 0}
T: m/2*(x'^2 + y'^2)
V: m*g*y + k/2*x^2 + kxy*x*y
Q: {x: -c*x'}
constraints: {belt: {expr: y >= 0, friction: mu, slip: x' - v_b}}
initial: {x: x0, y: 0, x': 0, y': 0}
"""


def only(model: lagcli.Model, **options: Any) -> Equilibrium:
    (found,) = lagcli.equilibrium(model, **options).equilibria
    return found


def states(found: Equilibrium) -> dict[str, str]:
    return {contact.name: contact.state for contact in found.operating_point.contacts}


def multipliers(found: Equilibrium) -> dict[str, float]:
    return {contact.name: contact.multiplier for contact in found.operating_point.contacts}


# equilibria


def test_a_ball_comes_down_to_the_floor() -> None:
    found = only(lagcli.load(CONTACT / "bouncing_ball.yaml"))
    assert found.operating_point.point.q == pytest.approx([0.0], abs=1e-14)
    assert multipliers(found) == pytest.approx({"floor": 2 * 9.81})
    assert found.stability.verdict == "stable"


def test_a_ladder_has_the_forces_of_statics() -> None:
    found, weight, angle = only(lagcli.load_text(LADDER)), 10 * 9.81, 1.1
    wall = weight / 2 / math.tan(angle)
    assert multipliers(found) == pytest.approx(
        {"floor": weight, "floor.slip": wall, "wall": -wall}, rel=1e-12
    )
    assert states(found) == {"floor": "closed", "floor.slip": "sticks", "wall": "closed"}
    # it may lean at other angles too, and cannot move while it sticks
    assert (found.dimension, found.stability.verdict) == (1, "stable")
    assert not len(found.stability.eigenvalues)


def test_a_ladder_beyond_its_friction_is_found_where_friction_just_suffices() -> None:
    model = lagcli.load_text(LADDER, set={"mu": 0.2})
    found = only(model)
    assert math.tan(found.operating_point.point.q[2]) == pytest.approx(1 / (2 * 0.2), rel=1e-12)
    assert states(found)["floor.slip"] == "at its limit"
    assert found.stability.verdict == "undecided"
    for analysis in (lagcli.linearize, lagcli.modes):
        with pytest.raises(NumericalError, match=r"`floor.slip` is at its limit"):
            analysis(model, equilibrium=True)
    with pytest.raises(NumericalError, match=r"no branch from mu = 0.2 on: `floor.slip`"):
        follow_equilibria(model, "mu", 0.2, 0.1)


#: A block on a spring in two guides, with friction by the length of both forces.
GUIDED = """
name: guided
coordinates: [x, y, z]
parameters: {u: 3, w: 4, F: 1.6, mu: 0.3, k: 1}
T: (x'^2 + y'^2 + z'^2)/2
Q: {x: F - k*x, y: -u, z: -w}
constraints:
  first: y = 0
  second: z = 0
  rub: {expr: x' = 0, limit: mu*sqrt(lambda.first^2 + lambda.second^2)}
initial: {x: 0, y: 0, z: 0, x': 0, y': 0, z': 0}
"""


@pytest.mark.parametrize(("force", "x"), [(1.4, 0.0), (1.6, 0.1), (-5.0, -3.5)])
def test_a_limit_by_two_forces_that_is_not_smooth_without_them(force: float, x: float) -> None:
    """It holds up to 0.3 * 5 = 1.5; the search starts from multipliers of 0."""
    found = only(lagcli.load_text(GUIDED, set={"F": force}))
    assert found.operating_point.point.q == pytest.approx([x, 0.0, 0.0], abs=1e-12)
    friction = min(max(-force, -1.5), 1.5)
    assert multipliers(found) == pytest.approx({"rub": friction}, rel=1e-12)
    assert states(found)["rub"] == ("at its limit" if x else "sticks")


def test_a_limit_that_is_not_smooth_at_the_equilibrium_is_an_error() -> None:
    with pytest.raises(NumericalError, match="not smooth there"):
        lagcli.equilibrium(lagcli.load_text(GUIDED, set={"u": 0, "w": 0}))


def test_a_spring_presses_a_block_against_a_stop() -> None:
    model = lagcli.load_text(
        """
coordinates: [x, y]
parameters: {m: 2, g: 9.81, k: 100, L: 0.5, d: 0.3}
T: m/2*(x'^2 + y'^2)
V: m*g*y + k/2*(x - L)^2
constraints: {floor: y >= 0, stop: x <= d}
initial: {x: 0, y: 0.1, x': 0, y': 0}
"""
    )
    for options in ({}, {"all": True, "starts": 4}):
        found = only(model, **options)
        assert found.operating_point.point.q == pytest.approx([0.3, 0.0], abs=1e-12)
        assert multipliers(found) == pytest.approx({"floor": 2 * 9.81, "stop": -100 * 0.2})


@pytest.mark.parametrize("start", ["0.1", "b"])
def test_a_pendulum_rests_at_a_stop_if_it_is_pressed_against_it(start: str) -> None:
    text = STOPPED.replace("{a: 0.1,", f"{{a: {start},")
    pressed = only(lagcli.load_text(text))
    assert multipliers(pressed) == pytest.approx({"stop": 2 * 9.81 * 0.7 * math.sin(0.35) - 5})
    free = only(lagcli.load_text(text, set={"M": 1}))  # from "b": the stop would pull
    assert states(free) == {"stop": "open"}
    angle = math.asin(1 / (2 * 9.81 * 0.7))
    assert free.operating_point.point.q == pytest.approx([angle], rel=1e-12)
    assert free.stability.stiffness == pytest.approx([9.81 / 0.7 * math.cos(angle)])


def test_all_equilibria_of_a_block_that_may_rock_are_found() -> None:
    model = lagcli.load(CONTACT / "rocking_block.yaml")
    found = lagcli.equilibrium(model, all=True, starts=8).equilibria
    angles = sorted(abs(float(x.operating_point.point.q[2])) for x in found)
    tipped = math.atan(0.1 / 0.3)  # half the width by half the height
    assert angles == pytest.approx([0.0, tipped, tipped, math.pi], abs=1e-9)
    verdicts = {round(abs(float(x.operating_point.point.q[2])), 2): x for x in found}
    assert verdicts[0.0].stability.verdict == "stable"
    assert verdicts[round(tipped, 2)].stability.verdict == "unstable"
    both = [x for x in verdicts[0.0].operating_point.contacts if x.name in ("left", "right")]
    assert [x.multiplier for x in both] == pytest.approx([9.81 / 2] * 2)


def test_redundant_contacts_share_their_load_within_the_laws() -> None:
    # of least norm, the load (a, b) = (0.9, 0.9) beyond the middle would pull at the leg at (0, 0)
    model = lagcli.load_text(
        """
coordinates: [z, u, w]
T: (z'^2 + u'^2 + w'^2)/2
V: 10*(z + 0.9*u + 0.9*w)
constraints: {A: z >= 0, B: z + u >= 0, C: z + w >= 0, D: z + u + w >= 0}
initial: {z: 0, u: 0, w: 0, z': 0, u': 0, w': 0}
"""
    )
    loads = multipliers(only(model))
    assert min(loads.values()) >= -1e-12
    assert sum(loads.values()) == pytest.approx(10)
    assert loads["B"] + loads["D"] == pytest.approx(9)
    assert loads["C"] + loads["D"] == pytest.approx(9)


def least_loads(places: list[float], load: float, at: float) -> Array:
    """Return the forces of least norm of supports that push, by trial of those that do."""
    best = np.full(len(places), np.inf)
    for pushes in itertools.product([0.0, 1.0], repeat=len(places)):
        rows = np.array([np.ones(len(places)), places]) * pushes
        force = np.linalg.lstsq(rows, load * np.array([1.0, at]), rcond=None)[0]
        carries = rows @ force == pytest.approx([load, at * load], abs=1e-9)
        if carries and force.min() > -1e-12 and force @ force < best @ best - 1e-12:
            best = force
    return best


def test_a_contact_that_only_touches_does_not_change_how_others_share_their_load() -> None:
    """A beam with its load at `at` on five supports, beside a wall that no force presses."""
    rng = np.random.default_rng(6)
    for at in [0.7, 0.8, 0.9] * 10:
        places = [-1.0, 1.0, *rng.uniform(-1, 1, 3).tolist()]
        a, b, c = rng.uniform(-1, 1, 3).tolist()
        supports = ", ".join(f"s{i}: y + {x!r}*phi >= 0" for i, x in enumerate(places))
        found = only(
            lagcli.load_text(f"""
coordinates: [x, y, phi]
T: (x'^2 + y'^2 + phi'^2/3)/2
V: 9*y + {9 * at!r}*phi + x^2/2
constraints: {{{supports}, wall: {a!r}*x + {b!r}*y + {c!r}*phi >= 0}}
initial: {{x: 0, y: 0, phi: 0, x': 0, y': 0, phi': 0}}
""")
        )
        forces = list(multipliers(found).values())
        assert forces == pytest.approx([*least_loads(places, 9, at), 0], abs=1e-8)


def test_without_an_equilibrium_the_forces_that_remain_are_named() -> None:
    model = lagcli.load_text(
        """
coordinates: [x]
T: x'^2/2
V: -x - x^2/2
constraints: {floor: x >= 0}
initial: {x: 0.2, x': 0}
"""
    )
    with pytest.raises(NumericalError, match=r"no equilibrium of .* was found.*forces on x"):
        lagcli.equilibrium(model)


def test_more_contacts_than_can_be_tried_are_rejected() -> None:
    contacts = ", ".join(f"c{i}: x >= -{i}" for i in range(1, 10))
    model = lagcli.load_text(
        f"coordinates: [x]\nT: x'^2/2\nV: x\nconstraints: {{{contacts}}}\ninitial: {{x: 0, x': 0}}"
    )
    with pytest.raises(UsageError, match=r"at most 8 contacts; .* has 9"):
        lagcli.equilibrium(model, all=True)
    assert only(model).operating_point.point.q == pytest.approx([-1.0])


def test_a_body_on_a_belt_slides_at_its_equilibrium() -> None:
    model = lagcli.load_text(PRESSED)
    found = only(model)
    assert states(found) == {"belt": "closed", "belt.slip": "slips"}
    # k x = mu (m g + kxy x)
    assert found.operating_point.point.q[0] == pytest.approx(0.3 * 2 * 9.81 / (80 - 0.3 * 60))
    slower = only(lagcli.load_text(PRESSED, set={"v_b": -0.5}))
    assert slower.operating_point.point.q[0] == pytest.approx(-0.3 * 2 * 9.81 / (80 + 0.3 * 60))


# branches


@pytest.mark.parametrize(("start", "end", "kind"), [(6, 2, "opens"), (0, 10, "closes")])
def test_a_branch_ends_where_its_contact_changes(start: float, end: float, kind: str) -> None:
    found = follow_equilibria(lagcli.load_text(STOPPED), "M", start, end)
    (point,) = found.special
    assert (point.kind, point.contact) == (f"contact {kind}", "stop")
    assert point.parameter == pytest.approx(2 * 9.81 * 0.7 * math.sin(0.35), rel=1e-9)
    assert found.branches[0].parameter[-1] == point.parameter
    assert [x.state for x in found.contacts] == ["closed" if kind == "opens" else "open"]


def test_a_branch_ends_where_friction_is_exhausted_and_where_sliding_stops() -> None:
    found = follow_equilibria(lagcli.load_text(LADDER), "mu", 0.4, 0.1)
    (point,) = found.special
    assert (point.kind, point.contact) == ("limit reached", "floor.slip")
    assert point.parameter == pytest.approx(1 / (2 * math.tan(1.1)), rel=1e-9)
    sliding = follow_equilibria(lagcli.load_text(PRESSED), "v_b", 0.5, -0.5)
    assert [(x.kind, x.contact) for x in sliding.special] == [("sliding stops", "belt.slip")]
    assert sliding.special[0].parameter == pytest.approx(0.0, abs=1e-9)


# linear models


@pytest.mark.parametrize(
    "where", [{"equilibrium": True}, {"at": 0.5}, {}], ids=["equilibrium", "at", "start"]
)
def test_the_frequency_is_that_of_what_a_closed_contact_leaves_free(where: dict[str, Any]) -> None:
    found = lagcli.modes(lagcli.load_text(STACK), **where)
    (mode,) = found.modes
    assert mode.natural_frequency == pytest.approx(math.sqrt(100 / 3), rel=1e-9)
    assert mode.position == pytest.approx([0, 1])
    assert mode.multipliers == pytest.approx([-100])  # of the floor, which carries the spring


def test_an_open_contact_leaves_both_masses_free() -> None:
    # thrown up: relative motion with the reduced mass, and the free fall of both
    model = lagcli.load_text(STACK, set_initial={"x'": 6, "y'": 6})
    found = lagcli.modes(model, at=0.1)
    assert [x.state for x in found.operating_point.contacts] == ["open", "open"]
    reduced = 2 * 3 / (2 + 3)
    assert found.modes[-1].natural_frequency == pytest.approx(math.sqrt(100 / reduced), rel=1e-9)


def test_sliding_friction_takes_part_with_its_normal_force() -> None:
    # m x'' = -k x + mu (m g + kxy x)
    model = lagcli.load_text(PRESSED)
    for where in ({"equilibrium": True}, {"at": 0.01}):
        found = lagcli.modes(model, **where)
        expected = math.sqrt((80 - 0.3 * 60) / 2)
        assert found.modes[0].natural_frequency == pytest.approx(expected, rel=1e-9)
    linear = lagcli.linearize(
        model, equilibrium=True, inputs=("Q.x", "mu"), outputs=("lambda.belt", "lambda.belt.slip")
    )
    np.testing.assert_allclose(linear.C[:, 0], [60, 0.3 * 60], rtol=1e-12)
    x = 0.3 * 2 * 9.81 / (80 - 0.3 * 60)
    np.testing.assert_allclose(linear.B[1], [1 / 2, (2 * 9.81 + 60 * x) / 2], rtol=1e-12)
    descriptor = lagcli.linearize(model, equilibrium=True, form="descriptor")
    from scipy.linalg import eigvals

    values = eigvals(descriptor.A, descriptor.E)
    finite = values[np.isfinite(values) & (np.abs(values) < 1e6)]
    assert np.abs(finite.imag).max() == pytest.approx(math.sqrt((80 - 0.3 * 60) / 2), rel=1e-8)


def test_small_simulated_motions_are_those_of_the_linear_model() -> None:
    """Beside the sliding equilibrium: friction follows the normal force."""
    at = 0.3 * 2 * 9.81 / (80 - 0.3 * 60)
    small = 1e-4
    model = lagcli.load_text(PRESSED, set={"x0": at + small, "c": 3})
    linear = lagcli.linearize(model, equilibrium=True)
    from scipy.linalg import expm

    times = np.linspace(0, 1, 21)
    run = lagcli.simulate(model, t_end=1, samples=21)
    assert run.events is not None
    assert not set(run.events.kinds) & {"sticks", "opens"}
    expected = [(expm(linear.A * t) @ [small, 0])[0] for t in times]
    # the law of friction and the spring are linear: only the tolerance of the run remains
    np.testing.assert_allclose(run.q[:, 0] - at, expected, atol=1e-6 * small + 1e-9)


def test_a_taut_rope_is_a_pendulum_to_the_linear_model_and_to_a_run() -> None:
    model = lagcli.load(CONTACT / "rope_pendulum.yaml")
    (mode,) = lagcli.modes(model, equilibrium=True).modes
    length = -only(model).operating_point.point.q[1]
    assert mode.natural_frequency == pytest.approx(math.sqrt(9.81 / length), rel=1e-12)
    small = 1e-4
    start = {"x": small, "y": -math.sqrt(length**2 - small**2), "x'": 0, "y'": 0}
    run = lagcli.simulate(lagcli.load(model.path, set_initial=start), t_end=2, samples=41)
    expected = small * np.cos(mode.natural_frequency * run.time)
    np.testing.assert_allclose(run.q[:, 0], expected, atol=2e-6 * small)


def test_a_row_that_sticks_is_a_velocity_constraint() -> None:
    # the belt carries the block: 0 degrees of freedom, and a force that grows with k
    model = lagcli.load(CONTACT / "stick_slip_belt.yaml")
    found = lagcli.linearize(model, at=1.0, outputs=("lambda.belt",))
    assert [x.state for x in found.operating_point.contacts] == ["sticks"]
    assert found.states == ("x",)
    np.testing.assert_array_equal(found.A, [[0.0]])
    np.testing.assert_allclose(found.C, [[100.0]])  # k of the model


def test_parameters_that_events_have_set_are_those_of_the_linear_model() -> None:
    model = lagcli.load_text(
        """
coordinates: [x]
parameters: {m: 1, k: 4}
T: m/2*x'^2
V: k/2*x^2
events: {stiffer: {when: t >= 1, set: {k: 9}}}
initial: {x: 1, x': 0}
"""
    )
    frequencies = [lagcli.modes(model, at=t).modes[0].natural_frequency for t in (0.5, 1.5)]
    assert frequencies == pytest.approx([2.0, 3.0])


def test_forces_that_depend_on_multipliers_have_linear_models() -> None:
    # k x + 0.2 (m g + kxy x) = m (-x'')
    model = lagcli.load_text(
        """
coordinates: [x, y]
parameters: {m: 2, g: 9.81, k: 80, kxy: 60}
T: m/2*(x'^2 + y'^2)
V: m*g*y + k/2*x^2 + kxy*x*y
Q: {x: -0.2*lambda.rail}
constraints: {rail: y = 0}
initial: {x: 0, y: 0, x': 0, y': 0}
"""
    )
    found = lagcli.modes(model, equilibrium=True)
    assert found.modes[0].natural_frequency == pytest.approx(math.sqrt((80 + 0.2 * 60) / 2))
    x = -0.2 * 2 * 9.81 / (80 + 0.2 * 60)
    assert found.operating_point.point.q == pytest.approx([x, 0], abs=1e-12)
    assert lagcli.modes(model).operating_point.point.a[0] == pytest.approx(-0.2 * 9.81)


def test_a_contact_without_a_force_has_no_linear_model() -> None:
    model = lagcli.load(CONTACT / "newtons_cradle.yaml")
    with pytest.raises(NumericalError, match=r"`hit\[3\]` touches without a force"):
        lagcli.modes(model)


def test_the_motion_of_a_mode_has_the_forces_of_all_contacts() -> None:
    run = mode_motion(lagcli.load_text(STACK), 1, equilibrium=True, amplitude=0.01)
    assert run.constraints == ("floor", "ceiling")
    at_rest = 1 - 3 * 9.81 / 100
    floor = 5 * 9.81 - 100 * (run.q[:, 1] - at_rest)
    np.testing.assert_allclose(run.multipliers[:, 0], floor, rtol=1e-9)
    assert not run.multipliers[:, 1].any()
