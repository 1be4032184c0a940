"""Linear models of the motion about an operating point, with inputs and outputs by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from lagcli.analysis.linear.operating_points import find_operating_point
from lagcli.analysis.local.clocked import clocked_notes
from lagcli.analysis.local.gradients import Gradients, ParameterPath, Point
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.operating_point import OperatingPoint, multipliers_of
from lagcli.analysis.local.relative import rates_along
from lagcli.analysis.local.steady import ignored_velocities
from lagcli.analysis.local.steady_terms import Given
from lagcli.arrays import Array
from lagcli.columns import SCALARS, read_column_name
from lagcli.engine.constraints.initial import almost_dependent
from lagcli.engine.constraints.random_states import MOST_COORDINATES
from lagcli.engine.system import State
from lagcli.equations.derivation.column_expressions import REPORTED, column_expression
from lagcli.equations.derivation.lagrange import Equations, with_forces
from lagcli.errors import UsageError
from lagcli.model.model import RATE, Model, check_is_model
from lagcli.model.spelling import did_you_mean, nearest

if TYPE_CHECKING:
    from symengine import Basic


_FORCE = "Q."
_LISTED = 20


class Inputs:
    """Derivatives of the forces with respect to inputs.

    An input is a parameter of the forces or of V, or ``Q.phi``, a generalized force that acts in
    addition to the model's.

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
        slopes = np.zeros((len(self.parameters), len(self.names)))
        for number, path in self._paths:
            places = [self.parameters.index(n) for n in path.followers]
            slopes[places, number] = path.slopes(point.p[self._all.index(path.name)])
        return slopes

    def at(self, point: Point) -> Array:
        """Return ∂G/∂u, (nq, inputs)."""
        matrix = self._forcing.at(point) @ self.slopes(point)
        for row, column in self.forces:
            matrix[row, column] = 1.0
        return matrix


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
        gradients = [gradient.at(point) for gradient in self._gradients]
        return *gradients[:4], gradients[4] @ self._inputs.slopes(point)


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


Form = Literal["reduced", "descriptor"]
FORMS: tuple[Form, ...] = ("reduced", "descriptor")

_TAKES_PART = 1e-6  # of a constraint in a dependency: less is a rounding error
#: Accelerations below this part of the motion's squared rates are rounding errors.
_TURNING = 1e-9
#: Multipliers below this part of the terms' magnitudes are rounding errors.
_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class LinearModel:
    """A linear model E ẋ = A x + B u, y = C x + D u of small deviations from an operating point.

    n states, m inputs, o outputs, nq coordinates, nc constraints; all in SI units.

    Parameters
    ----------
    model : Model
    form : "reduced" or "descriptor"
        Reduced: the states are deviations of independent coordinates and velocities. Descriptor:
        of all coordinates, velocities and multipliers, with the constraints as equations.
    operating_point : OperatingPoint
    coordinates, constraints : tuples of str
    states, inputs, outputs : tuples of str
    E : (n, n) array
        The identity in the reduced form; singular in the descriptor form.
    A : (n, n) array
    B : (n, m) array
    C : (o, n) array
    D : (o, m) array
    position_shape, velocity_shape : (nq, n) arrays
        δq and δv of a state x.
    multiplier_shape : (nc, n) array
        δλ of a state x without inputs; of least norm if constraints are redundant.
    notes : tuple of str
        Notes for the reader, one sentence each.
    """

    model: Model
    form: Form
    operating_point: OperatingPoint
    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    E: Array
    A: Array
    B: Array
    C: Array
    D: Array
    position_shape: Array
    velocity_shape: Array
    multiplier_shape: Array
    notes: tuple[str, ...] = ()


