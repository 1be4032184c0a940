"""The functions in tapes that depend on time explicitly, such as sin(ω t).

An integrator sees them only at its stages: a body at rest under a force of time, or before a short
pulse, allows steps in which they oscillate unseen. The core limits its steps by their curvature;
`engine/core/resolution.c`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lagcli.engine.tape.operations import ARITY, Op
from lagcli.engine.tape.tape import Builder, Tape

#: Operations that bend a function of time; sums and products inherit from their operands.
_NONLINEAR = {Op.DIV} | {
    op for op in Op if op.function is not None and op not in (Op.FLOOR, Op.CEIL)
}


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
        (t, q, v, parameters) → their results; None if there are none.
    """
    given = [tape for tape in tapes if tape.outputs]
    if not given:
        return None
    parameters = given[0].parameters
    builder = Builder(1 + states + parameters, parameters, functions=given[0].functions)
    found: list[int] = []
    for tape in given:
        first = tape.inputs - tape.rhs_inputs - tape.parameters
        own = [*range(1 + states), *[-1] * (first - 1 - states)]
        own += range(1 + states, 1 + states + parameters)
        wanted = _nonlinear(tape, states, first)
        found += builder.splice(tape._replace(outputs=tuple(wanted)), own)
    return builder.finish(dict.fromkeys(found)) if found else None


def _nonlinear(tape: Tape, states: int, parameters: int) -> Sequence[int]:
    """Return the registers of the operations."""
    timed, unknown, found = {0}, {*range(1 + states, parameters)}, []
    unknown |= {*range(parameters + tape.parameters, tape.inputs)}
    for op, to, a, b, c in tape.code:
        operands = (a, b, c)[: ARITY[op]]
        if not unknown.isdisjoint(operands):
            unknown.add(to)
        elif not timed.isdisjoint(operands):
            timed.add(to)
            if op in _NONLINEAR and (op != Op.DIV or b in timed):
                found.append(to)
    return found
