"""Random contact problems and impacts with few contacts, strong friction and redundancy."""

from __future__ import annotations

import numpy as np

from lagcli.engine.core.contact_problem import ContactLaw
from tests.support.impact_laws import ImpactProblem


def random_impact(rng: np.random.Generator, restitution: float | None = None) -> ImpactProblem:
    """Return an impact of 1 to 4 contacts, with friction, on 1 to 6 coordinates.

    Parameters
    ----------
    rng : Generator
    restitution : float, optional
        That of all contacts; otherwise each has its own.
    """
    contacts, nq = rng.integers(1, 5), rng.integers(1, 7)
    root = rng.standard_normal((nq, nq))
    compliance = root @ root.T + 0.1 * np.eye(nq)
    jacobian = rng.standard_normal((2 * contacts, nq))
    if contacts > 1 and rng.random() < 0.3:  # a contact twice
        jacobian[2:4] = jacobian[:2] * rng.uniform(0.5, 2)
    velocity = rng.standard_normal(nq)
    normal = 2 * np.arange(contacts)
    jacobian[normal[jacobian[normal] @ velocity > 0]] *= -1
    matrix = jacobian @ compliance @ jacobian.T
    friction = np.zeros((2 * contacts, 2 * contacts))
    friction[normal + 1, normal] = rng.choice([0.0, 0.1, 0.5, 1.0, 2.0], contacts)
    coefficients = np.zeros(2 * contacts)
    coefficients[normal] = (
        rng.choice([0.0, 0.3, 0.7, 1.0], contacts) if restitution is None else restitution
    )
    return ImpactProblem(
        (matrix + matrix.T) / 2,
        jacobian @ velocity,
        np.array([ContactLaw.UNILATERAL, ContactLaw.LIMITED] * int(contacts)),
        coefficients,
        friction,
    )
