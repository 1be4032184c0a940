"""Bodies in corners and funnels of planes, against complementarity problems solved by enumeration.

Without friction, impacts and forces have one solution, also of redundant contacts: A = G M⁻¹ Gᵀ is
positive semidefinite, and G v in its range (Cottle, Pang & Stone, The Linear Complementarity
Problem, theorem 3.1.2). Planes through 0 stay closed or open for good after the impact at t = 0.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.arrays import Array
from lagcli.trajectory.trajectory import Trajectory

FOUND = Path(__file__).parents[1] / "found"
#: Velocities after impacts at one instant, of those before: sequences end at 1e-11 of them.
_SAME = 1e-9


def complementary(matrix: Array, offset: Array) -> tuple[Array, Array]:
    """Return x ≥ 0 and y = A x + b ≥ 0 with x y = 0: the best of all sets of x that are not 0."""
    scale = 1 / np.sqrt(np.diag(matrix))
    a, b = matrix * np.outer(scale, scale), offset * scale
    found: list[tuple[float, Array, Array]] = []
    for active in itertools.product((False, True), repeat=len(b)):
        x, some = np.zeros(len(b)), np.flatnonzero(active)
        block = a[np.ix_(some, some)]
        if len(some) and np.linalg.cond(block) > 1e9:
            continue  # without redundant ones, the others do
        x[some] = np.linalg.solve(block, -b[some])
        y = a @ x + b
        found.append((max(-x.min(), -y.min(), 0.0), x, y))
    violation, x, y = min(found, key=lambda one: one[0])
    assert violation <= 1e-9 * np.abs(b).max(initial=0.0)
    return x.clip(0) * scale, y / scale


class Corner:
    """Planes G q ≥ 0 with one coefficient of restitution, a mass matrix and a constant force."""

    def __init__(self, mass: Array, planes: Array, force: Array, e: float):
        self.mass, self.planes, self.force, self.e = mass, planes, force, e

    def text(self, q: Sequence[float], v: Sequence[float], settings: str) -> str:
        """Return the model, with one coordinate for each row of M."""
        names = [f"x{i}" for i in range(len(self.mass))]

        def total(factors: Array, terms: list[str]) -> str:
            return " + ".join(f"({f!r})*{x}" for f, x in zip(factors.tolist(), terms, strict=True))

        squares = [f"{a}'*{b}'" for a in names for b in names]
        lines = [
            f"coordinates: [{', '.join(names)}]",
            f'T: "{total(self.mass.ravel() / 2, squares)}"',
            f'V: "{total(-self.force, names)}"',
            "constraints:",
        ]
        for k, plane in enumerate(self.planes):
            lines.append(f'  k{k}: {{expr: "{total(plane, names)} >= 0", restitution: {self.e}}}')
        start = [f"{x}: {a!r}, {x}': {b!r}" for x, a, b in zip(names, q, v, strict=True)]
        return "\n".join([*lines, f"initial: {{{', '.join(start)}}}", f"simulation: {settings}"])

    def _moved(self, rows: Array, impulse: Array) -> Array:
        return np.asarray(np.linalg.solve(self.mass, rows.T @ impulse))

    def _matrix(self, rows: Array) -> Array:
        return np.asarray(rows @ np.linalg.solve(self.mass, rows.T))

    def poisson(self, v: Array) -> Array:
        """Return the velocities after the impact of all planes by Poisson's law."""
        rows = self.planes
        matrix, before = self._matrix(rows), rows @ v
        compression, after = complementary(matrix, before)
        returned = after + self.e * matrix @ compression
        terms = np.abs(matrix) @ compression + np.abs(before)
        returned[np.abs(returned) <= 1e-12 * terms] = 0.0
        expansion, _ = complementary(matrix, returned)
        return v + self._moved(rows, (1 + self.e) * compression + expansion)

    def newton(self, v: Array) -> Array | None:
        """Return the velocities after impacts by Newton's law, of planes that do not open.

        None for long sequences, which lagcli ends with an impact without restitution.
        """
        none = 3e-11 * np.abs(self.planes).max() * np.abs(v).max()
        for _ in range(100):
            now = self.planes @ v
            rows = self.planes[now <= none]
            if now.min() >= -none:
                return v
            impulse, _ = complementary(self._matrix(rows), (1 + self.e) * (rows @ v))
            v = v + self._moved(rows, impulse)
        return None

    def acceleration(self, rows: Array) -> Array:
        """Return the accelerations with some planes closed."""
        free = np.linalg.solve(self.mass, self.force)
        if not len(rows):
            return np.asarray(free)
        force, _ = complementary(self._matrix(rows), rows @ free)
        return np.asarray(free + self._moved(rows, force))


