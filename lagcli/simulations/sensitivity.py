"""Runs with derivatives of the motion with respect to parameters and initial values."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from lagcli.engine.constraints.initial import (
    ConsistentState,
    Spin,
    consistent_state,
    determined,
    free_directions,
    rates_of_spin,
    spin_of,
)
from lagcli.engine.contract import IntegrationRequest, Outcome
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.tangent import lower_tangent
from lagcli.engine.sensitivity.integration import Derivatives, Sink, TangentProblem
from lagcli.engine.sensitivity.start import (
    ContradictingStart,
    StartDerivatives,
    start_derivatives,
)
from lagcli.engine.system import State, System
from lagcli.equations.derivation.lagrange import Equations
from lagcli.errors import Diagnostic, ModelError, UsageError
from lagcli.model.model import Model
from lagcli.settings.methods import METHODS
from lagcli.settings.settings import Settings
from lagcli.simulations.directions import Directions
from lagcli.simulations.start import spins_of

if TYPE_CHECKING:
    from lagcli.engine.sensitivity.switched_run import SwitchedProblem
    from lagcli.simulations.simulation import Simulation


#: Weights of central differences of sixth order, at 1, 2 and 3 steps, and the step relative to θ's
#: scale: their error is about 1e-18 for a smooth initial state, and that of rounding 1e-13.
_WEIGHTS, _STEP = (3 / 4, -3 / 20, 1 / 60), 1e-3


@dataclass(frozen=True, eq=False)
class SensitivityRun:
    """The derivatives of one run; made by `sensitivity_run`.

    Parameters
    ----------
    sensitivity : Sensitivity
    start : StartDerivatives
    """

    sensitivity: Sensitivity
    start: StartDerivatives

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters and initial values."""
        return self.sensitivity.directions.names

    @property
    def no_derivatives(self) -> Derivatives:
        """Derivatives of an empty block of samples."""
        nq, nc, n = *self.sensitivity.system.counts[:2], len(self.names)
        q, multipliers = np.empty((0, nq, n)), np.empty((0, nc, n))
        return Derivatives(q, q, q, multipliers)

    def integrate(
        self,
        request: IntegrationRequest,
        sink: Sink,
        progress: Callable[[float], None] | None = None,
    ) -> Outcome:
        """Integrate; see `Sensitivity.integrate`."""
        values = self.sensitivity.directions.values.tolist()
        return self.sensitivity.integrate(request, self.start, values, sink, progress)


def sensitivity_run(simulation: Simulation, names: tuple[str, ...]) -> SensitivityRun:
    """Prepare the derivatives of a simulation.

    Parameters
    ----------
    simulation : Simulation
    names : tuple of str
        Result of `directions.direction_names`.

    Raises
    ------
    UsageError, ModelError
        See `Sensitivity` and `Sensitivity.start`.
    """
    sensitivity = Sensitivity(simulation.equations, simulation.system, simulation.settings, names)
    start = sensitivity.start(simulation.start, sensitivity.directions.values.tolist())
    return SensitivityRun(sensitivity, start)


def _refuse_clocks(model: Model, directions: Directions) -> None:
    """Reject derivatives with respect to quantities on which clocks of events depend."""
    for event in model.events:
        if event.clock is None:
            continue
        needs = {x.name for x in (event.clock.period + event.clock.offset).free_symbols}
        for name, rates in zip(directions.names, directions.rates, strict=True):
            if needs.intersection(rates):
                raise UsageError(
                    Diagnostic(
                        "not-supported",
                        f"derivatives by `{name}` are not computed, since the clock of event"
                        f" `{event.name}` depends on it",
                        event.clock.location,
                        "compare runs with different values instead",
                    )
                )


