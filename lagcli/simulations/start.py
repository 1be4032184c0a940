"""The consistent initial state of a run, or the reason why there is none."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.initial import (
    ConsistentState,
    NoConsistentState,
    NoOrientation,
    Spin,
    UndefinedStart,
    VanishingGradient,
    consistent_state,
    dependent_sets,
    determined,
    next_to_singular,
)
from lagcli.engine.contract import Outcome
from lagcli.engine.evaluator import Dynamics, Evaluator
from lagcli.engine.lowering.lower import lower
from lagcli.engine.system import State, System
from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom, RedundantSet
from lagcli.equations.derivation.lagrange import Equations
from lagcli.errors import Diagnostic, LagcliError, ModelError, NumericalError, check_argument
from lagcli.model.expression.dimension import ANGLE, Dimension
from lagcli.model.model import RATE, InitialValue, Model, velocity
from lagcli.model.names.members import families
from lagcli.settings.settings import DEFAULTS

if TYPE_CHECKING:
    from lagcli.simulations.undefined import UndefinedExpression

#: Number of violated constraints whose residuals a message has.
_SHOWN = 10


def find_start(
    equations: Equations, system: System, t: float, closed: float | None = None
) -> ConsistentState:
    """Find the consistent initial state of a model at a time, or explain why there is none.

    Open contacts are not constraints.

    Parameters
    ----------
    equations : Equations
    system : System
    t : float
        s.
    closed : float, optional
        The setting ``closed``; by default that of the model.

    Raises
    ------
    ModelError
        The fixed initial values, or the constraints, contradict each other; a contact is violated.
    NumericalError
        No state near the guesses is consistent, a value there is not finite, or a coordinate has no
        inertia.
    """
    model = equations.model
    if model.inputs:
        from lagcli.simulations.inputs import check_input_range

        check_input_range(model, t, t)
    q, fixed_q = _initial(model, model.initial_positions)
    v, fixed_v = _initial(model, model.initial_velocities)
    given = State(t, q, v, tuple(model.parameter_values.values()))
    try:
        start = consistent_state(system, given, fixed_q, fixed_v, spins=spins_of(model))
    except UndefinedStart as error:
        raise _undefined_start(equations, error.state) from None
    except NoConsistentState as error:
        if any(x.constraint.endswith(RATE) for x in error.violations):
            _check_first_order(model, system, given)
        raise _no_start(model, error) from None
    except VanishingGradient as error:
        raise _no_gradient(model, error.constraints) from None
    except NoOrientation as error:
        raise _no_orientation(model, error.quaternion) from None
    if system.switching is not None:
        from lagcli.simulations.contacts import check_contacts

        check_contacts(model, system, start.state, _closed(model, closed))
    if not start.elimination:
        _check_inertia(equations, system, start)
    return start


def _closed(model: Model, given: float | None) -> float:
    """Return the setting ``closed``."""
    return given or model.settings.closed or DEFAULTS.closed or 0.0


def freedom_at(
    equations: Equations, system: System, start: ConsistentState, closed: float | None = None
) -> DegreesOfFreedom:
    """Return the degrees of freedom at a consistent state.

    Parameters
    ----------
    equations : Equations
    system : System
    start : ConsistentState
    closed : float, optional
        See `find_start`.
    """
    names, rank = system.constraints, start.rank
    rows: Sequence[int] = range(len(names))
    held: tuple[str, ...] | None = None
    if system.switching is not None and system.switching.rows:
        from lagcli.simulations.contacts import held_at

        rows, rank = held_at(system, start, _closed(equations.model, closed))
        held = tuple(names[i] for i in rows)
    sets = dependent_sets(system, start.state, rank, rows)
    named = ((tuple(names[i] for i in of), surplus) for of, surplus in sets)
    redundant = tuple(
        RedundantSet(of, surplus)
        for of, surplus in named
        if not all(name.endswith(RATE) for name in of)  # their λ are 0
    )
    return DegreesOfFreedom(len(equations.q), len(rows), rank, redundant, held)


#: Random states at which the rank of B is compared with that of the start: any one has the largest
#: rank, except by chance.
_NEARBY = 3


class ModelStart:
    """The System of equations and the consistent initial state of a model, each computed once.

    Parameters
    ----------
    equations : Equations
    """

    def __init__(self, equations: Equations):
        self.equations = equations

    @cached_property
    def system(self) -> System:
        """The equations as tapes."""
        return lower(self.equations)

    @cached_property
    def consistent(self) -> ConsistentState:
        """The consistent state; raises the errors of `find_start`."""
        t = self.equations.model.settings.t_start or 0.0
        return find_start(self.equations, self.system, t)

    @cached_property
    def freedom(self) -> DegreesOfFreedom:
        """The degrees of freedom; their rank is None if there is no consistent state."""
        k, r = len(self.equations.q), len(self.equations.constraints)
        if not r:
            return DegreesOfFreedom(k, 0, 0)
        try:
            freedom = freedom_at(self.equations, self.system, self.consistent)
        except LagcliError:
            return DegreesOfFreedom(k, r)
        if freedom.redundant and freedom.held is None:
            from lagcli.engine.constraints.random_states import random_states

            states = random_states(self.system, self.consistent, _NEARBY)
            freedom = freedom._replace(nearby=max((x.rank for x in states), default=None))
        return freedom


def degrees_of_freedom(equations: Equations) -> DegreesOfFreedom:
    """Count the degrees of freedom of a model by the rank of B at its consistent initial state.

    Parameters
    ----------
    equations : Equations

    Returns
    -------
    DegreesOfFreedom
        Its rank is None if there is no consistent initial state.
    """
    check_argument("degrees_of_freedom", equations, Equations, "lagcli.derive returns them")
    return ModelStart(equations).freedom


def determined_values(model: Model, system: System, start: ConsistentState) -> list[str]:
    """Return the free initial values that the constraints determine, by name.

    Parameters
    ----------
    model : Model
    system : System
    start : ConsistentState
        Of this model.
    """
    _, fixed_q = _initial(model, model.initial_positions)
    _, fixed_v = _initial(model, model.initial_velocities)
    evaluator = Evaluator(system, start.state.p)
    flags = determined(evaluator, start.state, fixed_q, fixed_v, spins_of(model))
    states = (
        (model.coordinate_names, flags[0]),
        ([f"{q}'" for q in model.coordinate_names], flags[1]),
    )
    return [name for names, of in states for name, is_so in zip(names, of, strict=True) if is_so]


def _initial(model: Model, table: Any) -> tuple[Array, Flags]:
    entries: list[InitialValue] = [table[name] for name in model.coordinate_names]
    return np.array([e.value for e in entries]), np.array([e.fixed for e in entries])


def spins_of(model: Model, named: Sequence[str] = ()) -> tuple[Spin, ...]:
    """Return the quaternions whose initial angular velocities are given.

    Parameters
    ----------
    model : Model
    named : sequence of str, optional
        Initial values that count as fixed: a quaternion with rates among them is left out.
    """
    place = {name: i for i, name in enumerate(model.coordinate_names)}
    spins = []
    for name, fixed in model.spins.items():
        parts = [f"{name}.{k}" for k in range(4)]
        if not any(f"{part}'" in named for part in parts):
            a, b, c, d = (place[part] for part in parts)
            spins.append(Spin(name, (a, b, c, d), fixed))
    return tuple(spins)


def undefined_at(equations: Equations, state: State) -> UndefinedExpression:
    """Return which expression of the model is not finite at a state."""
    from lagcli.simulations.undefined import undefined_expression

    return undefined_expression(equations, state)


def message_of(equations: Equations, run: Outcome) -> str:
    """Return the message of a run with the location in the model of its cause."""
    message = run.message
    if run.undefined is not None:
        given = run.undefined.p[: len(equations.model.parameters)]  # without branches
        message += "; " + undefined_at(equations, run.undefined._replace(p=given)).with_line
    for c in equations.model.constraints:
        if c.name in run.constraints and c.location is not None:
            message += f"; `{c.name}` is on line {c.location.line} of the model"
    return message


def _undefined_start(equations: Equations, state: State) -> NumericalError:
    undefined = undefined_at(equations, state)
    return NumericalError(
        Diagnostic(
            "undefined-start",
            f"no initial state: {undefined.clause}",
            undefined.location,
            "change the initial values, or write an expression that is smooth there",
        )
    )


def _no_start(model: Model, error: NoConsistentState) -> ModelError | NumericalError:
    gaps = _gaps(model, error)
    residuals, named = _residuals(error) if gaps is None else gaps
    what = "constraint" if gaps is None else "joint"
    names = ", ".join(f"`{x}`" for x in families(named))
    plural = "s" if len(named) > 1 else ""
    first = next(c for c in model.constraints if c.name == error.violations[0].constraint)
    kinds = {c.name: c.kind for c in model.constraints}
    holonomic = any(kinds[x.constraint] == "holonomic" for x in error.violations)
    level = ", differentiated in time," if error.level == "velocity" and holonomic else ""
    if error.contradiction and error.stuck:
        freed = error.stuck[0]
        base = freed.rstrip("'")
        spinning = base.partition("omega(")[2].partition(").")[0]
        if spinning:
            entry = model.initial_velocities[f"{spinning}.0"]
            example = f"write that component of `{spinning}'` as `{{guess: …}}`"
        else:
            table = model.initial_velocities if freed.endswith("'") else model.initial_positions
            entry = table[base]
            example = f"`{freed}: {{guess: {entry.value:.6g}}}`"
        return ModelError(
            [
                Diagnostic(
                    "inconsistent-start",
                    f"the fixed initial values violate the {what}{plural} {names}{level}\n"
                    + residuals,
                    entry.location,
                    f"free {_one_of(error.stuck)}, for instance {example}",
                )
            ]
        )
    if error.contradiction:
        return ModelError(
            [
                Diagnostic(
                    "contradicting-constraints",
                    f"no initial values satisfy the {what}{plural} {names}{level}: they"
                    " contradict"
                    f" each other near the guesses\n{residuals}",
                    first.location,
                    "correct the constraints, or give guesses nearer to a solution",
                )
            ]
        )
    return NumericalError(
        Diagnostic(
            "no-start",
            "no consistent initial state was found near the guesses: the"
            f" {what}{plural} {names}{level} do{'' if plural else 'es'} not"
            f" {'hold' if gaps is None else 'close'}\n{residuals}",
            first.location,
            "give guesses nearer to a solution"
            + (f", or free {_one_of(error.stuck)}" if error.stuck else "")
            + ("; check that the constraints do not contradict each other" if plural else ""),
        )
    )


def _residuals(error: NoConsistentState) -> tuple[str, list[str]]:
    """Return the residuals of violated constraints as lines, and the constraints."""
    shown = sorted(error.violations, key=lambda x: -x.relative)[:_SHOWN]
    lines = [
        f"  {x.constraint}: residual {x.residual:.3g} ({x.relative:.2g} of its scale)"
        for x in error.violations
        if x in shown
    ]
    if len(lines) < len(error.violations):
        lines.append(f"  and {len(error.violations) - len(lines)} with less")
    return "\n".join(lines), [x.constraint for x in error.violations]


def _gaps(model: Model, error: NoConsistentState) -> tuple[str, list[str]] | None:
    """Return the gaps of a machine's joints as lines, the largest first, and the joints.

    None unless all violated constraints are those of positions and angles of joints.
    """
    lengths: dict[str, float] = {}
    angles: dict[str, float] = {}
    for x in error.violations:
        base = re.split(r"[.\[]", x.constraint)[0]
        dimension = model.units.constraints.get(x.constraint)
        if (
            base not in model.names.joints
            or not isinstance(dimension, Dimension)
            or error.level != "position"
        ):
            return None
        joint = x.constraint
        if "." in joint:
            joint = joint.rpartition(".")[0]
        table = {Dimension(m=1): lengths, ANGLE: angles}.get(dimension)
        if table is None:
            return None
        table[joint] = math.hypot(table.get(joint, 0.0), x.residual)
    least = 1e-3 * max([*lengths.values(), 0.0]), 1e-3 * max([*angles.values(), 0.0])
    lines = [
        f"  {joint}: {1e3 * gap:.3g} mm"
        for joint, gap in sorted(lengths.items(), key=lambda x: -x[1])
        if gap >= least[0]
    ]
    lines += [
        f"  {joint}: {math.degrees(gap):.3g}°"
        for joint, gap in sorted(angles.items(), key=lambda x: -x[1])
        if gap >= least[1]
    ]
    if len(lines) > _SHOWN:
        lines = [*lines[:_SHOWN], f"  and {len(lines) - _SHOWN} with less"]
    return "\n".join(lines), list(dict.fromkeys([*lengths, *angles]))


def _one_of(names: Sequence[str]) -> str:
    """Return one of some coordinates, or of some velocities, in words."""
    if len(names) == 1:
        return names[0]
    primed = [name for name in names if name.endswith("'")]
    listed = [
        *families(name for name in names if name not in primed),
        *(f"{name}'" for name in families(name.removesuffix("'") for name in primed)),
    ]
    return "one of " + ", ".join(listed)


def _no_gradient(model: Model, constraints: list[str]) -> NumericalError:
    names = ", ".join(f"`{name}`" for name in constraints)
    first = next(c for c in model.constraints if c.name == constraints[0])
    one = len(constraints) == 1
    return NumericalError(
        Diagnostic(
            "vanishing-gradient",
            f"the constraint{'' if one else 's'} {names} hold{'s' if one else ''} only where"
            f" {'it has' if one else 'they have'} no gradient: the motion is undetermined",
            first.location,
            "check lengths that are 0; hold a point by its coordinates: x = 0 and y = 0 in place of"
            " x^2 + y^2 = 0",
        )
    )


def _no_orientation(model: Model, quaternion: str) -> ModelError:
    return ModelError(
        [
            Diagnostic(
                "no-orientation",
                f"the guess of the quaternion `{quaternion}` is 0, which is no orientation: its"
                " angular velocity is given in the frame of the body",
                model.initial_positions[f"{quaternion}.0"].location,
                f"give a rotation: `{quaternion}: {{guess: 1}}`",
            )
        ]
    )


def _check_inertia(equations: Equations, system: System, start: ConsistentState) -> None:
    """Reject admissible motions without inertia."""
    state = start.state
    d = Evaluator(system, state.p).dynamics(state.t, state.q, state.v)
    if not d.finite:
        raise _undefined_start(equations, state)
    if moving := _without_inertia(d, system, start.rank):
        of_rates = any(name + RATE in system.constraints for name in moving)
        raise (_undetermined if of_rates else _no_inertia)(equations.model, moving)


def _check_first_order(model: Model, system: System, state: State) -> None:
    """Reject first-order coordinates whose equations do not determine their velocities."""
    from lagcli.engine.linear.dense import count_rank

    d = Evaluator(system, state.p).dynamics(state.t, state.q, state.v)
    if d.finite:
        rank = count_rank(d.jacobian[list(system.held_at_start)])
        if moving := _without_inertia(d, system, rank):
            raise _undetermined(model, moving)


def _own_sizes(mass: Array) -> Array:
    """Return 1/√M_jj, which scales coordinates of different units; 1 without inertia."""
    size = np.sqrt(np.abs(np.diag(mass)))
    return 1 / np.where(size > 0, size, 1.0)


def _free_inertia(d: Dynamics, system: System, rank: int) -> tuple[Array, Array]:
    """Return the eigenvalues of the scaled M on the null space of B, and the eigenvectors."""
    free = np.eye(len(d.forcing))
    if held := list(system.held_at_start):
        from lagcli.engine.linear.dense import decompose

        free = decompose(d.jacobian[held], rank).null
    size = _own_sizes(d.mass_matrix)
    basis, _ = np.linalg.qr(free / size[:, None])
    reduced = basis.T @ (d.mass_matrix * np.outer(size, size)) @ basis
    values, vectors = np.linalg.eigh((reduced + reduced.T) / 2)
    return values, size[:, None] * (basis @ vectors)


def _without_inertia(d: Dynamics, system: System, rank: int) -> list[str]:
    """Return the coordinates that change in an admissible motion without inertia."""
    values, directions = _free_inertia(d, system, rank)
    weakest = int(np.argmin(np.abs(values))) if len(values) else 0
    if not len(values) or abs(values[weakest]) > 1e-12:
        return []
    return _moving(system, directions[:, weakest])


def _moving(system: System, direction: Array) -> list[str]:
    """Return the coordinates that change in a direction."""
    change = np.abs(direction)
    named = zip(system.coordinates, change, strict=True)
    return [name for name, x in named if x > 1e-6 * change.max()]


def _no_inertia(model: Model, coordinates: list[str]) -> NumericalError:
    from lagcli.model.locations import ExpressionLocations

    names = [f"`{name}`" for name in coordinates]
    what = names[0] if len(names) == 1 else f"a motion of {', '.join(names)}"
    key = "L" if model.kinetic is None else "T"
    massless = _vanishing_in(model, coordinates)
    reason = f" ({' and '.join(f'`{p}` is 0' for p in massless)})" if massless else ""
    declared = {c.name: c.location for c in model.coordinates}
    notes = [(f"`{coordinates[0]}` is declared here", declared[coordinates[0]])]
    notes += [(f"`{p}` is given here", model.parameters[p].location) for p in massless[:1]]
    places = ExpressionLocations(model)
    return NumericalError(
        Diagnostic(
            "no-inertia",
            f"`{key}` gives {what} no inertia{reason} and no constraint determines it: the"
            " acceleration is undetermined",
            places.location(places.entry(key)),
            "give it a mass, damping in `D`, or a constraint"
            + (f", for instance `--set {massless[0]}=1`" if massless else ""),
            tuple(notes),
        )
    )


def _undetermined(model: Model, coordinates: list[str]) -> NumericalError:
    names = ", ".join(f"`{name}`" for name in coordinates)
    declared = {c.name: c.location for c in model.coordinates}
    of, their = ("s", "their velocities") if len(coordinates) > 1 else ("", "its velocity")
    return NumericalError(
        Diagnostic(
            "first-order",
            f"the coordinate{of} {names} {'have' if of else 'has'} no inertia, and the equations do"
            f" not determine {their}: the matrix of the velocities in them is singular",
            declared[coordinates[0]],
            "give one of them damping in `D`, or a mass; without damping, the matrix is"
            " antisymmetric, and singular for an odd number of free coordinates",
        )
    )


def warnings_at_start(
    system: System, start: ConsistentState, freedom: Callable[[], DegreesOfFreedom]
) -> tuple[str, ...]:
    """Return the warnings about an initial state.

    Parameters
    ----------
    system : System
    start : ConsistentState
    freedom : callable
        Returns the degrees of freedom there; called if forces depend on multipliers.
    """
    warnings: list[str] = []
    if system.switching is not None:
        from lagcli.simulations.contacts import ambiguous_forces, true_at_start

        warnings += true_at_start(system, start.state)
        if system.switching.forces is not None:
            warnings += ambiguous_forces(system, start.state, freedom().redundant)
    return (
        *warnings,
        *negative_inertia(system, start.state, start.rank),
        *next_to_singular(system, start),
    )


def negative_inertia(system: System, state: State, rank: int) -> list[str]:
    """Return a warning if T decreases with admissible velocities.

    Equations with negative masses can be solved, but indicate a wrong sign.

    Parameters
    ----------
    system : System
    state : State
        A consistent state.
    rank : int
        Rank of B at the state.
    """
    evaluator = Evaluator(system, state.p)
    entries = evaluator.entries(state.t, state.q, state.v)[system.dynamics_layout.mass_matrix]
    if not np.isfinite(entries).all() or _resists(system, entries):
        return []
    d = evaluator.dynamics(state.t, state.q, state.v)
    values, directions = _free_inertia(d, system, rank)
    if not len(values) or values[0] > -1e-9:
        return []
    names = [f"`{name}`" for name in _moving(system, directions[:, 0])]
    return [
        f"the inertia of {', '.join(names[:6])}{', …' if len(names) > 6 else ''} is negative:"
        " `T` falls as the velocity grows; check the signs of masses and of `T`"
    ]


def _resists(system: System, entries: Sequence[float]) -> bool:
    """Return whether M ≥ 0 except for rounding: block by block of coordinates that it couples."""
    rows: list[dict[int, float]] = [{} for _ in system.coordinates]
    for (i, j), x in zip(system.mass_pattern, entries, strict=True):
        rows[i][j] = x
    left = set(range(len(rows)))
    while left:
        block, stack = set[int](), [left.pop()]
        while stack:
            i = stack.pop()
            block.add(i)
            stack.extend(rows[i].keys() - block)
        left -= block
        mass = np.array([[rows[i].get(j, 0.0) for j in block] for i in block])
        size = _own_sizes(mass)
        try:
            np.linalg.cholesky(mass * np.outer(size, size) + 1e-9 * np.eye(len(block)))
        except np.linalg.LinAlgError:
            return False
    return True


def _vanishing_in(model: Model, coordinates: list[str]) -> list[str]:
    """Return the parameters that are zero and are factors of velocities in T."""
    kinetic = -model.potential if model.kinetic is None else model.kinetic
    vanishing: dict[str, None] = {}
    for name in coordinates:
        for symbol in kinetic.diff(velocity(name)).free_symbols:
            p = model.parameters.get(symbol.name)
            if p is not None and p.value == 0:
                vanishing[p.name] = None
    return sorted(vanishing)