def linearize(
    model: Model,
    *,
    at: float | None = None,
    equilibrium: bool = False,
    steady: Given | None = None,
    form: Form = "reduced",
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
) -> LinearModel:
    """Linearize the equations of motion on the constraint manifold.

    With G = f − M a + Bᵀλ, small deviations satisfy

        M δa = G_q δq + G_v δv + Bᵀδλ + G_u δu,  ∂φ/∂q δq = 0,  B δv + ∂ψ/∂q δq = 0,

    where G_q = ∂f/∂q − ∂(M a)/∂q + Σ λ_β ∂b_β/∂q contains the geometric stiffness of the
    constraints. About a motion that is not steady, the matrices are valid at one instant.

    Parameters
    ----------
    model : Model
    at : float, optional
        Linearize about the state of a run at this time, s.
    equilibrium : bool
        Linearize about the equilibrium near the initial values.
    steady : mapping of str to float, optional
        Linearize about the steady motion with these velocities (``{"phi'": 10}``), SI.
    form : "reduced" or "descriptor"
    inputs : sequence of str
        Parameters of the forces or of V; ``Q.phi`` is a force on a coordinate.
    outputs : sequence of str
        Columns of results or outputs of the model: ``phi``, ``lambda.guide``.

    Returns
    -------
    LinearModel

    Raises
    ------
    UsageError
        A name is unknown, a parameter cannot be an input, or the options contradict each other.
    ModelError, NumericalError
        There is no such operating point, or the equations have no derivatives there.

    References
    ----------
    .. [1] J. García de Jalón, E. Bayo, "Kinematic and Dynamic Simulation of Multibody Systems",
       1994, sec. 5.2.
    .. [2] W. Schiehlen, P. Eberhard, "Applied Dynamics", 2014, doi:10.1007/978-3-319-07335-4.
    """
    check_is_model(model, "linearize")
    if form not in FORMS:
        raise UsageError(f"--form {form!r} is not a form; the forms are {', '.join(FORMS)}")
    local, operating_point = find_operating_point(
        model, at=at, equilibrium=equilibrium, steady=steady
    )
    signals = Inputs(local, inputs)
    measured = Outputs(local, outputs, signals)
    return linear_model(model, local, operating_point, signals, measured, form)


def linear_model(
    model: Model,
    local: LocalEquations,
    operating_point: OperatingPoint,
    inputs: Inputs | None = None,
    outputs: Outputs | None = None,
    form: Form = "reduced",
) -> LinearModel:
    """Return the linear model about a known operating point; see `linearize`."""
    inputs = inputs or Inputs(local, ())
    outputs = outputs or Outputs(local, (), inputs)
    build = _reduced if form == "reduced" else _descriptor
    matrices = build(local, operating_point, inputs, outputs)
    system = local.system
    return LinearModel(
        model=model,
        form=form,
        operating_point=operating_point,
        coordinates=system.coordinates,
        constraints=system.constraints,
        inputs=inputs.names,
        outputs=outputs.names,
        notes=(*_notes(local, operating_point, form), *clocked_notes(model)),
        **matrices,
    )


def _reduced(
    local: LocalEquations, operating_point: OperatingPoint, inputs: Inputs, outputs: Outputs
) -> dict[str, Any]:
    """Return states and matrices in independent coordinates and velocities."""
    point, tangent = operating_point.point, operating_point.tangent
    chosen, moving = list(tangent.positions), list(tangent.velocities)
    dq = np.hstack([tangent.position_basis, np.zeros_like(tangent.velocity_basis)])
    dv = np.hstack([tangent.velocity_by_position, tangent.velocity_basis])
    da, multipliers, by_input = _accelerations(local, operating_point, inputs, dq, dv)
    relative, turned = dv, da
    if operating_point.frame is not None:
        relative, turned = dv - operating_point.frame @ dq, da - operating_point.frame @ dv
    rates = np.vstack([relative[chosen], turned[moving]])
    driven = np.vstack([np.zeros((len(chosen), by_input[0].shape[1])), by_input[0][moving]])
    y_q, y_v, y_a, y_multipliers, y_u = outputs.at(point)
    names = local.system.coordinates
    return {
        "states": (*(names[i] for i in chosen), *(f"{names[i]}'" for i in moving)),
        "E": np.eye(len(rates)),
        "A": rates,
        "B": driven,
        "C": y_q @ dq + y_v @ dv + y_a @ da + y_multipliers @ multipliers,
        "D": y_a @ by_input[0] + y_multipliers @ by_input[1] + y_u,
        "position_shape": dq,
        "velocity_shape": dv,
        "multiplier_shape": multipliers,
    }


