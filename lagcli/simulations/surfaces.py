"""Surfaces at which forces jump: samples of motions that slide on them, and hidden jumps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import Block
from lagcli.engine.switching.kinks import Kink, frozen_of
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.system import System
from lagcli.engine.tape.crossings import lines_across
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.engine.tape.operations import ARITY, Op
from lagcli.engine.tape.tape import Tape

#: Values of a function below this part of its largest terms count as zero; residual of the
#: combination of both sides, relative to that of one side, while sliding.
_ON, _BETTER = 1e-9, 0.1


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


#: Comparisons, operations with whole results, and conditions made of others.
_COMPARED, _WHOLE, _JOINED = (Op.LT, Op.LE), (Op.FLOOR, Op.CEIL), (Op.AND, Op.OR, Op.NOT)
#: Number of lines needed for each comparison.
_NEEDED = 2
#: Distances from a surface; part of the difference at the farther one that a jump has at the nearer
#: one, and part of the values that rounding has.
_NEAR, _FAR, _KEPT, _ROUNDING = 1e-12, 1e-9, 0.3, 1e-13


def has_jumps(system: System, p: Sequence[float]) -> bool:
    """Return whether forces or constraints may jump at a branch.

    The two values between which each comparison decides are evaluated beside points of its surface.
    They count wherever they are used, since a region where they are may be met by no random point;
    so do those of surfaces that are not found.

    Parameters
    ----------
    system : System
    p : sequence of float
        Values of its parameters.
    """
    tape = system.dynamics
    if _has_whole(tape, p):
        return True
    for pair, choices in _choices(tape, p).items():
        found = 0
        for at in lines_across(tape, pair, [x for both in choices for x in both], p):
            (near, size), (far, _) = (_apart(at, distance) for distance in (_NEAR, _FAR))
            if np.isnan(near).any() or _is_jump(near, far, size):
                return True
            found += 1
            if found == _NEEDED:
                break
        if not found:
            return True
    return False


def _choices(tape: Tape, p: Sequence[float]) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """Return the values between which comparisons that change along a run decide."""
    compared: dict[int, set[tuple[int, int]]] = {}
    found: dict[tuple[int, int], list[tuple[int, int]]] = {}
    moving = _moving(tape, p)
    for op, to, a, b, c in tape.code:
        if op in _COMPARED and (a in moving or b in moving):
            compared[to] = {(a, b)}
        elif op in _JOINED:
            compared[to] = {x for i in (a, b)[: ARITY[op]] for x in compared.get(i, ())}
        elif op == Op.SELECT:
            for pair in compared.get(a, ()):
                found.setdefault(pair, []).append((b, c))
    return found


def _apart(at: Callable[[float], Array], distance: float) -> tuple[Array, Array]:
    """Return by how much pairs of values differ near a surface, and their sizes.

    Differences without a value do not count: each value may have one on its own side alone.
    """
    one, other = np.array([at(s).reshape(-1, 2) for s in (-distance, distance)]).T
    differences = np.abs(one[:, :, None] - other[:, None, :])
    sizes = np.fmax(np.abs(one), np.abs(other))
    return np.fmax.reduce(differences, axis=(1, 2)), np.fmax.reduce(sizes, axis=1)


def _is_jump(near: Array, far: Array, size: Array) -> bool:
    """Return whether values of some sizes that differ far from a surface also do so near it."""
    return bool(((near > _KEPT * far) & (near > _ROUNDING * size)).any())


def has_hidden_jumps(system: System, p: Sequence[float]) -> bool:
    """Return whether forces, limits or constraints jump at branches that are not frozen.

    The two sides of each comparison are evaluated beside points of its surface.

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


def _jumps(tape: Tape, count: int | None, p: Sequence[float]) -> bool:
    """Return whether one of the first outputs of a tape jumps."""
    if _has_whole(tape, p):
        return True
    for op, _, *operands in tape.code:
        if op not in _COMPARED:
            continue
        for at in lines_across(tape, (operands[0], operands[1]), tape.outputs[:count], p):
            sides = [np.array([at(-s), at(s)]) for s in (_NEAR, _FAR)]
            near, far = (np.abs(below - above) for below, above in sides)
            if _is_jump(near, far, np.abs(sides[0]).max(axis=0)):
                return True
    return False


def _moving(tape: Tape, p: Sequence[float]) -> set[int]:
    """Return the registers of a tape that change along a run."""
    moving = {*range(tape.inputs - tape.functions.size - len(p))}
    for op, to, *operands in tape.code:
        if not moving.isdisjoint(operands[: ARITY[op]]):
            moving.add(to)
    return moving


def _has_whole(tape: Tape, p: Sequence[float]) -> bool:
    """Return whether a tape takes whole parts of what changes along a run."""
    moving = _moving(tape, p)
    return any(op in _WHOLE and a in moving for op, _, a, *_ in tape.code)
