"""The unrolled elimination of exported code, with a check of its solution.

Code solves [[M, Bᵀ], [B, 0]] [a; −λ] = [f; γ] as the engine does: by the operations of an LDLᵀ
factorization in an order that is determined in advance. The order suits the states of the model's
own run. At other states, or with other parameters, a pivot may be small, so the code also evaluates
whether each equation holds to rounding errors, and solves densely, with pivots of the state, where
one does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.prepared import may_unroll
from lagcli.engine.layout import UnrolledLayout
from lagcli.engine.linear.elimination import Elimination, NoElimination, order_at, unroll
from lagcli.engine.system import State, System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Arithmetic, Tape

#: Residual of an equation, relative to the sum of its terms' magnitudes, up to which a solution is
#: accurate: a hundred roundings.
ACCURATE = 2e-14
#: Residual of an equation whose terms are all 0; not denormal, which some compilers make 0.
_LEAST = 1e-300


class EliminatedTape(NamedTuple):
    """An unrolled elimination with a check of its solution.

    Parameters
    ----------
    tape : Tape
        (t, q, v, p) → (a, λ, entries of B, conditions). a and λ are accurate where all conditions
        hold, of which each is 1 or 0. They do not where a number is not finite. λ of rows of B that
        are not eliminated is 0, and their equations are not checked.
    first : int
        The first condition among the outputs. There are no entries of B unless rows are left out.
    """

    tape: Tape
    first: int

    @property
    def conditions(self) -> Tape:
        """(t, q, v, p) → conditions."""
        return self.tape.selected(range(self.first, len(self.tape.outputs)))


def order_of(
    evaluator: Evaluator,
    states: Sequence[State],
    known: Elimination | None,
    rows: Sequence[int],
) -> Elimination | None:
    """Return an order of elimination for code; None if none is accurate, or all are long.

    Parameters
    ----------
    evaluator : Evaluator
    states : sequence of State
        States of a run, the initial one first.
    known : Elimination, optional
        The order of the run's start, which is kept if it is accurate at all states.
    rows : sequence of int
        The independent constraints, ascending.

    Returns
    -------
    Elimination or None
        Of the known order and those for the initial state and for all states, the first of those
        that are accurate at most states.
    """
    system = evaluator.system
    if not system.coordinates:
        return None
    points = [[s.t, *s.q, *s.v, *s.p] for s in states]
    values = [evaluator.entries(s.t, s.q, s.v) for s in states]
    orders = [] if known is None or len(rows) < len(system.constraints) else [known]
    best, most = None, 0
    for sampled in (values[:1], values):
        try:
            orders.append(_numbered(system, order_at(system, sampled, rows), rows))
        except NoElimination:
            continue
    for order in orders:
        if not may_unroll(order):
            continue
        conditions = ScalarTape(eliminated_tape(system, order).conditions)
        accurate = sum(all(conditions(x)) for x in points)
        if accurate > most:
            best, most = order, accurate
        if accurate == len(points):
            break
    return best


def _numbered(system: System, order: Elimination, rows: Sequence[int]) -> Elimination:
    """Return an order of some rows with the numbers of all."""
    nq = len(system.coordinates)
    return order._replace(order=tuple(u if u < nq else nq + rows[u - nq] for u in order.order))


def eliminated_tape(system: System, elimination: Elimination) -> EliminatedTape:
    """Return the unrolled elimination in an order, with the check of its solution."""
    given, nq = system.dynamics, system.counts.nq
    builder = Arithmetic(given.inputs, given.parameters, functions=given.functions)
    out, equations = equations_of(builder, system, elimination)
    left_out = elimination.left_out(system)
    bound, least = builder.constant(ACCURATE), builder.constant(_LEAST)
    sums, sizes = [], []
    for terms in equations:
        total = size = builder.zero
        for term in terms:
            total = builder.plus(total, term)
            size = builder.plus(size, builder.magnitude(term))
        sums.append(total)
        sizes.append(size)
    layout = UnrolledLayout(system.counts)
    accurate: list[int] = []
    for i, (total, size) in enumerate(zip(sums, sizes, strict=True)):
        if total != builder.zero and i - nq not in left_out:
            # infinite terms do not hold, but terms that are all 0
            within = builder.plus(builder.times(bound, size), least)
            accurate.append(builder.emit(Op.LT, builder.magnitude(total), within))
    jacobian = out[layout.jacobian] if left_out else []
    tape = builder.finish([*out[layout.solution], *jacobian, *accurate])
    return EliminatedTape(tape, len(tape.outputs) - len(accurate))


def equations_of(
    builder: Arithmetic, system: System, elimination: Elimination
) -> tuple[list[int], list[list[int]]]:
    """Emit an unrolled elimination, and the terms of its equations.

    Returns
    -------
    outputs : list of int
        The outputs by `UnrolledLayout`, up to a and λ, without powers.
    terms : list of nq + nc lists of int
        The terms of M a − f − Bᵀλ, then of B a − γ, which add up to 0.
    """
    nq = system.counts.nq
    layout = UnrolledLayout(system.counts)
    places = [*range(layout.power.start), *range(layout.solution.start, layout.solution.stop)]
    whole = unroll(system, elimination)
    out = [builder.zero] * layout.solution.stop
    needed = builder.splice(whole, range(system.dynamics.inputs), places)
    for place, x in zip(places, needed, strict=True):
        out[place] = x
    a, multipliers = out[layout.solution][:nq], out[layout.solution][nq:]
    terms = [[builder.negative(x)] for x in out[layout.forcing]]
    rows = [[builder.negative(x)] for x in out[layout.rhs]]
    for (i, j), x in zip(system.mass_pattern, out[layout.mass_matrix], strict=True):
        terms[i].append(builder.times(x, a[j]))
    for (i, j), x in zip(system.jacobian_pattern, out[layout.jacobian], strict=True):
        terms[j].append(builder.negative(builder.times(x, multipliers[i])))
        rows[i].append(builder.times(x, a[j]))
    return out, [*terms, *rows]
