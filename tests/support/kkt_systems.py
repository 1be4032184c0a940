"""Systems written by hand whose M, B and right side are given, and their solution."""

from __future__ import annotations

import numpy as np
from core_parts import run_tape, solve_ldl
from lowered import Lowered

from lagcli.engine.linear.elimination import Elimination, unroll
from lagcli.engine.system import System
from lagcli.engine.tape.tape import Builder, Tape


def hand_written(mass: np.ndarray, jacobian: np.ndarray, rhs: np.ndarray) -> Lowered:
    """Return a System whose dynamics tape yields the given numbers."""
    nq, nc = len(mass), len(jacobian)
    m = tuple((int(i), int(j)) for i, j in np.argwhere(mass))
    b = tuple((int(i), int(j)) for i, j in np.argwhere(jacobian))
    values = [*(mass[i, j] for i, j in m), *rhs[:nq], *(jacobian[i, j] for i, j in b), *rhs[nq:], 0]
    # as inputs, not as constants: those would be folded
    builder = Builder(1 + 2 * nq + len(values), len(values))
    dynamics = builder.finish(range(1 + 2 * nq, 1 + 2 * nq + len(values)))
    empty = Tape(1 + 2 * nq, (), (), ())
    names = tuple(map(str, range(nq)))
    system = System(
        coordinates=names,
        constraints=tuple(map(str, range(nc))),
        holonomic=(),
        parameters=tuple(map(str, range(len(values)))),
        mass_pattern=m,
        jacobian_pattern=b,
        dynamics=dynamics,
        constraint=empty,
        report=empty,
    )
    return Lowered(system, tuple(map(float, values)))


def whole(mass: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
    nc = len(jacobian)
    return np.block([[mass, jacobian.T], [jacobian, np.zeros((nc, nc))]])


def eliminated(
    case: Lowered, plan: Elimination, rhs: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return [a; −λ] by the unrolled tape, for another right side too, and by sparse factors; and
    the first nq unknowns for a right side without its first nq entries.
    """
    system, p = case
    nq = len(system.coordinates)
    tape = unroll(system, plan)
    inputs = [0.0] * (1 + 2 * nq) + [*p, *rhs, *rhs[nq:]]

    out = run_tape(tape, inputs)
    first = len(system.dynamics.outputs)
    x = out[first : first + len(rhs)].copy()
    other = out[-len(rhs) - nq : -nq]
    x[nq:] *= -1
    other[nq:] *= -1
    places = [
        *system.mass_pattern,
        *((nq + i, j) for i, j in system.jacobian_pattern),
        *((j, nq + i) for i, j in system.jacobian_pattern),
    ]
    nm, nb = len(system.mass_pattern), len(system.jacobian_pattern)
    m, b = p[:nm], p[nm + nq : nm + nq + nb]
    looped = solve_ldl(plan, places, [*m, *b, *b], rhs)
    return [x, other, looped], out[-nq:]
