"""Contacts whose forces or motions are not unique, or do not exist: the notes, and the solution."""

from __future__ import annotations

import itertools
import math
import random

import numpy as np
import pytest

import lagcli
from lagcli.arrays import Array
from lagcli.trajectory.event_log import EventLog, event_sentences
from lagcli.trajectory.trajectory import Trajectory


def simulate(text: str, **settings: object) -> tuple[Trajectory, EventLog]:
    run = lagcli.simulate(lagcli.load_text(text), **settings)  # type: ignore[arg-type]
    assert run.events is not None
    return run, run.events


def rod(theta: float, mu: float, load: float, forward: bool, unit: tuple[float, float]) -> str:
    """Painlevé's uniform rod, half length l, on the floor, with l θ'² sin θ = load g."""
    length, time = unit
    g = 9.81 * length / time**2
    rate = math.sqrt(load * g / (length * math.sin(theta)))
    slip = (1 if forward else -1) * length / time
    right = slip - length * math.sin(theta) * rate
    return f"""
coordinates: [x, y, theta]
parameters: {{l: {length!r}, g: {g!r}, mu: {mu!r}}}
definitions:
  x_A: x - l*cos(theta)
  y_A: y - l*sin(theta)
T: (x'^2 + y'^2)/2 + l^2/6*theta'^2
V: g*y
constraints:
  tip: {{expr: y_A >= 0, friction: mu, slip: x_A'}}
initial:
  x: 0
  y: l*sin({theta!r})
  theta: {theta!r}
  x': {right!r}
  y': {length * math.cos(theta) * rate!r}
  theta': {rate!r}
simulation: {{t_end: {1e-6 * time!r}, samples: 3}}
"""


@pytest.mark.parametrize("part", range(4))
def test_painleve_s_rod_on_both_sides_of_the_bound(part: int) -> None:
    """m y_A'' = (1 + 3 c² ± 3 μ s c) λ + m (l θ'² s − g), − where the tip slides backwards.

    The bound is μ = (1 + 3 c²)/(3 s c), 4/3 at tan θ = 2. Beyond it there is no motion where the
    tip is pressed on the floor, and there are two where it is not.
    """
    seen = set()
    for seed in range(part, 120, 4):
        rng = random.Random(seed)
        theta, mu, load = rng.uniform(0.2, 1.45), rng.uniform(0, 4), rng.uniform(0, 2)
        forward = rng.random() < 0.3
        unit = rng.choice([1e-6, 1.0, 1e3]), rng.choice([1e-9, 1.0, 3600.0])
        c, s, g = math.cos(theta), math.sin(theta), 9.81 * unit[0] / unit[1] ** 2
        bound = (1 + 3 * c * c) / (3 * s * c)
        margin = 1 + 3 * c * c + (3 if forward else -3) * mu * s * c
        if abs(margin) < 0.05 or abs(load - 1) < 0.02:
            continue
        run, log = simulate(rod(theta, mu, load, forward, unit))
        seen.add((margin > 0, load > 1))
        if margin > 0:
            assert run.status == "completed", run.message
            assert log.undetermined() == []
            force = (1 - load) * g / margin if load < 1 else 0.0
            assert run.multipliers[0] == pytest.approx(
                [force, (-mu if forward else mu) * force], rel=1e-9
            )
            continue
        kind = "two motions" if load > 1 else "no motion"
        assert run.status == "failed"
        assert (log.names[-1], log.kinds[-1]) == ("tip", kind)
        assert f"mu = {mu:.6g} is beyond the bound {bound:.4g} here (Painlevé)" in run.message
        (note,) = [x for x in event_sentences(log.to_mapping()) if x.startswith("note")]
        assert "not unique; none was taken" in note if load > 1 else "no motion at `tip`" in note
    assert len(seen) == 4


def test_the_bound_of_a_uniform_rod_is_four_thirds() -> None:
    theta = math.atan(2)
    for mu, status in ((1.3333, "completed"), (1.3334, "failed")):
        assert simulate(rod(theta, mu, 0.5, False, (1.0, 1.0)))[0].status == status


