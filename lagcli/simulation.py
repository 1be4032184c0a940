"""Model + settings → Trajectory."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lagcli
from lagcli.engine.evaluator import Batch, Evaluator
from lagcli.engine.initial import (
    ConsistentState,
    NoConsistentState,
    UndefinedStart,
    consistent_state,
)
from lagcli.engine.run import Engine, Request, Run
from lagcli.engine.system import System, compile_system
from lagcli.equations.lagrange import Equations, derive
from lagcli.errors import Diagnostic, ModelError, NumericalError, UsageError
from lagcli.model.model import DEFAULTS, InitialValue, Model, SettingError, Settings
from lagcli.model.units import si_notation
from lagcli.trajectory import Trajectory

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

DEFAULT_SAMPLES = 1001
#: What the compiled engine can do; the reference engine can do all.
COMPILED_METHODS = ("DOP853",)


def simulate(
    model: Model,
    settings: Settings | None = None,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Trajectory:
    """Simulate a model.

    Parameters
    ----------
    model : Model
    settings : Settings, optional
        What it leaves open is taken from the model's ``simulation`` block, then from the defaults.
    progress : callable, optional
        Called with the time reached, s, after each step.
    **options
        Fields of Settings, in place of ``settings``.

    Returns
    -------
    Trajectory
        Its ``status`` says whether the run was completed; a run that fails or is interrupted keeps
        the samples it reached.

    Raises
    ------
    UsageError
        A setting is out of range or unknown.
    ModelError
        The fixed initial values contradict the constraints.
    NumericalError
        There is no start: no consistent state near the guesses, no finite value there, or a
        coordinate without inertia.
    """
    began = time.perf_counter()
    if options:
        try:
            given = Settings(**options)
        except TypeError as error:
            raise UsageError(f"no such option: {error}") from None
        settings = given.over(settings or Settings())
    chosen = resolve(settings or Settings(), model)
    equations = derive(model)
    derived = time.perf_counter()
    system = compile_system(equations)
    compiled = time.perf_counter()
    start = find_start(equations, system, chosen)
    run = _engine(chosen)(system, _request(start, chosen), progress)
    integrated = time.perf_counter()
    if run.undefined is not None:
        run.message += "; " + _undefined(equations, *run.undefined)
    seconds = {
        "derive": derived - began,
        "compile": compiled - derived,
        "integrate": integrated - compiled,
    }
    return _trajectory(model, system, chosen, start, run, seconds)


def resolve(settings: Settings, model: Model) -> Settings:
    """Return complete settings: the given ones, the model's, the defaults; checked.

    Raises
    ------
    UsageError
        A value is out of its range.
    """
    chosen = settings.over(model.settings).over(DEFAULTS)
    if chosen.times is not None:
        times = tuple(float(x) for x in chosen.times)
        chosen = dataclasses.replace(chosen, times=times)
    elif chosen.samples is None and chosen.dt is None:
        chosen = dataclasses.replace(chosen, samples=DEFAULT_SAMPLES)
    if chosen.engine is None:
        suits = chosen.method in COMPILED_METHODS and compiled_available()
        chosen = dataclasses.replace(chosen, engine="compiled" if suits else "scipy")
    try:
        chosen.check()
        _check_engine(chosen)
    except SettingError as error:
        help_ = f"; {error.help}" if error.help else ""
        raise UsageError(f"{error}{help_}") from None
    return chosen


def compiled_available() -> bool:
    """Return whether the compiled engine was built when the package was installed."""
    return find_spec("lagcli.engine.core.binding") is not None


def _check_engine(settings: Settings) -> None:
    if settings.engine != "compiled":
        return
    if settings.method not in COMPILED_METHODS:
        raise SettingError(
            "engine",
            f"the compiled engine has no method {settings.method}",
            f"its methods are {', '.join(COMPILED_METHODS)}; --engine scipy has all",
        )
    if not compiled_available():
        raise SettingError(
            "engine",
            "the compiled engine was not built: there was no C compiler at installation",
            "install one and lagcli again, or give --engine scipy",
        )


def sample_times(settings: Settings) -> Array:
    """Return the sample times of complete settings, s."""
    if settings.times is not None:
        return np.array(settings.times)
    start, end = settings.t_start, settings.t_end
    assert start is not None
    assert end is not None
    if settings.dt is not None:
        # the last multiple of dt within rounding of the end counts as the end
        count = int(np.floor((end - start) / settings.dt * (1 + 1e-12) + 1e-9))
        return np.minimum(start + settings.dt * np.arange(count + 1), end)
    assert settings.samples is not None
    return np.array([end]) if settings.samples == 1 else np.linspace(start, end, settings.samples)


def _engine(settings: Settings) -> Engine:
    if settings.engine == "compiled":
        from lagcli.engine import compiled_engine

        return compiled_engine.run
    from lagcli.engine import scipy_engine

    return scipy_engine.run


def _request(start: ConsistentState, settings: Settings) -> Request:
    s = settings
    times = sample_times(s)
    t_end = times[-1] if s.times is not None else s.t_end
    assert t_end is not None
    assert s.rtol
    assert s.atol
    assert s.method
    assert s.formulation
    assert s.max_steps
    return Request(
        q=start.q,
        v=start.v,
        rank=start.rank,
        t_start=s.t_start or 0.0,
        t_end=float(t_end),
        times=times,
        rtol=s.rtol,
        atol=s.atol,
        method=s.method,
        formulation=s.formulation,
        alpha=s.alpha,
        beta=s.beta,
        max_step=s.max_step or np.inf,
        max_steps=s.max_steps,
        timeout=s.timeout,
        through_singular=bool(s.through_singular),
    )


# the start


def find_start(equations: Equations, system: System, settings: Settings) -> ConsistentState:
    """Find the consistent initial state of a model, or explain why there is none.

    Raises
    ------
    ModelError
        The fixed initial values, or the constraints among each other, contradict.
    NumericalError
        No consistent state near the guesses, no finite value there, a coordinate without inertia.
    """
    model = equations.model
    q, fixed_q = _initial(model, model.initial_positions)
    v, fixed_v = _initial(model, model.initial_velocities)
    t = settings.t_start or 0.0
    try:
        start = consistent_state(system, t, q, v, fixed_q, fixed_v)
    except UndefinedStart as error:
        at, q0, v0 = error.state
        raise NumericalError(
            "no start: " + _undefined(equations, at, q0, v0) + "; change the initial values"
        ) from None
    except NoConsistentState as error:
        raise _no_start(model, error) from None
    if not start.regular:
        _check_inertia(equations, system, t, start)
    return start


def _initial(model: Model, table: Any) -> tuple[Array, Flags]:
    entries: list[InitialValue] = [table[name] for name in model.coordinate_names]
    return np.array([e.value for e in entries]), np.array([e.fixed for e in entries])


def _undefined(equations: Equations, t: float, q: Array, v: Array) -> str:
    from lagcli.undefined import undefined_expression

    return undefined_expression(equations, t, q.tolist(), v.tolist())


def _no_start(model: Model, error: NoConsistentState) -> ModelError | NumericalError:
    residuals = "\n".join(
        f"  {x.constraint}: residual {x.residual:.3g} ({x.relative:.2g} of its terms)"
        for x in error.violations
    )
    names = ", ".join(f"`{x.constraint}`" for x in error.violations)
    plural = "s" if len(error.violations) > 1 else ""
    first = next(c for c in model.constraints if c.name == error.violations[0].constraint)
    level = "" if error.level == "position" else ", differentiated in time,"
    if error.contradiction and error.stuck:
        freed = error.stuck[0]
        base = freed.rstrip("'")
        table = model.initial_velocities if freed.endswith("'") else model.initial_positions
        entry = table[base]
        return ModelError(
            [
                Diagnostic(
                    "inconsistent-start",
                    f"the fixed initial values violate the constraint{plural} {names}{level}\n"
                    + residuals,
                    entry.location,
                    f"free one of {', '.join(error.stuck)}, for instance"
                    f" `{freed}: {{guess: {entry.value:.6g}}}`",
                )
            ]
        )
    if error.contradiction:
        return ModelError(
            [
                Diagnostic(
                    "contradicting-constraints",
                    f"no initial values satisfy the constraint{plural} {names}{level}: near the"
                    f" guesses they contradict\n{residuals}",
                    first.location,
                    "mend the constraints, or guess values nearer to a solution",
                )
            ]
        )
    return NumericalError(
        f"no consistent initial state was found near the guesses: the constraint{plural} {names}"
        f"{level} do{'' if plural else 'es'} not hold\n{residuals}\n"
        "   help: guess values nearer to a solution"
    )


def _check_inertia(equations: Equations, system: System, t: float, start: ConsistentState) -> None:
    """Refuse a motion that the constraints allow and no inertia resists."""
    d = Evaluator(system).dynamics(t, start.q, start.v)
    if not d.finite:
        raise NumericalError(
            "no start: "
            + _undefined(equations, t, start.q, start.v)
            + "; change the initial values"
        )
    nq = len(start.q)
    free = np.eye(nq)
    if len(d.jacobian):
        from lagcli.engine.linear import decompose

        free = decompose(d.jacobian, start.rank).null
    if not free.shape[1]:
        return
    # coordinates of different units are compared by their own inertia
    size = np.sqrt(np.abs(np.diag(d.mass_matrix)))
    size = 1 / np.where(size > 0, size, 1.0)
    basis, _ = np.linalg.qr(free / size[:, None])
    reduced = basis.T @ (d.mass_matrix * np.outer(size, size)) @ basis
    values, vectors = np.linalg.eigh((reduced + reduced.T) / 2)
    weakest = int(np.argmin(np.abs(values)))
    if abs(values[weakest]) > 1e-12:
        return
    direction = np.abs(size * (basis @ vectors[:, weakest]))
    names = [
        f"`{n}`"
        for n, x in zip(system.coordinates, direction, strict=True)
        if x > 1e-6 * direction.max()
    ]
    what = f"coordinate {names[0]} has" if len(names) == 1 else f"motion of {', '.join(names)} has"
    raise NumericalError(
        f"the {what} no inertia: `T` does not resist it and no constraint determines it, so that"
        " its acceleration is undetermined; give it a mass, or a constraint"
    )


# the result


def _trajectory(
    model: Model,
    system: System,
    settings: Settings,
    start: ConsistentState,
    run: Run,
    seconds: dict[str, float],
) -> Trajectory:
    nt, nc = len(run.time), len(system.constraints)
    batch = Batch(system, run.time, run.q, run.v)
    d, c = batch.dynamics(), batch.constraints()
    kinetic, potential, total, applied, explicit, *outputs = batch.report(run.a, run.multipliers)
    by = run.multipliers.T[:, None, :] * d.jacobian  # (nc, nq, nt)
    velocity = np.einsum("cqt,tq->ct", d.jacobian, run.v) + c.drift
    position = np.full((nc, nt), np.nan)
    position[list(system.holonomic)] = c.position
    scale_position = np.full(nc, np.nan)
    scale_position[list(system.holonomic)] = _largest(c.position_scale)
    equation = np.einsum("ijt,tj->it", d.mass_matrix, run.a) - d.forcing - by.sum(axis=0)
    options = {k: v for k, v in dataclasses.asdict(settings).items() if v is not None}
    return Trajectory(
        coordinates=system.coordinates,
        constraints=system.constraints,
        time=run.time,
        q=run.q,
        v=run.v,
        a=run.a,
        multipliers=run.multipliers,
        constraint_force_by=np.ascontiguousarray(by.transpose(2, 0, 1)),
        energy_kinetic=kinetic,
        energy_potential=potential,
        energy_total=total,
        power_applied=applied,
        power_constraint=np.einsum("tc,cqt,tq->t", run.multipliers, d.jacobian, run.v),
        power_time=explicit,
        energy_balance=total - (total[:1] - run.work[:1]) - run.work if nt else total,
        residual_position=np.ascontiguousarray(position.T),
        residual_velocity=np.ascontiguousarray(velocity.T),
        residual_equation=np.abs(equation).max(axis=0, initial=0.0),
        scale_position=scale_position,
        scale_velocity=_largest(c.velocity_scale),
        outputs=dict(zip(system.outputs, outputs, strict=True)),
        units=_units(model),
        status=run.status,
        message=run.message,
        model=model.text,
        model_sha256=model.sha256,
        parameters=model.parameter_values,
        options=options,
        counts={
            "steps": run.steps,
            "rejected": run.rejected,
            "evaluations": run.evaluations,
        },
        seconds=seconds,
        initial_correction=dict(start.moved),
        lagcli_version=lagcli.__version__,
    )


def _largest(scale: Array) -> Array:
    """Return each constraint's largest scale along the run; 1 where its terms are always 0."""
    largest = scale.max(axis=1, initial=0.0)
    return np.where(largest > 0, largest, 1.0)


def _units(model: Model) -> dict[str, str]:
    units = {c.name: c.unit for c in model.coordinates if c.unit}
    units |= {p.name: si_notation(p.unit) for p in model.parameters.values() if p.unit}
    return units | dict(model.output_units)
