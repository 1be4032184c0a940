"""Consistent initial states: guesses are adjusted until the constraints hold; fixed values stay.

A model file gives the angular velocity ω of a quaternion e, in the body frame, each component fixed
or guessed, and e' = e ∘ (0, ω)/2: where the orientation is adjusted, e' follows, so that ω stays as
it is given. Redundant constraints form sets, and a state next to a singular configuration is
reported.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Literal, NamedTuple

import numpy as np

from lagcli.arrays import Array, Flags, Indices, Int32, rank_of
from lagcli.engine.constraints.rates import constraint_program
from lagcli.engine.core.program import Program, assemble
from lagcli.engine.core.start_search import CoreSearch
from lagcli.engine.core.status import StartStatus
from lagcli.engine.evaluator import Constraints, Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.linear.dense import decompose
from lagcli.engine.linear.elimination import Elimination, NoElimination, order_at
from lagcli.engine.scales import apart, largest, least_scales, lengths_of_rows, usable
from lagcli.engine.sparse_rows import SparseRows, entries_of
from lagcli.engine.system import State, System

Level = Literal["position", "velocity"]

#: Fixed values may violate a constraint by this part of its scale, because they are given with a
#: limited number of digits. The first projection removes the residual.
ACCEPTED = 1e-10
#: Accuracy of a constraint, of its scale, at the end of the search.
REACHED = 1e-15
_LARGE = 60  # number of unknowns above which regularity is first tested by sparse elimination
REGULAR = 1e-6  # smallest pivot of a regular matrix with entries of order one
#: Part of a constraint's scale at the guess that its scale is, at least.
OF_GUESS = 1e-5
_ROUNDING = 1e-14  # of an angular velocity, of its largest component


class ConsistentState(NamedTuple):
    """A state on the constraints.

    Parameters
    ----------
    state : State
    rank : int
        Rank of B.
    elimination : Elimination or None
        An order of elimination that proves [[M, Bᵀ], [B, 0]] to be regular, if one was found: B
        then has full rank and no admissible motion is without inertia. B contains the rows of
        ``System.held_at_start``.
    moved : mapping of str to (float, float)
        Adjusted coordinates and velocities (``phi'``, ``omega(e).z``), with the values before and
        after.
    """

    state: State
    rank: int
    elimination: Elimination | None
    moved: Mapping[str, tuple[float, float]]


class Violation(NamedTuple):
    """A violated constraint: its name, its residual, and the residual relative to its scale."""

    constraint: str
    residual: float
    relative: float


class NoStart(Exception):
    """An initial state that cannot be used."""


class NoConsistentState(NoStart):
    """No consistent initial state was found.

    Parameters
    ----------
    level : "position" or "velocity"
    violations : list of Violation
    stuck : list of str
        The fixed ones among the unknowns of the violated constraints.
    contradiction : bool
        Whether the free entries cannot reduce the residual at all: the fixed values, or the
        constraints, contradict each other.
    """

    def __init__(
        self, level: Level, violations: list[Violation], stuck: list[str], contradiction: bool
    ):
        super().__init__(level)
        self.level, self.violations = level, violations
        self.stuck, self.contradiction = stuck, contradiction


class UndefinedStart(NoStart):
    """The equations are not finite at the initial state."""

    def __init__(self, state: State):
        super().__init__("undefined")
        self.state = state


def consistent_state(
    system: System,
    given: State,
    fixed_q: Flags,
    fixed_v: Flags,
    evaluator: Evaluator | None = None,
    spins: Sequence[Spin] = (),
) -> ConsistentState:
    """Solve for an initial state that satisfies φ = 0 and ψ = 0.

    Positions by damped Gauss–Newton steps of least M-weighted length, then velocities, which occur
    linearly. If several solutions exist, the one nearest to the guess is taken.

    Parameters
    ----------
    system : System
    given : State
        Fixed values and guesses of q and v.
    fixed_q, fixed_v : (nq,) arrays of bool
    evaluator : Evaluator, optional
        Evaluator of the System, for any values of its parameters; created if not given.
    spins : sequence of Spin, optional
        Quaternions whose angular velocities are given, by their rates at the given orientation:
        ``fixed_v`` does not apply to them.

    Returns
    -------
    ConsistentState

    Raises
    ------
    NoConsistentState
        Contains the residuals and the values that could be freed.
    UndefinedStart
        The equations are not finite there.
    VanishingGradient
        A constraint holds only at points where its gradient vanishes.
    NoOrientation
        The guess of a quaternion whose angular velocity is given is 0.
    """
    known = Evaluator(system, given.p) if evaluator is None else evaluator
    search = ConsistentSearch(
        known.with_parameters(given.p), given.t, fixed_q, fixed_v, spins=spins
    )
    return search.solve(given.q, given.v)


class NoOrientation(NoStart):
    """A quaternion whose components are all 0: its angular velocity has no meaning.

    Parameters
    ----------
    quaternion : str
    """

    def __init__(self, quaternion: str):
        super().__init__(f"{quaternion} is 0")
        self.quaternion = quaternion


class VanishingGradient(NoStart):
    """Constraints that hold only where their gradient vanishes, such as a rod of length 0.

    Parameters
    ----------
    constraints : list of str
    """

    def __init__(self, constraints: list[str]):
        super().__init__(f"{', '.join(constraints)} without gradient")
        self.constraints = constraints


class ConsistentSearch:
    """The search for one state on the constraints.

    Parameters
    ----------
    evaluator : Evaluator
    t : float
        s.
    fixed_q, fixed_v : (nq,) arrays of bool
    held : sequence of int, optional
        The constraints that hold; by default those at the start.
    spins : sequence of Spin, optional
        See `consistent_state`.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        t: float,
        fixed_q: Flags,
        fixed_v: Flags,
        held: Sequence[int] | None = None,
        spins: Sequence[Spin] = (),
    ):
        self.spins = tuple(spins)
        self.evaluator, self.system, self.t = evaluator, evaluator.system, t
        self.fixed_q, self.fixed_v = np.asarray(fixed_q, bool), np.asarray(fixed_v, bool)
        self.held = list(self.system.held_at_start if held is None else held)
        rows = set(self.held)
        self.places = [k for k, i in enumerate(self.system.holonomic) if i in rows]
        self.holonomic = [self.system.holonomic[k] for k in self.places]
        self.of_guess: Array | None = None  # least scales of positions, by those at the guess

    def solve(self, q: Array, v: Array) -> ConsistentState:
        """Return the state, with the rank of B."""
        new_q = self.positions(q.copy(), v)
        new_v = self.velocities(new_q, with_given_spins(self.spins, q, v, new_q))
        c = self.evaluator.constraint_rows(self.t, new_q, new_v)
        elimination = self.elimination(new_q, new_v)
        rank = len(self.held)
        if rank and not elimination:
            sizes = self.evaluator.sizes(self.t, new_q, new_v)
            lengths = self.evaluator.row_lengths(self.t, new_q, new_v, c, sizes)[self.held]
            rank = dense.count_rank(c.jacobian[self.held], scale=lengths, sizes=sizes)
        if rank == len(self.held):
            self.check_gradients(c, new_q, new_v)
        moved = self.moved(q, v, new_q, new_v)
        return ConsistentState(self.evaluator.state(self.t, new_q, new_v), rank, elimination, moved)

    def place(self, q: Array, v: Array) -> Array:
        """Return the coordinates of `solve`, without the rank of B unless an error depends on it.

        Raises
        ------
        NoStart
            As `solve`.
        """
        new_q = self.positions(q.copy(), v)
        new_v = self.velocities(new_q, with_given_spins(self.spins, q, v, new_q))
        if len(self._small(self.evaluator.constraint_rows(self.t, new_q, new_v))):
            return self.solve(q, v).state.q
        return new_q

    def moved(
        self, q: Array, v: Array, new_q: Array, new_v: Array
    ) -> dict[str, tuple[float, float]]:
        """Return the adjusted values by name, as in `ConsistentState`."""
        names = self.system.coordinates
        moved = dict[str, tuple[float, float]]()
        if (q != new_q).any() or (v != new_v).any():
            noise, noise_of_rates = self.noise(new_q, new_v)
            for i in np.flatnonzero(np.abs(new_q - q) > noise):
                moved[names[i]] = float(q[i]), float(new_q[i])
            turning = {place for spin in self.spins for place in spin.places}
            for i in np.flatnonzero(np.abs(new_v - v) > noise_of_rates):
                if i not in turning:
                    moved[f"{names[i]}'"] = float(v[i]), float(new_v[i])
        for spin in self.spins:
            places = list(spin.places)
            before, after = spin_of(q[places], v[places]), spin_of(new_q[places], new_v[places])
            rounding = _ROUNDING * np.abs([before, after]).max()
            for label, x, y in zip(spin.labels(), before.tolist(), after.tolist(), strict=True):
                if abs(x - y) > rounding:
                    moved[label] = x, y
        return moved

    def noise(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return bounds of the rounding errors of coordinates and of velocities, (nq,) each.

        The search leaves such errors, also of values that are 0: relative to what counts as equal
        among the other coordinates, and for velocities to the coordinates per second.
        """
        sizes = self.evaluator.sizes(self.t, q, v)
        reach = _reach(q, sizes)
        rates = np.maximum(np.abs(v), largest(v, sizes) * sizes)
        return _ROUNDING * reach, _ROUNDING * np.maximum(rates, reach)

    def elimination(self, q: Array, v: Array) -> Elimination | None:
        """Return a sparse elimination that proves a large system to be regular, or None.

        The cost of singular values grows with the third power of the size.
        """
        system = self.system
        if len(system.coordinates) + len(self.held) < _LARGE:
            return None
        try:
            elimination = order_at(system, [self.evaluator.entries(self.t, q, v)], self.held)
        except NoElimination:
            return None
        return elimination if elimination.smallest > REGULAR else None

    # positions

    def residual(self, q: Array, v: Array) -> tuple[Array, Array, Array | SparseRows]:
        """Return φ, its scale and its Jacobian."""
        c = self.constraints(q, v)
        jacobian, position = c.jacobian[self.holonomic], c.position[self.places]
        inertia = self.evaluator.inertia(self.t, q, v)
        scale = np.maximum(c.position_scale[self.places], least_scales(inertia, jacobian, q))
        if self.of_guess is None:
            self.of_guess = OF_GUESS * scale
        return position, usable(np.maximum(scale, self.of_guess)), jacobian

    def constraints(self, q: Array, v: Array) -> Constraints[Array | SparseRows]:
        """Return the constraints; raises `UndefinedStart` where φ or its Jacobian is undefined."""
        c = self.evaluator.constraint_rows(self.t, q, v)
        entries = entries_of(c.jacobian[self.holonomic])
        if not (np.isfinite(c.position[self.places]).all() and np.isfinite(entries).all()):
            raise UndefinedStart(self.evaluator.state(self.t, q, v))
        return c

    @cached_property
    def core(self) -> CoreSearch:
        """The search in the core."""
        spins = [(spin.places, spin.fixed) for spin in self.spins]
        return CoreSearch(self.system, *programs_of_search(self.system), spins)

    def find(
        self, search: Callable[..., tuple[Int32, Array]], fixed: Flags, q: Array, v: Array
    ) -> tuple[int, Array]:
        """Return a `StartStatus`, and what a search of the core finds."""
        p = np.array([self.evaluator.p], dtype=float)
        statuses, found = search(self.t, p, self.held, fixed, q[None], v[None])
        return int(statuses[0]), found[0]

    def positions(self, q: Array, v: Array) -> Array:
        """Return q on φ = 0; may raise `NoConsistentState`."""
        if not self.holonomic:
            return q
        status, found = self.find(self.core.positions, self.fixed_q, q, v)
        self.of_guess = self.core.least_scales[self.holonomic]
        if status == StartStatus.UNDEFINED:
            raise UndefinedStart(self.evaluator.state(self.t, found, v))
        if status == StartStatus.CONTRADICTED:
            phi, scale, jacobian = self.residual(found, v)
            sizes = self.evaluator.sizes(self.t, found, v)
            raise self.failure("position", found, phi, scale, np.asarray(jacobian), sizes)
        return found

    def check_gradients(self, c: Constraints[Array | SparseRows], q: Array, v: Array) -> None:
        """Raise an error if the gradient of a constraint has no direction.

        All terms of a constraint such as x = 0 may vanish at the initial state; its scale is then
        that of its terms at the guess. Within the accuracy of that, its gradient must not change
        its direction.
        """
        small = self._small(c)
        if self.of_guess is None or not len(small):
            return
        sizes = self.evaluator.sizes(self.t, q, v)
        turned = []
        for k in small:
            row, accuracy = self.holonomic[k], 10 * REACHED * self.of_guess[k]
            least = accuracy / float(lengths_of_rows(c.jacobian[[row]], sizes)[0])
            far = self.evaluator.reach(self.t, q, v, row, accuracy, sizes, least)
            beside = [
                self.evaluator.constraint_rows(self.t, q + x * apart(sizes), v).jacobian[[row]]
                for x in (-far, far)
            ]
            first, second = (np.asarray(one)[0] * sizes for one in beside)
            both = np.linalg.norm(first) + np.linalg.norm(second)
            if np.linalg.norm(second - first) > 0.5 * both:
                turned.append(self.system.constraints[row])
        if turned:
            raise VanishingGradient(turned)

    def _small(self, c: Constraints[Array | SparseRows]) -> Indices:
        """Return the position constraints whose terms are much smaller than at the guess."""
        if self.of_guess is None:
            return np.zeros(0, dtype=np.intp)
        return np.flatnonzero(c.position_scale[self.places] < self.of_guess)

    # velocities

    def velocities(self, q: Array, v: Array) -> Array:
        """Return v on ψ = 0; may raise `NoConsistentState`."""
        if not self.held:
            return v
        status, found = self.find(self.core.velocities, self.fixed_v, q, v)
        if status == StartStatus.UNDEFINED:
            raise UndefinedStart(self.evaluator.state(self.t, q, found))
        if status == StartStatus.CONTRADICTED:
            c = self.evaluator.constraint_rows(self.t, q, found)
            residual, rows = c.velocity(found)[self.held], np.asarray(c.jacobian[self.held])
            inertia = self.evaluator.inertia(self.t, q, found)
            scale = np.maximum(c.velocity_scale[self.held], least_scales(inertia, rows, found))
            scale = usable(np.maximum(scale, self.core.least_scales[self.held]))
            sizes = self.evaluator.sizes(self.t, q, found)
            raise self.failure("velocity", q, residual, scale, rows, sizes)
        return found

    def failure(
        self, level: Level, q: Array, residual: Array, scale: Array, jacobian: Array, sizes: Array
    ) -> NoConsistentState:
        """Return the violated constraints and the cause, at the nearest state."""
        relative = np.abs(residual / scale)
        bad = np.flatnonzero(relative > ACCEPTED)
        position = level == "position"
        rows = self.holonomic if position else self.held
        names = [self.system.constraints[i] for i in rows]
        violations = [Violation(names[i], float(residual[i]), float(relative[i])) for i in bad]
        fixed = self.fixed_q if position else self.fixed_v
        free = np.eye(len(q))[:, ~fixed]
        if not position:
            free = free_directions(self.spins, fixed, q)
        # the free entries are at a least-squares solution and cannot be improved
        jacobian, free = jacobian * sizes, free / sizes[:, None]
        length = dense.row_scale(jacobian)
        scaled = residual / length
        slope = (
            scaled @ (jacobian / length[:, None]) @ (free / usable(lengths_of_rows(free.T, 1.0)))
        )
        contradiction = bool(np.abs(slope).max(initial=0.0) <= 1e-3 * np.abs(scaled).max())
        touched = (jacobian[bad] != 0.0).any(axis=0) & ~_held(np.delete(jacobian, bad, 0), fixed)
        stuck = self.stuck(q, touched, jacobian[bad] / sizes, position)
        return NoConsistentState(level, violations, stuck, contradiction)

    def stuck(self, q: Array, touched: Flags, jacobian: Array, position: bool) -> list[str]:
        """Return the fixed entries that matter: those touched, and spins in some rows of B."""
        names = self.system.coordinates
        if position:
            return [names[i] for i in np.flatnonzero(self.fixed_q & touched)]
        turning = [list(spin.places) for spin in self.spins]
        plain = self.fixed_v & touched
        plain[[i for places in turning for i in places]] = False
        stuck = [f"{names[i]}'" for i in np.flatnonzero(plain)]
        for spin, places in zip(self.spins, turning, strict=True):
            turns = (along(jacobian[:, places], rates_of_spin(q[places])) != 0.0).any(axis=0)
            labels = zip(spin.labels(), spin.fixed, turns.tolist(), strict=True)
            stuck += [label for label, is_fixed, is_touched in labels if is_fixed and is_touched]
        return stuck


def _held(jacobian: Array, fixed: Flags) -> Flags:
    """Return which fixed entries the rows of B hold too: the free ones cannot make up for them."""
    held = np.zeros(len(fixed), bool)
    for i in np.flatnonzero(fixed & (jacobian != 0.0).any(axis=0)):
        free = ~fixed
        without = rank_of(jacobian[:, free])
        free[i] = True
        held[i] = rank_of(jacobian[:, free]) > without
    return held


@lru_cache(maxsize=4)
def programs_of_search(system: System) -> tuple[Program, Program]:
    """Return the programs of the constraints with their rates, and of the entries of M."""
    masses = system.dynamics_layout.mass_matrix
    mass = system.dynamics.selected(range(masses.start, masses.stop))
    return constraint_program(system), assemble(mass, system.families)


_NOTHING = 1e-14  # of the terms of a product


class Spin(NamedTuple):
    """The angular velocity of one quaternion.

    Parameters
    ----------
    name : str
        Of the quaternion.
    places : tuple of 4 int
        Indices of its components among the coordinates.
    fixed : tuple of 3 bool
        Which components of ω are fixed.
    """

    name: str
    places: tuple[int, int, int, int]
    fixed: tuple[bool, bool, bool]

    def labels(self) -> tuple[str, ...]:
        """Return the names of the components of ω, as in expressions."""
        return tuple(f"omega({self.name}).{axis}" for axis in "xyz")


def rates_of_spin(e: Array) -> Array:
    """Return the matrix G/2 of e' = G ω/2, (..., 4, 3)."""
    a, b, c, d = np.moveaxis(np.asarray(e, dtype=float), -1, 0)
    rows = [[-b, -c, -d], [a, -d, c], [d, a, -b], [-c, b, a]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1)) / 2


