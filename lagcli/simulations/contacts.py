"""Contacts at the start of a run: none is violated, and their coefficients have a meaning."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.state import State
from lagcli.engine.switching.switching import Switching
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.errors import Diagnostic, ModelError
from lagcli.model.locations import ExpressionLocations
from lagcli.model.model import Constraint, Model
from lagcli.model.yaml.source import Scalar


def check_contacts(model: Model, system: System, state: State, closed: float) -> None:
    """Check the contacts of a System at the initial state.

    Parameters
    ----------
    model : Model
    system : System
        With ``switching``.
    state : State
    closed : float
        Gap below which a contact counts as closed, of the scale of its φ.

    Raises
    ------
    ModelError
        A contact is violated, or a coefficient or a limit is negative.
    """
    assert system.switching is not None
    constraints = Evaluator(system, state.p).constraints(state.t, state.q, state.v)
    found = []
    for row in system.switching.rows:
        if not row.sign or not row.active:
            continue
        place = system.holonomic.index(row.row)
        gap = row.sign * constraints.position[place]
        if gap < -closed * constraints.position_scale[place]:
            slopes = row.sign * constraints.jacobian[row.row]
            found.append(_violated(model, model.constraints[row.row], gap, slopes))
    found += _bad_coefficients(model, system.switching, state)
    if found:
        raise ModelError(found)


def _violated(model: Model, constraint: Constraint, gap: float, slopes: Array) -> Diagnostic:
    """Return the error for a contact that is violated."""
    name = constraint.name
    node = ExpressionLocations(model).entry("constraints", name)
    written = " ".join(node.value.split()) if isinstance(node, Scalar) else name
    unit = model.units.of_residual(name, holonomic=True, rate=False)
    amount = f"{-gap:.6g}" + (f" {unit}" if unit and unit != "1" else "")
    j = int(np.argmax(np.abs(slopes)))
    coordinate = model.coordinate_names[j]
    move = "raise" if slopes[j] > 0 else "lower"
    entry = model.initial_positions[coordinate]
    return Diagnostic(
        "violated-contact",
        f"`{name}` is violated by {amount} at the start ({written})",
        entry.location,
        f"{move} `{coordinate}`, or write `{coordinate}: {{guess: {entry.value:.6g}}}` and"
        f" `{name}: closed`",
        ((f"`{name}` is declared here", constraint.location),),
    )


def _bad_coefficients(model: Model, switching: Switching, state: State) -> list[Diagnostic]:
    """Return errors for coefficients and limits that are out of range at the start."""
    inputs = (state.t, *state.q.tolist(), *state.v.tolist())
    values = ScalarTape(switching.impact)((*inputs, *state.p))
    unilateral = [row.row for row in switching.rows if row.sign]
    limited = [row.row for row in switching.rows if row.limit is not None]
    checked = [("restitution", i, x, 1.0) for i, x in zip(unilateral, values, strict=False)]
    checked += [
        ("friction", i, x, np.inf) for i, x in zip(limited, values[len(unilateral) :], strict=True)
    ]
    nothing = (0.0,) * (len(state.q) + len(model.constraints))
    limits = ScalarTape(switching.limits)((*inputs, *nothing, *state.p))
    checked += [
        ("limit", limited[k % len(limited)], x, np.inf)
        for k, x in enumerate(limits[: 2 * len(limited)])
    ]
    found = []
    for field, i, x, most in checked:
        if not 0 <= x <= most:
            constraint = model.constraints[i]
            bounds = "not be negative" if most == np.inf else f"lie between 0 and {most:g}"
            found.append(
                Diagnostic(
                    "bad-value",
                    f"`{field}` of constraint `{constraint.name}` is {x:.6g} at the start, and must"
                    f" {bounds}",
                    constraint.location,
                    "change the expression, or the parameters that it depends on",
                )
            )
    return found
