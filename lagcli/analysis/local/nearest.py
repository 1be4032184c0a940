"""The equilibrium or steady motion next to a model's initial values."""

from __future__ import annotations

from collections.abc import Mapping

from lagcli.analysis.local.active_set import ActiveSet
from lagcli.analysis.local.contact_mode import SwitchedModel
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.steady import SteadyProblem
from lagcli.analysis.local.steady_states import (
    SteadyState,
    completed,
    held_velocities,
    none_found,
)
from lagcli.model.model import Model


def nearest_steady_state(model: Model, steady: Mapping[str, float]) -> SteadyState:
    """Return the equilibrium, or steady motion, to which Newton's method leads from the start.

    With contacts, it is one that satisfies 0 ≤ φ ⊥ λ ≥ 0: see `ActiveSet`.

    Raises
    ------
    UsageError
        A velocity cannot be held.
    ModelError, NumericalError
        There is no consistent start, or no equilibrium is found.
    """
    held = held_velocities(model.coordinate_names, steady)
    if model.switches:
        return ActiveSet(SwitchedModel(model), held).nearest()
    local = LocalEquations(model)
    problem = SteadyProblem(local, held)
    q = local.start.state.q
    found = problem.solve(q, local.p)
    if found is None:
        raise none_found(local, problem, q)
    return completed(problem, found)