class Sensitivity:
    """A model's motion with its derivatives, for one or many values of parameters.

    Parameters
    ----------
    equations, system
        The equations and the System of a model.
    settings : Settings
        Complete settings.
    names : tuple of n str
        Parameters and initial values from `directions.direction_names`.
    many_runs : bool
        Whether to optimize for many runs.

    Raises
    ------
    UsageError
        The method needs derivatives that are not available, or a force jumps inside a step.
    """

    def __init__(
        self,
        equations: Equations,
        system: System,
        settings: Settings,
        names: Sequence[str],
        *,
        many_runs: bool = False,
    ):
        if settings.method in METHODS and METHODS[settings.method].exact:
            raise UsageError(
                f"{settings.method} needs second derivatives for sensitivities, which are not"
                " formed; give --method Radau for stiff motion, or auto"
            )
        self.equations, self.system, self.settings = equations, system, settings
        self.directions = Directions(equations.model, tuple(names))
        _refuse_clocks(equations.model, self.directions)
        self._evaluator = Evaluator(system, tuple(equations.model.parameter_values.values()))
        self._determines: bool | None = None
        self.tangent = lower_tangent(equations, self.directions.rates)
        if system.has_kinks:
            self._refuse_hidden_jumps()
        self.problem: TangentProblem | SwitchedProblem
        if self._switches():
            from lagcli.engine.sensitivity.switched_run import SwitchedProblem

            self.problem = SwitchedProblem(system, names, self.directions.scales)
        else:
            self.problem = TangentProblem(
                system, self.tangent, names, self.directions.scales, many_runs=many_runs
            )

    def _refuse_hidden_jumps(self) -> None:
        from lagcli.simulations.surfaces import has_hidden_jumps

        if has_hidden_jumps(self.system, tuple(self.equations.model.parameter_values.values())):
            raise UsageError(
                "sensitivities and fits need the times at which forces jump, but one jumps next"
                " to a root, power or logarithm, or with a multiplier in `floor` or `ceil`, where"
                " steps do not end; smooth it, for instance with `tanh`"
            )

    def _switches(self) -> bool:
        """Return whether derivatives may jump: at contacts, events, and jumps of forces."""
        system = self.system
        if system.switching is not None or not system.has_kinks:
            return system.switching is not None
        from lagcli.engine.switching.kinks import frozen_of
        from lagcli.simulations.surfaces import has_jumps

        frozen = frozen_of(system)
        if frozen is None:
            return False
        p = tuple(self.equations.model.parameter_values.values())
        return any(kink.timed for kink in frozen.kinks) or has_jumps(system, p)

    def start(self, start: ConsistentState, values: Sequence[float]) -> StartDerivatives:
        """Return the derivatives of a consistent initial state with respect to θ / scale.

        Parameters
        ----------
        start : ConsistentState
        values : sequence of n float
            Values of θ at this state.

        Raises
        ------
        ModelError
            The fixed initial values satisfy the constraints only for these values of θ.
        """
        given = self.directions.given(values)
        fixed_q, fixed_v = self.directions.fixed
        try:
            derivatives = start_derivatives(
                self._evaluator.with_parameters(start.state.p),
                self.tangent,
                start.state,
                given,
                fixed_q,
                fixed_v,
                self.spins,
                self.directions.state(start.state.t, values),
            )
        except ContradictingStart as error:
            raise self._contradiction(error) from None
        if start.moved and not self.determined(start):
            return self._differences(start, values)
        return derivatives

    def integrate(
        self,
        request: IntegrationRequest,
        start: StartDerivatives,
        values: Sequence[float],
        sink: Sink,
        progress: Callable[[float], None] | None = None,
    ) -> Outcome:
        """Integrate for values of θ; see `TangentProblem.integrate`."""
        if isinstance(self.problem, TangentProblem):
            return self.problem.integrate(request, start, sink, progress)
        parameters = self.directions.parameters(values)
        return self.problem.integrate(request, start, parameters, sink, progress)

    def consistent(self, given: State, near: ConsistentState | None = None) -> ConsistentState:
        """Return the consistent initial state for given values.

        Parameters
        ----------
        given : State
            State from `Directions.state`.
        near : ConsistentState, optional
            Initial state for similar values. If the constraints determine the free initial values,
            the search starts from it and stays on its branch.

        Raises
        ------
        NoStart
        """
        if near is not None and self.determined(near):
            fixed_q, fixed_v = self.directions.fixed
            q = np.where(fixed_q, given.q, near.state.q)
            v = np.where(fixed_v, given.v, near.state.v)
            for spin in self.spins:  # at the orientation from which the search begins
                places = list(spin.places)
                turn = spin_of(given.q[places], given.v[places])
                v[places] = rates_of_spin(q[places]) @ turn
            given = State(given.t, q, v, given.p)
        return consistent_state(
            self.system, given, *self.directions.fixed, self._evaluator, self.spins
        )

    def determined(self, start: ConsistentState) -> bool:
        """Return whether the constraints determine the initial values that are not fixed.

        Otherwise, the result of the search depends on the path from the guesses. It is computed
        once: the ranks are structural.
        """
        if self._determines is None:
            self._determines = self._leaves_no_choice(start)
        return self._determines

    def _leaves_no_choice(self, start: ConsistentState) -> bool:
        evaluator, fixed = self._evaluator.with_parameters(start.state.p), self.directions.fixed
        of_q, of_v = determined(evaluator, start.state, *fixed, self.spins)
        free_v = free_directions(self.spins, fixed[1], start.state.q).any(axis=1)
        return bool(of_q[~np.asarray(fixed[0], bool)].all() and of_v[free_v].all())

    @cached_property
    def spins(self) -> tuple[Spin, ...]:
        """The quaternions whose initial angular velocities are given."""
        return spins_of(self.equations.model, self.directions.names)

    def _differences(self, start: ConsistentState, values: Sequence[float]) -> StartDerivatives:
        """Return the derivatives of the computed initial state, by differences of sixth order."""
        directions, n = self.directions, len(values)
        nq = len(self.system.coordinates)
        derivatives = StartDerivatives(np.zeros((n, nq)), np.zeros((n, nq)))
        for i in range(n):
            for step in (1, -1, 2, -2, 3, -3):
                beside = np.array(values, dtype=float)
                beside[i] += step * _STEP * directions.scales[i]
                given = directions.state(start.state.t, beside.tolist())
                near = self.consistent(given).state
                weight = _WEIGHTS[abs(step) - 1] * math.copysign(1.0, step) / _STEP
                derivatives.q[i] += weight * near.q
                derivatives.v[i] += weight * near.v
        return derivatives

    def _contradiction(self, error: ContradictingStart) -> ModelError:
        model, names = self.equations.model, self.directions.names
        constraint, name = model.constraints[error.constraint], names[error.direction]
        velocity = error.level == "velocity"
        symbols = constraint.expression.free_symbols
        prime = "'" if velocity else ""
        stuck = [
            f"{q}{prime}"
            for q in model.coordinate_names
            if any(s.name.rstrip("'") == q for s in symbols) and model.initial[f"{q}{prime}"].fixed
        ]
        other = next((x for x in stuck if x not in names), None)
        differentiated = velocity and constraint.kind == "holonomic"
        level = ", differentiated in time," if differentiated else ""
        help_ = f"name other quantities than `{name}`"
        if other is not None:
            entry = model.initial[other]
            help_ = (
                f"free an initial value that follows, for instance"
                f" `{other}: {{guess: {entry.value:.6g}}}`"
            )
        return ModelError(
            [
                Diagnostic(
                    "inconsistent-start",
                    f"the fixed initial values satisfy the constraint `{constraint.name}`{level}"
                    f" for this value of `{name}` only: the start has no derivative with respect"
                    " to it",
                    model.initial[other].location if other else constraint.location,
                    help_,
                )
            ]
        )