def test_a_guide_that_jams_is_in_the_log() -> None:
    """Klein's masses with friction that grows to the bound μ tan φ = 2 at t = (2/√3 − 0.8)/5 s."""
    text = """
coordinates: [x1, y1, x2, y2]
parameters: {L: 1, phi: 60 deg, v: 100}
T: (x1'^2 + y1'^2 + x2'^2 + y2'^2)/2
Q: {x2: 6}
constraints:
  rough: {expr: y1 = 0, friction: 0.8 + 5*t, slip: x1'}
  smooth: y2 = L*sin(phi)
  rod: (x2 - x1)^2 + (y2 - y1)^2 = L^2
initial: {x1: 0, y1: 0, x2: L*cos(phi), y2: L*sin(phi), x1': v, x2': v, y1': 0, y2': 0}
simulation: {t_end: 1}
"""
    run, log = simulate(text)
    assert run.status == "failed"
    assert (log.names[-1], log.kinds[-1]) == ("rough", "jams")
    assert log.time[-1] == pytest.approx((2 / math.sqrt(3) - 0.8) / 5, rel=1e-8)
    assert any("`rough`" in x and "the run ends" in x for x in event_sentences(log.to_mapping()))


def test_a_run_with_derivatives_ends_with_the_same_entry() -> None:
    run, log = simulate(rod(math.atan(2), 2.0, 0.5, False, (1.0, 1.0)), sensitivity=("mu",))
    assert run.status == "failed"
    assert (log.names[-1], log.kinds[-1]) == ("tip", "no motion")
    assert log.dtime.shape == (len(log), 1)
    assert np.isnan(log.dtime[-1]).all()


def test_redundant_contacts_are_told_once() -> None:
    """A beam on three supports: 3 forces, 2 equations; least norm of (1, 1, 1), without moment."""
    text = """
coordinates: [y, phi]
T: y'^2/2 + phi'^2/10
V: 9.81*y
constraints:
  left: y - sin(phi) >= 0
  mid: y >= 0
  right: y + sin(phi) >= 0
initial: {y: 0, phi: 0, y': 0, phi': 0}
simulation: {t_end: 1, samples: 5}
"""
    run, log = simulate(text)
    assert run.status == "completed"
    assert run.multipliers == pytest.approx(9.81 / 3, rel=1e-12)
    assert [(x.time, x.kind, x.names) for x in log.undetermined()] == [
        (0.0, "redundant", ("left", "mid", "right"))
    ]
    (note,) = [x for x in event_sentences(log.to_mapping()) if x.startswith("note")]
    assert note == (
        "note: from t = 0 s on, the forces of `left`, `mid`, `right` are not unique (the motion"
        " is): those of least norm within their laws were taken"
    )
    two = text.replace("  mid: y >= 0\n", "")
    run, log = simulate(two)
    assert run.multipliers == pytest.approx(9.81 / 2, rel=1e-12)
    assert log.undetermined() == []


def four_contacts(rate: float, restitution: list[float]) -> str:
    """A rod with m = 1, J = 4 that falls on contacts at x = -2, -1, 0, 1 and rotates."""
    contacts = "".join(
        f"  c{k}: {{expr: y + ({x})*sin(phi) >= 0, restitution: {e}}}\n"
        for k, (x, e) in enumerate(zip((-2, -1, 0, 1), restitution, strict=True))
    )
    return (
        f"coordinates: [y, phi]\nT: y'^2/2 + 2*phi'^2\nconstraints:\n{contacts}"
        f"initial: {{y: 0, phi: 0, y': -1, phi': {rate}}}\n"
        "simulation: {t_end: 1e-6, samples: 2}"
    )


def test_motion_that_depends_on_shares_of_several_contacts() -> None:
    """Impulses p of the compression have Σ p = 1, Σ x p = 0.8.

    Those of least norm are (0, 0, 0.2, 0.8), which return nothing. (0, 0.1, 0, 0.9) satisfies the
    law too and returns 0.05 at x = -1. Neither contact without an impulse can have one alone.
    """
    _, log = simulate(four_contacts(-0.2, [0, 0.5, 0, 0]))
    assert np.abs(log.after[log.kinds.index("impact")]).max() < 1e-12
    assert "not unique" in log.kinds
    _, log = simulate(four_contacts(-0.2, [0.5, 0, 0, 0]))
    assert "not unique" in log.kinds  # (0.2/3, 0, 0, 2.8/3)


