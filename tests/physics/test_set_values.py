"""Events that set values off the constraints: the values hold, the others follow by an impulse."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

import lagcli
from lagcli.arrays import Array
from lagcli.trajectory.trajectory import Trajectory

PENDULUM = """
coordinates: [x, y]
parameters: {l: 1, m: 2, g: 9.81, new: 0}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints: {rod: x^2 + y^2 = l^2}
events: {EVENTS}
initial: {x: 0.8, y: {guess: -0.6}, x': 0, y': {guess: 0}}
simulation: {t_end: 1, samples: 101}
"""


def pendulum(events: str, **parameters: float) -> Trajectory:
    text = PENDULUM.replace("EVENTS", events)
    return lagcli.simulate(lagcli.load_text(text, set=parameters))


def balance(run: Trajectory) -> float:
    """Return the largest error of the energy balance, relative to the kinetic energy."""
    return float(np.abs(run.energy_balance).max() / np.abs(run.energy_kinetic).max())


def test_a_velocity_that_is_set_holds_and_the_rod_answers() -> None:
    """x' = 0 where y is not 0 leaves y' = −x x'/y = 0; the rod's Λ stops y: m Δy' = 2 y Λ.

    The state was projected before: x' = −0.526, no impulse, an energy balance off by 0.28 J.
    """
    run = pendulum("brake: {when: t >= 0.2, set: {x': 0}}")
    log = run.events
    assert log is not None
    x, y = log.q[0]
    assert log.after[0] == pytest.approx([0, 0], abs=1e-15)
    assert log.impulse[0] == pytest.approx([-2 * log.before[0, 1] / (2 * y)], rel=1e-12)
    assert log.work[0] == pytest.approx(-2 * 9.81 * (0.8 * 0 + -0.6 - y), rel=1e-8)
    assert balance(run) < 1e-8
    at_rest = pendulum("never: {when: t > 9, stop: true}")
    again = lagcli.load_text(
        PENDULUM.replace("EVENTS", "never: {when: t > 9, stop: true}").replace(
            "x: 0.8", f"x: {float(x)!r}"
        )
    )
    rest = lagcli.simulate(again, t_end=0.8, samples=81)
    assert run.q[20:] == pytest.approx(rest.q, abs=1e-8)
    assert run.q[:20] == pytest.approx(at_rest.q[:20], abs=1e-12)


def test_a_coordinate_that_is_set_holds_on_the_constraint() -> None:
    run = pendulum("jump: {when: t >= 0.5, set: {x: new}}", new=-0.3)
    log = run.events
    assert log is not None
    assert log.q[0] == pytest.approx([-0.3, -sqrt(1 - 0.09)], abs=1e-15)
    before, normal = log.before[0], log.q[0]
    # the velocity keeps its part along the new tangent, and Λ 2 (x, y) takes the rest
    assert log.after[0] == pytest.approx(before - normal * (normal @ before), abs=1e-14)
    assert log.impulse[0] == pytest.approx([-2 * (normal @ before) / 2], rel=1e-12)
    assert balance(run) < 1e-8
    assert any("moved further coordinates" in x and "y = " in x for x in run.warnings)


def test_a_length_that_is_set_moves_the_mass_along_the_rod() -> None:
    run = pendulum("winch: {when: t >= 0.5, set: {l: 0.7}}")
    log = run.events
    assert log is not None
    before = pendulum("never: {when: t > 9, stop: true}").q[50]
    assert log.q[0] == pytest.approx(0.7 * before, abs=1e-9)
    assert log.after[0] == pytest.approx(log.before[0], abs=1e-9)
    assert balance(run) < 1e-8


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ("a: {when: t >= 0.2, set: {x: 1.3}}", "`a` sets x = 1.3 .* no other coordinates nearby"),
        ("a: {when: t >= 0.2, set: {x: 1, x': 0.1}}", "no other velocities nearby satisfy"),
        ("a: {when: t >= 0.2, set: {x': 1, y': 1}}", "sets x' = 1, y' = 1 at t = 0.2 s, and no"),
        (
            "a: {when: t >= 0.2, set: {x': 1}}, b: {when: t >= 0.2, set: {y': 1}}",
            "`b` sets y' = 1 at t = 0.2 s, where another event sets x', and no other velocities",
        ),
    ],
)
def test_values_that_contradict_the_constraints_are_refused(event: str, message: str) -> None:
    run = pendulum(event)
    assert run.status == "failed"
    assert pytest.approx(0.2, abs=0.011) == run.time[-1]
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(run.message)
    assert "`rod` is on line 6 of the model" in run.message


SLOPE = """
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {floor: {expr: "y - 0.5*x >= 0", restitution: 0.8}}
events: {e: {when: t >= 0.3, set: VALUES}}
initial: {x: 0, y: 0, x': -1, y': -0.5}
simulation: {t_end: 1, samples: 101}
"""


def on_slope(values: str) -> Trajectory:
    return lagcli.simulate(lagcli.load_text(SLOPE.replace("VALUES", values)))


@pytest.mark.parametrize("e", [0.0, 0.3])
def test_values_of_a_body_at_rest_are_consistent_but_for_rounding(e: float) -> None:
    """The pendulum rests on the floor with velocities of 1e-16, which the clock turns back."""
    model = lagcli.load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints:
  rod: x^2 + y^2 = 0.6211^2
  floor: {{expr: y >= -0.4554, restitution: {e}}}
events: {{turn: {{every: 0.11, offset: 1.5, set: {{x': -x', y': -y'}}}}}}
initial: {{x: {{guess: -0.55}}, y: -0.29, x': 0, y': 0}}
simulation: {{t_end: 2}}
""")
    run = lagcli.simulate(model)
    assert run.status == "completed"
    assert run.events is not None
    assert run.events.kinds.count("event") == 5
    np.testing.assert_allclose(run.v[-1], 0.0, atol=1e-12)


