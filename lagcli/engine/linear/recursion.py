"""Solution of M a = f by velocities that are defined one after the other.

The matrix of the recursive form (`lagcli.equations.derivation.recursion`) is sparse where M is
full, and its determinant has the magnitude of M's. M and f themselves are needed once per step, for
the residual of the solution, and are left to another program.

Its order of elimination follows from its structure: velocities from the last to the first, each
with its equation as a pivot of order two, [[c, 1], [1, 0]], and a coordinate once no velocity that
it changes is left. Thus each velocity adds its inertia to that of the velocity before it, as in
Featherstone's articulated-body algorithm: inertias stay positive, and nothing cancels.

A multiplier waits until the coordinates that its constraint acts on are eliminated, and then, until
more multipliers wait than close a loop in space. The oldest one is eliminated first. The matrix of
those that wait is −G M⁻¹ Gᵀ of the coordinates eliminated so far, which is definite as soon as
these can move in all directions of the constraints.

References
----------
R. Featherstone, Rigid Body Dynamics Algorithms, Springer 2008, chapter 7.
"""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.engine.linear.elimination import Elimination, Unrolling
from lagcli.engine.system import System
from lagcli.engine.tape.tape import Tape

#: Multipliers that wait, at most: those that close a loop in space.
_WAITING = 6


def recursive_order(system: System) -> Elimination:
    """Return the order of elimination of a System's recursive form.

    Parameters
    ----------
    system : System
        With a recursive form.
    """
    form, nq = system.recursive, len(system.coordinates)
    assert form is not None
    count = len(form.coordinates)
    velocities = count - nq
    beside: list[set[int]] = [set() for _ in range(count + len(form.constraints))]
    for i, j in form.mass_pattern:
        beside[i].add(j)
    changed: list[set[int]] = [set() for _ in range(nq)]  # the velocities that change with each
    for k, j in form.jacobian_pattern:
        beside[count + k].add(j)
        beside[j].add(count + k)
        if j < nq and k < velocities:
            changed[j].add(k)
    order: list[int] = []
    paired: list[bool] = []
    columns: list[set[int]] = []
    waiting: list[int] = []  # multipliers

    def eliminate(*pivots: int) -> None:
        below = set.union(*(beside[u] for u in pivots)).difference(pivots)
        for u in below:
            beside[u] |= below
            beside[u].difference_update(pivots)
        for n, u in enumerate(pivots, 1):
            order.append(u)
            paired.append(n < len(pivots))
            columns.append(below)

    def eliminate_coordinate(j: int) -> None:
        touched = (u for u in sorted(beside[j]) if u >= count + velocities)
        waiting.extend(u for u in touched if u not in waiting)
        eliminate(j)
        while len(waiting) > _WAITING:
            eliminate(waiting.pop(0))

    for k in reversed(range(velocities)):
        eliminate(nq + k, count + k)
        for j in sorted(beside[nq + k] | beside[count + k]):
            if j < nq and changed[j]:
                changed[j].discard(k)
                if not changed[j]:
                    eliminate_coordinate(j)
    for j in sorted({*range(nq)}.difference(order)):
        eliminate_coordinate(j)
    for u in waiting:
        eliminate(u)
    place = {u: n for n, u in enumerate(order)}
    return Elimination(
        tuple(order),
        tuple(paired),
        tuple(tuple(sorted(place[u] for u in below)) for below in columns),
        1.0,
    )


def unroll_recursive(system: System, elimination: Elimination) -> Tape:
    """Return the dynamics of a System by its recursive form.

    Parameters
    ----------
    system : System
    elimination : Elimination
        Of its recursive form.

    Returns
    -------
    Tape
        Outputs and inputs as for `unroll`, with zeros for M and f.
    """
    return _Recursive(system, elimination).tape()


class _Recursive(Unrolling):
    """Emits the solution for a and λ, and those for other right sides."""

    def __init__(self, system: System, elimination: Elimination):
        assert system.recursive is not None
        self.moving, self.rows = len(system.coordinates), len(system.constraints)
        super().__init__(system.recursive, elimination, self.moving + 2 * self.rows)
        self.entries_of_mass = len(system.mass_pattern)
        layout = system.dynamics_layout
        first = layout.jacobian.start  # B, γ and the power are those of the System
        kept = range(first, layout.power.stop)
        self.own = self.splice(system.dynamics, range(system.dynamics.inputs), kept)
        entries = zip(system.jacobian_pattern, self.own, strict=False)
        self.speeds = self.rates(system, self.rows, entries)
        rhs = layout.rhs.start - first
        self.add_rates(system.recursive, self.own[rhs : rhs + self.rows])

    def add_rates(self, form: System, rhs: Sequence[int]) -> None:
        """Add γ and the rates of the velocities, without accelerations, to the right side of the
        constraints."""
        count, velocities = len(form.coordinates), len(form.coordinates) - self.moving
        rates = [self.right[self.place[count + k]] for k in range(velocities)]
        sums = [*[self.zero] * velocities, *rhs]
        entries = zip(
            form.jacobian_pattern, self.outputs[form.dynamics_layout.jacobian], strict=True
        )
        of_velocities = [(i, j - self.moving, x) for (i, j), x in entries if j >= self.moving]
        for i, k, x in sorted(of_velocities):
            if i >= velocities:
                sums[i] = self.plus(sums[i], self.times(x, rates[k]))
            elif k != i:
                rates[i] = self.plus(rates[i], rates[k])
        for i in range(velocities, len(sums)):
            self.right[self.place[count + i]] = sums[i]

    def tape(self) -> Tape:
        self.factor()
        nq, nc = self.moving, self.rows
        given, nothing = self.inputs - self.rhs_inputs, [self.zero] * nq
        a, multipliers = self.solved(self.right)
        main = [
            *[self.zero] * self.entries_of_mass,
            *nothing,
            *self.own,
            *a,
            *multipliers,
            self.power(self.own[-1], multipliers, self.speeds),
        ]
        rhs_inputs = self.solved(self.side(range(given, given + nq + nc)))
        moved, _ = self.solved(self.side([*nothing, *range(given + nq + nc, self.inputs)]))
        outputs = [*main, self.determinant(), *rhs_inputs[0], *rhs_inputs[1], *moved]
        return self.finish(
            outputs,
            deferred=(1, nq + nc, nq),
            output_subsets=(tuple(range(len(main) + 1, len(outputs))),),
            isomorphic=self.isomorphic,
        )

    def side(self, given: Sequence[int]) -> list[int]:
        """Return a right side by place: of the coordinates and constraints of the System."""
        side = [self.zero] * len(self.place)
        first = self.nq + self.nc - self.rows
        for u, x in zip(
            [*range(self.moving), *range(first, first + self.rows)], given, strict=True
        ):
            side[self.place[u]] = x
        return side

    def solved(self, right: Sequence[int]) -> tuple[list[int], list[int]]:
        """Emit a solution; return a and λ of the System."""
        x = self.solution(right)
        return x[: self.moving], x[len(x) - self.rows :]
