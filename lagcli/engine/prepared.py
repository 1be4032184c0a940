"""What the runs of a System have in common, whatever its parameters' values."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from lagcli.engine.elimination import Elimination, NoElimination, order_at
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.program import Program, assemble
from lagcli.engine.rates import with_rates
from lagcli.engine.run import State
from lagcli.engine.system import System, without_numbers
from lagcli.engine.unrolling import unroll


class Prepared(NamedTuple):
    """A System made ready for the core: its programs, and how a and λ are solved for.

    It serves the runs of all Systems that differ in the parameters' values alone.

    Parameters
    ----------
    elimination : Elimination or None
        None: the equations are solved densely.
    dynamics : Program
        With the elimination, where it is unrolled.
    constraint : Program
        With ψ.
    """

    elimination: Elimination | None
    dynamics: Program
    constraint: Program

    @property
    def unrolled(self) -> bool:
        """Whether the program of the dynamics yields a and λ."""
        return self.elimination is not None and self.elimination.unrolled

    def serves(self, elimination: Elimination | None) -> bool:
        """Return whether it is what an order of elimination, or None, is made ready by."""
        own = self.elimination
        if own is None or elimination is None:
            return own is elimination
        return (own.order, own.paired, own.columns) == (
            *(elimination.order, elimination.paired, elimination.columns),
        )


def prepare(system: System, elimination: Elimination | None) -> Prepared:
    """Assemble a System's programs with an order of elimination, or for the dense solution."""
    unrolled = elimination is not None and elimination.unrolled
    tape = unroll(system, elimination) if elimination and unrolled else system.dynamics
    labels = system.families
    right = [without_numbers(name) + "''" for name in (*system.coordinates, *system.constraints)]
    rhs = [without_numbers(name) + "'''" for name in system.constraints]
    return Prepared(
        elimination,
        dynamics=assemble(tape, [*labels, *right, *rhs] if tape.other else labels),
        constraint=assemble(with_rates(system), labels),
    )


def find_elimination(evaluator: Evaluator, states: Iterable[State]) -> Elimination | None:
    """Find an order of elimination that suits states; None where there is none."""
    try:
        return order_at(evaluator.system, [evaluator.entries(*state) for state in states])
    except NoElimination:
        return None
