"""Structures of `lagcore.h`, `lagmodel.h` and `lagbatch.h`, and how they are filled.

Structures and fields have their names and order in C, where each is explained. A pointer is to
numbers of 8 bytes (`Doubles`) or to integers of 4 (`Integers`).
"""

from __future__ import annotations

import ctypes
from ctypes import c_char, c_double, c_int, c_int64, c_void_p
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from lagcli.arrays import Array, Int32
from lagcli.engine.core.settings import CORE_SETTINGS, c_type

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from lagcli.engine.core.program import Program


class Doubles(c_void_p):
    """A pointer to numbers."""


class Integers(c_void_p):
    """A pointer to integers."""


class Structure(ctypes.Structure):
    """A structure of C, whose annotations mypy does not see."""

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...


class _Records(c_void_p):
    """A pointer to structures."""

    of: type[Structure]


def _records(of: type[Structure]) -> type[_Records]:
    """Return the type of pointers to structures of a type."""
    return type(f"{of.__name__}s", (_Records,), {"of": of})


def each(kind: Any, names: str) -> list[tuple[str, Any]]:
    """Return fields of one type."""
    return [(name, kind) for name in names.split()]


class lag_stream(Structure):
    """A sequence of operations."""

    _fields_ = [("code", Integers), ("length", c_int64)]


class lag_program(Structure):
    """A function as operations on a register file."""

    _fields_ = [
        *each(lag_stream, "prelude main"),
        ("deferred", lag_stream * 3),
        ("output_subsets", lag_stream * 2),
        ("inputs", c_int),
        ("registers", Doubles),
        ("register_count", c_int64),
        ("outputs", Integers),
        ("output_count", c_int64),
    ]


class lag_equations(Structure):
    """The sizes and the sparsity of the equations."""

    _fields_ = [
        *each(c_int, "nq nc nh np"),
        ("holonomic", Integers),
        *each(c_int, "nm nb"),
        *each(Integers, "mass_row mass_column jacobian_row jacobian_column unit"),
        ("constraint", lag_program),
    ]


_TYPES: dict[str, Any] = {"double": c_double, "int64_t": c_int64, "int": c_int}


class lag_settings(Structure):
    """The settings that the core uses."""

    _fields_ = [(name, _TYPES[c_type(setting)]) for name, setting in CORE_SETTINGS.items()]


class lag_problem(Structure):
    """An initial value problem."""

    _fields_ = [
        ("settings", lag_settings),
        ("t", c_double),
        *each(Doubles, "y parameters atol"),
        ("kind", Integers),
        ("rank", c_int),
        *each(Doubles, "sizes lengths plain_lengths"),
        *each(c_int, "watching detecting refinable"),
        ("times", Doubles),
        ("times_count", c_int64),
        ("block", Doubles),
        ("block_rows", c_int64),
        *each(c_int, "extra directions kernel"),
    ]


class lag_elimination(Structure):
    """An order of elimination."""

    _fields_ = [
        ("n", c_int),
        *each(Integers, "order paired start row"),
        *each(Integers, "mass_targets jacobian_targets"),
    ]


class lag_series_program(Structure):
    """A program for Taylor coefficients."""

    _fields_ = [
        ("values", lag_program),
        ("stream", lag_stream),
        *each(c_int, "convolutions order invariant numbers"),
        ("begins", Integers),
        *each(c_int, "begin_count origin layer"),
        ("state", Integers),
        ("size", c_int64),
    ]


class lag_block(Structure):
    """A sparse block of derivatives."""

    _fields_ = [("count", c_int), ("places", Integers)]


class lag_jacobians(Structure):
    """The derivatives that implicit methods need."""

    _fields_ = [
        ("program", lag_program),
        *each(lag_block, "force_position force_velocity rhs_position rhs_velocity"),
        *each(lag_block, "power_position power_velocity"),
        ("n", c_int),
        *each(Integers, "start columns parts"),
        ("parts_count", c_int64),
    ]


class lag_pivots(Structure):
    """Sparse LU with a known order of pivots."""

    _fields_ = [("n", c_int), *each(Integers, "row column start columns diagonal places")]


class lag_function(Structure):
    """A known function of time in pieces."""

    _fields_ = [
        *each(c_int, "first degree"),
        ("count", c_int64),
        *each(Doubles, "knots origins coefficients"),
        ("period", c_double),
    ]


class lag_event(Structure):
    """An event of a model, of lagmodel.h."""

    _fields_ = [
        *each(c_int, "condition clock constraint change times first target_count"),
        *each(Integers, "kind target"),
        *each(c_int, "displaces impulse_count"),
        ("impulse", Integers),
        *each(c_int, "release_count engage_count"),
        *each(Integers, "release engage"),
        ("stops", c_int),
    ]


class lag_switching_rules(Structure):
    """Switched rows of constraints, kinks, conditions and clocks."""

    _fields_ = (
        *each(c_int, "rows exported nc"),
        *each(Integers, "constraint base law limit normal place"),
        ("sign", Doubles),
        *each(Integers, "active friction restitution"),
        *each(c_int, "nb nh"),
        *each(Integers, "row column"),
        *each(lag_program, "functions gaps"),
        ("signs", c_int),
        *each(lag_program, "sign_functions limits"),
        *each(c_int, "nl pattern_count"),
        *each(Integers, "pattern_limit pattern_row"),
        ("impact", lag_program),
        *each(c_int, "nf force_count"),
        *each(Integers, "force_coordinate force_row force_constraint"),
        ("forces", lag_program),
        *each(c_int, "conditions force_conditions"),
        *each(lag_program, "condition_functions force_condition_functions"),
        *each(Integers, "either time"),
        ("clocks", c_int),
        ("ticks", Doubles),
        *each(Integers, "most reported"),
        *each(c_int, "kinks first_branch"),
        *each(Integers, "whole of_time"),
        ("kink_functions", lag_program),
        ("log", Doubles),
        ("log_rows", c_int64),
    )


