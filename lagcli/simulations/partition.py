"""Independent coordinates of a model at its consistent initial state."""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.reduction.partition import CoordinatePartition, values_at
from lagcli.equations.reduction.partition import partition as partition_at
from lagcli.errors import check_argument
from lagcli.simulations.contacts import refuse_switching
from lagcli.simulations.start import ModelStart


def partition(
    equations: Equations, independent: Sequence[str] | None = None
) -> CoordinatePartition:
    """Divide the coordinates into independent and dependent ones at the initial state.

    Parameters
    ----------
    equations : Equations
    independent : sequence of str, optional
        Names of the independent coordinates. By default, those with fixed initial values, if the
        constraints determine the others.

    Returns
    -------
    CoordinatePartition

    Raises
    ------
    UsageError
        The named coordinates cannot be independent: an unknown name, a wrong number of names, or a
        singular choice.
    ModelError, NumericalError
        There is no consistent initial state.
    """
    check_argument("partition", equations, Equations, "lagcli.derive returns them")
    return partition_of(ModelStart(equations), independent)


def partition_of(
    start: ModelStart, independent: Sequence[str] | None = None
) -> CoordinatePartition:
    """Divide the coordinates of a model at its initial state; see `partition`."""
    equations = start.equations
    refuse_switching(equations, "independent coordinates", nonlinear=True)
    state = start.consistent.state
    values = values_at(equations.model, state.t, state.q.tolist(), state.v.tolist(), state.p)
    return partition_at(equations, values, independent)
