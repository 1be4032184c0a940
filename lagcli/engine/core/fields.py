"""The fields of structures of `lagcore.h` and `lagmodel.h`, by their names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli.engine.core.program import Program, assemble
from lagcli.engine.core.structures import lag_model

if TYPE_CHECKING:
    from lagcli.engine.linear.elimination import Elimination
    from lagcli.engine.linear.sparse import MatrixPattern, PivotOrder
    from lagcli.engine.system import JacobianTapes, System
    from lagcli.engine.taylor.series import SeriesProgram


#: lag_model_contents, by a part that is there then.
_CONTENTS = {
    "dynamics": 1,
    "elimination": 2,
    "unrolled": 4,
    "explicit_time": 8,
    "series": 16,
    "jacobians": 32,
    "rules": 64,
    "tangent": 128,
    "mass": 512,
}
_RECURSIVE = 256
_COUNTS = {
    "breaks": "break_count",
    "functions": "function_count",
    "pivots": "pivots_count",
    "events": "event_count",
}
_NOTHING: dict[str, Any] = dict.fromkeys(name for name, *_ in lag_model._fields_)


def model_fields(*, recursive: bool = False, **parts: Any) -> dict[str, Any]:
    """Return what a run needs, `lag_model`.

    Parameters
    ----------
    recursive : bool
        Whether the unrolled elimination is that of the recursive form.
    **parts
        Fields by their names, without counts: dictionaries of the fields of structures, lists of
        these, programs, numbers. What is not given is not there.
    """
    model = _NOTHING | parts
    there = sum(bit for name, bit in _CONTENTS.items() if model[name] is not None)
    model["contents"] = there + (_RECURSIVE if recursive else 0)
    for name, count in _COUNTS.items():
        model[count] = 0 if model[name] is None else len(model[name])
    return model


def equations_fields(system: System, constraint: Program) -> dict[str, Any]:
    """Return the sizes and the sparsity of a System, `lag_equations`."""
    first = {j: group[0] for group in system.same_unit for j in group}
    return {
        "nq": len(system.coordinates),
        "nc": len(system.constraints),
        "nh": len(system.holonomic),
        "np": system.held,
        "holonomic": system.holonomic,
        "nm": len(system.mass_pattern),
        "nb": len(system.jacobian_pattern),
        "mass_row": [i for i, _ in system.mass_pattern],
        "mass_column": [j for _, j in system.mass_pattern],
        "jacobian_row": [i for i, _ in system.jacobian_pattern],
        "jacobian_column": [j for _, j in system.jacobian_pattern],
        "unit": [first.get(j, j) for j in range(len(system.coordinates))],
        "constraint": constraint,
    }


def order_fields(plan: Elimination) -> dict[str, Any]:
    """Return an order of elimination, `lag_elimination` without the entries of M and B."""
    return {
        "n": len(plan.order),
        "order": plan.order,
        "paired": plan.paired,
        "start": plan.starts,
        "row": [i for column in plan.columns for i in column],
        "mass_targets": None,
        "jacobian_targets": None,
    }


def elimination_fields(system: System, plan: Elimination) -> dict[str, Any]:
    """Return an order of elimination, and where the entries of M and B go, `lag_elimination`."""
    # an entry of B stands in the matrix twice; one of them in the half that is stored
    entries, nq = system.jacobian_pattern, len(system.coordinates)
    lower = plan.targets([(nq + i, j) for i, j in entries])
    upper = plan.targets([(j, nq + i) for i, j in entries])
    return {
        **order_fields(plan),
        "mass_targets": plan.targets(system.mass_pattern),
        "jacobian_targets": np.maximum(lower, upper),
    }


def function_fields(system: System) -> list[dict[str, Any]]:
    """Return the known functions of time of a System, each a `lag_function`."""
    places = system.functions.places()
    return [
        {
            "first": len(system.parameters) + places[f.name][0],
            "degree": f.degree,
            "count": len(f.knots),
            "knots": f.knots,
            "origins": f.origins,
            "coefficients": f.coefficients,
            "period": f.period,
        }
        for f in system.functions.functions
    ]


def series_fields(program: SeriesProgram) -> dict[str, Any]:
    """Return a program for Taylor coefficients, `lag_series_program`."""
    return {
        "values": assemble(program.values),
        "stream": program.stream,
        "convolutions": program.convolutions,
        "order": program.order,
        "invariant": program.invariant,
        "numbers": program.numbers,
        "begins": program.begins,
        "begin_count": len(program.begins),
        "origin": program.origin,
        "layer": program.layer,
        "state": program.state,
        "size": program.size,
    }


def jacobian_fields(variation: JacobianTapes, pattern: MatrixPattern, nq: int) -> dict[str, Any]:
    """Return the derivatives that implicit methods need, `lag_jacobians`."""

    def flat(places: Sequence[tuple[int, int]]) -> list[int]:
        return [i * nq + j for i, j in places]

    return {
        "program": assemble(variation.tape),
        "force_position": flat(variation.force_position),
        "force_velocity": flat(variation.force_velocity),
        "rhs_position": flat(variation.rhs_position),
        "rhs_velocity": flat(variation.rhs_velocity),
        "power_position": variation.power_position,
        "power_velocity": variation.power_velocity,
        "n": len(pattern.start) - 1,
        "start": pattern.start,
        "columns": pattern.columns,
        "parts": pattern.parts,
        "parts_count": len(pattern.parts),
    }


def pivot_fields(chosen: PivotOrder) -> dict[str, Any]:
    """Return an order of pivots, `lag_pivots`."""
    return {
        "n": len(chosen.row),
        "row": chosen.row,
        "column": chosen.column,
        "start": chosen.start,
        "columns": chosen.columns,
        "diagonal": chosen.diagonal,
        "places": chosen.places,
    }