@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_a_closed_contact_holds_while_a_velocity_is_set(speed: float) -> None:
    run = on_slope(f"{{x': {speed}}}")
    log = run.events
    assert log is not None
    assert log.kinds == ("event",)
    assert log.after[0] == pytest.approx([speed, speed / 2], abs=1e-14)
    assert log.impulse[0] == pytest.approx([speed / 2 - log.before[0, 1]], rel=1e-12)
    # along the slope, x'' = -g/2/(1 + 1/4)
    t = run.time[31:] - 0.3
    assert run.v[31:, 0] == pytest.approx(speed - 9.81 * 0.4 * t, abs=1e-9)
    assert balance(run) < 1e-12


def test_a_contact_opens_where_values_move_away_from_it() -> None:
    """Before, the contact stayed closed at any gap: its projection was work of nobody."""
    run = on_slope("{x: -1}")
    log = run.events
    assert log is not None
    assert log.kinds[:3] == ("event", "opens", "impact")
    fall = sqrt(2 * (log.q[0, 1] + 0.5) / 9.81)
    assert log.time[2] == pytest.approx(0.3 + fall, abs=1e-9)
    assert balance(run) < 1e-12
    pulled = on_slope("{x': -3}").events
    assert pulled is not None
    assert pulled.kinds[:3] == ("event", "opens", "impact")
    assert pulled.after[0, 0] == -3


def test_a_contact_that_values_violate_closes_or_ends_the_run() -> None:
    run = on_slope("{x: 1}")
    log = run.events
    assert log is not None
    assert log.q[0] == pytest.approx([1, 0.5], abs=1e-12)
    assert run.status == "completed"
    assert "an event violates `floor` by 0.5" in on_slope("{x: 1, y: 0}").message
    bounce = on_slope("{x': 1, y': 0}").events
    assert bounce is not None
    assert bounce.kinds[:3] == ("event", "impact", "opens")
    assert bounce.after[1, 1] - bounce.after[1, 0] / 2 == pytest.approx(0.8 * 0.5)