def spin_of(e: Array, rates: Array) -> Array:
    """Return ω of a quaternion of any length, and its rates, (3,)."""
    return np.asarray(4 * rates_of_spin(e).T @ rates / (e @ e))


def spin_derivative(e: Array, rates: Array, de: Array, drates: Array) -> Array:
    """Return the derivative of ω along changes of the quaternion and of its rates, (3,)."""
    along = 4 * (rates_of_spin(de).T @ rates + rates_of_spin(e).T @ drates)
    return np.asarray((along - 2 * (e @ de) * spin_of(e, rates)) / (e @ e))


def with_given_spins(spins: Sequence[Spin], before: Array, v: Array, q: Array) -> Array:
    """Return velocities whose ω at an orientation q are those of v at another one.

    Raises
    ------
    NoOrientation
        The other one is a quaternion of zeros, whose rates say nothing of ω.
    """
    v = v.copy()
    for spin in spins:
        places = list(spin.places)
        if not before[places].any():
            raise NoOrientation(spin.name)
        if not np.array_equal(before[places], q[places]):
            v[places] = rates_of_spin(q[places]) @ spin_of(before[places], v[places])
    return v


def free_directions(spins: Sequence[Spin], fixed: Flags, q: Array) -> Array:
    """Return the changes of the velocities that are not fixed, (nq, n).

    Parameters
    ----------
    spins : sequence of Spin
    fixed : (nq,) array of bool
        Ignored for the components of the quaternions of spins.
    q : (nq,) array
    """
    plain = ~np.asarray(fixed, dtype=bool)
    for spin in spins:
        plain[list(spin.places)] = False
    columns = [np.eye(len(q))[:, plain]]
    for spin in spins:
        places = list(spin.places)
        turned = np.zeros((len(q), 3))
        turned[places] = rates_of_spin(q[places])
        columns.append(turned[:, ~np.array(spin.fixed)])
    return np.hstack(columns)