@pytest.mark.parametrize("restitution", [(0, 0, 0, 0.25), (0, 0.5, 0.3, 0.25), (0.5, 0, 0, 0)])
def test_an_impulse_that_only_one_contact_can_bear(restitution: tuple[float, ...]) -> None:
    """Σ x p = Σ p: all of it is at x = 1, but for rounding errors."""
    _, log = simulate(four_contacts(-0.25, list(restitution)))
    after = log.after[log.kinds.index("impact")]
    assert after == pytest.approx([restitution[3], restitution[3] / 4], abs=1e-12)
    assert "not unique" not in log.kinds


def compressions(matrix: Array, before: Array, mu: float) -> list[Array]:
    """Return the motions after plastic impacts of contacts with friction, rows n₁, t₁, n₂, t₂, …"""
    n, found = len(before), list[Array]()
    for modes in itertools.product(("open", "sticks", 1, -1), repeat=n // 2):
        equations, right = np.zeros((n, n)), np.zeros(n)
        for i, mode in enumerate(modes):
            normal, along = 2 * i, 2 * i + 1
            equations[normal], right[normal] = matrix[normal], -before[normal]
            equations[along], right[along] = matrix[along], -before[along]
            if mode == "open":
                equations[normal : along + 1] = np.eye(n)[normal : along + 1]
                right[normal : along + 1] = 0.0
            elif mode != "sticks":
                equations[along] = np.eye(n)[along] + mode * mu * np.eye(n)[normal]
                right[along] = 0.0
        if abs(np.linalg.det(equations)) < 1e-9:
            continue
        x = np.linalg.solve(equations, right)
        y = matrix @ x + before
        valid = True
        for i, mode in enumerate(modes):
            x_n, x_t, y_n, y_t = x[2 * i], x[2 * i + 1], y[2 * i], y[2 * i + 1]
            if mode == "open":
                valid &= y_n > -1e-9
            elif mode == "sticks":
                valid &= x_n > -1e-9 and abs(x_t) < mu * x_n + 1e-9
            else:
                valid &= x_n > -1e-9 and mode * y_t > -1e-9
        if valid and not any(np.abs(y - other).max() < 1e-7 for other in found):
            found.append(y)
    return found


@pytest.mark.slow
def test_impacts_with_more_than_one_motion() -> None:
    """Random bodies in general position; counted by trial of all modes."""
    counted = {1: 0, 2: 0}
    for seed in range(80):
        rng = np.random.default_rng(seed)
        root = rng.standard_normal((4, 4))
        mass = root @ root.T + 0.2 * np.eye(4)
        rows = rng.standard_normal((4, 4))
        velocity, mu = rng.standard_normal(4), rng.choice([0.3, 2.0, 4.0])
        rows[[0, 2]] *= -np.sign(rows[[0, 2]] @ velocity)[:, None]
        motions = compressions(rows @ np.linalg.solve(mass, rows.T), rows @ velocity, mu)
        names = [f"q{k}" for k in range(4)]

        def linear(row: Array, rate: str = "") -> str:
            return " + ".join(f"({x!r})*q{k}{rate}" for k, x in enumerate(row.tolist()))

        energy = " + ".join(
            f"({mass[i, j].item()!r})/2*q{i}'*q{j}'" for i in range(4) for j in range(4)
        )
        contacts = "".join(
            f"  c{k}: {{expr: '{linear(rows[2 * k])} >= 0', friction: {mu},"
            f' slip: "{linear(rows[2 * k + 1], chr(39))}"}}\n'
            for k in range(2)
        )
        start = ", ".join(
            f"{q}: 0, {q}': {v!r}" for q, v in zip(names, velocity.tolist(), strict=True)
        )
        run, log = simulate(
            f"coordinates: [{', '.join(names)}]\nT: {energy}\nV: 0\nconstraints:\n{contacts}"
            f"initial: {{{start}}}\nsimulation: {{t_end: 1e-9, samples: 2}}"
        )
        first = [kind for kind, time in zip(log.kinds, log.time, strict=True) if time == 0.0]
        after = log.after[first.index("impact")]
        distances = [np.abs(rows @ after - y).max() for y in motions]
        assert min(distances) < 1e-8, (seed, run.message)
        noted = "not unique" in first
        if first.count("impact") <= 2:  # one impact, of both contacts or one
            assert noted == (len(motions) > 1), (seed, motions)
        counted[1 + noted] += 1
        if noted:
            assert any("more than one motion" in x for x in event_sentences(log.to_mapping()))
    assert counted[1] > 5
    assert counted[2] > 5


@pytest.mark.parametrize("law", ["abs(lambda.{0}y)", "sqrt(lambda.{0}x^2 + lambda.{0}y^2)"])
@pytest.mark.parametrize("rate", [1.0, 3.0])
def test_bearings_share_a_torque_by_forces_of_the_other_sign(law: str, rate: float) -> None:
    """A crank slips where no share of the torque obeys both laws, and no earlier.

    The shares of least norm, which obey none, have a force of the other sign on the pin.
    """
    k, angles = (0.07, 0.015), (-2.6, math.acos(0.5 * math.cos(2.6)) - math.pi)
    model = lagcli.load_text(f"""
coordinates: [x, y, h, u, w, b]
T: (x'^2 + y'^2)/2 + 0.08/2*h'^2 + 1.5/2*(u'^2 + w'^2) + 0.25/2*b'^2
V: 11*y + 15*w
Q: {{h: "-2 + {rate!r}*t", b: 4.27}}
constraints:
  Ox: x - 0.3*sin(h) = 0
  Oy: y + 0.3*cos(h) = 0
  Ax: u - 0.6*sin(b) = x + 0.3*sin(h)
  Ay: w + 0.6*cos(b) = y - 0.3*cos(h)
  guide: w - 0.6*cos(b) = 0
  first: {{expr: "h' = 0", limit: "{k[0]}*{law.format("O")}"}}
  second: {{expr: "b' - h' = 0", limit: "{k[1]}*{law.format("A")}"}}
initial: {{x: {{guess: 0}}, y: {{guess: 0}}, u: {{guess: 0}}, w: {{guess: 0}},
  b: {{guess: {angles[1]}}},
  x': {{guess: 0}}, y': {{guess: 0}}, u': {{guess: 0}}, w': {{guess: 0}}, b': {{guess: 0}},
  h: {angles[0]}, h': 0}}
simulation: {{t_end: 1, samples: 101}}
""")
    run = lagcli.simulate(model)
    assert run.status == "completed", run.message
    assert run.events is not None
    # at the limit of both, with forces Ox, Oy, Ax, Ay, guide, and the torque on the crank
    (s, c), (sb, cb) = [(math.sin(x), math.cos(x)) for x in (run.q[0, 2], run.q[0, 5])]
    rows = np.array(
        [
            [1, 0, -1, 0, 0, 0],
            [0, 1, 0, -1, 0, 0],
            [-0.3 * c, -0.3 * s - k[0], -0.3 * c, -0.3 * s - k[1], 0, 1],
            [0, 0, 1, 0, 0, 0],
            [0, 0, 0, 1, 1, 0],
            [0, 0, -0.6 * cb, -0.6 * sb + k[1], 0.6 * sb, 0],
        ]
    )
    torque = np.linalg.solve(rows, [0, 11, 0, 0, 15, -4.27])[5]
    slips = run.events.time[np.array(run.events.kinds) == "slips"]
    assert slips == pytest.approx(np.full(2, (torque + 2) / rate), rel=1e-6)
    stuck = run.multipliers[run.time < slips[0]]
    assert (np.abs(stuck[:, 5]) <= k[0] * np.hypot(stuck[:, 0], stuck[:, 1]) * (1 + 1e-9)).all()
    assert (np.abs(stuck[:, 6]) <= k[1] * np.hypot(stuck[:, 2], stuck[:, 3]) * (1 + 1e-9)).all()


@pytest.mark.parametrize("share", [0.6, -0.5, -1.6, -5.0])
def test_a_ball_on_a_floor_whose_force_pushes_it_back(share: float) -> None:
    """y'' = λ (1 + share) − g: beyond a share of −1 no λ ≥ 0 holds the ball, and it was held by a
    λ < 0, since the iteration for such forces does not converge.
    """
    text = (
        "coordinates: [y]\nparameters: {g: 10}\nT: y'^2/2\nV: g*y\n"
        f"Q: {{y: {share}*lambda.floor}}\n"
        "constraints: {floor: {expr: y >= 0, restitution: 0.3}}\ninitial: {y: 0.05, y': 0}\n"
    )
    run, _ = simulate(text, t_end=1)
    if share > -1:
        assert run.status == "completed"
        assert run.multipliers[-1, 0] == pytest.approx(10 / (1 + share), rel=1e-12)
    else:
        assert run.status == "failed"
        assert "no motion is possible at `floor`" in run.message
    assert run.multipliers.min() >= 0