DRIVEN = """
coordinates: [x, y, z]
T: (x'^2 + 2*y'^2 + 3*z'^2 + x'*y')/2
V: x^2
constraints: {drive: x + y = sin(3*t), pin: {expr: z - y = 0, active: false}}
events: {close: {when: t >= 0.3, engage: pin, set: {y: 0.1, z: 0.1, y': 0.5}}, EVENTS}
initial: {x: 0, y: 0, z: 0, x': {guess: 1}, y': 2, z': 2}
simulation: {t_end: 1, samples: 101}
"""


def test_constraints_that_are_engaged_and_released_take_part() -> None:
    later = (
        "stop_z: {when: t >= 0.5, set: {z': 3}},"
        " open: {when: t >= 0.6, release: pin, set: {z': 0, y': 1}},"
        " push: {when: t >= 0.7, set: {y': 0.5}, impulse: {x: 2}}"
    )
    run = lagcli.simulate(lagcli.load_text(DRIVEN.replace("EVENTS", later)))
    log = run.events
    assert log is not None
    events = [i for i, kind in enumerate(log.kinds) if kind == "event"]
    first, second, third, fourth = (log.after[i] for i in events)
    assert first == pytest.approx([3 * np.cos(0.9) - 0.5, 0.5, 0.5], abs=1e-13)
    assert second == pytest.approx([3 * np.cos(1.5) - 3, 3, 3], abs=1e-13)
    assert third == pytest.approx([3 * np.cos(1.8) - 1, 1, 0], abs=1e-13)
    # with x' + y' = r, the push 2 at x: Δx' (1 - 2/2 + 2 - 1/2 ...) from M Δv = (2, 0) + Λ (1, 1)
    mass, rows = np.array([[1, 0.5], [0.5, 2]]), np.array([1.0, 1.0])
    middle = np.array([3 * np.cos(2.1) - 0.5, 0.5])
    saddle = np.block([[mass, -rows[:, None]], [rows[None], np.zeros((1, 1))]])
    answer = np.linalg.solve(saddle, [2.0, 0.0, 0.0])
    assert fourth[:2] == pytest.approx(middle + answer[:2], abs=1e-12)
    set_impulse = (mass @ (middle - log.before[events[3], :2]))[0]
    set_impulse -= 0.5 * (0.5 - log.before[events[3], 1])  # y' is set: x' alone is free
    assert log.impulse[events[3]] == pytest.approx([answer[2] + set_impulse, 0], abs=1e-12)
    assert balance(run) < 1e-8


