"""Programs shared by the runs of a System, for any parameter values.

Unrolling an elimination into the tape and assembling it takes some µs of Python time for each
operation, and saves the core some nanoseconds at each evaluation. Therefore a short elimination is
unrolled before the first step, a longer one when a run has taken as many steps as pay for it or
when many runs are to come, and one with large fill never: its columns are long enough for the loop
in C.

Steps are limited where functions depend on t explicitly, such as sin(ω t): an integrator sees them
only at its stages, and a body at rest under a force of time, or before a short pulse, would allow
steps in which they oscillate unseen (`engine/core/resolution.c`).
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple, TypeGuard

from lagcli.arrays import Array
from lagcli.engine.constraints.rates import constraint_program
from lagcli.engine.core.program import LONG, Program, assemble
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.dense import independent_rows
from lagcli.engine.linear.elimination import (
    MOST_FOR_EACH,
    MOST_UNROLLED,
    Elimination,
    NoElimination,
    order_at,
    unroll,
)
from lagcli.engine.system import State, System, without_numbers
from lagcli.engine.tape.operations import ARITY, Op
from lagcli.engine.tape.tape import Builder, Tape

#: Largest number of operations of the dynamics and updates of an elimination that is unrolled
#: immediately.
SHORT = 1000
#: Part of the updates of M's elimination which that of the recursive form may have.
SHORTER = 0.5
#: Average size of families, and number of operations, from which right sides of derivatives are
#: vectorized.
_MEMBERS, _LONG_OF_MEMBERS = 8, 500


class Prepared(NamedTuple):
    """A System prepared for the core: its programs, and how a and λ are computed.

    Shared by all Systems that differ only in parameter values.

    Parameters
    ----------
    elimination : Elimination or None
        Order of elimination; None: the equations are solved densely.
    constraint : Program
        The constraint tape with ψ.
    plain : Program or None
        The dynamics; None if they are not needed without the elimination.
    whole : Program or None
        The dynamics with the unrolled elimination, if it is unrolled.
    tangent : Program, optional
        Program of the derivatives' right sides, for a System with derivatives.
    recursive : bool
        Whether the unrolled elimination is that of the recursive form: M and f are then those of
        ``plain``.
    """

    elimination: Elimination | None
    constraint: Program
    plain: Program | None
    whole: Program | None
    tangent: Program | None = None
    recursive: bool = False

    @property
    def unrolled(self) -> bool:
        """Whether the program of the dynamics yields a and λ."""
        return self.whole is not None

    @property
    def dynamics(self) -> Program:
        """The program of the dynamics to run."""
        program = self.whole or self.plain
        assert program is not None
        return program

    def serves(self, elimination: Elimination | None) -> bool:
        """Return whether it has been prepared for an order of elimination, or for None."""
        return self.elimination == elimination

    @property
    def worth_unrolling(self) -> bool:
        """Whether a long run, or many runs, should use the unrolled elimination."""
        return not self.unrolled and may_unroll(self.elimination)


def prepare(
    system: System, elimination: Elimination | None, known: Prepared | None = None
) -> Prepared:
    """Make a System ready with an order of elimination, or for the dense solution.

    Parameters
    ----------
    system : System
    elimination : Elimination or None
    known : Prepared, optional
        A previous preparation of the System, possibly with another order; its programs are reused
        if they do not depend on the order.
    """
    if known is not None and known.serves(elimination):
        return known
    if known is None:
        constraint, tangent, plain = constraint_program(system), None, None
        if system.tangent is not None:
            tangent = _tangent(system)
    else:
        constraint, tangent, plain = known.constraint, known.tangent, known.plain
    if may_unroll(elimination) and len(system.dynamics.code) + elimination.updates <= SHORT:
        return Prepared(elimination, constraint, None, _with(system, elimination), tangent)
    plain = plain or assemble(system.dynamics, system.families)
    return Prepared(elimination, constraint, plain, None, tangent)


def unrolled(system: System, prepared: Prepared) -> Prepared:
    """Return the preparation for long or many runs: the elimination is unrolled if permitted."""
    elimination = prepared.elimination
    if prepared.unrolled or not may_unroll(elimination):
        return prepared
    return prepared._replace(whole=_with(system, elimination))


def recursive(system: System, prepared: Prepared) -> Prepared | None:
    """Return the preparation for a long run by the System's recursive form; None if its elimination
    is not shorter.

    Parameters
    ----------
    system : System
        With a recursive form.
    prepared : Prepared
        With an elimination that is not unrolled.
    """
    from lagcli.engine.linear.recursion import recursive_order, unroll_recursive

    assert prepared.elimination is not None
    order = recursive_order(system)
    if not may_unroll(order) or order.updates > SHORTER * prepared.elimination.updates:
        return None
    right = [without_numbers(name) + "''" for name in system.coordinates]
    whole = assemble(unroll_recursive(system, order), [*system.families, *right])
    return prepared._replace(whole=whole, recursive=True)


def may_unroll(elimination: Elimination | None) -> TypeGuard[Elimination]:
    """Return whether an elimination has so few updates that it may be unrolled."""
    if elimination is None:
        return False
    return elimination.updates <= min(MOST_UNROLLED, MOST_FOR_EACH * len(elimination.order))


def _with(system: System, elimination: Elimination) -> Program:
    """Return the program of the dynamics with an elimination."""
    motion = system.motion
    right = [without_numbers(name) + "''" for name in (*motion.coordinates, *motion.constraints)]
    rhs = [without_numbers(name) + "'''" for name in motion.constraints]
    return assemble(unroll(system, elimination), [*system.families, *right, *rhs])


def _tangent(system: System) -> Program:
    """Return the program of the derivatives' right sides, which uses the registers of the
    dynamics."""
    assert system.tangent is not None
    motion, families = system.motion, system.families
    first = len(families) - system.held
    accelerations = [
        without_numbers(name) + "''" for name in (*motion.coordinates, *motion.constraints)
    ]
    members = len(motion.coordinates) / max(1, len(set(map(without_numbers, motion.coordinates))))
    return assemble(
        system.tangent.tape,
        [*families[:first], *accelerations, *families[first:]],
        _LONG_OF_MEMBERS if members >= _MEMBERS else LONG,
    )


@lru_cache(maxsize=4)
def explicit_time(system: System) -> Program | None:
    """Return the program of the functions that depend on time explicitly; None if there are none.

    Cached for many runs.
    """
    tapes = [system.dynamics]
    if system.switching is not None:
        s = system.switching
        tapes += [x for x in (s.limits, s.forces, s.force_conditions) if x is not None]
    functions = explicit_functions(tapes, 2 * len(system.coordinates))
    return None if functions is None else assemble(functions)


def find_elimination(
    evaluator: Evaluator,
    states: Sequence[State],
    rank: int | None = None,
    lengths: Array | None = None,
) -> Elimination | None:
    """Find an order of elimination for some states; None if there is none.

    Parameters
    ----------
    evaluator : Evaluator
    states : sequence of State
    rank : int, optional
        Rank of B, of which so many rows are eliminated, independent ones at the last state; all
        rows by default.
    lengths : (nc,) array, optional
        The largest lengths so far of the rows of B times sizes, in which a row that vanishes in
        passing is short; by default those at the last state.
    """
    motion = evaluator.system.motion
    if motion is not evaluator.system:
        nq, evaluator = len(motion.coordinates), Evaluator(motion, evaluator.p)
        states = [State(s.t, s.q[:nq], s.v[:nq], s.p) for s in states]
    rows = None
    if rank is not None and rank < len(motion.constraints):
        rows = _independent(evaluator, states[-1], rank, lengths)
    try:
        found = order_at(motion, [evaluator.entries(s.t, s.q, s.v) for s in states], rows)
    except NoElimination:
        return None
    if rows is None:
        return found
    nq = len(motion.coordinates)
    return found._replace(order=tuple(u if u < nq else nq + rows[u - nq] for u in found.order))


def _independent(
    evaluator: Evaluator, state: State, rank: int, lengths: Array | None
) -> list[int] | None:
    """Return independent rows of B at a state; None if B is not finite."""
    t, q, v = state.t, state.q, state.v
    c = evaluator.constraints(t, q, v)
    if not c.finite:
        return None
    sizes = evaluator.sizes(t, q, v)
    if lengths is None:
        lengths = evaluator.row_lengths(t, q, v, c, sizes)
    return independent_rows(c.jacobian, rank, scale=lengths, sizes=sizes)


#: Operations that bend a function of time, beside products and divisions by another one.
_NONLINEAR = {op for op in Op if op.function is not None and op not in (Op.FLOOR, Op.CEIL)}


def explicit_functions(tapes: Iterable[Tape], states: int) -> Tape | None:
    """Return the tape of the nonlinear operations whose operands depend on t explicitly.

    Parameters
    ----------
    tapes : iterable of Tape
        Of (t, q, v, …, parameters), with the same parameters. Operations on inputs between v and
        the parameters are left out.
    states : int
        Number of q and v.

    Returns
    -------
    Tape or None
        (t, q, v, parameters) → their results; for each whether the branches in which it is used may
        be those taken; and for each whether it depends on q or v. None if there are none.
    """
    given = [tape for tape in tapes if tape.outputs]
    if not given:
        return None
    parameters = given[0].parameters
    builder = Builder(1 + states + parameters, parameters, functions=given[0].functions)
    found: dict[tuple[int, ...], None] = {}
    for tape in given:
        first = tape.inputs - tape.rhs_inputs - tape.parameters
        own = [*range(1 + states), *[-1] * (first - 1 - states)]
        own += range(1 + states, 1 + states + parameters)
        outputs = builder.splice(_nonlinear(tape, states, first), own)
        count = len(outputs) // 3
        parts = (outputs[k * count : (k + 1) * count] for k in range(3))
        found |= dict.fromkeys(zip(*parts, strict=True))
    return builder.finish(x for part in zip(*found, strict=True) for x in part) if found else None


def _nonlinear(tape: Tape, states: int, parameters: int) -> Tape:
    """Return the tape of the operations, of whether each is used, and whether of q or v."""
    timed, unknown, results = {0}, {*range(1 + states, parameters)}, []
    moving = {*range(1, 1 + states)}
    unknown |= {*range(parameters + tape.parameters, tape.inputs)}
    for op, to, a, b, c in tape.code:
        operands = (a, b, c)[: ARITY[op]]
        if not moving.isdisjoint(operands):
            moving.add(to)
        if not unknown.isdisjoint(operands):
            unknown.add(to)
        elif not timed.isdisjoint(operands):
            timed.add(to)
            product = op == Op.MUL and timed.issuperset(operands)
            if op in _NONLINEAR or product or (op == Op.DIV and b in timed):
                results.append(to)
    if not results:
        return tape._replace(outputs=())
    builder = Builder(tape.inputs, tape.parameters, tape.rhs_inputs, tape.functions)
    always, never = builder.constant(1.0), builder.constant(0.0)
    of_state = [always if x in moving else never for x in results]
    if all(op != Op.SELECT for op, *_ in tape.code):
        found = builder.splice(tape._replace(outputs=tuple(results)), range(tape.inputs))
        return builder.finish([*found, *[always] * len(found), *of_state])
    place = builder.extend(tape._replace(outputs=tuple(range(tape.registers))))
    taken = _branches(tape, builder, place, unknown)
    used = (taken.get(x, always) for x in results)
    return builder.finish([*(place[x] for x in results), *used, *of_state])


def _branches(
    tape: Tape, builder: Builder, place: Sequence[int], unknown: Container[int]
) -> dict[int, int]:
    """Return whether results are used, as registers of a builder with the tape's at some places;
    none for results that are used always or where an unknown condition holds.
    """
    always = set(tape.outputs)
    used: dict[int, int] = {}
    for op, to, *operands in reversed(tape.code):
        for k, x in enumerate(operands[: ARITY[op]]):
            where = None if to in always or to not in used else used[to]
            if op == Op.SELECT and k and operands[0] not in unknown:
                condition = place[operands[0]]
                if k == 2:
                    condition = builder.emit(Op.NOT, condition)
                where = condition if where is None else builder.emit(Op.AND, where, condition)
            if where is None:
                always.add(x)
            else:
                used[x] = builder.emit(Op.OR, used[x], where) if x in used else where
    return {x: where for x, where in used.items() if x not in always}
