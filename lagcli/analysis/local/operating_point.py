"""OperatingPoint: the state about which a model is linearized."""

from __future__ import annotations

from dataclasses import dataclass

from lagcli.analysis.local.contact_status import ContactStatus
from lagcli.analysis.local.gradients import Point
from lagcli.analysis.local.tangent import Tangent


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """A point on the constraints, with the tangent space there.

    Parameters
    ----------
    name : str
        Description, such as "the start" or "the state at t = 2 s".
    point : Point
        t, q, v, a, λ and the parameters' values.
    tangent : Tangent
    steady : bool
        Whether the independent velocities are constant: an equilibrium or a steady motion.
    contacts : tuple of ContactStatus
        The states of contacts, limits and friction there; the linear model is that of this mode.
    """

    name: str
    point: Point
    tangent: Tangent
    steady: bool
    contacts: tuple[ContactStatus, ...] = ()
