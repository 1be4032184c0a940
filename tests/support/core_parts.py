"""Parts of the core by themselves, core/parts.h, and models as data, core/lagmodel.h."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterable, Sequence
from ctypes import byref, c_double, c_int, c_void_p
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lagcli.arrays import Array
from lagcli.engine.core.batch import core
from lagcli.engine.core.contact_problem import ContactProblem
from lagcli.engine.core.fields import order_fields
from lagcli.engine.core.library import KERNEL, LIBRARY, PORTABLE, check
from lagcli.engine.core.program import Program, assemble
from lagcli.engine.core.run import Integrator
from lagcli.engine.core.structures import (
    Arguments,
    Doubles,
    Integers,
    Structure,
    address,
    lag_elimination,
)
from lagcli.engine.linear.elimination import Elimination
from lagcli.engine.tape.tape import Tape

parts = ctypes.PyDLL(str(LIBRARY))
Function = Callable[[float], float]
_SCALAR_FUNCTION = ctypes.PYFUNCTYPE(c_double, c_void_p, c_double)
_ROOT = _SCALAR_FUNCTION, c_void_p, *[c_double] * 5
SIGNATURES: dict[str, tuple[Any, ...]] = {
    "lag_part_run": (None, c_int, c_void_p, c_void_p),
    "lag_part_code_create": (c_void_p, c_void_p, c_int, c_int),
    "lag_part_code_destroy": (None, c_void_p),
    "lag_part_code_run": (None, c_void_p, c_int, c_void_p, ctypes.c_int64),
    "lag_part_code_size": (ctypes.c_int64, c_void_p, c_int),
    "lag_part_enclose": (c_int, c_void_p, c_void_p, c_double, c_int, c_int, c_void_p),
    "lag_part_ldl": (c_int, c_void_p, c_int, *[c_void_p] * 4),
    "lag_part_contact_memory": (ctypes.c_size_t, c_int),
    "lag_part_contacts": (c_int, *[c_void_p] * 5),
    "lag_part_lemke": (c_int, *[c_void_p] * 3),
    "lag_part_share": (c_int, *[c_void_p] * 6),
    "lag_part_least_distance": (c_int, c_int, c_int, *[c_void_p] * 5),
    "lag_part_impact_memory": (ctypes.c_size_t, c_int),
    "lag_part_impact": (c_int, c_void_p, c_int, c_void_p, c_void_p),
    "lag_part_bracketed_root": (c_double, *_ROOT),
    "lag_part_last_digit_root": (c_double, *_ROOT[:4]),
    "lag_part_node": (c_double, c_int),
    "lag_part_bernstein_matrix": (None, c_void_p),
    "lag_part_resolved": (c_int, c_void_p),
    "lag_part_first_change": (c_int, c_void_p, c_double, c_void_p, c_void_p),
    "lag_part_estimate_root": (c_double, c_void_p, c_double, c_double),
    "lag_part_enclose_watched": (None, c_void_p, c_int, *[c_double] * 2, c_int, *[c_void_p] * 3),
    "lag_part_search_cost": (None, *[c_void_p] * 3),
    "lag_part_watch": (c_int, c_void_p, c_double, *[c_void_p] * 3),
    "lag_part_steps_over": (c_int, c_void_p, c_double, c_double, c_void_p, c_void_p),
    "lag_part_path": (c_int, c_void_p, c_int, *[c_void_p] * 3),
    "lag_part_measure": (None, c_void_p, c_double, c_void_p),
    "lag_part_is_smooth": (c_int, c_int, c_void_p, c_void_p),
    "lag_part_approaches": (c_int, c_void_p, c_double, c_void_p),
    "lag_part_follow_approach": (c_int, c_void_p, c_double, *[c_void_p] * 3),
    "lag_part_acceleration_terms": (Doubles, c_void_p),
    "lag_part_coefficients": (None, c_void_p, c_void_p),
    # of programs without the binding
    "lag_create": (c_void_p, *[c_void_p] * 3),
    "lag_destroy": (None, c_void_p),
    "lag_start": (c_int, c_void_p),
    "lag_advance": (c_int, c_void_p, ctypes.c_int64),
    "lag_use_tangent": (c_int, c_void_p, c_void_p, c_int, c_int),
    "lag_use_explicit_time": (c_int, c_void_p, c_void_p),
    "lag_use_breaks": (c_int, c_void_p, c_void_p, ctypes.c_int64),
    "lag_use_functions": (c_int, c_void_p, c_void_p, c_int),
    "lag_use_switching": (c_int, c_void_p, c_void_p),
    "lag_read_model": (c_int, c_void_p, c_void_p, ctypes.c_int64, c_void_p),
    "lag_release_model": (None, c_void_p),
    "lag_check_program": (c_int, c_void_p),
    "lag_simulate_to": (c_int, c_void_p, c_double),
    "lag_stopped_by": (c_int, c_void_p),
    "lag_log_of": (Doubles, c_void_p, c_void_p, c_void_p),
    "lag_simulation_size": (ctypes.c_size_t, c_void_p),
    "lag_state_size": (ctypes.c_size_t, c_void_p),
    "lag_save": (None, c_void_p, c_void_p),
    "lag_restore": (c_int, c_void_p, c_void_p),
    "lag_save_simulation": (None, c_void_p, c_void_p),
    "lag_restore_simulation": (c_int, c_void_p, c_void_p),
}
for name, (result, *arguments) in SIGNATURES.items():
    getattr(parts, name).restype, getattr(parts, name).argtypes = result, arguments


class lag_contacts(Structure):
    _fields_ = (
        ("n", c_int),
        *((name, Doubles) for name in ("matrix", "offset")),
        ("law", Integers),
        *((name, Doubles) for name in ("static_limit", "static_slope")),
        *((name, Doubles) for name in ("kinetic_limit", "kinetic_slope", "rounding")),
    )


class lag_contact_motion(Structure):
    _fields_ = (("force", Doubles), ("motion", Doubles), ("mode", Integers))


class lag_impact(Structure):
    _fields_ = (
        ("n", c_int),
        *((name, Doubles) for name in ("matrix", "before")),
        ("law", Integers),
        *((name, Doubles) for name in ("restitution", "friction", "rounding")),
        *((name, c_void_p) for name in ("phase", "context")),
    )


class lag_impact_result(Structure):
    _fields_ = (("impulse", Doubles), ("after", Doubles), ("loss", Doubles))


class lag_rodas5p_coefficients(Structure):
    _fields_ = (
        ("gamma", c_double),
        *((name, c_double * 8) for name in ("c", "d")),
        *((name, c_double * 7 * 8) for name in ("a", "C")),
        ("h", c_double * 8 * 3),
    )


class lag_radau5_coefficients(Structure):
    _fields_ = (
        ("c", c_double * 3),
        *((name, c_double * 3 * 3) for name in ("t", "t_inverse")),
        *((name, c_double) for name in ("real", "re", "im")),
        ("error", c_double * 3),
        *((name, c_double) for name in ("defect", "zero")),
    )


def _coefficients() -> tuple[Any, Any]:
    made = lag_rodas5p_coefficients(), lag_radau5_coefficients()
    parts.lag_part_coefficients(*map(byref, made))
    return made


def rodas5p_coefficients() -> tuple[Any, ...]:
    """Return γ, c, d, a, C and h of Rodas5P; see core/methods/rodas5p_tableau.h."""
    r = _coefficients()[0]
    return r.gamma, *map(np.array, (r.c, r.d, r.a, r.C, r.h))


def radau5_coefficients() -> tuple[Any, ...]:
    """Return c, T, T⁻¹, the eigenvalues, the weights of the error and the factors of the defect;
    see radau5_tableau.h."""
    r = _coefficients()[1]
    eigenvalues = r.real, complex(r.re, r.im)
    defect = (r.defect, r.zero)
    return *map(np.array, (r.c, r.t, r.t_inverse)), eigenvalues, np.array(r.error), defect


def run_tape(
    tape: Tape, inputs: ArrayLike, families: Sequence[str | None] = (), output_subset: int = -1
) -> Array:
    """Run a tape once, with all that is asked for apart, as the engine does.

    Parameters
    ----------
    tape : Tape
    inputs : sequence of float
    families : sequence of str or None
        Labels of the inputs.
    output_subset : int
        Which of the subsets of outputs to evaluate, if any; other outputs have no meaning
        then.
    """
    program = assemble(tape, families)
    registers = program.registers
    registers[: tape.inputs] = inputs
    main = program.main if output_subset < 0 else program.output_subsets[output_subset]
    for stream in (program.prelude, main, *program.deferred):
        parts.lag_part_run(KERNEL, address(stream), address(registers))
    return registers[program.outputs]


class NativeProgram:
    """A program whose routines become machine code, each after its first call.

    Parameters
    ----------
    program : Program
    lanes : int
        1, or the lanes of a batch.
    at_once : bool
        Otherwise only after as many calls as are worth it.
    """

    def __init__(self, program: Program, lanes: int = 1, at_once: bool = True):
        self._given = Arguments()
        self._code = parts.lag_part_code_create(
            byref(self._given.program(program)), lanes, int(at_once)
        )
        check(not self._code)

    def __del__(self) -> None:
        parts.lag_part_code_destroy(self._code)

    def run(self, routine: int, registers: Array, times: int = 1) -> None:
        """Run a routine: the main stream, the deferred ones, then those of subsets."""
        parts.lag_part_code_run(self._code, routine, address(registers), times)

    def size(self, routine: int) -> int:
        """Return the bytes of a routine's machine code; 0 where it is interpreted."""
        found: int = parts.lag_part_code_size(self._code, routine)
        return found


