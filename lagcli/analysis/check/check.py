"""Analysis of a model at its initial state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import symengine as se

from lagcli.analysis.check.integrability import Integrability, check_integrability
from lagcli.analysis.check.rank import RankCheck, check_rank
from lagcli.analysis.check.time_scales import TimeScales, time_scales
from lagcli.analysis.check.units import UnitReport, report_units
from lagcli.analysis.check.unused import unused_parameters
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.constraints.random_states import random_states
from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.lowering.lower import lower
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.lagrange import Equations, derive
from lagcli.equations.symmetry.conserved import Conserved, conserved_quantities, generalized
from lagcli.equations.symmetry.units import conserved_unit
from lagcli.model.hints import Hint, hints
from lagcli.model.model import TIME, Model, check_is_model
from lagcli.simulations.contacts import model_at_start
from lagcli.simulations.momenta import distinct
from lagcli.simulations.start import find_start, freedom_at
from lagcli.simulations.threads import one_thread


@dataclass(frozen=True, eq=False)
class Check:
    """Analysis of a model at its initial state.

    Parameters
    ----------
    equations : Equations
        Equations of the model.
    start : ConsistentState
        The consistent initial state, and the values adjusted for it.
    index : int
        The index of the differential-algebraic equations in the coordinates and multipliers: 3 with
        position constraints, 2 with velocity constraints alone, 0 without constraints.
    rank : RankCheck
        The rank of B, the degrees of freedom, and the uniqueness of the multipliers.
    integrability : Integrability
        What is integrable of the velocity constraints.
    conserved : Conserved
        The conserved quantities, without momenta that vanish on the constraints.
    conserved_values : mapping of str to float
        Their values at the initial state, in SI units.
    conserved_units : mapping of str to str
        Their SI units, as far as they are known.
    steady : bool or None
        Whether the initial state is an equilibrium or a steady motion; None for large models, and
        at and next to singular configurations.
    time_scales : TimeScales or None
        Time scales of small motions about the initial state, where it is steady. About other
        states they would describe a frozen instant.
    units : UnitReport
        Units as given and derived, and what disagrees.
    unused_parameters : mapping of str to list of str
        Parameters that nothing in the model file uses, with a similar name that is used, if any.
    hints : tuple of Hint
        What is probably meant otherwise: angles in degrees, kinetic energies without 1/2.
    """

    equations: Equations
    start: ConsistentState
    index: int
    rank: RankCheck
    integrability: Integrability
    conserved: Conserved
    conserved_values: Mapping[str, float]
    conserved_units: Mapping[str, str]
    steady: bool | None
    time_scales: TimeScales | None
    units: UnitReport
    unused_parameters: Mapping[str, list[str]]
    hints: tuple[Hint, ...]

    @property
    def degrees_of_freedom(self) -> int:
        """k − rank B at the initial state."""
        return self.rank.freedom.degrees


def check(model: Model) -> Check:
    """Check a model at its consistent initial state.

    Parameters
    ----------
    model : Model

    Returns
    -------
    Check

    Raises
    ------
    ModelError
        If the fixed initial values contradict the constraints.
    NumericalError
        There is no initial state: none is consistent near the guesses, a value there is not
        finite, or a coordinate has no inertia.
    """
    check_is_model(model, "check")
    equations = derive(model)
    system = lower(equations)
    with one_thread():
        start = find_start(equations, system, model.settings.t_start or 0.0)
        freedom = freedom_at(equations, system, start)
        held, there = equations, start
        if freedom.held is not None:  # valid at the initial state, for all local analyses
            held = derive(model_at_start(model, freedom.held))
            system = lower(held)
            there = start._replace(rank=freedom.rank or 0, elimination=None)
        states = random_states(system, there)
        rank = check_rank(system, there, freedom, states)
        singular = rank.special or bool(rank.near_singular)
        scales = None if singular else time_scales(system, there)
        steady = None if scales is None else _is_steady(held, system, there)
        analysis = conserved_quantities(equations)
        found = analysis.quantities
        if freedom.held is None:  # others hold while constraints switch
            found = distinct(equations, system, start, lambda: states, found)
    conserved = analysis._replace(quantities=tuple(generalized(equations, q) for q in found))
    return Check(
        equations=equations,
        start=start,
        index=_index(equations),
        rank=rank,
        integrability=check_integrability(held, there, states),
        conserved=conserved,
        conserved_values=_values(equations, conserved, start),
        conserved_units={
            q.name: unit
            for q in conserved.quantities
            if (unit := conserved_unit(model, q)) is not None
        },
        steady=steady,
        time_scales=scales if steady else None,
        units=report_units(model),
        unused_parameters=unused_parameters(model),
        hints=hints(model),
    )


def _is_steady(equations: Equations, system: System, start: ConsistentState) -> bool:
    # fixed values need not satisfy the constraint of a contact that is closed by `closed`
    local = LocalEquations(equations.model, equations, system, start)
    point = local.moving(start.state, start.rank)
    return local.is_steady(point, local.tangent(point, local.constant_velocities(point)))


def _index(equations: Equations) -> int:
    if any(c.position is not None for c in equations.constraints):
        return 3
    return 2 if equations.constraints else 0


def _values(equations: Equations, conserved: Conserved, start: ConsistentState) -> dict[str, float]:
    eq, s = equations, start.state
    parameters = [se.Symbol(name) for name in eq.model.parameters]
    expressions = [q.expression for q in conserved.quantities]
    tape = ScalarTape(
        compile_tape(expressions, [TIME, *eq.q, *eq.v], parameters, input_functions(eq.model))
    )
    values = tape((s.t, *s.q.tolist(), *s.v.tolist(), *s.p))
    return {q.name: float(x) for q, x in zip(conserved.quantities, values, strict=True)}
