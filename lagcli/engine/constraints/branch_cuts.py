"""Branch cuts of `atan2` in holonomic constraints, at which these jump by 2π."""

from __future__ import annotations

from lagcli.arrays import Array
from lagcli.engine.contract import Stop
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape


def passes_branch_cut(
    evaluator: Evaluator, before: tuple[float, Array, Array], after: tuple[float, Array, Array]
) -> Stop | None:
    """Return the end of a run at a branch cut of a holonomic constraint; None if there is none.

    Parameters
    ----------
    evaluator : Evaluator
    before, after : tuple of float, (nq,) array and (nq,) array
        t, q and v at the start and the end of a step.
    """
    system = evaluator.system
    for k, row in enumerate(system.holonomic):
        arguments = _arguments(system.constraint.selected([k]))
        tape = ScalarTape(arguments)
        start, end = (tape([t, *q, *v, *evaluator.p]) for t, q, v in (before, after))
        for y0, x0, y1, x1 in zip(start[::2], start[1::2], end[::2], end[1::2], strict=True):
            if (y0 < 0.0) != (y1 < 0.0) and x0 < 0.0 and x1 < 0.0:
                return Stop(
                    f"the constraint `{system.constraints[row]}` jumps at t = {after[0]:.9g} s: an"
                    " `atan2` in it changes by 2 pi where its first argument passes 0 and its"
                    " second is negative; write it without the jump, as `x*sin(phi) = y*cos(phi)`"
                    " in place of `atan2(y, x) = phi`"
                )
    return None


def _arguments(tape: Tape) -> Tape:
    """Return a tape of the arguments of each `atan2` on which the outputs of another depend."""
    places = [place for op, _, *operands in tape.code if op == Op.ATAN2 for place in operands[:2]]
    return tape._replace(outputs=tuple(places), rhs_inputs=0, deferred=(), output_subsets=())