def determined(
    evaluator: Evaluator, state: State, fixed_q: Flags, fixed_v: Flags, spins: Sequence[Spin]
) -> tuple[Flags, Flags]:
    """Return which free coordinates and velocities the constraints determine, (nq,) each.

    Their guesses only select one of several solutions.

    Parameters
    ----------
    evaluator : Evaluator
        With the parameters of the state.
    state : State
        A consistent one.
    fixed_q, fixed_v : (nq,) arrays of bool
    spins : sequence of Spin
        See `consistent_state`.
    """
    system, held = evaluator.system, list(evaluator.system.held_at_start)
    jacobian = evaluator.constraints(state.t, state.q, state.v).jacobian
    sizes = evaluator.sizes(state.t, state.q, state.v)
    holonomic = [i for i in system.holonomic if i in set(held)]
    positions = np.eye(len(sizes))[:, ~np.asarray(fixed_q, bool)]
    velocities = free_directions(spins, fixed_v, state.q)
    found: list[Flags] = []
    for rows, free in ((holonomic, positions), (held, velocities)):
        own = 1 / usable(lengths_of_rows(free.T, 1 / sizes))
        null = free @ dense.decompose(along(jacobian[rows], free), sizes=own).null
        still = (np.abs(null) <= _TAKES_PART * sizes[:, None]).all(axis=1)
        found.append(np.asarray(free.any(axis=1) & still))
    return found[0], found[1]


