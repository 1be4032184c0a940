"""Comparison of two models of one system: their motions and multipliers.

On the constraints, L and L + Σ φ_β F_β have the same motion: the Lagrangian derivative of φ F is
-F ∂φ/∂q there. The second model's multipliers are λ - F. F is found at each sample from the
derivatives of the difference of the two Lagrangians, which equal Bᵀ F.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import symengine as se

from lagcli.arrays import Array
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.tape.inputs import InputFunctions
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.derivation.motion import Motion
from lagcli.errors import UsageError
from lagcli.model import model as symbols
from lagcli.model.model import Model, check_is_model
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import Simulation, prepare
from lagcli.trajectory.trajectory import Trajectory

#: Relative difference that counts as zero, given the errors of both runs.
_EQUAL = 1e-6


@dataclass(frozen=True, eq=False)
class QuantityDifference:
    """The largest difference of a quantity of both models.

    Parameters
    ----------
    name : str
    difference : float
        Largest difference at a sample, in SI units.
    time : float
        Time of that sample, s.
    size : float
        The largest value in the first model.
    """

    name: str
    difference: float
    time: float
    size: float


@dataclass(frozen=True, eq=False)
class ModelComparison:
    """Runs of two models, and their differences.

    Parameters
    ----------
    models : tuple of two Models
    first, second : Trajectory
        Their runs.
    coordinates, multipliers, outputs : tuples of QuantityDifference
        Of the names that both models have.
    only_first, only_second : tuples of str
        Coordinates and multipliers (``lambda.NAME``) of only one of the models.
    explained : mapping of str to float
        Multipliers that differ because the Lagrangians differ by φ F, with the largest deviation of
        the change of λ from -F, in SI units.
    """

    models: tuple[Model, Model]
    first: Trajectory
    second: Trajectory
    coordinates: tuple[QuantityDifference, ...]
    multipliers: tuple[QuantityDifference, ...]
    outputs: tuple[QuantityDifference, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]
    explained: Mapping[str, float]


def compare_models(
    first: Model, second: Model, settings: SettingsOverrides | None = None
) -> ModelComparison:
    """Simulate two models of one system, and compare their motions and multipliers.

    Parameters
    ----------
    first, second : Model
    settings : SettingsOverrides, optional
        For both models. Defaults are taken from the first model's ``simulation`` block.

    Returns
    -------
    ModelComparison

    Raises
    ------
    UsageError
        The models have no coordinate in common.
    ModelError, NumericalError
        As `lagcli.simulate`.
    """
    for model in (first, second):
        check_is_model(model, "compare_models")
    given = (settings or SettingsOverrides()).over(first.settings)
    common = [name for name in first.coordinate_names if name in second.coordinate_names]
    if not common:
        raise UsageError(
            f"{first.name} and {second.name} have no coordinate in common: nothing to compare"
        )
    ready = [prepare(model, given) for model in (first, second)]
    runs = [simulation.trajectory() for simulation in ready]
    count = min(len(run.time) for run in runs)
    one, other = (_Named(run, count) for run in runs)
    multipliers = one.against(other, "multipliers", "constraints")
    names = [
        {*x.coordinate_names, *(f"lambda.{c}" for c in x.constraint_names)} for x in (first, second)
    ]
    return ModelComparison(
        models=(first, second),
        first=runs[0],
        second=runs[1],
        coordinates=one.against(other, "q", "coordinates"),
        multipliers=multipliers,
        outputs=one.outputs_against(other),
        only_first=tuple(sorted(names[0] - names[1])),
        only_second=tuple(sorted(names[1] - names[0])),
        explained=_explained(ready, runs, count, multipliers),
    )


class _Named:
    """The samples of a run at the times of the other run."""

    def __init__(self, run: Trajectory, count: int):
        self.run, self.count = run, count

    def against(self, other: _Named, quantity: str, axis: str) -> tuple[QuantityDifference, ...]:
        mine, theirs = getattr(self.run, axis), getattr(other.run, axis)
        return tuple(
            self._difference(
                name,
                getattr(self.run, quantity)[: self.count, mine.index(name)],
                getattr(other.run, quantity)[: self.count, theirs.index(name)],
            )
            for name in mine
            if name in theirs
        )

    def outputs_against(self, other: _Named) -> tuple[QuantityDifference, ...]:
        return tuple(
            self._difference(name, values[: self.count], other.run.outputs[name][: self.count])
            for name, values in self.run.outputs.items()
            if name in other.run.outputs
        )

    def _difference(self, name: str, mine: Array, theirs: Array) -> QuantityDifference:
        off = np.abs(theirs - mine)
        worst = int(np.argmax(off)) if len(off) else 0
        return QuantityDifference(
            name,
            float(off[worst]) if len(off) else 0.0,
            float(self.run.time[worst]) if len(off) else 0.0,
            float(np.abs(mine).max(initial=0.0)),
        )


def _explained(
    ready: list[Simulation],
    runs: list[Trajectory],
    count: int,
    multipliers: tuple[QuantityDifference, ...],
) -> dict[str, float]:
    """Return the multipliers whose difference is -F, with the remaining deviation."""
    one, other = (simulation.equations for simulation in ready)
    values, others = one.model.parameter_values, other.model.parameter_values
    same = (
        one.model.coordinate_names == other.model.coordinate_names
        and one.model.constraint_names == other.model.constraint_names
        and len(ready[0].system.holonomic) == len(one.constraints)
        and all(values[name] == others[name] for name in values.keys() & others.keys())
    )
    differing = [x for x in multipliers if x.difference > _EQUAL * max(x.size, 1e-300)]
    if not same or not differing or not count:
        return {}
    slopes = _slopes(one, other, runs[0], count, {**values, **others})
    evaluator = Evaluator(ready[0].system, ready[0].start.state.p)
    factors = np.zeros((count, len(one.constraints)))
    left = 0.0
    for k in range(count):
        run = runs[0]
        rows = evaluator.constraints(float(run.time[k]), run.q[k], run.v[k]).jacobian
        factors[k] = np.linalg.lstsq(rows.T, slopes[k], rcond=None)[0]
        left = max(left, float(np.abs(rows.T @ factors[k] - slopes[k]).max()))
    if left > _EQUAL * float(np.abs(slopes).max()):
        return {}
    deviations = {}
    for x in differing:
        i = one.model.constraint_names.index(x.name)
        change = runs[1].multipliers[:count, i] - runs[0].multipliers[:count, i]
        deviation = float(np.abs(change + factors[:, i]).max())
        if deviation <= _EQUAL * max(x.size, x.difference):
            deviations[x.name] = deviation
    return deviations


def _slopes(
    one: Equations, other: Equations, run: Trajectory, count: int, values: Mapping[str, float]
) -> Array:
    """Return ∂(L' − L)/∂q at the samples, (count, nq)."""
    motion, difference = Motion.of(other.model), other.lagrangian - one.lagrangian
    known = {f.name: f for eq in (one, other) for f in input_functions(eq.model).functions}
    tape = compile_tape(
        [motion.diff(difference, q) for q in one.q],
        [symbols.TIME, *one.q, *one.v],
        [se.Symbol(name) for name in values],
        InputFunctions(tuple(known.values())),
    )
    inputs = [run.time[:count], *run.q[:count].T, *run.v[:count].T, *values.values()]
    return np.ascontiguousarray(run_arrays(tape, inputs, count).T)
