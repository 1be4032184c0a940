"""Comparison: one motion by several formulations, methods and tolerances."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np

from lagcli.analysis.compare.formulations import (
    Formulation,
    MaggiForm,
    SecondKindForm,
    StabilizedIndexTwo,
    integrate,
)
from lagcli.arrays import Array
from lagcli.engine.evaluator import Evaluator
from lagcli.errors import NumericalError, UsageError
from lagcli.model.model import Model, check_is_model
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.settings.methods import FORMULATIONS, METHODS
from lagcli.settings.settings import Settings, SettingsOverrides, resolve
from lagcli.simulations.derived import DerivedColumns
from lagcli.simulations.simulation import Simulation, prepare
from lagcli.trajectory.samples import Record, Samples

#: Formulations in addition to those of simulations, integrated by SciPy's DOP853.
REDUCED = ("ggl", "maggi", "second")
#: Factor of the reference run's tolerance.
_TIGHTER = 1e-3
_LEAST_RTOL = 1e-13


class ComparedRow(NamedTuple):
    """A formulation, a method and a relative tolerance."""

    formulation: str
    method: str
    rtol: float


def reference_row(settings: Settings, rtols: Sequence[float]) -> ComparedRow:
    """Return the reference run: projection, with the smallest tolerance."""
    rtol = max(_TIGHTER * min(rtols or [settings.rtol]), _LEAST_RTOL)
    return ComparedRow("projection", "DOP853", rtol)


def rows_of(
    settings: Settings,
    formulations: Sequence[str] = (),
    methods: Sequence[str] = (),
    rtols: Sequence[float] = (),
) -> tuple[ComparedRow, ...]:
    """Return the runs to compare.

    By default: all formulations with DOP853, all methods with projection, and a tolerance that is a
    thousand times larger.
    Otherwise all supported combinations of the chosen formulations, methods and tolerances.

    Raises
    ------
    UsageError
        A formulation or method is unknown, or no chosen method supports a chosen formulation.
    """
    _check(formulations, (*FORMULATIONS, *REDUCED), "formulation")
    _check(methods, tuple(METHODS), "method")
    rtol = settings.rtol
    if not (formulations or methods or rtols):
        first = ComparedRow("projection", "DOP853", rtol)
        coarse = ComparedRow("projection", "DOP853", min(1e3 * rtol, 0.1))
        others = [ComparedRow(f, "DOP853", rtol) for f in (*FORMULATIONS[1:], *REDUCED)]
        others += [ComparedRow("projection", m, rtol) for m in METHODS if m != "DOP853"]
        rows = [first, *others, coarse]
    else:
        rows = [
            ComparedRow(formulation, method, tolerance)
            for formulation in formulations or ("projection",)
            for method in methods or ("DOP853",)
            for tolerance in rtols or (rtol,)
            if _suits(formulation, method)
        ]
        if not rows:
            raise UsageError(
                f"no method of {', '.join(methods)} has the formulation {', '.join(formulations)};"
                " DOP853 has all of them"
            )
    return tuple(dict.fromkeys(rows))


def _check(names: Sequence[str], known: Sequence[str], what: str) -> None:
    for name in names:
        if name not in known:
            remedy = did_you_mean(nearest(name, known)) or f"there are {', '.join(known)}"
            raise UsageError(f"there is no {what} `{name}`; {remedy}")


def _suits(formulation: str, method: str) -> bool:
    if formulation in REDUCED:
        return method == "DOP853"
    return formulation in METHODS[method].formulations


T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class ComparedRun:
    """One run of a comparison.

    Parameters
    ----------
    row : ComparedRow
    status, message : str
        As in `Record`; "not available" if the model has no such formulation.
    samples : Samples or None
        The samples up to the end of the run.
    drift_position, drift_velocity : float
        Largest residual of a constraint, relative to its terms.
    energy : float
        Largest error of the energy balance, relative to the largest energy of the reference.
    difference_q, difference_lambda : float
        Largest difference from the reference at a sample, relative to the largest value among
        coordinates, or multipliers, of the same unit. NaN for λ that are not unique.
    steps, evaluations : int
    seconds : float
        CPU time of the integration.
    """

    row: ComparedRow
    status: str
    message: str = ""
    samples: Samples | None = None
    drift_position: float = float("nan")
    drift_velocity: float = float("nan")
    energy: float = float("nan")
    difference_q: float = float("nan")
    difference_lambda: float = float("nan")
    steps: int = 0
    evaluations: int = 0
    seconds: float = float("nan")


@dataclass(frozen=True, eq=False)
class FormulationComparison:
    """Runs of one model, and the reference run.

    Parameters
    ----------
    model : Model
    reference : ComparedRun
    runs : tuple of ComparedRun
    unique : bool
        Whether the equations determine λ.
    """

    model: Model
    reference: ComparedRun
    runs: tuple[ComparedRun, ...]
    unique: bool


def compare(
    model: Model,
    settings: SettingsOverrides | None = None,
    formulations: Sequence[str] = (),
    methods: Sequence[str] = (),
    rtols: Sequence[float] = (),
) -> FormulationComparison:
    """Simulate a model by several formulations, methods and tolerances.

    Parameters
    ----------
    model : Model
    settings : SettingsOverrides, optional
        As for `lagcli.simulate`.
    formulations, methods : sequences of str, optional
        See `rows_of` for the defaults. In addition to the formulations of
        `simulate` there are "ggl" (Gear, Gupta & Leimkuhler), "maggi" and "second" (Lagrange's
        equations of the second kind).
    rtols : sequence of float, optional

    Returns
    -------
    FormulationComparison

    Raises
    ------
    ModelError, UsageError, NumericalError
        As `lagcli.simulate`; also if the reference run fails.
    """
    check_is_model(model, "compare")
    simulation = prepare(model, settings)
    rows = rows_of(simulation.settings, formulations, methods, rtols)
    tightest = reference_row(simulation.settings, [row.rtol for row in rows])
    reference = _run(simulation, tightest)
    if reference.status not in ("completed", "stopped-by-event") or reference.samples is None:
        raise NumericalError(f"the run to compare with failed: {reference.message}")
    # B has no rows of contacts that are open at the initial state
    unique = not simulation.freedom.redundant
    runs = tuple(_beside(reference, _run(simulation, row), simulation, unique) for row in rows)
    return FormulationComparison(
        model, _beside(reference, reference, simulation, unique), runs, unique
    )


def _run(simulation: Simulation, row: ComparedRow) -> ComparedRun:
    if row.formulation in REDUCED:
        return _run_reduced(simulation, row)
    run, seconds = _timed(_with(simulation, row).trajectory)
    return _measured(row, run, run, seconds)


def _with(simulation: Simulation, row: ComparedRow) -> Simulation:
    given = SettingsOverrides(**row._asdict())
    in_force = SettingsOverrides(**simulation.settings.as_dict())
    return replace(simulation, settings=resolve(given, in_force))


def _measured(row: ComparedRow, samples: Samples, record: Record, seconds: float) -> ComparedRun:
    return ComparedRun(
        row,
        record.status,
        record.message,
        samples,
        _relative(samples.residual_position, record.scale_position),
        _relative(samples.residual_velocity, record.scale_velocity),
        steps=record.counts["steps"],
        evaluations=record.counts["evaluations"],
        seconds=seconds,
    )


def _run_reduced(simulation: Simulation, row: ComparedRow) -> ComparedRun:
    system, start = simulation.system, simulation.start
    evaluator = Evaluator(system, start.state.p)
    if system.switching is not None:
        return ComparedRun(row, "not available", "not for contacts and events")
    if row.formulation == "second" and len(system.holonomic) < len(system.constraints):
        return ComparedRun(row, "not available", "a constraint is nonholonomic")
    if row.formulation == "maggi" and system.nonlinear:
        return ComparedRun(row, "not available", "a constraint is nonlinear in the velocities")
    forms: dict[str, Callable[[], Formulation]] = {
        "ggl": lambda: StabilizedIndexTwo(evaluator, start.rank),
        "maggi": lambda: MaggiForm(evaluator, start.rank),
        "second": lambda: SecondKindForm(evaluator, start.rank),
    }
    request = _with(simulation, row._replace(formulation="projection")).request
    (block, outcome), seconds = _timed(
        lambda: integrate(forms[row.formulation](), request, system.sample_layout)
    )
    columns = DerivedColumns(system, start.state.p)
    samples = columns(block)
    return ComparedRun(
        row,
        outcome.status,
        outcome.message,
        samples,
        _relative(samples.residual_position, columns.scale_position),
        _relative(samples.residual_velocity, columns.scale_velocity),
        steps=outcome.steps,
        evaluations=outcome.evaluations,
        seconds=seconds,
    )


def _timed(run: Callable[[], T]) -> tuple[T, float]:
    began = time.process_time()
    return run(), time.process_time() - began


def _relative(residuals: Array, scales: Array) -> float:
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.nanmax(np.abs(residuals) / scales, initial=0.0))


def _beside(
    reference: ComparedRun, run: ComparedRun, simulation: Simulation, unique: bool
) -> ComparedRun:
    """Return a run with its differences from the reference at their common samples."""
    if run.samples is None or reference.samples is None or not len(run.samples.time):
        return run
    count = min(len(run.samples.time), len(reference.samples.time))
    exact, samples = reference.samples, run.samples
    energy = max(np.abs(exact.energy_kinetic).max(), np.abs(exact.energy_total).max())
    units = simulation.model.units
    kinds = [units.of(name) for name in simulation.system.coordinates]
    rows = [units.of_multiplier(name) for name in simulation.system.constraints]
    return replace(
        run,
        energy=float(np.abs(samples.energy_balance).max() / (energy or 1.0)),
        difference_q=_difference(samples.q[:count], exact.q[:count], kinds),
        difference_lambda=_difference(samples.multipliers[:count], exact.multipliers[:count], rows)
        if unique
        else float("nan"),
    )


def _difference(values: Array, exact: Array, kinds: Sequence[object]) -> float:
    worst = 0.0
    for kind in dict.fromkeys(kinds):
        same = [i for i, x in enumerate(kinds) if x == kind]
        size = np.abs(exact[:, same]).max(initial=0.0)
        off = np.abs(values[:, same] - exact[:, same]).max(initial=0.0)
        if off:
            worst = max(worst, float(off / size) if size else float("inf"))
    return worst
