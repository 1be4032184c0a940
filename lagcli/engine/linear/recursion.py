"""Solution of M a = f by velocities that are defined one after the other.

The matrix of the recursive form (`lagcli.equations.derivation.recursion`) is sparse where M is
full, and its determinant has the magnitude of M's. M and f themselves are needed once per step, for
the residual of the solution, and are left to another program.

Its order of elimination follows from its structure: velocities from the last to the first, each
with its equation as a pivot of order two, [[c, 1], [1, 0]], and a coordinate once no velocity that
it changes is left. Thus each velocity adds its inertia to that of the velocity before it, as in
Featherstone's articulated-body algorithm: inertias stay positive, and nothing cancels.

References
----------
R. Featherstone, Rigid Body Dynamics Algorithms, Springer 2008, chapter 7.
"""

from __future__ import annotations

from lagcli.engine.linear.elimination import Elimination, Unrolling
from lagcli.engine.system import System
from lagcli.engine.tape.tape import Tape


def recursive_order(system: System) -> Elimination:
    """Return the order of elimination of a recursive form.

    Parameters
    ----------
    system : System
        `System.recursive` of another one.
    """
    count, velocities = len(system.coordinates), len(system.constraints)
    nq = count - velocities
    beside: list[set[int]] = [set() for _ in range(count + velocities)]
    for i, j in system.mass_pattern:
        beside[i].add(j)
    changed: list[set[int]] = [set() for _ in range(nq)]  # the velocities that change with each
    for k, j in system.jacobian_pattern:
        beside[count + k].add(j)
        beside[j].add(count + k)
        if j < nq:
            changed[j].add(k)
    order: list[int] = []
    paired: list[bool] = []
    columns: list[set[int]] = []

    def eliminate(*pivots: int) -> None:
        below = set.union(*(beside[u] for u in pivots)).difference(pivots)
        for u in below:
            beside[u] |= below
            beside[u].difference_update(pivots)
        for n, u in enumerate(pivots, 1):
            order.append(u)
            paired.append(n < len(pivots))
            columns.append(below)

    for k in reversed(range(velocities)):
        eliminate(nq + k, count + k)
        for j in sorted(beside[nq + k] | beside[count + k]):
            if j < nq and changed[j]:
                changed[j].discard(k)
                if not changed[j]:
                    eliminate(j)
    for j in sorted({*range(nq)}.difference(order)):
        eliminate(j)
    place = {u: n for n, u in enumerate(order)}
    return Elimination(
        tuple(order),
        tuple(paired),
        tuple(tuple(sorted(place[u] for u in below)) for below in columns),
        1.0,
    )


def unroll_recursive(system: System, elimination: Elimination) -> Tape:
    """Return the dynamics of a System without constraints, by its recursive form.

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
    """Emits the solution for a, and that for another right side."""

    def __init__(self, system: System, elimination: Elimination):
        assert system.recursive is not None
        self.moving = len(system.coordinates)
        super().__init__(system.recursive, elimination, self.moving)
        self.entries_of_mass = len(system.mass_pattern)
        power = system.dynamics_layout.power
        self.power = self.splice(system.dynamics, range(system.dynamics.inputs), [power.start])[0]

    def tape(self) -> Tape:
        self.factor()
        given, nothing = self.inputs - self.rhs_inputs, [self.zero] * self.moving
        other = [given + u if u < self.moving else self.zero for u in self.plan.order]
        main = [
            *[self.zero] * self.entries_of_mass,
            *nothing,
            self.power,
            *self.solution(self.right)[: self.moving],
            self.power,
        ]
        others = self.solution(other)[: self.moving]
        outputs = [*main, self.determinant(), *others, *nothing]
        return self.finish(
            outputs,
            deferred=(1, self.moving, self.moving),
            output_subsets=(tuple(range(len(main) + 1, len(outputs))),),
            isomorphic=self.isomorphic,
        )
