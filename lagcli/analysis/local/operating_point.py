"""OperatingPoint: the state about which a model is linearized."""

from __future__ import annotations

from dataclasses import dataclass

from lagcli.analysis.local.contact_status import ContactStatus
from lagcli.analysis.local.gradients import Point
from lagcli.analysis.local.tangent import Tangent
from lagcli.arrays import Array


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
    frame : (nq, nq) array or None
        Of a motion along symmetries, the matrix F of q̇ = F q + b: deviations are those for an
        observer who moves along, δq = e^(F t) x.
    neutral : int
        The dimension of the motions along all symmetries.
    """

    name: str
    point: Point
    tangent: Tangent
    steady: bool
    contacts: tuple[ContactStatus, ...] = ()
    frame: Array | None = None
    neutral: int = 0
