"""The data of one experiment, and the residuals with their exact derivatives."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import symengine as se

from lagcli.analysis.fit.assemblies import Assemblies
from lagcli.arrays import Array
from lagcli.engine.constraints.initial import ConsistentState, NoConsistentState, NoStart
from lagcli.engine.contract import Block, IntegrationRequest
from lagcli.engine.lowering.tangent import lower_observed
from lagcli.engine.sensitivity.integration import Derivatives
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.equations.derivation.column_expressions import column_expression
from lagcli.equations.derivation.lagrange import Equations, with_forces
from lagcli.errors import Diagnostic, FileError, LagcliError, ModelError, UsageError
from lagcli.model.csv_table import CsvTable, read_bytes
from lagcli.model.dimensions.deriving import expression_unit
from lagcli.model.expression.dimension import Factor
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.trees import Name, Tree
from lagcli.model.expression.units import commensurable, remedy, same_dimension
from lagcli.model.model import DataFile, Model, ObservedQuantity
from lagcli.model.names.expansion import expand
from lagcli.settings.settings import Settings
from lagcli.simulations.inputs import check_input_range
from lagcli.simulations.sampling import absolute_tolerances
from lagcli.simulations.sensitivity import Sensitivity


@dataclass(frozen=True, eq=False)
class Measured:
    """The data of one experiment, in SI.

    Parameters
    ----------
    path : str
    times : (n,) array
        s, increasing.
    values : (n, m) array
        Values of the observed quantities; NaN where there is no measured value.
    sigmas : (m,) array
        Standard deviations; NaN if they are to be estimated.
    """

    path: str
    times: Array
    values: Array
    sigmas: Array


def read_measured(
    file: DataFile,
    folder: str | os.PathLike[str],
    model: Model,
    observed: Sequence[ObservedQuantity],
) -> Measured:
    """Read the data of one experiment.

    Parameters
    ----------
    file : DataFile
    folder : path
        Folder of relative file names.
    model : Model
        The model, with the units of the observed quantities.
    observed : sequence of m ObservedQuantity

    Returns
    -------
    Measured

    Raises
    ------
    FileError
        The file cannot be read, lacks a column, or contains an entry that is not a number; the
        times do not increase; there is no measured value; a unit does not fit.
    ModelError
        A unit of the model file does not fit.
    """
    path = os.fspath(Path(folder) / file.path)
    try:
        data = read_bytes(path)
    except FileError as error:
        help_ = "the path is relative to the folder of the model"
        raise FileError(
            Diagnostic("unreadable", f"`data` of `fit`: {error}", file.location, help_)
        ) from None
    return _measured(CsvTable(path, data), file.time, model, observed)


def _measured(
    table: CsvTable, time: str, model: Model, observed: Sequence[ObservedQuantity]
) -> Measured:
    converted = [table.times(time), *(_column(table, model, x) for x in observed)]
    columns = [(number, float(factor)) for number, factor in converted]
    at = columns[0][0]
    rows: list[list[float]] = []
    before = -math.inf
    for line, fields in table.rows():
        row = [table.number(fields, number, line, factor) for number, factor in columns]
        if not row[0] > before:
            reason = "is missing" if math.isnan(row[0]) else "is not after the one before"
            raise table.error(
                "bad-data",
                f"the time {fields[at].strip() or 'of the line'} {reason}",
                "sort the lines by time, and give each time once",
                line,
                at,
            )
        before = row[0]
        rows.append(row)
    values = np.array(rows).reshape(-1, len(columns))
    if not np.isfinite(values[:, 1:]).any():
        raise FileError(f"{table.path} contains no measured values below its header")
    sigmas = [
        math.nan if x.sigma is None else x.sigma * (factor if x.sigma_given is None else 1.0)
        for x, (_, factor) in zip(observed, columns[1:], strict=True)
    ]
    return Measured(table.path, values[:, 0].copy(), values[:, 1:].copy(), np.array(sigmas))


def _column(table: CsvTable, model: Model, x: ObservedQuantity) -> tuple[int, Factor]:
    """Return the number of a column, and its conversion factor to SI; check its unit, and sigma's.

    Raises
    ------
    FileError
        The column does not exist, or the unit in its title has another dimension than the quantity.
    ModelError
        The same of the units of the model file.
    """
    number, factor, unit = table.column(x.column, x.unit)
    tree = expand(parse(x.name), model.names)
    own = expression_unit(model, tree)
    # hertz are right for an expression such as phi'/(2*pi)
    fits = commensurable if isinstance(tree, Name) else same_dimension
    sigma = x.sigma_given
    if isinstance(sigma, Tree):
        sigma = expression_unit(model, sigma)
    for what, given in (("its column", unit), ("its `sigma`", sigma)):
        if own is None or given is None or fits(own, given):
            continue
        message = f"`{x.name}` is in {own}, and {what} in {given}"
        help_ = remedy(own, given)
        if given is unit and x.unit is None:
            raise table.error("units", message, help_, 1, number)
        raise ModelError([Diagnostic("units", message, x.location, help_)])
    return number, factor


#: The initial states of all experiments.
Assembly = tuple[ConsistentState, ...]


class Evaluation(NamedTuple):
    """Residuals of all measured values, by experiment, time and observed quantity.

    Parameters
    ----------
    residuals : (n,) array
        (model − data) / sigma; sigma is 1 if it is to be estimated.
    jacobian : (n, k) array
        Derivatives with respect to the fitted quantities.
    assembly : tuple of ConsistentState
        The initial states of the experiments.
    """

    residuals: Array
    jacobian: Array
    assembly: Assembly


class FailedRun(Exception):
    """A run could not be completed, so that it has no residuals."""


class Experiment:
    """One experiment: a model with its parameter and initial values, and the data.

    Parameters
    ----------
    equations, system
        The equations and the System of the model, with the experiment's values.
    settings : Settings
        Complete settings; their times are replaced by those of the data.
    observed : sequence of m ObservedQuantity
    names : sequence of k str
        Names of the fitted quantities.
    data : Measured

    Raises
    ------
    UsageError
        The data begin before the run, or a derivative is not available.
    ModelError
        The table of an input ends before the data do.
    """

    def __init__(
        self,
        equations: Equations,
        system: System,
        settings: Settings,
        observed: Sequence[ObservedQuantity],
        names: Sequence[str],
        data: Measured,
    ):
        if data.times[0] < settings.t_start:
            raise UsageError(
                f"{data.path} begins at {data.times[0]:g} s, before the run at"
                f" {settings.t_start:g} s; give --t-start {data.times[0]:g}"
            )
        self.model, self.system, self.data = equations.model, system, data
        times = tuple(data.times.tolist())
        self.settings = settings.replace(times=times, samples=None, dt=None, t_end=times[-1])
        check_input_range(self.model, settings.t_start, times[-1])
        expressions = _expressions(equations, observed)
        _refuse_changed(equations.model, expressions)
        self.sensitivity = Sensitivity(equations, system, self.settings, names, many_runs=True)
        self.directions = self.sensitivity.directions
        self.values, self.slopes = lower_observed(equations, expressions, self.directions.rates)
        self.measured = np.isfinite(data.values)
        self.assemblies = Assemblies(self.sensitivity)
        self.sigmas = np.where(np.isfinite(data.sigmas), data.sigmas, 1.0)

    @property
    def count(self) -> int:
        """The number of measured values."""
        return int(self.measured.sum())

    def __call__(self, values: Sequence[float], near: ConsistentState | None = None) -> Evaluation:
        """Return the residuals for values of the fitted quantities.

        Parameters
        ----------
        values : sequence of k float
        near : ConsistentState, optional
            Initial state for similar values, whose assembly the run has. By default, that of the
            model's guesses.

        Raises
        ------
        FailedRun
        """
        blocks, start, _ = self._run(values, self.data.times, near)
        model, slopes = self._observe(blocks, start.state.p, len(self.data.times))
        residuals = (model - self.data.values) / self.sigmas
        jacobian = slopes / self.sigmas[:, None]
        own = residuals[self.measured], jacobian[self.measured]
        evaluation = Evaluation(*own, (start,))
        if not (np.isfinite(evaluation.residuals).all() and np.isfinite(evaluation.jacobian).all()):
            raise FailedRun("an observed quantity has no finite value, or no derivative")
        return evaluation

    def simulate(
        self,
        values: Sequence[float],
        near: ConsistentState | None = None,
        times: Array | None = None,
    ) -> Array:
        """Return the observed quantities (n, m).

        They are those at the times of the data, or at others between the start and the last. The
        other parameters and the errors are those of a call.
        """
        times = self.data.times if times is None else times
        blocks, start, _ = self._run(values, times, near)
        return self._observe(blocks, start.state.p, len(times))[0]

    def others(self, values: Sequence[float], own: ConsistentState) -> list[ConsistentState]:
        """Return other assemblies for the same values."""
        given = self.directions.state(self.settings.t_start, values)
        return self.assemblies.others(given, own)

    def guesses(self, start: ConsistentState) -> dict[str, float]:
        """Return the guesses of coordinates with which a run begins at a state."""
        free = self.assemblies.free
        pairs = zip(self.system.coordinates, start.state.q.tolist(), free, strict=True)
        return {name: x for name, x, is_free in pairs if is_free}

    def leads_to(
        self, start: ConsistentState, values: Sequence[float], guesses: Mapping[str, float]
    ) -> bool:
        """Return whether a run with other guesses begins with an assembly."""
        given = self.directions.state(self.settings.t_start, values)
        q = given.q.copy()
        for i, name in enumerate(self.system.coordinates):
            if self.assemblies.free[i]:
                q[i] = guesses.get(name, q[i])
        try:
            found = self.sensitivity.consistent(given._replace(q=q))
        except (NoStart, LagcliError, ArithmeticError):
            return False
        return self.assemblies.same(found, start)

    def steps(self, values: Sequence[float]) -> int:
        """Return the number of steps of a run.

        Raises
        ------
        FailedRun
        """
        return self._run(values, self.data.times)[2]

    def _run(
        self, values: Sequence[float], times: Array, near: ConsistentState | None = None
    ) -> tuple[list[tuple[Block, Derivatives]], ConsistentState, int]:
        given = self.directions.state(self.settings.t_start, values)
        try:
            start = self.sensitivity.consistent(given, near)
            slopes = self.sensitivity.start(start, values)
        except NoConsistentState as error:
            names = ", ".join(x.constraint for x in error.violations)
            raise FailedRun(f"no consistent start: {names} cannot be met") from None
        except (NoStart, LagcliError, ArithmeticError) as error:
            raise FailedRun(f"no start: {error}") from None
        state = start.state
        request = IntegrationRequest(
            state=state,
            rank=start.rank,
            settings=self.settings,
            times=times,
            atol=absolute_tolerances(self.settings.atol, self.system.coordinates),
            block_rows=len(times),
        )
        blocks: list[tuple[Block, Derivatives]] = []
        try:
            run = self.sensitivity.integrate(request, slopes, values, lambda *x: blocks.append(x))
        except LagcliError as error:
            raise FailedRun(str(error)) from None
        if run.status != "completed":
            raise FailedRun(run.message)
        return blocks, start, run.steps

    def _observe(
        self, blocks: list[tuple[Block, Derivatives]], p: tuple[float, ...], n: int
    ) -> tuple[Array, Array]:
        def joined(part: int, name: str) -> Array:
            return np.concatenate([getattr(block[part], name) for block in blocks])

        names = ("q", "v", "a", "multipliers")
        motion = [joined(0, "time"), *(x for name in names for x in joined(0, name).T)]
        scales = self.directions.scales
        # by direction, then by coordinate or constraint: (nt, nq, n) → (n, nq, nt)
        changes = [
            x for name in names for direction in (joined(1, name) * scales).T for x in direction
        ]
        with np.errstate(all="ignore"):
            values = run_arrays(self.values, [*motion, *p], n)
            slopes = run_arrays(self.slopes, [*motion, *changes, *p], n)
        derivatives = slopes.reshape(len(scales), -1, n).T / scales
        return values.T, derivatives


def experiments_of(
    models: Sequence[Model],
    settings: Sequence[Settings],
    data: Sequence[Measured],
    names: Sequence[str],
) -> list[Experiment]:
    """Return the experiments; models that differ only in values share one derivation."""
    from lagcli.engine.lowering.lower import lower
    from lagcli.equations.derivation.lagrange import derive

    experiments: list[Experiment] = []
    derived: list[tuple[Equations, System]] = []
    for model, chosen, measured in zip(models, settings, data, strict=True):
        assert model.fit is not None
        known = next((x for x in derived if _same_equations(x[0].model, model)), None)
        if known is None:
            equations = derive(model)
            known = equations, lower(equations)
            derived.append(known)
        equations, system = replace(known[0], model=model), known[1]
        experiments.append(
            Experiment(equations, system, chosen, model.fit.observed, names, measured)
        )
    return experiments


def _refuse_changed(model: Model, expressions: Sequence[se.Basic]) -> None:
    """Reject observed quantities that depend on parameters set by events."""
    changed = model.changing_parameters
    for expression in expressions:
        names = sorted(changed & {symbol.name for symbol in expression.free_symbols})
        if names:
            raise UsageError(
                f"an observed quantity depends on `{names[0]}`, which an event sets; observe"
                " coordinates, velocities or multipliers, or leave that event out"
            )


def _same_equations(first: Model, second: Model) -> bool:
    """Return whether two variants of a model have the same equations."""
    return first.coordinate_names == second.coordinate_names and all(
        first.parameters[name].value == second.parameters[name].value
        for name in first.structural_parameters
    )


def _expressions(equations: Equations, observed: Sequence[ObservedQuantity]) -> list[se.Basic]:
    expressions = {
        x.name: column_expression(equations, x.expression)
        if isinstance(x.expression, str)
        else x.expression
        for x in observed
    }
    completed = with_forces(equations.model, equations.constraints, expressions)
    known = {*equations.q, *equations.v, *equations.a, *equations.multipliers, se.Symbol("t")}
    known |= {se.Symbol(name) for name in equations.model.parameters}
    for x in observed:
        if not completed[x.name].free_symbols <= known:
            raise UsageError(
                Diagnostic(
                    "not-supported",
                    f"`{x.name}` cannot be observed: it is not a function of the state at one time",
                    x.location,
                    "observe coordinates, velocities, multipliers or outputs",
                )
            )
    return list(completed.values())


def sigma_estimated(data: Sequence[Measured]) -> bool:
    """Return whether the standard deviation of the data is to be estimated from the residuals."""
    return any(math.isnan(x) for measured in data for x in measured.sigmas)