def mechanism(rng: np.random.Generator) -> tuple[str, dict[str, Array]]:
    """Return a model with random constraints φ = qᵀAq + bᵀq + c sin 3t − d, and its data."""
    n = int(rng.integers(3, 7))
    count = int(rng.integers(1, n))
    root = rng.normal(size=(n, n)) * 0.4
    mass = np.round(root @ root.T + np.diag(rng.uniform(0.3, 3, n)), 3)
    q, v = rng.normal(size=(2, n))
    forms = np.round(rng.normal(size=(count, n, n)) * (rng.random((count, n, n)) < 0.5), 3)
    forms, linear = forms + forms.transpose(0, 2, 1), np.round(rng.normal(size=(count, n)), 3)
    drive = np.round(rng.normal(size=count) * (rng.random(count) < 0.4), 3)
    if count < n - 1 and rng.random() < 0.3:  # a redundant one
        forms, linear = (np.concatenate([x, 2 * x[:1]]) for x in (forms, linear))
        drive = np.append(drive, 2 * drive[0])
    names = [f"q{i}" for i in range(n)]
    level = np.einsum("kij,i,j->k", forms, q, q) + linear @ q
    rows = []
    for k, form in enumerate(forms):
        terms = [f"{form[i, j]!r}*q{i}*q{j}" for i in range(n) for j in range(n) if form[i, j]]
        terms += [f"{b!r}*{name}" for b, name in zip(linear[k], names, strict=True)]
        terms += [f"{drive[k]!r}*sin(3*t)", f"(-1)*{float(level[k])!r}"]
        rows.append(f"  c{k}: {' + '.join(terms)} = 0".replace("np.float64", ""))
    kinetic = " + ".join(
        f"{mass[i, j] / 2!r}*q{i}'*q{j}'" for i in range(n) for j in range(n)
    ).replace("np.float64", "")
    start = ", ".join(
        f"{name}: {{guess: {float(a)!r}}}, {name}': {{guess: {float(b)!r}}}"
        for name, a, b in zip(names, q, v, strict=True)
    )
    potential = " + ".join(f"{name}^2" for name in names)
    text = "\n".join(
        [
            f"coordinates: [{', '.join(names)}]",
            f"T: {kinetic}",
            f"V: {potential}",
            "constraints:",
            *rows,
            "events: {set: {when: t >= 0.1, set: VALUES}}",
            f"initial: {{{start}}}",
            "simulation: {t_end: 0.2, times: [0, 0.1, 0.2]}",
        ]
    )
    return text, {"mass": mass, "forms": forms, "linear": linear, "drive": drive, "level": level}


def check_mechanism(seed: int) -> str:
    """Set random values of a random mechanism; check the state, the impulse and the energy."""
    rng = np.random.default_rng(seed)
    text, data = mechanism(rng)
    n, mass = len(data["mass"]), data["mass"]
    free_run = lagcli.simulate(lagcli.load_text(text.replace("VALUES", "{q0: q0}"), set={}))
    if free_run.status != "completed":
        return "singular"
    q, before = free_run.q[1], free_run.v[1]
    chosen = rng.permutation(n)[: int(rng.integers(1, n - len(data["forms"]) + 2))].tolist()
    velocity = rng.random() < 0.6
    prime = "'" if velocity else ""
    values = {
        i: float(np.round(before[i] + rng.normal() if velocity else q[i] + 0.1 * rng.normal(), 4))
        for i in chosen
    }
    listed = ", ".join(f"q{i}{prime}: {x!r}" for i, x in values.items())
    run = lagcli.simulate(lagcli.load_text(text.replace("VALUES", f"{{{listed}}}")))

    def rates(q: Array) -> tuple[Array, Array]:
        jacobian = 2 * np.einsum("kij,j->ki", data["forms"], q) + data["linear"]
        return jacobian, 3 * data["drive"] * np.cos(0.3)

    if run.status == "failed":
        assert "sets" in run.message
        assert "nearby satisfy" in run.message
        if velocity:  # really none: the free velocities cannot
            jacobian, drift = rates(q)
            rest = drift + jacobian[:, chosen] @ np.array(list(values.values()))
            others = np.delete(jacobian, chosen, axis=1)
            found = np.linalg.lstsq(others, -rest, rcond=1e-8)[0]
            assert np.abs(others @ found + rest).max() > 1e-6 * np.abs(rest).max()
        return "refused"
    log = run.events
    assert log is not None
    at, after = log.q[0], log.after[0]
    for i, x in values.items():
        assert (after if velocity else at)[i] == x
    phi = np.einsum("kij,i,j->k", data["forms"], at, at) + data["linear"] @ at
    phi += data["drive"] * np.sin(0.3) - data["level"]
    jacobian, drift = rates(at)
    size = 1 + np.abs(at).max() ** 2
    assert np.abs(phi).max() < 1e-12 * size * n**2
    speed = max(np.abs(after).max(), np.abs(before).max())
    assert np.abs(jacobian @ after + drift).max() < 1e-12 * np.abs(jacobian).sum() * (1 + speed)
    middle, free = before.copy(), np.ones(n, dtype=bool)
    if velocity:
        middle[chosen], free[chosen] = list(values.values()), False
    momentum = mass @ (after - middle) - jacobian.T @ log.impulse[0]
    assert np.abs(momentum[free]).max(initial=0) < 1e-8 * np.abs(mass).max() * (1 + speed)
    assert log.supplied[0] == pytest.approx(-log.impulse[0] @ drift, rel=1e-9, abs=1e-12)
    assert np.abs(run.energy_balance).max() < 1e-7 * (1 + np.abs(run.energy_kinetic).max())
    assert run.v[1] == pytest.approx(after, abs=1e-9 * (1 + speed))
    return "held"