def along(jacobian: Array, free: Array) -> Array:
    """Return the rows of B along directions, B times `free_directions`, without rounding errors.

    All ω are tangent to |e| = 1, whose row must vanish.
    """
    product = jacobian @ free
    product[np.abs(product) <= _NOTHING * (np.abs(jacobian) @ np.abs(free))] = 0.0
    return np.asarray(product)


#: Entries of the projection onto the dependencies above this count: vanishing ones are about 1e-8,
#: the tolerance of the rank.
_TAKES_PART = 1e-6


def dependent_sets(
    system: System, state: State, rank: int, held: Sequence[int]
) -> list[tuple[list[int], int]]:
    """Return the sets of constraints whose rows of B are linearly dependent at a state.

    The projection P onto the combinations of rows that vanish does not depend on their basis.
    Constraints coupled by it form a set; the trace of P over the set is the number of redundant
    rows in it.

    Parameters
    ----------
    system : System
    state : State
        On the constraints.
    rank : int
        Rank of the active rows of B.
    held : sequence of int
        The active constraints.

    Returns
    -------
    list of (list of int, int)
        The constraints of each set, and the number of redundant ones.
    """
    held = list(held)
    if rank == len(held):
        return []
    evaluator, t, q, v = Evaluator(system, state.p), state.t, state.q, state.v
    c = evaluator.constraints(t, q, v)
    sizes = evaluator.sizes(t, q, v)
    lengths = evaluator.row_lengths(t, q, v, c, sizes)[held]
    dependent = dense.decompose(c.jacobian[held], rank, scale=lengths, sizes=sizes).dependent
    projection = dependent @ dependent.T
    joined = np.abs(projection) > _TAKES_PART
    left = {int(i) for i in np.flatnonzero(np.diag(joined))}
    sets = []
    while left:
        members: set[int] = set()
        stack = [min(left)]
        while stack:
            i = stack.pop()
            if i not in members:
                members.add(i)
                stack.extend(left.intersection(np.flatnonzero(joined[i]).tolist()) - members)
        left -= members
        inside = sorted(members)
        sets.append(([held[i] for i in inside], round(float(projection[inside, inside].sum()))))
    return sets


