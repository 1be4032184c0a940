"""Independent coordinates of a model at its consistent initial state."""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.engine.lowering import lower
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.reduction.partition import CoordinatePartition, values_at
from lagcli.equations.reduction.partition import partition as partition_at
from lagcli.simulations.contacts import refuse_switching
from lagcli.simulations.start import find_start


def partition(
    equations: Equations, independent: Sequence[str] | None = None
) -> CoordinatePartition:
    """Divide the coordinates into independent and dependent ones at the initial state.

    Parameters
    ----------
    equations : Equations
    independent : sequence of str, optional
        Names of the independent coordinates. By default those with fixed initial values, as far as
        the constraints determine the others.

    Returns
    -------
    CoordinatePartition

    Raises
    ------
    UsageError
        The named coordinates cannot be independent: an unknown name, a wrong number, or a singular
        choice.
    ModelError, NumericalError
        There is no consistent initial state.
    """
    refuse_switching(equations, "independent coordinates", nonlinear=True)
    model = equations.model
    start = find_start(equations, lower(equations), model.settings.t_start or 0.0).state
    values = values_at(model, start.t, start.q.tolist(), start.v.tolist(), start.p)
    return partition_at(equations, values, independent)