def test_values_of_random_mechanisms_hold() -> None:
    found = [check_mechanism(seed) for seed in range(8)]
    assert found.count("held") >= 4


@pytest.mark.slow
def test_values_of_many_random_mechanisms_hold() -> None:
    found = [check_mechanism(seed) for seed in range(1000, 1300)]
    assert found.count("held") >= 150


@pytest.mark.parametrize(
    ("event", "names"),
    [
        ("brake: {when: t >= 0.2, set: {x': 0.3}}", ["l", "g"]),
        ("jump: {when: t >= 0.5, set: {x: new}}", ["new", "g"]),
        ("winch: {when: x <= 0.5, set: {l: 0.7 + new}}", ["new", "g"]),
    ],
)
def test_derivatives_of_values_that_are_set(event: str, names: list[str]) -> None:
    text = PENDULUM.replace("EVENTS", event)
    values = {"new": -0.3 if "jump" in event else 0.0, "l": 1.0, "g": 9.81}
    run = lagcli.simulate(lagcli.load_text(text, set=values), sensitivity=tuple(names), samples=11)
    alone = lagcli.simulate(lagcli.load_text(text, set=values), samples=11)
    assert run.q == pytest.approx(alone.q, abs=1e-8)
    for k, name in enumerate(names):
        h, difference = 1e-3, np.zeros_like(run.q)
        for step, weight in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60)):
            for side in (1, -1):
                beside = {**values, name: values[name] + side * step * h}
                found = lagcli.simulate(lagcli.load_text(text, set=beside), samples=11, rtol=1e-11)
                difference += side * weight * found.q / h
        assert run.dq[..., k] == pytest.approx(difference, abs=2e-6)


@pytest.mark.parametrize("action", ["impulse: {x: 0.7}", "set: {x': x' + 0.35}", "set: {c: 2}"])
@pytest.mark.parametrize("speed", ["3*cos(t)", "w + 1"])
def test_the_work_on_a_moving_body_is_that_of_v_p_minus_l(action: str, speed: str) -> None:
    """A mass on a cart of a given speed u: h = m/2 (x'² − u²) + c x²/2, and not T + V.

    The warning was that the energy balance had an error of m u Δx'.
    """
    run = lagcli.simulate(
        lagcli.load_text(f"""
coordinates: [x]
parameters: {{m: 2, c: 1}}
inputs: {{w: {{times: [0, 0.2, 1], values: [0, 1, 3]}}}}
T: m/2*(x' + {speed})^2
V: c/2*x^2
events: {{hit: {{when: t >= 0.3, {action}}}}}
initial: {{x: 0.1, x': 0.5}}
simulation: {{t_end: 1, samples: 11}}
""")
    )
    log = run.events
    assert log is not None
    ((x,),), ((before,),), ((after,),) = log.q, log.before, log.after
    spring = x * x / 2 if "c" in action.split(":")[1] else 0.0
    assert after - before == pytest.approx(0.0 if spring else 0.35, abs=1e-14)
    assert log.work == pytest.approx([after**2 - before**2 + spring], rel=1e-12)
    assert np.abs(run.energy_balance).max() < 1e-8 * np.abs(run.energy_kinetic).max()
    assert run.warnings == ()