def random_corner(rng: np.random.Generator) -> Corner:
    """Return a corner of three to six planes, of which some depend on others in half of them."""
    n, count = int(rng.integers(2, 4)), int(rng.integers(3, 7))
    root = rng.standard_normal((n, n))
    planes = rng.standard_normal((count, n)).round(2)
    if rng.random() < 0.5:
        for k in range(2, count):
            i, j = rng.integers(0, k, 2)
            planes[k] = (rng.integers(1, 3) * planes[i] + rng.integers(0, 3) * planes[j]).round(2)
    mass = (root @ root.T + 0.5 * np.eye(n)).round(3)
    return Corner((mass + mass.T) / 2, planes, np.zeros(n), float(rng.choice([0, 0.3, 0.5, 0.8])))


def simulate(text: str, **settings: object) -> Trajectory:
    run = lagcli.simulate(lagcli.load_text(text), **settings)  # type: ignore[arg-type]
    assert (run.status, run.message, run.warnings) == ("completed", "", ()), text
    return run


@pytest.mark.parametrize("law", ["poisson", "newton"])
def test_random_corners(law: str) -> None:
    """Without forces, or with forces that push out of the corner or, with e = 0, into it."""
    rng = np.random.default_rng(7)
    moved, compared = 0, 0
    for _ in range(40):
        corner = random_corner(rng)
        n = len(corner.mass)
        push = 3 * rng.uniform(0, 1, len(corner.planes)) @ corner.planes
        corner.force = push * rng.choice([0, 1, -1 if corner.e == 0 else 1])
        v = rng.uniform(-2, 2, n).round(2)
        text = corner.text([0.0] * n, v.tolist(), f"{{t_end: 1, samples: 3, impacts: {law}}}")
        after = corner.poisson(v) if law == "poisson" else corner.newton(v)
        if after is None:
            continue
        gaps = corner.planes @ after
        rests = np.abs(gaps) <= 1e-9 * np.abs(corner.planes).max() * np.abs(v).max()
        a = corner.acceleration(corner.planes[rests])
        if (gaps + (corner.planes @ a).clip(None, 0) / 2)[~rests].min(initial=1.0) <= 0:
            continue  # another plane may be struck later
        run = simulate(text)
        size = max(np.abs(v).max(), np.abs(corner.force).max())
        assert run.v[-1] == pytest.approx(after + a, abs=_SAME * size), text
        assert run.q[-1] == pytest.approx(after + a / 2, abs=_SAME * size), text
        moved += np.abs(after).max() > 0.01
        compared += 1
    assert compared > 22
    assert moved > 12


@pytest.mark.parametrize("law", ["poisson", "newton", "sequential"])
def test_marbles_come_to_rest_in_funnels(law: str) -> None:
    """They end in the apex, by way of grooves, whatever the planes and coefficients."""
    rng = np.random.default_rng(11)
    for _ in range(8):
        count, mass, e = int(rng.integers(3, 7)), rng.uniform(0.5, 3), rng.choice([0.3, 0.5, 0.7])
        angle = 2 * np.pi * (np.arange(count) + rng.uniform(-0.2, 0.2, count)) / count
        slope = rng.uniform(0.4, 2, count)
        planes = np.stack([slope * np.cos(angle), slope * np.sin(angle), np.ones(count)], axis=1)
        corner = Corner(mass * np.eye(3), planes, np.array([0, 0, -9.81 * mass]), float(e))
        q, v = [*rng.uniform(-0.1, 0.1, 2), 1.0], rng.uniform(-0.5, 0.5, 3)
        text = corner.text(
            [float(x) for x in q], v.tolist(), f"{{t_end: 40, samples: 2, impacts: {law}}}"
        )
        run = simulate(text)
        assert np.abs(run.q[-1]).max() <= 1e-12, text
        assert np.abs(run.v[-1]).max() <= 1e-11, text  # of velocities of some m/s


def test_a_marble_that_strikes_two_faces_from_a_groove() -> None:
    """v⁺ = −0.7 v⁻ at each impact in the apex: the direction of the groove is unique."""
    run = lagcli.simulate(lagcli.load(FOUND / "funnel_poisson_fails.yaml"), t_end=6)
    assert (run.status, run.warnings) == ("completed", ())
    log = run.events
    assert log is not None
    at_apex = [k for k, (name, what) in enumerate(zip(log.names, log.kinds, strict=True))
               if (name, what) == ("k3", "impact") and log.time[k] > 2.5]  # fmt: skip
    assert len(at_apex) > 10
    for k in at_apex:
        assert log.after[k] == pytest.approx(-0.7 * log.before[k], rel=1e-6)
    assert np.abs(run.q[-1]).max() <= 1e-12
    assert np.abs(run.v[-1]).max() <= 1e-12