#: Next to a singular configuration, the weakest singular value of B, which is proportional to the
#: distance, is below this part of its median at states that are this far away, relative to the
#: sizes of the coordinates.
_NEAR, _AROUND = 1e-4, 0.1
_STATES = 20
#: A larger singular value of B, whose rows have length one, needs no comparison.
_REGULAR = 1e-2
#: Constraints with a smaller part in the weakest combination are not named.
_PART = 0.05


def coordinate_reach(evaluator: Evaluator, state: State) -> Array:
    """Return the sizes of the coordinates, (nq,), comparable to the largest coordinate."""
    return _reach(state.q, evaluator.sizes(state.t, state.q, state.v))


def _reach(q: Array, sizes: Array) -> Array:
    most = largest(q, sizes) or 1.0
    return np.maximum(np.abs(q), np.minimum(most * sizes, 1.0))


def almost_dependent(system: System, state: State, rank: int) -> tuple[str, ...]:
    """Return the constraints that are almost dependent at the initial state, but not around it.

    The states around it are not consistent: where constraints touch, all consistent states may be
    next to the singular configuration. The weakest singular value of constraints that are almost
    dependent everywhere does not depend on the state.

    Parameters
    ----------
    system : System
    state : State
        A consistent state.
    rank : int
        The rank of B there, of the constraints that hold at the start.

    Returns
    -------
    tuple of str
        Empty away from singular configurations.
    """
    held = list(system.held_at_start)
    if not rank:
        return ()
    evaluator, t, v = Evaluator(system, state.p), state.t, state.v
    sizes = evaluator.sizes(t, state.q, v)
    c = evaluator.constraints(t, state.q, v)
    lengths = usable(evaluator.row_lengths(t, state.q, v, c, sizes)[held])
    here = decompose(c.jacobian[held], rank, lengths, sizes)
    weakest = here.values[rank - 1]
    if weakest > _REGULAR:
        return ()

    def around(q: Array) -> float:
        jacobian = evaluator.constraints(t, q, v).jacobian[held]
        if not np.isfinite(jacobian).all():
            return 0.0
        return float(decompose(jacobian, rank, lengths, sizes).values[rank - 1])

    random, reach = np.random.default_rng(8), _AROUND * coordinate_reach(evaluator, state)
    others = [around(state.q + reach * random.normal(size=len(reach))) for _ in range(_STATES)]
    if not weakest < _NEAR * np.median(others):
        return ()
    parts = np.abs(here.left[:, rank - 1])
    return tuple(system.constraints[k] for k, part in zip(held, parts, strict=True) if part > _PART)


def next_to_singular(system: System, start: ConsistentState) -> list[str]:
    """Return a warning if the start is next to a singular configuration.

    Parameters
    ----------
    system : System
    start : ConsistentState
        A large system with an order of elimination is regular.
    """
    names = () if start.elimination else almost_dependent(system, start.state, start.rank)
    if not names:
        return []
    listed = ", ".join(f"`{name}`" for name in names)
    plural, verb = ("s", "are dependent") if len(names) > 1 else ("", "has no gradient")
    return [
        "the start is next to a singular configuration, in which the"
        f" constraint{plural} {listed} {verb}: accelerations and multipliers change much over a"
        " small distance; give guesses that lead to a start away from it"
    ]