def enclosures(
    tape: Tape, inputs: ArrayLike, high: float, order: int, *, narrowed: bool = False
) -> Array:
    """Return bounds of the Taylor coefficients of a tape's outputs: (outputs, order + 1, 2).

    The first input is in an interval from its value to `high`, the others are fixed; `narrowed` by
    jets at its middle.
    """
    given = Arguments()
    program = given.program(assemble(tape))
    out = np.empty((len(tape.outputs), order + 1, 2))
    start = given.doubles(inputs)
    check(parts.lag_part_enclose(byref(program), start, high, order, narrowed, address(out)))
    return out


def solve_ldl(
    plan: Elimination,
    places: Sequence[tuple[int, int]],
    values: Iterable[float],
    right: ArrayLike,
    kernel: int = KERNEL,
) -> Array:
    """Factor a sparse symmetric matrix and solve with it, as the engine does for large models.

    Parameters
    ----------
    plan : Elimination
    places : sequence of (row, column)
        Of the nonzero entries, both triangles.
    values : sequence of float
    right : (n,) array
    kernel : int
    """
    given = Arguments()
    record = given.filled(lag_elimination, **order_fields(plan))
    n, count = len(plan.order), plan.starts[-1]
    factors = np.zeros(2 * n + count + 1)
    for target, value in zip(plan.targets(places), values, strict=True):
        if target >= 0:
            factors[target] = value
    product, work, x = np.zeros(count + 1), np.zeros(2 * n), np.array(right, dtype=float)
    check(parts.lag_part_ldl(*(byref(record), kernel), *map(address, (factors, product, work, x))))
    return x


