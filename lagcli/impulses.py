"""Impulses of constraint forces along a trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lagcli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Impulses:
    """Integrals of multipliers over time.

    Parameters
    ----------
    by_constraint : dict of str to float
        ∫ λ dt, by the trapezoidal rule.
    """

    by_constraint: dict[str, float]


def impulses(trajectory: Trajectory) -> Impulses:
    """Return the impulses ∫ λ dt of a run."""
    found = np.trapezoid(trajectory.multipliers, trajectory.time, axis=0)
    return Impulses(dict(zip(trajectory.constraints, found.tolist(), strict=True)))