class lag_method_pivots(Structure):
    """An order of pivots of a method."""

    _fields_ = [("method", c_int), ("pivots", lag_pivots)]


class lag_model(Structure):
    """What a run needs, of lagmodel.h."""

    _fields_ = [
        ("equations", lag_equations),
        ("problem", lag_problem),
        ("contents", c_int),
        ("unroll_after", c_int64),
        ("breaks", Doubles),
        ("break_count", c_int64),
        *each(c_int, "function_count pivots_count event_count"),
        ("functions", _records(lag_function)),
        ("pivots", _records(lag_method_pivots)),
        ("events", _records(lag_event)),
        ("left_out", Integers),
        *each(lag_program, "dynamics unrolled explicit_time"),
        ("elimination", lag_elimination),
        ("series", lag_series_program),
        ("jacobians", lag_jacobians),
        ("rules", lag_switching_rules),
        *each(lag_program, "actions energy"),
        ("whole", lag_equations),
        *each(lag_program, "mass tangent"),
        *each(c_int, "tangent_blocks tangent_complete"),
        ("owned", c_void_p),
    ]


class lag_report(Structure):
    """The state of a run."""

    _fields_ = [
        *each(c_double, "t_old t"),
        *each(Doubles, "y atol lengths"),
        *each(c_int64, "steps rejected evaluations times_next"),
        ("t_bad", c_double),
        ("y_bad", Doubles),
        ("examined", c_int64),
        *each(c_double, "suspect_from suspect_to"),
        ("limiting", c_int),
    ]


_S = TypeVar("_S", bound=Structure)


def address(array: np.ndarray[Any, Any]) -> int:
    """Return the address of an array, which must exist as long as the address is used."""
    if array.size and array.flags.writeable and array.flags.c_contiguous:
        # a third of the time of the attribute
        return ctypes.addressof(c_char.from_buffer(array))  # type: ignore[arg-type]
    return array.ctypes.data


def copied(pointer: Doubles, count: int) -> Array:
    """Return a copy of the core's numbers."""
    if not count:
        return np.empty(0)
    # through the buffer of an array of ctypes, NumPy takes ten times as long
    return np.frombuffer(bytearray(ctypes.string_at(pointer.value or 0, 8 * count)))


def copied_integers(pointer: Integers, count: int) -> Int32:
    """Return a copy of the core's integers."""
    if not count:
        return np.empty(0, dtype=np.int32)
    whole = bytearray(ctypes.string_at(pointer.value or 0, 4 * count))
    return np.frombuffer(whole, dtype=np.int32)


def listed(pointer: Integers, count: int) -> list[int]:
    """Return the core's integers."""
    return (c_int * count).from_address(pointer.value or 0)[:] if count else []


class Arguments:
    """Arguments of a call of the core: structures that point into arrays, which it keeps alive."""

    def __init__(self) -> None:
        self.arrays: list[Any] = []

    # a pointer is never NULL, also to nothing: C forbids that even for copies of no bytes

    def doubles(self, values: ArrayLike) -> int:
        """Return the address of numbers."""
        array = np.ascontiguousarray(values, dtype=float)
        self.arrays.append(array)
        return address(array)

    def integers(self, values: ArrayLike) -> int:
        """Return the address of integers."""
        array = np.ascontiguousarray(values, dtype=np.int32)
        self.arrays.append(array)
        return address(array)

    def stream(self, code: Any) -> lag_stream:
        """Return a stream of operations."""
        return lag_stream(self.integers(code), len(code))

    def program(self, program: Program) -> lag_program:
        """Return a program."""
        made = lag_program(
            prelude=self.stream(program.prelude),
            main=self.stream(program.main),
            inputs=program.inputs,
            registers=self.doubles(program.registers),
            register_count=len(program.registers),
            outputs=self.integers(program.outputs),
            output_count=len(program.outputs),
        )
        for i, code in enumerate(program.deferred):
            made.deferred[i] = self.stream(code)
        for i, code in enumerate(program.output_subsets):
            made.output_subsets[i] = self.stream(code)
        return made

    def filled(self, structure: type[_S], /, **values: Any) -> _S:
        """Return a structure from the values of all its fields.

        Arrays and lists become pointers, programs and dictionaries become structures; None is NULL,
        or a structure of zeros.
        """
        made, fields = structure(), cast("list[tuple[str, Any]]", structure._fields_)
        for name, of in fields:
            value = values.pop(name)
            if value is None:
                continue
            if of is c_void_p:
                pass
            elif of is Doubles:
                value = self.doubles(value)
            elif of is Integers:
                value = self.integers(value)
            elif of is lag_program:
                value = self.program(value)
            elif of is lag_stream:
                value = self.stream(value)
            elif of is lag_block:
                value = lag_block(len(value), self.integers(value))
            elif of is lag_settings:
                value = of(**value)
            elif issubclass(of, _Records):
                records = (of.of * len(value))(*(self.filled(of.of, **x) for x in value))
                self.arrays.append(records)
                value = ctypes.addressof(records)
            elif issubclass(of, Structure):
                value = self.filled(of, **value)
            setattr(made, name, value)
        if values:
            raise TypeError(f"{structure.__name__} has no {', '.join(values)}")
        return made