def _contacts(
    problem: ContactProblem, given: Arguments, rounding: ArrayLike | None = None
) -> lag_contacts:
    return given.filled(
        lag_contacts,
        n=len(problem.offset),
        matrix=problem.matrix,
        offset=problem.offset,
        law=problem.laws,
        static_limit=problem.static,
        static_slope=problem.static_slopes,
        kinetic_limit=problem.kinetic,
        kinetic_slope=problem.kinetic_slopes,
        rounding=rounding,
    )


def _unwritten(*shape: int, dtype: type = np.uint8) -> Array:
    """Return memory of which nothing can be read before it is written: numbers near 1e301."""
    count = math.prod(shape) * np.dtype(dtype).itemsize
    return np.full(count, 0x7E, dtype=np.uint8).view(dtype).reshape(shape)


def solve_contacts(
    problem: ContactProblem, present: ArrayLike | None = None, rounding: ArrayLike | None = None
) -> list[tuple[Array, Array, Any]]:
    """Return the solutions of a contact problem, two at most: (force, motion, modes) of each.

    Parameters
    ----------
    problem : ContactProblem
    present : (n,) array of int, optional
        Modes to try first.
    rounding : (n,) array, optional
        Errors that the offset may have.
    """
    given = Arguments()
    record = _contacts(problem, given, rounding)
    n: int = record.n
    made = [
        (*(_unwritten(n, dtype=float) for _ in range(2)), _unwritten(n, dtype=np.int32))
        for _ in range(2)
    ]
    motions = [lag_contact_motion(*map(address, one)) for one in made]
    first = None if present is None else given.integers(present)
    memory = _unwritten(parts.lag_part_contact_memory(n))
    count = parts.lag_part_contacts(byref(record), first, address(memory), *map(byref, motions))
    return made[:count]