def _descriptor(
    local: LocalEquations, operating_point: OperatingPoint, inputs: Inputs, outputs: Outputs
) -> dict[str, Any]:
    """Return states and matrices in all coordinates, velocities and multipliers."""
    point, system = operating_point.point, local.system
    nq, nc = len(system.coordinates), len(system.constraints)
    evaluator = local.evaluator(point.p)
    d = evaluator.dynamics(point.t, point.q, point.v)
    jac, gradient = local.jacobians(point), local.velocity_gradient(point)
    n, held = 2 * nq + nc, list(system.holonomic)
    mass, matrix = np.zeros((2, n, n))
    position, velocity, forces = slice(0, nq), slice(nq, 2 * nq), slice(2 * nq, n)
    mass[position, position] = np.eye(nq)
    mass[velocity, velocity] = d.mass_matrix
    matrix[position, velocity] = np.eye(nq)
    if operating_point.frame is not None:
        matrix[position, position] = -operating_point.frame
    reactions = local.reactions(point, d.jacobian)
    matrix[velocity] = np.hstack([jac.force_position, jac.force_velocity, reactions])
    if operating_point.frame is not None:
        matrix[velocity, velocity] -= d.mass_matrix @ operating_point.frame
    by_position, by_velocity = gradient.copy(), d.jacobian.copy()
    by_position[held], by_velocity[held] = d.jacobian[held], 0.0
    matrix[forces, position], matrix[forces, velocity] = by_position, by_velocity
    dq, dv = np.zeros((2, nq, n))
    dq[:, position], dv[:, velocity] = np.eye(nq), np.eye(nq)
    shape = np.zeros((nc, n))
    shape[:, forces] = np.eye(nc)
    da, _, by_input = _accelerations(local, operating_point, inputs, dq, dv)
    driven = np.zeros((n, len(inputs.names)))
    driven[velocity] = inputs.at(point)
    y_q, y_v, y_a, y_multipliers, y_u = outputs.at(point)
    names = system.coordinates
    return {
        "states": (
            *names,
            *(f"{name}'" for name in names),
            *(f"lambda.{name}" for name in system.constraints),
        ),
        "E": mass,
        "A": matrix,
        "B": driven,
        "C": y_q @ dq + y_v @ dv + y_a @ da + y_multipliers @ shape,
        "D": y_a @ by_input[0] + y_u,
        "position_shape": dq,
        "velocity_shape": dv,
        "multiplier_shape": shape,
    }


def _accelerations(
    local: LocalEquations, operating_point: OperatingPoint, inputs: Inputs, dq: Array, dv: Array
) -> tuple[Array, Array, tuple[Array, Array]]:
    """Return δa and δλ for states with given δq and δv, and for the inputs."""
    point, tangent = operating_point.point, operating_point.tangent
    jac, respond = local.jacobians(point), local.response(point, tangent)
    forces = jac.force_position @ dq + jac.force_velocity @ dv
    rates = jac.rhs_position @ dq + jac.rhs_velocity @ dv
    by_input = inputs.at(point)
    driven = respond(by_input, np.zeros((len(rates), by_input.shape[1])))
    da, multipliers = respond(forces, rates)
    # multipliers are differences of these forces; relatively small ones are rounding errors
    terms = np.abs(jac.force_position) @ np.abs(dq) + np.abs(jac.force_velocity) @ np.abs(dv)
    terms += np.abs(respond.mass) @ np.abs(da)
    bound = np.abs(multipliers_of(tangent.decomposition, np.eye(len(terms)))) @ terms
    multipliers = np.where(np.abs(multipliers) > _ROUNDING * bound, multipliers, 0.0)
    return da, multipliers, driven


def _notes(local: LocalEquations, operating_point: OperatingPoint, form: Form) -> tuple[str, ...]:
    notes = []
    point, name = operating_point.point, operating_point.name
    rate = np.abs(point.v / local.lengths).max(initial=0.0)
    turning = np.abs(point.a / local.lengths).max(initial=0.0) > _TURNING * rate**2
    along = {} if operating_point.steady else rates_along(local, point)
    if along:
        given = " ".join(f'--steady "{rate}={value:.6g}"' for rate, value in along.items())
        notes.append(
            f"{name} is a steady motion along a symmetry: the matrices hold at this instant only;"
            f" those of --equilibrium {given} hold at all times, in axes that move along"
        )
    elif not operating_point.steady:
        notes.append(
            f"{name} is not an equilibrium or a steady motion: the matrices hold at this instant"
            " only; --equilibrium finds an equilibrium near the initial values"
        )
    elif operating_point.frame is not None and operating_point.frame.any():
        notes.append(f"deviations are in axes that move along with {name}")
    elif form == "descriptor" and turning:
        notes.append(
            f"velocities of dependent coordinates change along {name}: the matrices hold at this"
            " instant only, those of the reduced form at all times"
        )
    if name in ("the equilibrium", "the steady motion"):
        ignored = ignored_velocities(local.model, point)
        if ignored:
            given = ", ".join(f"{q} = {x:.6g}" for q, x in list(ignored.items())[:6])
            notes.append(f"{name} does not have initial velocities of the file: {given}")
    d = operating_point.tangent.decomposition
    nc, rank = len(point.multipliers), d.rank
    if len(point.q) <= MOST_COORDINATES:
        state = State(point.t, point.q, point.v, point.p)
        near = almost_dependent(local.system, state, rank)
        if near:
            notes.append(
                f"{name} is next to a singular configuration, in which {', '.join(near)} are"
                " dependent: the matrices change much over a small distance"
            )
    of_forces = [i for i, c in enumerate(local.system.constraints) if not c.endswith(RATE)]
    if np.abs(d.dependent[of_forces]).max(initial=0.0) > _TAKES_PART:
        notes.append(
            f"{nc - rank} of {nc} constraints are redundant: δλ is the one of least norm, only the"
            " constraint forces are unique"
        )
    return tuple(notes)
