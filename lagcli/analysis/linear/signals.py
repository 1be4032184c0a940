"""Inputs and outputs of linear models, by name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lagcli.analysis.local.gradients import Gradients, Point
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.parameter_path import ParameterPath
from lagcli.arrays import Array
from lagcli.columns import SCALARS, read_column_name
from lagcli.equations.derivation.column_expressions import REPORTED, column_expression
from lagcli.equations.derivation.lagrange import Equations, with_forces
from lagcli.errors import UsageError
from lagcli.model.spelling import did_you_mean, nearest

if TYPE_CHECKING:
    from symengine import Basic


_FORCE = "Q."
_LISTED = 20


class Inputs:
    """Derivatives of the forces with respect to inputs.

    An input is a parameter of the forces or of V, or ``Q.phi``, a generalized force that acts in
    addition to the model's.

    Parameters
    ----------
    local : LocalEquations
    names : sequence of str

    Raises
    ------
    UsageError
        A name is unknown or occurs twice, or the parameter enters a constraint or T.
    """

    def __init__(self, local: LocalEquations, names: Sequence[str]):
        import symengine as se

        self.names = tuple(names)
        _check_distinct("input", self.names)
        eq = local.equations
        coordinates = local.model.coordinate_names
        self._all = tuple(local.model.parameters)
        self.forces: list[tuple[int, int]] = []
        self._paths: list[tuple[int, ParameterPath]] = []
        for number, name in enumerate(self.names):
            coordinate = name.removeprefix(_FORCE)
            if name.startswith(_FORCE) and coordinate in coordinates:
                self.forces.append((coordinates.index(coordinate), number))
            elif name not in local.model.parameters:
                known = [*local.model.parameters, *(_FORCE + q for q in coordinates)]
                raise _unknown("input", name, known, "a parameter of the forces, or Q.COORDINATE")
            else:
                path = ParameterPath(local.model, name)
                for follower in path.followers:
                    _check_parameter(eq, name, follower)
                self._paths.append((number, path))
        changing = dict.fromkeys(n for _, path in self._paths for n in path.followers)
        #: Parameters that depend on an input.
        self.parameters = tuple(changing)
        self.symbols = [se.Symbol(n) for n in self.parameters]
        forces = [f + own for f, own in zip(eq.forcing, eq.reactive_forces, strict=True)]
        self._forcing = Gradients.of(eq, forces, self.symbols)

    def slopes(self, point: Point) -> Array:
        """Return the derivatives of these parameters with respect to the inputs, (n, inputs)."""
        found = np.zeros((len(self.parameters), len(self.names)))
        for number, path in self._paths:
            places = [self.parameters.index(n) for n in path.followers]
            found[places, number] = path.slopes(point.p[self._all.index(path.name)])
        return found

    def at(self, point: Point) -> Array:
        """Return ∂G/∂u, (nq, inputs)."""
        found = self._forcing.at(point) @ self.slopes(point)
        for row, column in self.forces:
            found[row, column] = 1.0
        return found


def _check_parameter(eq: Equations, name: str, follower: str) -> None:
    """Reject a parameter that affects more than the forces."""
    import symengine as se

    symbol = se.Symbol(follower)
    some = eq.model.coordinate_names[0]
    it = "it" if follower == name else f"`{follower}`, which depends on it,"
    for c in eq.constraints:
        if symbol in c.velocity.free_symbols or (
            c.position is not None and symbol in c.position.free_symbols
        ):
            raise UsageError(
                f"`{name}` cannot be an input: {it} enters the constraint `{c.constraint.name}`, so"
                " that its derivatives in time would be inputs too; take a parameter of the forces"
                f" or of V, or a force on a coordinate, as in --input Q.{some}"
            )
    if any(symbol in p.free_symbols for p in eq.momenta):
        raise UsageError(
            f"`{name}` cannot be an input: {it} enters T, so that its derivative in time would be"
            " an input too; take a parameter of the forces or of V"
        )


class Outputs:
    """Derivatives of outputs with respect to q, v, a, λ and the inputs.

    Parameters
    ----------
    local : LocalEquations
    names : sequence of str
        Columns of results, such as ``phi``, ``phi_dot``, ``lambda.guide``, ``Qc.guide.phi``,
        ``energy_kinetic``, or outputs of the model.
    inputs : Inputs

    Raises
    ------
    UsageError
        A name is unknown or occurs twice.
    """

    def __init__(self, local: LocalEquations, names: Sequence[str], inputs: Inputs):
        self.names, self._inputs = tuple(names), inputs
        _check_distinct("output", self.names)
        eq = local.equations
        expressions = [local.express(_expression(local.whole, name)) for name in self.names]
        groups = (eq.q, eq.v, eq.a, eq.multipliers, inputs.symbols)
        self._gradients = [Gradients.of(eq, expressions, group) for group in groups]

    def at(self, point: Point) -> tuple[Array, ...]:
        """Return ∂y/∂q, ∂y/∂v, ∂y/∂a, ∂y/∂λ and ∂y/∂u."""
        found = [gradient.at(point) for gradient in self._gradients]
        return *found[:4], found[4] @ self._inputs.slopes(point)


def _expression(eq: Equations, name: str) -> Basic:
    """Return the expression of an output in t, q, v, a, λ and the parameters."""
    from lagcli.model.model import constraint_force, multiplier

    model = eq.model
    if name in eq.outputs:
        return eq.outputs[name]
    base = name.rstrip("'")
    order = len(name) - len(base)
    if base in model.coordinate_names and order <= 2:
        return (eq.q, eq.v, eq.a)[order][model.coordinate_names.index(base)]
    column = read_column_name(name, model.coordinate_names, model.constraint_names)
    if column is not None:
        groups = {"q": eq.q, "v": eq.v, "a": eq.a}
        if column.quantity in groups:
            return groups[column.quantity][model.coordinate_names.index(column.coordinate)]
        if column.quantity == "multipliers":
            return multiplier(column.constraint)
        if column.quantity in ("constraint_force", "constraint_force_by"):
            force = constraint_force(column.coordinate, column.constraint or None)
            return with_forces(model, eq.constraints, {name: force})[name]
        if column.quantity in REPORTED:
            return column_expression(eq, column.quantity)
    known = [
        *model.coordinate_names,
        *(f"{q}_dot" for q in model.coordinate_names),
        *(f"lambda.{c}" for c in model.constraint_names),
        *eq.outputs,
        *(q.name for q in SCALARS if q.name in REPORTED),
    ]
    raise _unknown("output", name, known, "a column of results, as lagcli plot has them")


def _check_distinct(what: str, names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"--{what} gives `{name}` twice; keep one of them")


def _unknown(what: str, name: str, known: Sequence[str], kind: str) -> UsageError:
    rest = f" and {len(known) - _LISTED} more" if len(known) > _LISTED else ""
    remedy = did_you_mean(nearest(name, known)) or f"there are {', '.join(known[:_LISTED])}{rest}"
    return UsageError(f"--{what} `{name}` is not {kind}; {remedy}")