def lemke_modes(problem: ContactProblem) -> tuple[bool, bool, Any]:
    """Return whether Lemke's method ends with a solution, whether its modes are those of one, and
    the modes."""
    given = Arguments()
    record = _contacts(problem, given)
    n: int = record.n
    modes = _unwritten(n, dtype=np.int32)
    memory = _unwritten(parts.lag_part_contact_memory(n))
    found = parts.lag_part_lemke(byref(record), address(memory), address(modes))
    return found > 0, found == 2, modes


def share_contacts(
    problem: ContactProblem, modes: ArrayLike, force: ArrayLike
) -> tuple[bool, Array, Array, Any]:
    """Return whether rows are redundant, the forces of given modes, the common slack of the laws of
    redundant rows, and which are tight.

    Where they are not redundant, the forces are those given, and no slack is finite.

    Parameters
    ----------
    problem : ContactProblem
    modes : (n,) array of int
    force : (n,) array
        Forces of the modes.
    """
    given = Arguments()
    record = _contacts(problem, given)
    n: int = record.n
    shared, slack = np.array(force, dtype=float), np.full(n, np.inf)
    tight = np.zeros(n, dtype=np.int32)
    memory = _unwritten(parts.lag_part_contact_memory(n))
    redundant = parts.lag_part_share(
        byref(record), given.integers(modes), *map(address, (memory, shared, slack, tight))
    )
    return bool(redundant), shared, slack, tight.astype(bool)


def least_distance(normal: ArrayLike, bound: ArrayLike) -> Array | None:
    """Return the shortest z with normal z >= bound; None where there is none."""
    rows = np.array(normal, dtype=float)
    m, n = rows.shape
    z, room = _unwritten(n, dtype=float), _unwritten((n + 1) * (n + 4) + 2 * m, dtype=float)
    place = _unwritten(m, dtype=np.int32)
    given = Arguments()
    found = parts.lag_part_least_distance(
        n, m, address(rows), given.doubles(bound), *map(address, (z, room, place))
    )
    return z if found else None


def solve_impact(
    matrix: ArrayLike,
    before: ArrayLike,
    laws: ArrayLike,
    restitution: ArrayLike,
    friction: ArrayLike,
    law: int,
    rounding: ArrayLike | None = None,
) -> tuple[int, Array, Array, Array]:
    """Return how many motions follow an impact, up to 2, and impulses, velocities after, losses.

    Parameters
    ----------
    matrix, friction : (n, n) arrays
    before, restitution : (n,) arrays
    laws : (n,) array of int
    law : int
        0, Poisson's; 1, Newton's; 2, one contact at a time.
    rounding : (n,) array, optional
        Errors that the velocities before may have.
    """
    given, n = Arguments(), np.size(before)
    record = given.filled(
        lag_impact,
        n=n,
        matrix=matrix,
        before=before,
        law=laws,
        restitution=restitution,
        friction=friction,
        rounding=rounding,
        phase=None,
        context=None,
    )
    impulse, after, loss = (_unwritten(n, dtype=float) for _ in range(3))
    made = lag_impact_result(*map(address, (impulse, after, loss)))
    memory = _unwritten(parts.lag_part_impact_memory(n))
    count = parts.lag_part_impact(byref(record), law, address(memory), byref(made))
    return count, impulse, after, loss


