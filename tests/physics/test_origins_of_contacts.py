"""Contacts that strike, touch and rest without forces, wherever the origin of their gaps is."""

from __future__ import annotations

import numpy as np
import pytest
from impact_laws import ImpactLaw, ImpactProblem, resolve_impact

import lagcli
from lagcli.arrays import Array
from lagcli.engine.core.contact_problem import ContactLaw
from lagcli.trajectory.trajectory import Trajectory

LAWS: tuple[ImpactLaw, ...] = ("poisson", "newton", "sequential")


def coupled(rng: np.random.Generator, n: int) -> Array:
    """Return a mass matrix."""
    a = rng.normal(size=(n, n))
    mass = a @ a.T + rng.uniform(0.05, 1.0) * np.eye(n)
    return np.asarray(mass / mass.max())


def run(
    mass: Array, q: Array, v: Array, restitution: Array, law: str, origin: float, t_end: float
) -> Trajectory:
    """Simulate bodies with gaps x[i] − origin; no force acts."""
    n = len(q)
    pairs = [(i, j) for i in range(n) for j in range(n)]
    kinetic = " + ".join(f"({mass[i, j] / 2})*x{i}'*x{j}'" for i, j in pairs)
    floor = [f"{{expr: x{i} >= {origin}, restitution: {restitution[i]}}}" for i in range(n)]
    contacts = "".join(f"  c{i}: {floor[i]}\n" for i in range(n))
    start = ", ".join(f"x{i}: {q[i] + origin}, x{i}': {v[i]}" for i in range(n))
    found = lagcli.simulate(
        lagcli.load_text(f"""
coordinates: [{", ".join(f"x{i}" for i in range(n))}]
T: "{kinetic}"
constraints:
{contacts}
initial: {{{start}}}
simulation: {{t_end: {t_end}, samples: 5, impacts: {law}}}
""")
    )
    assert found.status == "completed", found.message
    return found


def after_impacts(mass: Array, v: Array, restitution: Array, law: ImpactLaw) -> Array:
    """Return the velocities after impacts at one instant, where all gaps are zero."""
    inverse, none = np.linalg.inv(mass), 1e-9 * np.abs(v).max()
    while (v < -none).any():
        rows = np.flatnonzero(v <= none)
        block = np.ix_(rows, rows)
        unilateral, before = np.full(len(rows), ContactLaw.UNILATERAL), np.minimum(v[rows], 0.0)
        no_friction = np.zeros((len(rows), len(rows)))
        impact = ImpactProblem(inverse[block], before, unilateral, restitution[rows], no_friction)
        result = resolve_impact(impact, law)
        assert result is not None
        v = v + inverse[:, rows] @ result.impulse
    return v


@pytest.mark.parametrize("seed", [2, 6, 11, 130, 258, 529, 538])
def test_velocities_after_impacts_at_one_instant(seed: int) -> None:
    """Of coupled bodies, some of which touch without a velocity, or rest after a plastic impact;
    in other units of length and time, too.
    """
    rng = np.random.default_rng([1, seed])
    n, law = int(rng.integers(2, 5)), LAWS[seed % 3]
    mass, restitution = coupled(rng, n), np.where(rng.random(n) < 0.5, 0.0, rng.random(n))
    length, time = 10.0 ** rng.integers(-4, 5, size=2)
    v = np.where(rng.random(n) < 0.4, 0.0, rng.normal(size=n)) * length / time
    v[0] = -length / time
    expected = after_impacts(mass, v, restitution, law)
    for origin in (0.0, length):
        found = run(mass, np.zeros(n), v, restitution, law, origin, time)
        np.testing.assert_allclose(found.v[-1], expected, atol=1e-9 * length / time)
        np.testing.assert_allclose(
            found.q[-1] - origin, expected * time, atol=1e-9 * length, rtol=1e-9
        )


@pytest.mark.parametrize("seed", [3, 15, 97, 255, 343])
def test_later_impacts_of_contacts_that_touch(seed: int) -> None:
    """A gap of zero is closed, also where no coordinate says how large a gap is."""
    rng = np.random.default_rng([2, seed])
    n, law = int(rng.integers(2, 5)), LAWS[seed % 3]
    mass, restitution = coupled(rng, n), np.where(rng.random(n) < 0.4, 0.0, rng.random(n))
    q = np.where(rng.random(n) < 0.5, 0.0, rng.random(n))
    v = np.where(q > 0.0, -rng.random(n), np.where(rng.random(n) < 0.6, 0.0, rng.normal(size=n)))
    at_zero = run(mass, q, v, restitution, law, 0.0, 3.0)
    beside = run(mass, q, v, restitution, law, 1.0, 3.0)
    np.testing.assert_allclose(at_zero.q, beside.q - 1.0, atol=1e-7)
    assert at_zero.events is not None
    assert beside.events is not None
    assert at_zero.events.kinds == beside.events.kinds
