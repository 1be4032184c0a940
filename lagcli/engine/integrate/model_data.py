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

from lagcli.engine.constraints.initial import programs_of_search
from lagcli.engine.contract import IntegrationRequest, breaks_of
from lagcli.engine.core import run as core_run
from lagcli.engine.core.fields import (
    equations_fields,
    jacobian_fields,
    model_fields,
    pivot_fields,
    series_fields,
)
from lagcli.engine.core.program import Program, assemble
from lagcli.engine.core.structures import (
    Doubles,
    Integers,
    Structure,
    lag_block,
    lag_model,
    lag_program,
    lag_stream,
)
from lagcli.engine.core.switching import CHANGES, clock_fields
from lagcli.engine.integrate.engine import switches
from lagcli.engine.integrate.prepared import unrolled
from lagcli.engine.integrate.run import Integration
from lagcli.engine.integrate.switching_run import SwitchingIntegration
from lagcli.engine.linear.sparse import matrix_pattern
from lagcli.engine.switching.switching import EventRule
from lagcli.engine.system import ENERGY, System
from lagcli.settings.methods import METHODS

_MAGIC, _VERSION = int.from_bytes(b"lagmodel", "little"), 8
_TYPES: dict[str, Any] = dict(lag_model._fields_)  # type: ignore[arg-type]
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

    Raises
    ------
    Stop
        The start is singular: whoever runs the data elsewhere refuses starts at which the rank of
        B is another one.
    """
    run = _integration(system, request, "DOP853")
    run.check_start()
    prepared, start = run.in_use, run.request.state
    parts = run.parts(prepared)
    parts["breaks"] = breaks_of(run.system, run.request)
    parts["problem"] = run.problem() | {
        "detecting": 0,
        "parameters": run.system.held_at(start.t, start.p),
        "times_count": np.size(request.times),
        "block": None,
        "kernel": 0,
    }
    if math.isfinite(run.unroll_at):
        later = run.for_long_runs()
        parts |= {"unrolled": later.whole, "recursive": later.recursive}
        parts["unroll_after"] = int(run.unroll_at)
    else:
        parts["unroll_after"] = 0
    series = run.series_program(unrolled(run.system, prepared)) if "Taylor" in methods else ""
    if not isinstance(series, str):
        parts["series"] = series_fields(series)
    implicit = [name for name in methods if METHODS[name].implicit]
    if implicit and run.system.variation is not None:
        parts |= _jacobians(run, system, request, implicit)
    if isinstance(run, SwitchingIntegration):
        parts["rules"] |= clock_fields(run.clocks)
        parts |= _actions(run)
    return _data(model_fields(**parts))


def _integration(system: System, request: IntegrationRequest, method: str) -> Integration:
    """Return a run that has not begun."""
    request = request._replace(settings=request.settings.replace(method=method))
    kind = SwitchingIntegration if switches(system) else Integration
    return kind(system, request, lambda block: None, None)


def _jacobians(
    run: Integration, system: System, request: IntegrationRequest, methods: Iterable[str]
) -> dict[str, Any]:
    """Return the derivatives that implicit methods need, and orders of pivots."""
    assert run.system.variation is not None
    variation = run.system.variation()
    pattern = matrix_pattern(run.system, variation, run.request.rank)
    orders = []
    for name in methods:
        if METHODS[name].exact and not variation.exact:
            continue
        nominal = _integration(system, request, name)
        nominal.run()
        number = core_run.METHODS.index(name)
        orders += [{"method": number, "pivots": pivot_fields(x)} for x in nominal.core.orders]
    return {"jacobians": jacobian_fields(variation, pattern, run.nq), "pivots": orders}


def _actions(run: SwitchingIntegration) -> dict[str, Any]:
    """Return the events, and what they do."""
    split = run.split_system
    actions, report = split.switching.actions, split.system.report
    place = {row.row: i for i, row in enumerate(split.switching.rows)}
    events = [
        _event(rule, place, rule.displaces(run.whole.constraining))
        for rule in split.switching.events
    ]
    parts: dict[str, Any] = {
        "actions": split.program(actions if actions else report.selected(())),
        "energy": assemble(report.selected([ENERGY])),
        "events": events,
    }
    if run.whole.constraints and any(e["displaces"] or e["impulse_count"] for e in events):
        constraint, mass = programs_of_search(run.whole)
        parts |= {"whole": equations_fields(run.whole, constraint), "mass": mass}
    return parts


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


def _data(model: dict[str, Any]) -> bytes:
    """Return a model as data, in the order of `lagmodel.h`."""

    def there(*names: str) -> Iterator[bytes]:
        for name in names:
            if model[name] is not None:
                yield _field(_TYPES[name], model[name])

    def listed(name: str) -> Iterator[bytes]:
        values = model[name] or ()
        yield word_data(len(values))
        for fields in values:
            yield _structure(_TYPES[name].of, fields)

    parts = [
        word_data(model["contents"]),
        word_data(model["unroll_after"]),
        *there("equations", "problem", "breaks"),
        *listed("functions"),
        *there("left_out", "dynamics", "elimination", "unrolled", "explicit_time", "series"),
    ]
    if model["jacobians"] is not None:
        parts += [*there("jacobians"), *listed("pivots")]
    if model["rules"] is not None:
        parts += [*there("rules", "actions", "energy"), *listed("events"), *there("whole", "mass")]
    body = b"".join(parts)
    return word_data(_MAGIC) + word_data(_VERSION) + word_data(3 + len(body) // 8) + body


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
    if of in (Integers, lag_stream, lag_block):
        return integers_data(value)
    return _structure(of, value)


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
