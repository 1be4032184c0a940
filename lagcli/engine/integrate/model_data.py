"""A model as data, for programs on the core without Python: `core/lagmodel.h` states the format.

The data hold what a run would be given: equations, start, settings, and what switches. Orders of
pivots for implicit methods, which Python chooses during a run, are those of a run by that method.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from ctypes import c_double, c_int, c_int64
from typing import Any

import numpy as np

from lagcli.engine.contract import IntegrationRequest, breaks_of
from lagcli.engine.core import run as core_run
from lagcli.engine.core.fields import (
    elimination_fields,
    equations_fields,
    function_fields,
    jacobian_fields,
    pivot_fields,
    series_fields,
)
from lagcli.engine.core.program import Program, assemble
from lagcli.engine.core.structures import (
    Doubles,
    Integers,
    Structure,
    lag_block,
    lag_elimination,
    lag_equations,
    lag_event,
    lag_function,
    lag_jacobians,
    lag_pivots,
    lag_problem,
    lag_program,
    lag_series_program,
    lag_settings,
    lag_stream,
)
from lagcli.engine.core.switching import CHANGES, lag_switching_rules, rules_fields
from lagcli.engine.integrate.engine import switches
from lagcli.engine.integrate.prepared import unrolled
from lagcli.engine.integrate.run import Integration
from lagcli.engine.integrate.switching_run import SwitchingIntegration
from lagcli.engine.linear.sparse import matrix_pattern
from lagcli.engine.switching.switching import EventRule
from lagcli.engine.system import ENERGY, System
from lagcli.settings.methods import METHODS

_MAGIC, _VERSION = int.from_bytes(b"lagmodel", "little"), 7
#: lag_model_contents.
_PLAIN, _LOOP, _UNROLLED, _TIME, _SERIES, _JACOBIANS, _SWITCHING = (1 << i for i in range(7))
_KINDS = ("q", "v", "p")


def model_data(
    system: System, request: IntegrationRequest, methods: Sequence[str] = tuple(METHODS)
) -> bytes:
    """Return a System, its start and settings as data, which `lag_read_model` reads.

    Parameters
    ----------
    system : System
    request : IntegrationRequest
        As for `integrate`; its method does not matter.
    methods : sequence of str
        The methods that are to be available, as far as the equations permit. An implicit one
        takes a run by it.
    """
    run = _integration(system, request, "DOP853")
    prepared = run.in_use
    whole = unrolled(run.system, prepared).whole
    contents = 0
    parts: list[bytes] = []

    def add(bit: int, *data: bytes) -> None:
        nonlocal contents
        contents |= bit
        parts.extend(data)

    problem = run.problem() | {
        "detecting": 0,
        "parameters": run.system.held_at(request.state.t, run.request.state.p),
        "times_count": np.size(request.times),
        "block": None,
        "kernel": 0,
    }
    functions = function_fields(run.system)
    add(
        0,
        _structure(lag_equations, equations_fields(run.system, prepared.constraint)),
        _structure(lag_problem, problem),
        numbers_data(breaks_of(run.system, run.request)),
        word_data(len(functions)),
        *(_structure(lag_function, fields) for fields in functions),
    )
    if prepared.elimination is not None and run.redundant:
        add(0, integers_data(prepared.elimination.left_out(run.system)))
    if prepared.whole is None:
        add(_PLAIN, program_data(prepared.dynamics))
        if prepared.elimination is not None:
            plan = elimination_fields(run.system, prepared.elimination)
            add(_LOOP, _structure(lag_elimination, plan))
    if whole is not None:
        add(_UNROLLED, program_data(whole))
    explicit = run.explicit_time()
    if explicit is not None:
        add(_TIME, program_data(explicit))
    series = run.series_program(unrolled(run.system, prepared)) if "Taylor" in methods else ""
    if not isinstance(series, str):
        add(_SERIES, _structure(lag_series_program, series_fields(series)))
    implicit = [name for name in methods if METHODS[name].implicit]
    if implicit and run.system.variation is not None:
        add(_JACOBIANS, *_jacobians(run, system, request, implicit))
    if isinstance(run, SwitchingIntegration):
        add(_SWITCHING, *_switching(run))
    unroll_after = int(run.unroll_at) if math.isfinite(run.unroll_at) else 0
    body = word_data(contents) + word_data(unroll_after) + b"".join(parts)
    return word_data(_MAGIC) + word_data(_VERSION) + word_data(3 + len(body) // 8) + body


def _integration(system: System, request: IntegrationRequest, method: str) -> Integration:
    """Return a run that has not begun."""
    request = request._replace(settings=request.settings.replace(method=method))
    kind = SwitchingIntegration if switches(system) else Integration
    return kind(system, request, lambda block: None, None)


def _jacobians(
    run: Integration, system: System, request: IntegrationRequest, methods: Iterable[str]
) -> Iterator[bytes]:
    assert run.system.variation is not None
    variation = run.system.variation()
    pattern = matrix_pattern(run.system, variation, run.request.rank)
    yield _structure(lag_jacobians, jacobian_fields(variation, pattern, run.nq))
    orders = []
    for name in methods:
        if METHODS[name].exact and not variation.exact:
            continue
        nominal = _integration(system, request, name)
        nominal.run()
        number = core_run.METHODS.index(name)
        orders += [(number, pivot_fields(order)) for order in nominal.core.orders]
    yield word_data(len(orders))
    for number, fields in orders:
        yield word_data(number) + _structure(lag_pivots, fields)


def _switching(run: SwitchingIntegration) -> Iterator[bytes]:
    split = run.split_system
    rules = rules_fields(split, run.frozen, run.ticks())
    yield _structure(lag_switching_rules, rules | {"log": None, "log_rows": 0})
    actions, report = split.switching.actions, split.system.report
    yield program_data(split.program(actions if actions else report.selected(())))
    yield program_data(assemble(report.selected([ENERGY])))
    events = split.switching.events
    yield word_data(len(events))
    place = {row.row: i for i, row in enumerate(split.switching.rows)}
    for rule in events:
        displaces = rule.displaces(run.whole.constraining)
        yield _structure(lag_event, _event(rule, place, displaces))


def _event(rule: EventRule, place: dict[int, int], displaces: bool) -> dict[str, Any]:
    constraint, change = rule.change or (-1, CHANGES[0])
    return {
        "condition": -1 if rule.condition is None else rule.condition,
        "clock": -1 if rule.clock is None else rule.clock,
        "constraint": constraint,
        "change": CHANGES.index(change),
        "times": rule.times or 0,
        "first": rule.first,
        "target_count": len(rule.targets),
        "kind": [_KINDS.index(what) for what, _ in rule.targets],
        "target": [index for _, index in rule.targets],
        "displaces": displaces,
        "impulse_count": len(rule.impulses),
        "impulse": rule.impulses,
        "release_count": len(rule.release),
        "engage_count": len(rule.engage),
        "release": [place[constraint] for constraint in rule.release],
        "engage": [place[constraint] for constraint in rule.engage],
        "stops": rule.stop,
    }


def _structure(structure: type[Structure], values: dict[str, Any]) -> bytes:
    """Return the fields of a structure, in their order."""
    return b"".join(_field(of, values[name]) for name, of in structure._fields_)  # type: ignore[misc]


def _field(of: Any, value: Any) -> bytes:
    if value is None:
        return word_data(0)
    if of in (c_int, c_int64):
        return word_data(int(value))
    if of is c_double:
        return np.float64(value).tobytes()
    if of is Doubles:
        return numbers_data(value)
    if of is lag_program:
        return program_data(value)
    if of is lag_settings:
        return _structure(of, value)
    assert of in (Integers, lag_stream, lag_block)
    return integers_data(value)


def word_data(value: int) -> bytes:
    """Return an integer as data."""
    return np.int64(value).tobytes()


def integers_data(values: Any) -> bytes:
    """Return a list of integers as data."""
    array = np.ravel(np.array([*values], dtype=np.int32))
    return word_data(len(array)) + array.tobytes() + bytes(4 * (len(array) % 2))


def numbers_data(values: Any) -> bytes:
    """Return a list of numbers as data."""
    array = np.ravel(np.array(values, dtype=float))
    return word_data(len(array)) + array.tobytes()


def program_data(program: Program) -> bytes:
    """Return a program as data."""
    none = program.main[:0]
    deferred = [*program.deferred, none, none, none][:3]
    subsets = [*program.output_subsets, none, none][:2]
    streams = [program.prelude, program.main, *deferred, *subsets]
    inputs, registers = word_data(program.inputs), numbers_data(program.registers)
    return b"".join(
        [*map(integers_data, streams), inputs, registers, integers_data(program.outputs)]
    )
