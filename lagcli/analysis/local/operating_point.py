"""OperatingPoint: the state about which a model is linearized."""

from __future__ import annotations

from dataclasses import dataclass

from lagcli.analysis.local.gradients import Point
from lagcli.analysis.local.tangent import Tangent


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """A point on the constraints, with the motions that they allow near it.

    Parameters
    ----------
    name : str
        What it is, as in "the start" or "the state at t = 2 s".
    point : Point
        t, q, v, a, λ and the parameters' values.
    tangent : Tangent
    steady : bool
        Whether the independent velocities stay as they are: an equilibrium or a steady motion.
    """

    name: str
    point: Point
    tangent: Tangent
    steady: bool