@pytest.mark.parametrize("law", ["poisson", "newton", "sequential"])
def test_a_mass_rests_in_a_corner_after_many_impacts_at_the_start(law: str) -> None:
    """More impacts at t = 0 than a block of the log has entries, before the first step."""
    run = lagcli.simulate(lagcli.load(FOUND / "corner_rest_fails.yaml"), t_end=1, impacts=law)
    assert (run.status, run.warnings) == ("completed", ())
    assert np.abs(run.q).max() <= 1e-15
    assert np.abs(run.v).max() <= 1e-15
    assert run.events is not None
    assert law == "poisson" or run.events.kinds.count("impact") > 600
    assert float(run.events.loss.sum()) == pytest.approx(5.1, rel=1e-12)


def test_a_body_leaves_a_corner_after_many_impacts_at_the_start() -> None:
    run = lagcli.simulate(
        lagcli.load(FOUND / "free_body_fails_newton.yaml"), t_end=1, impacts="newton"
    )
    assert (run.status, run.warnings) == ("completed", ())
    assert run.q[-1] == pytest.approx(run.v[-1], rel=1e-12)
    mass = np.diag([0.67, 2.24, 1.44, 2.02, 0.93])
    mass[0, 1] = mass[1, 0] = -0.04900285705956338
    assert run.events is not None
    lost = float(run.events.loss.sum())
    v = np.array([-1.88, 1.42, -0.29, 1.74, 1.18])
    assert run.v[-1] @ mass @ run.v[-1] / 2 == pytest.approx(v @ mass @ v / 2 - lost, rel=1e-12)
    assert np.abs(run.v[-1]).max() > 1


def test_a_contact_that_opens_at_the_start_takes_part_in_poissons_law() -> None:
    run = lagcli.simulate(lagcli.load(FOUND / "closed_but_separating.yaml"), t_end=1)
    mass = np.array([[1.11, 0.05828035689664228], [0.05828035689664228, 0.85]])
    planes = np.array([[-0.8, 0.48], [0.09, 0.18], [-0.94, -0.81]])
    v = np.array([0.81, -0.32])
    expected = Corner(mass, planes, np.zeros(2), 0.51).poisson(v)
    assert expected == pytest.approx([-0.4005, 0.2003], abs=5e-5)
    assert run.v[-1] == pytest.approx(expected, rel=1e-12)
    assert run.events is not None
    assert run.events.names == ("k0", "k1", "k2")  # one impact


def test_a_contact_that_holds_takes_part_where_an_impulse_opens_it() -> None:
    """A ball is pressed against two walls; a kick towards one opens the other.

    By Poisson's law both return part of the impulse of compression, and both are closed again.
    """
    text = """
coordinates: [x, y]
T: (x'^2 + y'^2)/2 + 0.6*x'*y'
V: 0.1*x + 0.1*y
constraints:
  a: {expr: x >= 0, restitution: 0.5}
  b: {expr: y >= 0, restitution: 0.5}
initial: {x: 0, y: 0, x': 0, y': 0}
events: {kick: {when: t >= 1, set: {x': -1, y': 0.2}}}
simulation: {t_end: 1, samples: 2}
"""
    run = simulate(text)
    mass = np.array([[1.0, 0.6], [0.6, 1.0]])
    corner = Corner(mass, np.eye(2), np.zeros(2), 0.5)
    alone = np.array([-1.0, 0.2]) + 1.5 / np.linalg.inv(mass)[0, 0] * np.linalg.inv(mass)[:, 0]
    expected = corner.poisson(np.array([-1.0, 0.2]))
    assert run.v[-1] == pytest.approx(expected, abs=1e-12)
    assert np.abs(expected - alone).max() > 0.1


def test_derivatives_of_an_impact_in_which_an_opening_contact_is_pressed_again() -> None:
    """M = [[1, c], [c, 1]], compression to v = 0: then x' = −e (b + c u) and y' = 0."""
    text = """
coordinates: [x, y]
parameters: {b: -1.0, e: 0.5, u: 0.7}
T: (x'^2 + y'^2)/2 + 0.8*x'*y'
constraints:
  a: {expr: x >= 0, restitution: e}
  b: {expr: y >= 0, restitution: e}
initial: {x: 0, y: 0, x': b, y': u}
simulation: {t_end: 1, samples: 2}
"""
    run = simulate(text, sensitivity=["b", "e", "u"])
    assert run.dq is not None
    assert run.dv is not None
    assert run.v[-1] == pytest.approx([0.22, 0], abs=1e-14)
    assert run.dv[-1] == pytest.approx(np.array([[-0.5, 0.44, -0.4], [0, 0, 0]]), abs=1e-13)
    assert run.dq[-1] == pytest.approx(run.dv[-1], abs=1e-13)
