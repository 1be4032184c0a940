"""The equilibrium or steady motion next to a model's initial values."""

from __future__ import annotations

from lagcli.analysis.local.active_set import ActiveSet
from lagcli.analysis.local.contact_mode import SwitchedModel
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.steady import SteadyProblem
from lagcli.analysis.local.steady_states import SteadyState, completed, none_found
from lagcli.analysis.local.steady_terms import Given, SteadyTerms
from lagcli.errors import NumericalError, UsageError
from lagcli.model.model import Model


def nearest_steady_state(model: Model, steady: Given) -> SteadyState:
    """Return the equilibrium, or steady motion, to which Newton's method leads from the start.

    With contacts, it is one that satisfies 0 ≤ φ ⊥ λ ≥ 0: see `ActiveSet`. Velocities that no
    motion with constant independent velocities has are those of a motion along symmetries.

    Raises
    ------
    UsageError
        A velocity cannot be held.
    ModelError, NumericalError
        There is no consistent start, or no equilibrium is found.
    """
    terms = SteadyTerms(model, steady)
    if model.switches:
        check_switching(model, terms)
        return ActiveSet(SwitchedModel(model), terms.held).nearest()
    local = LocalEquations(model)
    try:
        return _solved(terms.problem(local))
    except (NumericalError, UsageError) as error:
        if not (terms.plain and terms.held):
            raise
        try:
            return _solved(terms.relative(local))
        except (NumericalError, UsageError):
            raise error from None


def _solved(problem: SteadyProblem) -> SteadyState:
    """Return the solution from the start."""
    local = problem.local
    q = local.start.state.q
    found = problem.solve(q, local.p)
    if found is None:
        raise none_found(local, problem, q)
    return completed(problem, found)


def check_switching(model: Model, terms: SteadyTerms) -> None:
    """Raise UsageError for what steady motions of models with contacts cannot hold."""
    if not terms.plain:
        name = next(n for n, x in terms.named.items() if n in terms.others or x is None)
        raise UsageError(
            f"--steady {name}: steady motions of models with contacts, friction or limits, as"
            f' {model.name}, hold velocities of coordinates, as in --steady "phi\'=10"'
        )
