"""Programs shared by the runs of a System, for any parameter values.

Unrolling an elimination into the tape and assembling it takes some 50 µs of Python time for each
operation, and saves the core some nanoseconds at each evaluation. Therefore a short elimination is
unrolled before the first step, a longer one when a run has taken many steps or when many runs are
to come, and one with large fill never: its columns are long enough for the loop in C.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple, TypeGuard

from lagcli.engine.constraints.rates import with_rates
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.elimination import Elimination, NoElimination, order_at
from lagcli.engine.linear.unrolling import unroll
from lagcli.engine.program.program import Program, assemble
from lagcli.engine.program.vectorize import LONG
from lagcli.engine.state import State
from lagcli.engine.system import System, without_numbers
from lagcli.engine.tape.explicit_time import explicit_functions

#: Largest number of operations of the dynamics and updates of an elimination that is unrolled
#: immediately.
SHORT = 1000
#: Number of steps of a run after which unrolling pays off.
STEPS_TO_UNROLL = 2500
#: Largest number of updates, in total and per unknown, of an elimination that is unrolled.
MOST_UNROLLED = 30_000
_MOST_FOR_EACH = 100
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
    """

    elimination: Elimination | None
    constraint: Program
    plain: Program | None
    whole: Program | None
    tangent: Program | None = None

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
        return not self.unrolled and _may_unroll(self.elimination)


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
        constraint, tangent, plain = assemble(with_rates(system), system.families), None, None
        if system.tangent is not None:
            tangent = _tangent(system)
    else:
        constraint, tangent, plain = known.constraint, known.tangent, known.plain
    if _may_unroll(elimination) and len(system.dynamics.code) + elimination.updates <= SHORT:
        return Prepared(elimination, constraint, None, _with(system, elimination), tangent)
    plain = plain or assemble(system.dynamics, system.families)
    return Prepared(elimination, constraint, plain, None, tangent)


def unrolled(system: System, prepared: Prepared) -> Prepared:
    """Return the preparation for long or many runs: the elimination is unrolled if permitted."""
    elimination = prepared.elimination
    if prepared.unrolled or not _may_unroll(elimination):
        return prepared
    return prepared._replace(whole=_with(system, elimination))


def _may_unroll(elimination: Elimination | None) -> TypeGuard[Elimination]:
    if elimination is None:
        return False
    return elimination.updates <= min(MOST_UNROLLED, _MOST_FOR_EACH * len(elimination.order))


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
    found = [without_numbers(name) + "''" for name in (*motion.coordinates, *motion.constraints)]
    members = len(motion.coordinates) / max(1, len(set(map(without_numbers, motion.coordinates))))
    return assemble(
        system.tangent.tape,
        [*families[:first], *found, *families[first:]],
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
    found = explicit_functions(tapes, 2 * len(system.coordinates))
    return None if found is None else assemble(found)


def find_elimination(evaluator: Evaluator, states: Iterable[State]) -> Elimination | None:
    """Find an order of elimination for some states; None if there is none."""
    motion = evaluator.system.motion
    if motion is not evaluator.system:
        nq, evaluator = len(motion.coordinates), Evaluator(motion, evaluator.p)
        states = [State(s.t, s.q[:nq], s.v[:nq], s.p) for s in states]
    try:
        return order_at(motion, [evaluator.entries(s.t, s.q, s.v) for s in states])
    except NoElimination:
        return None
