"""Bifurcation diagrams: branches of equilibria as a parameter varies."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from lagcli.analysis.equilibria.continuation import (
    LINE,
    ConditionValue,
    ExtendedProblem,
    HeldVelocity,
    LocatedPoint,
    ModelParameter,
    SpecialKind,
    Traced,
    Tracer,
    vertical,
)
from lagcli.analysis.equilibria.stability import Stability, Verdict
from lagcli.analysis.local.active_set import ActiveSet
from lagcli.analysis.local.contact_mode import SwitchedModel
from lagcli.analysis.local.contacts import ContactStatus, check_determinate
from lagcli.analysis.local.gradients import ParameterPath
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.steady import SteadyState, none_found, velocity_coordinate
from lagcli.analysis.local.steady_terms import Given, SteadyTerms, check_switching, is_velocity
from lagcli.arrays import Array, Flags
from lagcli.errors import UsageError
from lagcli.model.model import Model, check_is_model

Crossing = Literal["pitchfork", "transcritical", "line of equilibria"]

_MOST_BRANCHES = 32
#: In scaled unknowns: first step along another branch, and distance of points that coincide.
_ENTRY, _SAME = 1e-2, 1e-4
_ROUNDING = 1e-13  # rounding error of scaled unknowns
_VERTICAL = 1e-9  # smallest change of s along another branch, in scaled unknowns


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """A fold, a branch point, a change of stability or of a contact; SI units.

    Parameters
    ----------
    kind : str
        ``fold``, ``branch point``, ``Hopf point``, or ``flutter``: two frequencies of an
        undamped model coincide and an oscillation begins to grow. ``divergence``: a deviation
        begins to grow without oscillation, and no other branch crosses. ``stability change``: any
        other change of the verdict. ``contact closes``, ``contact opens``, ``limit reached`` or
        ``sliding stops``: a contact ends the branch.
    branch : int
        The branch on which it lies, from 0.
    parameter : float
    q, v : (nq,) arrays
    multipliers : (nc,) array
    frequency : float or None
        Frequency of the oscillation that begins there, rad/s.
    crossing : str or None
        Type of a branch point: ``pitchfork`` if the other branch lies on one side of it,
        ``transcritical`` if it continues on both, ``line of equilibria`` if the parameter is
        constant along it; None if it was not found.
    contact : str or None
        The constraint that ends the branch.
    stability : (str, str) or None
        The verdicts on stability before and after it, if they differ.
    """

    kind: SpecialKind
    branch: int
    parameter: float
    q: Array
    v: Array
    multipliers: Array
    frequency: float | None
    crossing: Crossing | None = None
    contact: str | None = None
    stability: tuple[Verdict, Verdict] | None = None


@dataclass(frozen=True, eq=False)
class Branch:
    """A branch of n points, in order; SI units.

    Parameters
    ----------
    parameter : (n,) array
    q, v : (n, nq) arrays
    multipliers : (n, nc) array
    stability : tuple of n str
        The verdict on the stability of each point, as of `Stability`.
    growth : (n,) array
        Largest real part of an eigenvalue, 1/s.
    origin : int or None
        The branch from which it branches off; None for the first.
    line : bool
        Whether it ends in a line of equilibria, at one value of the parameter. Lines have no end
        and are cut after some points.
    """

    parameter: Array
    q: Array
    v: Array
    multipliers: Array
    stability: tuple[Verdict, ...]
    growth: Array
    origin: int | None
    line: bool = False

    @property
    def stable(self) -> Flags:
        """Where no deviation grows in the linear approximation, (n,)."""
        return np.array([verdict != "unstable" for verdict in self.stability])


@dataclass(frozen=True, eq=False)
class BifurcationDiagram:
    """Branches of equilibria, or of steady motions, as a parameter varies.

    Parameters
    ----------
    model : Model
    coordinates, constraints : tuples of str
        Of the constraints, those that hold along the branches.
    parameter : str
        Name of the parameter, or of a prescribed velocity (``phi'``).
    limits : (float, float)
        Range of the parameter.
    steady : mapping of str to float
        Prescribed velocities.
    branches : tuple of Branch
    special : tuple of SpecialPoint
    contacts : tuple of ContactStatus
        What contacts, limits and friction do where the first branch begins.
    """

    model: Model
    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    parameter: str
    limits: tuple[float, float]
    steady: Mapping[str, float | None]
    branches: tuple[Branch, ...]
    special: tuple[SpecialPoint, ...]
    contacts: tuple[ContactStatus, ...] = ()


def follow_equilibria(
    model: Model,
    parameter: str,
    start: float,
    end: float,
    *,
    steady: Given | None = None,
    branches: bool = False,
) -> BifurcationDiagram:
    """Follow equilibria as a parameter varies, with their multipliers and stability.

    Pseudo-arclength continuation of R(q, λ, s) = 0 from the equilibrium near the initial
    values. Folds, branch points and Hopf points are located to rounding errors: by the tangent's
    component along s, by the determinant of the bordered ∂R/∂(q, λ, s), and by the growth rate of
    oscillations; other changes of stability by bisection. A branch along which the parameter does
    not change is a line of equilibria. Contacts stay as they are where the branch begins: it ends
    where one changes.

    Parameters
    ----------
    model : Model
    parameter : str
        A parameter of the model, or what a steady motion has: a velocity (``phi'``), or another
        value that `equilibrium` can hold.
    start, end : float
        Its range, SI; the branch begins at ``start``.
    steady : mapping of str to float, optional
        Prescribed velocities, as for `equilibrium`.
    branches : bool
        Also follow the other branches at branch points, in both directions.

    Returns
    -------
    BifurcationDiagram

    Raises
    ------
    UsageError
        The parameter is unknown, or the structure of the model depends on it.
    ModelError, NumericalError
        There is no equilibrium at ``start``.

    References
    ----------
    .. [1] H. B. Keller, "Lectures on Numerical Methods in Bifurcation Problems", 1987.
    .. [2] W. J. F. Govaerts, "Numerical Methods for Bifurcations of Dynamical Equilibria", 2000,
       doi:10.1137/1.9780898719543.
    """
    check_is_model(model, "follow_equilibria")
    if not (np.isfinite(start) and np.isfinite(end)) or start == end:
        raise UsageError(f"--along {parameter}={start:g}:{end:g}: give two different finite values")
    names = model.coordinate_names
    free = _is_parameter(model, parameter)
    terms = SteadyTerms(model, {**(steady or {}), **({} if free else {parameter: start})})
    local, given = LocalEquations(model), None
    if model.switches:
        check_switching(model, terms)
        given = _in_mode(model, parameter, start, terms.held)
        contacts = given.operating_point.contacts
        check_determinate(model, contacts, f"branch from {parameter} = {start:g} on")
        local = given.local
    base = terms.problem(local)
    variable: ModelParameter | HeldVelocity | ConditionValue
    if free:
        variable = ModelParameter(local, parameter)
    elif is_velocity(names, parameter) and not base.is_along_symmetries:
        variable = HeldVelocity(local, velocity_coordinate(names, parameter))
    else:
        variable = ConditionValue(local, parameter, base.place_of(parameter))
    problem, p = variable.problem(base, start)
    root = problem.solve(local.start.state.q, p) if given is None else given.residual
    if root is None:
        raise none_found(local, problem, local.start.state.q)
    problem.check_held(root)
    extended = ExtendedProblem(base, variable, abs(end - start), root, start)
    first = extended.scaled(root, start)
    tracer = Tracer.at(extended, (start, end), first)
    diagram = _Diagram(extended)
    diagram.trace(_Entry(tracer, tracer.start(first, float(np.sign(end - start)))), None)
    if branches:
        diagram.trace_others()
    return BifurcationDiagram(
        model,
        names,
        local.system.constraints,
        variable.name,
        (start, end),
        {name: x for name, x in terms.named.items() if name != variable.name},
        tuple(diagram.branches),
        tuple(diagram.special),
        local.contacts(root.point),
    )


def _is_parameter(model: Model, name: str) -> bool:
    """Whether a name is to be that of a parameter, and not of a value of a steady motion."""
    known = name in model.coordinate_names or re.fullmatch(r"J_\d+|p_.*", name)
    return name in model.parameters or (
        name.isidentifier() and not name.endswith("_dot") and not known
    )


def _in_mode(model: Model, parameter: str, start: float, held: Mapping[str, float]) -> SteadyState:
    """Return the first point of a branch of a model with contacts, in its mode there."""
    switched, p = SwitchedModel(model), tuple(model.parameter_values.values())
    if _is_parameter(model, parameter):
        return ActiveSet(switched, held).nearest(ParameterPath(model, parameter).values(p, start))
    coordinate = velocity_coordinate(model.coordinate_names, parameter)
    return ActiveSet(switched, {**held, coordinate: start}).nearest()


class _Entry(NamedTuple):
    """A starting point on a branch near a branch point, and its tracer."""

    tracer: Tracer
    point: Traced


class _Diagram:
    """The branches traced so far."""

    def __init__(self, extended: ExtendedProblem):
        self.extended = extended
        self.branches: list[Branch] = []
        self.special: list[SpecialPoint] = []
        self.crossings: list[tuple[int, list[_Entry]]] = []
        self.seen: list[Array] = []

    def trace(self, entry: _Entry, origin: int | None) -> None:
        """Trace a branch from a point."""
        number = len(self.branches)
        points: list[tuple[Traced, Stability]] = []
        for traced, stability, special in entry.tracer.follow(entry.point):
            points.append((traced, stability))
            for located in special:
                self._add(located, number, entry.tracer)
        self.branches.append(self._branch(points, origin))

    def _add(self, special: LocatedPoint, number: int, tracer: Tracer) -> None:
        z = special.point.place.z
        if special.kind == "branch point":
            if any(np.abs(z - other).max() < _SAME for other in self.seen):
                return
            self.seen.append(z)
        point, frequency, crossing = special.point.place.residual.point, None, None
        if special.kind == "branch point":
            entered = [self._entered(tracer, special.point, sign) for sign in (1.0, -1.0)]
            self.crossings.append((number, [x for x in entered if x is not None]))
            crossing = _crossing(special.point, self.crossings[-1][1])
        if special.kind in ("Hopf point", "flutter"):
            values = tracer.stability(special.point).eigenvalues
            oscillating = values[values.imag > 0]
            if len(oscillating):
                frequency = float(oscillating[np.argmax(oscillating.real)].imag)
        value, q = self._clean(special.point)
        self.special.append(
            SpecialPoint(
                special.kind,
                number,
                value,
                q,
                point.v,
                point.multipliers,
                frequency,
                crossing,
                special.contact,
                special.change,
            )
        )

    def _clean(self, traced: Traced) -> tuple[float, Array]:
        """Return s and q, with zeros for rounding errors relative to large changes."""
        columns, z = self.extended.columns, traced.place.z
        rounded = np.where(np.abs(z) > _ROUNDING, z, 0.0) * columns
        return float(rounded[-1]), rounded[: self.extended.nq]

    def trace_others(self) -> None:
        """Trace the branches that cross the known ones, in both directions."""
        done = 0
        while done < len(self.crossings) and len(self.branches) < _MOST_BRANCHES:
            number, entered = self.crossings[done]
            done += 1
            for entry in entered:
                self.trace(entry, number)

    def _entered(self, tracer: Tracer, crossing: Traced, direction: float) -> _Entry | None:
        """Return a point on the other branch near a branch point.

        The rank may be larger by one there, if a motion that is neutral along this branch is not
        neutral along the other: a vehicle that goes straight may have any heading, one that turns
        at a given velocity along an axis may not.
        """
        _, _, vt = np.linalg.svd(crossing.place.matrix)
        # at a branch point the null space has one more dimension
        null = vt[tracer.rank - 1 :].T
        known = np.column_stack([crossing.tangent, crossing.frame.right])
        rest = null - known @ (known.T @ null)
        u, _, _ = np.linalg.svd(rest, full_matrices=False)
        across = direction * u[:, 0]
        for length in (_ENTRY, _ENTRY / 10, _ENTRY / 100):
            z = crossing.place.z + length * across
            for rank in range(tracer.rank, min(tracer.rank + 2, len(crossing.place.matrix) + 1)):
                corrected = self.extended.correct(z, across, rank)
                if corrected is not None:
                    other = tracer.with_rank(rank)
                    return _Entry(
                        other, other.framed(corrected[0], corrected[0].z - crossing.place.z)
                    )
        return None

    def _branch(self, points: list[tuple[Traced, Stability]], origin: int | None) -> Branch:
        at = [traced.place.residual.point for traced, _ in points]
        clean = [self._clean(traced) for traced, _ in points]
        growth = [s.eigenvalues.real.max(initial=-np.inf) for _, s in points]
        return Branch(
            np.array([value for value, _ in clean]),
            np.array([q for _, q in clean]),
            np.array([point.v for point in at]),
            np.array([point.multipliers for point in at]),
            tuple(s.verdict for _, s in points),
            np.array([x if np.isfinite(x) else 0.0 for x in growth]),
            origin,
            len(points) > LINE and all(vertical(traced) for traced, _ in points[-LINE:]),
        )


def _crossing(point: Traced, entered: list[_Entry]) -> Crossing | None:
    """Determine on which sides of a branch point the other branch lies."""
    if len(entered) < 2:
        return None
    one, other = (x.point.place.z[-1] - point.place.z[-1] for x in entered)
    if max(abs(one), abs(other)) < _VERTICAL:
        one, other = (x.tracer.turned(x.point, point.place.z[-1]) for x in entered)
        if not (one or other):
            return "line of equilibria"
    if min(abs(one), abs(other)) < _VERTICAL:
        return None
    return "pitchfork" if one * other > 0 else "transcritical"
