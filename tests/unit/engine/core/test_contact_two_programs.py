"""The core's contact problems and impacts beside those of an independent program: equal motions."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from core_parts import solve_impact
from random_impacts import random_impact

from lagcli.engine.core.contact_problem import ContactProblem
from tests.support.contact_problems import contact_motions
from tests.support.impact_laws import ImpactLaw, ImpactProblem, resolve_impact

LAWS = get_args(ImpactLaw)


def compare(impact: ImpactProblem, law: ImpactLaw) -> bool | None:
    """Return whether the motions after an impact are equal; None where they are not unique."""
    nothing = np.zeros(len(impact.before))
    start = ContactProblem(
        impact.matrix,
        impact.before,
        impact.laws,
        nothing,
        nothing,
        impact.friction,
        impact.friction,
    )
    if len(contact_motions(start)) != 1:
        return None
    found, _, after, loss = solve_impact(*impact, LAWS.index(law))
    expected = resolve_impact(impact, law)
    if found == 2:
        return None
    if (expected is None) != (found == 0):
        assert (
            law == "sequential"
        )  # what is left of a sequence without end, after hundreds of impacts
        return False
    if expected is None:
        return None
    size = np.abs(impact.before).max()
    energy = size * np.abs(expected.impulse).max()
    return bool(
        np.abs(after - expected.after).max() < 1e-6 * size
        and abs(loss.sum() - expected.loss.sum()) < 1e-6 * energy
    )


def check(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    answers: dict[str, list[bool]] = {law: [] for law in LAWS}
    for k in range(count):
        law = LAWS[k % len(LAWS)]
        equal = compare(random_impact(rng), law)
        if equal is not None:
            answers[law].append(equal)
    assert sum(map(len, answers.values())) > 0.7 * count
    assert all(answers["newton"])
    # two contacts in one place, with different restitution: the compression has one motion, but the
    # share of each, which restitution returns, depends on the modes that are found first
    assert answers["poisson"].count(False) <= count // 300
    # sequences without end, of hundreds of impacts, let rounding grow
    assert answers["sequential"].count(False) <= count // 300


def test_random_impacts() -> None:
    check(50, 7)


@pytest.mark.slow
def test_many_random_impacts() -> None:
    check(20_000, 8)
