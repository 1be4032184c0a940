"""Equilibria and steady motions as operating points, and errors where there is none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from lagcli.analysis.local.gradients import Point
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.operating_point import OperatingPoint
from lagcli.analysis.local.steady import Residual, SteadyProblem
from lagcli.arrays import Array
from lagcli.errors import NumericalError, UsageError
from lagcli.model.model import Model
from lagcli.model.spelling import did_you_mean, nearest

#: Relative differences of velocities above rounding errors.
_DIFFERENT = 1e-6


class SteadyState(NamedTuple):
    """A root of the steady problem.

    Parameters
    ----------
    local : LocalEquations
        The equations of which it is a root.
    operating_point : OperatingPoint
    found : Residual
    neutral : (nq, dimension) array
        Changes of q that lead to other roots: the tangent space of a set of equilibria.
    speeds : mapping of str to float
        Unknown speeds, by name.
    """

    local: LocalEquations
    operating_point: OperatingPoint
    found: Residual
    neutral: Array
    speeds: Mapping[str, float] = MappingProxyType({})


def velocity_coordinate(names: Sequence[str], text: str) -> str:
    """Return the coordinate whose velocity a text such as ``phi'`` or ``phi_dot`` names.

    Raises
    ------
    UsageError
        It names none.
    """
    name = text.removesuffix("'") if text.endswith("'") else text.removesuffix("_dot")
    if name not in names or name == text:
        known = [f"{q}'" for q in names]
        remedy = did_you_mean(nearest(text, known)) or f"there are {', '.join(known[:20])}"
        raise UsageError(f"--steady `{text}` is not a velocity of the model; {remedy}")
    return name


def held_velocities(names: Sequence[str], steady: Mapping[str, float]) -> dict[str, float]:
    """Return velocities by the names of their coordinates.

    Raises
    ------
    UsageError
        A name is no velocity, or a value is not finite.
    """
    found = {}
    for text, value in steady.items():
        name = velocity_coordinate(names, text)
        if not np.isfinite(value):
            raise UsageError(f"--steady {text}={value}: give a finite value")
        found[name] = float(value)
    return found


def completed(problem: SteadyProblem, found: Residual) -> SteadyState:
    """Return a root as an operating point.

    Raises
    ------
    UsageError
        The constraints determine a prescribed velocity.
    NumericalError
        The state is not steady: the equations depend on time or on a coordinate that moves.
    """
    local = problem.local
    problem.check_held(found)
    name = "the steady motion" if np.any(found.point.v) else "the equilibrium"
    if not problem.is_steady(found):
        what = "steady motion" if problem.is_motion else "equilibrium"
        cause = "the time" if not np.any(found.point.v) else "the time, or on what moves"
        raise NumericalError(
            f"{local.model.name} has no {what} here: forces balance at t ="
            f" {found.point.t:g} s, but they depend on {cause}"
        )
    point = problem.operating_point(found, name)
    speeds = dict(zip(problem.speed_names, found.speeds.tolist(), strict=True))
    return SteadyState(local, point, found, problem.neutral(found), speeds)


def ignored_velocities(model: Model, point: Point) -> dict[str, float]:
    """Return initial velocities that the file gives and that a motion does not have."""
    found = dict(zip(model.coordinate_names, point.v.tolist(), strict=True))
    return {
        f"{name}'": given.value
        for name, given in model.initial_velocities.items()
        if given.value and abs(given.value - found[name]) > _DIFFERENT * abs(given.value)
    }


def none_found(local: LocalEquations, problem: SteadyProblem, q: Array) -> NumericalError:
    """Return the error of an unsuccessful search, with the unbalanced forces."""
    start = problem.residual(q, np.zeros(len(local.system.constraints)), local.p)
    what = "steady motion" if problem.is_motion else "equilibrium"
    text = f"no {what} of {local.model.name} was found from its initial values"
    if np.isfinite(start.value).all():
        balanced = problem.residual(q, problem.multipliers(start), local.p)
        relative = np.abs(balanced.value) / np.where(balanced.scale > 0, balanced.scale, 1.0)
        nq = len(q)
        worst = [int(i) for i in np.argsort(-relative[:nq]) if relative[i] > 1e-6][:3]
        if worst:
            names = ", ".join(local.system.coordinates[i] for i in worst)
            text += f": forces on {names} remain"
    return NumericalError(
        f"{text}; give initial values nearer to one (--set-initial), or check that there is one"
    )
