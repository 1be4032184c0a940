"""Surfaces at which forces jump: samples of motions that slide on them, and hidden jumps."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import Block
from lagcli.engine.switching.kinks import Kink, frozen_of
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.system import State, System
from lagcli.engine.tape.interpreter import ScalarTape, run_arrays
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape
from lagcli.named_tuples import NamedTuple

#: Values of a function below this part of its largest terms count as zero; residual of the
#: combination of both sides, relative to that of one side, while sliding.
_ON, _BETTER = 1e-9, 0.1
#: Number of trial states, number of steps towards a surface, accuracy; difference that is a jump.
_TRIES, _NEWTON, _SOLVED, _JUMP = 3, 6, 1e-7, 1e-4


class SurfaceValues(NamedTuple):
    """Columns of samples with the forces that act on surfaces.

    Parameters
    ----------
    residual : (n,) array
        The largest difference between these forces and those required by the motion.
    report : (outputs, n) array
        Outputs of the System's report tape.
    """

    residual: Array
    report: Array


def with_surfaces(
    system: System, p: tuple[float, ...], block: Block, required: Array, values: SurfaceValues
) -> SurfaceValues:
    """Return columns with Filippov's combination of both sides for samples on a surface.

    The weights are those with which the forces agree with the motion. Reports are combined with the
    same weights, since they are averages over rapid switching.

    Parameters
    ----------
    system : System
    p : tuple of float
        Values of the System's parameters.
    block : Block
    required : (nq, n) array
        M a − Bᵀλ, without forces that depend on λ.
    values : SurfaceValues
        Columns with the branches of the samples.
    """
    frozen = frozen_of(system)
    if frozen is None:
        return values
    kinks, count = frozen.kinks, len(block.time)
    state = [block.time, *block.q.T, *block.v.T]
    inputs = [*state, *p]
    sides: list[Array] = [np.ones(count) for _ in kinks]
    for _ in range(len(kinks) + 1):
        functions = run_arrays(frozen.functions, [*inputs, *sides], count)
        before, sides = sides, [_sides(kink, x) for kink, x in zip(kinks, functions, strict=False)]
        if all(map(np.array_equal, before, sides)):
            break
    forcing = frozen.system.dynamics_layout.forcing
    residual, report = values.residual.copy(), values.report.copy()
    for k, kink in enumerate(kinks):
        distance = np.abs(functions[k] - (np.round(functions[k]) if kink.whole else 0))
        size = np.abs(functions[len(kinks) + k]).max(initial=0.0) + bool(kink.whole)
        (on,) = np.nonzero(distance <= _ON * size)
        if not len(on):
            continue
        here: list[float | Array] = [*p, *(x[on] for x in sides)]
        moving = [x[on] for x in state]
        more = [*block.a[on].T, *block.multipliers[on].T]
        forces, reports = [], []
        for upper in (True, False):
            here[len(p) + k] = _beside(kink, np.round(functions[k, on]), upper)
            forces.append(run_arrays(frozen.system.dynamics, [*moving, *here], len(on))[forcing])
            reports.append(run_arrays(frozen.report, [*moving, *more, *here], len(on)))
        jump, rest = forces[0] - forces[1], required[:, on] - forces[1]
        with np.errstate(all="ignore"):
            part = np.clip(np.nan_to_num((rest * jump).sum(0) / (jump * jump).sum(0)), 0, 1)
        combined = np.abs(rest - part * jump).max(axis=0, initial=0.0)
        better = combined < _BETTER * residual[on]
        residual[on] = np.fmin(residual[on], combined)
        both = reports[1] + part * (reports[0] - reports[1])
        report[:, on[better]] = both[:, better]
    return SurfaceValues(residual, report)


def _sides(kink: Kink, values: Array) -> Array:
    if kink.whole:
        return np.floor(values) if kink.whole > 0 else np.ceil(values)
    return np.where(values < 0, -1.0, 1.0)


def _beside(kink: Kink, whole: Array, upper: bool) -> Array:
    """Return the branch above or below a surface."""
    if not kink.whole:
        return np.full(len(whole), 1.0 if upper else -1.0)
    return np.asarray(whole - (not upper) + (kink.whole < 0))


def jumping_names(system: System, start: State) -> tuple[str, ...]:
    """Return names on which a branch with jumps of forces or constraints depends; empty if there is
    none.

    The two sides are compared at points of each surface near random states.

    Parameters
    ----------
    system : System
    start : State
    """
    frozen = frozen_of(system) if system.has_kinks else None
    if frozen is None:
        return ()
    functions, dynamics = ScalarTape(frozen.functions), ScalarTape(frozen.system.dynamics)
    rng, nq = np.random.default_rng(0), len(start.q)
    for _ in range(_TRIES):
        change = rng.normal(size=(2, nq))
        y = np.concatenate([start.q, start.v]) + change.ravel()
        for k, kink in enumerate(frozen.kinks):
            if kink.timed:
                continue
            at = frozen.frozen(start._replace(q=y[:nq], v=y[nq:]))
            point = _on_surface(functions, k, at, y)
            if point is None:
                continue
            sides = []
            for upper in (True, False):
                p = list(at.p)
                whole = np.round(functions((at.t, *point, *p))[k])
                p[len(start.p) + k] = float(_beside(kink, np.array([whole]), upper)[0])
                sides.append(np.array(dynamics((at.t, *point, *p))))
            if (np.abs(sides[0] - sides[1]) > _JUMP * (1 + np.abs(sides[0]))).any():
                return kink.names
    return ()


def _on_surface(functions: ScalarTape, k: int, at: State, y: Array) -> list[float] | None:
    """Return a state near another at which the function of a kink vanishes, or is an integer."""
    point = y.copy()

    def value(x: Array) -> float:
        return functions((at.t, *x.tolist(), *at.p))[k]

    for _ in range(_NEWTON):
        g = value(point)
        slopes = np.array(
            [(value(point + d) - value(point - d)) / 2e-6 for d in 1e-6 * np.eye(len(y))]
        )
        square = float(slopes @ slopes)
        if not np.isfinite(g) or not square > 0:
            return None
        point = point - g / square * slopes
    return point.tolist() if abs(value(point)) < _SOLVED * (1 + np.abs(point).max()) else None


_COMPARED, _WHOLE = (Op.LT, Op.LE), (Op.FLOOR, Op.CEIL)
#: Number of lines for each comparison, number of steps to its surface, and relative accuracy; step
#: across the surface, and relative difference that is a jump.
_LINES, _SECANT, _ROOT, _OVER, _LEAST_JUMP = 8, 40, 1e-14, 1e-12, 1e-3


def has_hidden_jumps(system: System, p: Sequence[float]) -> bool:
    """Return whether forces, limits or constraints jump at branches that are not frozen.

    The two sides of each comparison are evaluated at points of its surface on random lines.

    Parameters
    ----------
    system : System
    p : sequence of float
        Values of its parameters.
    """
    if not system.has_kinks:
        return False
    frozen = frozen_of(system)
    values = list(p)
    if frozen is not None:
        system, values = frozen.system, [*p, *[1.0] * len(frozen.kinks)]
    if any(_jumps(tape, None, values) for tape in (system.dynamics, system.constraint)):
        return True
    switching = system.switching
    if switching is None:
        return False
    laws = SplitSystem(system).laws
    # their outputs end with derivatives, which may jump
    limits = 2 * sum(row.limit is not None for row in switching.rows)
    fixed = [*[1.0] * laws.signs, *values]
    return _jumps(laws.limits, limits, fixed) or (
        laws.forces is not None and _jumps(laws.forces, len(switching.force_coordinates), fixed)
    )


def _jumps(tape: Tape, count: int | None, p: list[float]) -> bool:
    """Return whether one of the first outputs of a tape jumps."""
    compared = [(a, b) for op, _, a, b, _ in tape.code if op in _COMPARED]
    if any(line[0] in _WHOLE for line in tape.code):
        return True
    if not compared:
        return False
    outputs = tape.outputs[:count]
    count = len(outputs)
    run = ScalarTape(tape._replace(outputs=(*outputs, *(x for pair in compared for x in pair))))
    rng, moving = np.random.default_rng(0), tape.inputs - tape.functions.size - len(p)

    for k in range(len(compared)):
        for _ in range(_LINES):
            start, along = rng.normal(size=(2, moving))

            def at(s: float, start: Array = start, along: Array = along) -> Array:
                return np.array(run((*(start + s * along).tolist(), *p)))

            s = _surface(at, count + 2 * k)
            if s is None:
                continue
            below, above = at(s - _OVER)[:count], at(s + _OVER)[:count]
            if (np.abs(above - below) > _LEAST_JUMP * (1 + np.abs(below))).any():
                return True
    return False


def _surface(at: Callable[[float], Array], place: int) -> float | None:
    """Return the point of a line where the operands of a comparison are equal, by the secant
    method."""
    s, t = 0.0, 1.0
    values = at(s)[place : place + 2]
    g = values[0] - values[1]
    for _ in range(_SECANT):
        a, b = at(t)[place : place + 2]
        h = a - b
        if not np.isfinite(h):
            return None
        if abs(h) <= _ROOT * (abs(a) + abs(b)):
            return t
        if h == g:
            return None
        s, t, g = t, t - h * (t - s) / (h - g), h
    return None
