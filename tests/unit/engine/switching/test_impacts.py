"""Impact laws: closed forms, and what they promise of random impacts."""

import numpy as np
import pytest

from lagcli.engine.core.contact_problem import ContactLaw
from tests.support.impact_laws import ImpactLaw, ImpactProblem, resolve_impact
from tests.support.random_impacts import random_impact


def cradle(balls: int) -> ImpactProblem:
    """Return the impact of the first of equal balls on the others, which touch, e = 1."""
    rows = np.diff(np.eye(balls), axis=0)
    velocity = np.eye(balls)[0]
    n = balls - 1
    return ImpactProblem(
        rows @ rows.T,
        rows @ velocity,
        np.full(n, int(ContactLaw.UNILATERAL)),
        np.ones(n),
        np.zeros((n, n)),
    )


@pytest.mark.parametrize(
    ("balls", "law", "after"),
    [
        (3, "poisson", [-1 / 3, 2 / 3, 2 / 3]),
        (3, "newton", [-1 / 3, 2 / 3, 2 / 3]),
        (3, "sequential", [0, 0, 1]),
        (4, "poisson", [-1 / 2, 1 / 2, 1 / 2, 1 / 2]),
        (5, "newton", [-0.6, 0.4, 0.4, 0.4, 0.4]),
        (5, "sequential", [0, 0, 0, 0, 1]),
    ],
)
def test_newton_s_cradle(balls: int, law: ImpactLaw, after: list[float]) -> None:
    """Values of tests/benchmark/contact/newtons_cradle.yaml, in rational arithmetic."""
    found = resolve_impact(cradle(balls), law)
    assert found is not None
    impulses = np.diff(np.concatenate([[0.0], found.impulse, [0.0]]))
    np.testing.assert_allclose(np.eye(balls)[0] - impulses, after, atol=1e-12)
    assert abs(found.loss.sum()) < 1e-12


def kane_levinson() -> ImpactProblem:
    """Return the double pendulum of tests/benchmark/contact/kane_levinson.yaml."""
    a, b = np.radians(20), np.radians(30)
    mass = np.array([[4 / 3, np.cos(a - b) / 2], [np.cos(a - b) / 2, 1 / 3]])
    rows = np.array([[np.sin(a), np.sin(b)], [np.cos(a), np.cos(b)]])
    friction = np.zeros((2, 2))
    friction[1, 0] = 0.5
    return ImpactProblem(
        rows @ np.linalg.inv(mass) @ rows.T,
        rows @ np.array([-0.1, -0.2]),
        np.array([ContactLaw.UNILATERAL, ContactLaw.LIMITED]),
        np.array([0.7, 0.0]),
        friction,
    )


def test_kane_and_levinson_s_double_pendulum() -> None:
    found = resolve_impact(kane_levinson(), "poisson")
    assert found is not None
    np.testing.assert_allclose(
        found.impulse, [0.1288789629522897144735343, 0.02913926649880179502501691], rtol=1e-12
    )
    newton = resolve_impact(kane_levinson(), "newton")
    assert newton is not None
    assert -newton.loss.sum() == pytest.approx(0.04074390455344531033440829, rel=1e-10)


@pytest.mark.parametrize("law", ["poisson", "newton", "sequential"])
def test_one_contact_returns_with_its_coefficient(law: ImpactLaw) -> None:
    rng = np.random.default_rng(0)
    for e in (0.0, 0.3, 1.0):
        impact = random_impact(rng, e).of_rows(np.array([0]), np.array([-2.0]))
        found = resolve_impact(impact, law)
        assert found is not None
        assert found.after[0] == pytest.approx(2.0 * e)
        assert found.loss[0] == pytest.approx((1 - e**2) * 2 / impact.matrix[0, 0])


def check(impact: ImpactProblem, law: ImpactLaw) -> float | None:
    """Hold a random impact to what all laws promise; return its relative loss of energy."""
    found = resolve_impact(impact, law)
    if found is None:
        return None
    normal = impact.laws == ContactLaw.UNILATERAL
    size = float(np.abs(impact.before).max())
    unit = float(np.abs(found.impulse).max()) or 1.0
    np.testing.assert_allclose(
        found.after, impact.before + impact.matrix @ found.impulse, atol=1e-9 * size
    )
    assert found.after[normal].min() > -1e-7 * size
    assert found.impulse[normal].min() > -1e-7 * unit
    excess = np.abs(found.impulse) - impact.friction @ np.abs(found.impulse)
    if law == "newton":  # of one phase
        assert excess[~normal].max() < 1e-7 * unit
    if law != "sequential":
        energy = -(found.impulse @ (impact.before + found.after)) / 2
        assert found.loss.sum() == pytest.approx(energy, abs=1e-9 * unit * size)
    return float(found.loss.sum() / (unit * size))


def gained(law: ImpactLaw, count: int, seed: int, same: bool) -> tuple[int, int]:
    """Return how many of random impacts gain energy, and how many have no solution."""
    rng = np.random.default_rng(seed)
    losses = [
        check(random_impact(rng, float(rng.choice([0.0, 0.3, 0.7, 1.0])) if same else None), law)
        for _ in range(count)
    ]
    return sum(x is not None and x < -1e-8 for x in losses), losses.count(None)


def test_poisson_s_law_with_one_coefficient_never_gains_energy() -> None:
    assert gained("poisson", 40, 1, same=True) == (0, 0)


def test_newton_s_law_with_friction_gains_energy_now_and_then() -> None:
    many, _ = gained("newton", 40, 2, same=True)
    assert many > 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_poisson_s_law_on_ten_thousand_impacts(seed: int) -> None:
    assert gained("poisson", 10_000, seed, same=True) == (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "count"), [("newton", 10_000), ("sequential", 1_000)])
def test_other_laws_on_many_impacts(law: ImpactLaw, count: int) -> None:
    """A sequence of Poisson's impacts of one contact each gains nothing either."""
    many, none = gained(law, count, 3, same=True)
    if law == "sequential":
        assert (many, none) == (0, 0)


def test_an_impulse_that_is_zero_except_for_rounding_is_not_returned() -> None:
    """A contact twice, of which least norm leaves −3e-10 to one that another one relieves."""
    rng = np.random.default_rng(0)
    for _ in range(4512):
        impact = random_impact(rng, float(rng.choice([0.0, 0.3, 0.7, 1.0])))
    loss = check(impact, "poisson")
    assert loss is not None
    assert loss >= 0