def batch_sincos(x: Array, portable: bool = False) -> Array:
    """Return sin and cos of numbers as batches have them, (2, n)."""
    lanes = 8
    given = np.concatenate([x, np.zeros(lanes)])
    out = np.zeros((2, len(given)))
    for i in range(0, len(x), lanes):
        core.lag_batch_sincos(
            *map(address, (given[i:], out[0, i:], out[1, i:])), PORTABLE if portable else KERNEL
        )
    return out[:, : len(x)]


class _Watched:
    """A function for C, and what it has raised: after that it is not called again."""

    def __init__(self, function: Function):
        self.function, self.error = function, None

    def __call__(self, _: Any, x: float) -> float:
        if self.error is not None:
            return np.nan
        try:
            return self.function(x)
        except BaseException as error:
            self.error = error
            return np.nan


def _root(find: Any, function: Function, *numbers: float) -> float:
    watched = _Watched(function)
    root: float = find(_SCALAR_FUNCTION(watched), None, *numbers)
    if watched.error is not None:
        raise watched.error
    return root


def bracketed_root(function: Function, low: float, high: float, exact: float) -> float:
    """Return where a function is found negative, after values that are not."""
    numbers = low, high, function(low), function(high), exact
    return _root(parts.lag_part_bracketed_root, function, *numbers)


def last_digit_root(function: Function, low: float, high: float) -> float:
    """Return the first number at which a function is not positive."""
    return _root(parts.lag_part_last_digit_root, function, low, high)


#: Nodes of an interval at which watched functions are evaluated: core/switching/switching.h.
NODES = 9


def nodes() -> Array:
    """Return the nodes of an interval from 0 to 1."""
    return np.array([parts.lag_part_node(k) for k in range(NODES)])


def bernstein_matrix() -> Array:
    """Return the matrix that converts values at nodes to Bernstein coefficients."""
    matrix = np.empty((NODES, NODES))
    parts.lag_part_bernstein_matrix(address(matrix))
    return matrix


def resolved(values: ArrayLike) -> bool:
    """Return whether values at the nodes determine a function."""
    given = Arguments()
    return bool(parts.lag_part_resolved(given.doubles(values)))


def first_change(bernstein: ArrayLike, start: float = 0.0) -> tuple[float, float] | None:
    """Return where a polynomial becomes negative first beyond a place: a bracket, or None."""
    given, low, high = Arguments(), c_double(), c_double()
    found = parts.lag_part_first_change(given.doubles(bernstein), start, byref(low), byref(high))
    return (low.value, high.value) if found else None


def estimated_root(bernstein: ArrayLike, low: float, high: float) -> float:
    """Return the root of a polynomial in a bracket."""
    root: float = parts.lag_part_estimate_root(Arguments().doubles(bernstein), low, high)
    return root


class Enclosed(NamedTuple):
    """Enclosures of a watched function along the last step of a run.

    Parameters
    ----------
    start, length : float
        Of the step.
    over : (2,) array
        Bounds over the step, before the dense output is known.
    jet : (order + 1, 2) array
        Bounds of the Taylor coefficients in a part of it.
    """

    start: float
    length: float
    over: Array
    jet: Array


def enclosed(run: int, k: int, a: float, b: float, order: int) -> Enclosed:
    """Return the enclosures of function k, and from a to b in parts of the step."""
    step, over, jet = np.empty(2), np.empty(2), np.empty((order + 1, 2))
    parts.lag_part_enclose_watched(run, k, a, b, order, *map(address, (step, over, jet)))
    return Enclosed(*step.tolist(), over, jet)


def search_cost(run: int) -> Array:
    """Return what the search for events of a run has cost: coefficients of jets, and states."""
    coefficients, states = ctypes.c_int64(), ctypes.c_int64()
    parts.lag_part_search_cost(run, byref(coefficients), byref(states))
    return np.array([coefficients.value, states.value])


def save(core: Integrator) -> bytes:
    """Return the state of a run, to which `restore` goes back."""
    saved = ctypes.create_string_buffer(parts.lag_state_size(core._run))
    parts.lag_save(core._run, saved)
    return saved.raw


def restore(core: Integrator, saved: bytes) -> bool:
    """Go back to a state of this run; return whether that was possible."""
    return not parts.lag_restore(core._run, saved)
