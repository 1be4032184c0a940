"""System: the input of integrations, as tapes, sizes and sparsity, without symbols."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.layout import ConstraintLayout, Counts, DynamicsLayout, SampleLayout
from lagcli.engine.tape.inputs import NO_FUNCTIONS, InputFunctions
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape
from lagcli.prose import counted

if TYPE_CHECKING:
    from lagcli.engine.switching.switching import Switching


class State(NamedTuple):
    """Time, coordinates, velocities and parameters.

    Parameters
    ----------
    t : float
        s.
    q, v : (nq,) arrays
    p : tuple of float
        Values of the System's parameters, in their order.
    """

    t: float
    q: Array
    v: Array
    p: tuple[float, ...] = ()

    @property
    def y(self) -> Array:
        """y = (q, v, 0), (2 nq + 1,): the initial state of a run, with zero work."""
        return np.concatenate([self.q, self.v, [0.0]])


#: Place of the energy, v·p − L, among the outputs of `System.report`.
ENERGY = 2
#: Operations at which a tape is not smooth.
KINKS = frozenset(map(int, (Op.LT, Op.LE, Op.FLOOR, Op.CEIL)))
Pattern = tuple[tuple[int, int], ...]

#: Largest number of operations of a motion and its derivatives' right sides in one stream.
_ONE_STREAM = 1000


class JacobianTapes(NamedTuple):
    """G = f − M a + Bᵀλ and Γ = γ − B a, differentiated at fixed a and λ.

    It can be written by hand: the contract is only the tape's inputs and outputs, in the order
    given here.

    Parameters
    ----------
    force_position, force_velocity : tuples of (row, coordinate)
        Places of the nonzero entries of ∂G/∂q and ∂G/∂v.
    rhs_position, rhs_velocity : tuples of (constraint, coordinate)
        Places of the nonzero entries of ∂Γ/∂q and ∂Γ/∂v.
    power_position, power_velocity : tuples of int
        Coordinates on whose position and velocity the power of all forces depends, at fixed λ.
    tape : Tape
        (t, q, v, a, λ, parameters) → (entries of ∂G/∂q, ∂G/∂v, ∂Γ/∂q, ∂Γ/∂v, ∂power/∂q, ∂power/∂v;
        ∂G/∂t, ∂Γ/∂t, ∂power/∂t).
    exact : bool
        Whether all derivatives are included; Rosenbrock methods require that, Newton's iteration
        does not.
    """

    force_position: Pattern
    force_velocity: Pattern
    rhs_position: Pattern
    rhs_velocity: Pattern
    power_position: tuple[int, ...]
    power_velocity: tuple[int, ...]
    tape: Tape
    exact: bool = True


class ParameterTapes(NamedTuple):
    """G = f − M a + Bᵀλ, Γ = γ − B a, φ and ψ, differentiated with respect to parameters.

    Parameters
    ----------
    parameters : tuple of str
        Names, in the order of the patterns' columns.
    force, rhs, position, velocity, outputs : tuples of (row, parameter)
        Places of the nonzero entries of ∂G/∂p, ∂Γ/∂p, ∂φ/∂p, ∂ψ/∂p and of the derivatives of the
        System's outputs. Rows of φ are numbered as in ``System.holonomic``.
    tape : Tape
        (t, q, v, a, λ, parameters) → the entries, in that order.
    """

    parameters: tuple[str, ...]
    force: Pattern
    rhs: Pattern
    position: Pattern
    velocity: Pattern
    outputs: Pattern
    tape: Tape


class TangentBlocks(NamedTuple):
    """Derivatives of a motion in n directions, appended to a System in blocks.

    Coordinates, constraints and the patterns of M and B are those of the motion, n + 1 times; the
    dynamics tape has f and γ of the motion and 0 for the derivatives. The matrix is that of the
    motion for all blocks.

    Parameters
    ----------
    motion : System
    directions : int
        n.
    tape : Tape
        (t, q, v, a, λ, parameters) → (f, γ) of each direction: q and v of all blocks, a and λ of
        the motion.
    """

    motion: System
    directions: int
    tape: Tape

    @property
    def blocks(self) -> int:
        """The motion and its directions."""
        return 1 + self.directions

    @property
    def complete(self) -> bool:
        """Whether an unrolled elimination also computes the derivatives, in one short stream."""
        return len(self.motion.dynamics.code) + len(self.tape.code) <= _ONE_STREAM


@dataclass(frozen=True, eq=False)
class System:
    """The equations M a = f + Bᵀλ, B a = γ, φ = 0, ψ = 0 in numerical form.

    nq coordinates, nc constraints, nh of them holonomic. A System can be written by hand: the
    contract is only the tapes' inputs and outputs, in the order given here.

    Parameters
    ----------
    coordinates, constraints : tuples of str
        Names, in the model's order.
    holonomic : tuple of nh int
        Indices of the holonomic constraints.
    parameters : tuple of str
        Names of the tapes' last inputs. Their values are part of a `State`.
    mass_pattern : tuple of (row, column)
        Places of the nonzero entries of M, both triangles.
    jacobian_pattern : tuple of (constraint, coordinate)
        Places of the nonzero entries of B.
    dynamics : Tape
        (t, q, v, parameters) → (M entries, f, B entries, γ, power), where power is that of the
        applied forces and of explicit time, Q·v − ∂L/∂t.
    constraint : Tape
        (t, q, v, parameters) → (φ, B entries, b_0, scale of φ, scale of ψ), where ψ = B v + b_0
        and a scale is the sum of the magnitudes of the terms; φ and its scale have nh entries.
    report : Tape
        (t, q, v, a, λ, parameters) → (T, V, v·∂L/∂v − L, Q·v, −∂L/∂t, outputs).
    outputs : tuple of str
        Names of the outputs at the end of ``report``.
    events : Tape, optional
        (t, q, v, parameters) → functions whose sign changes are events.
    variation : callable, optional
        Returns the derivatives for implicit methods; called when one is used.
    parameter_variation : callable, optional
        Names of parameters → derivatives with respect to them (`ParameterTapes`); called when an
        analysis needs them.
    functions : InputFunctions
        Known functions of time, inputs of all tapes.
    same_unit : tuple of tuples of int
        Coordinates known to have the same unit, such as those of a quaternion.
    switching : Switching, optional
        Contacts, friction and events.
    tangent : TangentBlocks, optional
        The derivatives appended to the motion, which depend on its a and λ.
    nonlinear : tuple of int
        Constraints whose ψ is nonlinear in v: B and b_0 = ψ − B v depend on v.
    recursive_form : callable, optional
        Returns `recursive`.
    """

    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    holonomic: tuple[int, ...]
    parameters: tuple[str, ...]
    mass_pattern: Pattern
    jacobian_pattern: Pattern
    dynamics: Tape
    constraint: Tape
    report: Tape
    outputs: tuple[str, ...] = ()
    events: Tape | None = None
    variation: Callable[[], JacobianTapes] | None = None
    parameter_variation: Callable[[Sequence[str]], ParameterTapes] | None = None
    same_unit: tuple[tuple[int, ...], ...] = ()
    functions: InputFunctions = NO_FUNCTIONS

    def __repr__(self) -> str:
        coordinates = counted(len(self.coordinates), "coordinate")
        constraints = counted(len(self.constraints), "constraint")
        return f"<System: {coordinates}, {constraints}>"

    @property
    def held(self) -> int:
        """Number of inputs of the tapes that are constant along a step: parameters, and pieces."""
        return len(self.parameters) + self.functions.size

    def held_at(self, t: float, p: Sequence[float]) -> list[float]:
        """Return the values of the constant inputs from a time on."""
        return [*p, *self.functions.pieces_at(t)]

    switching: Switching | None = None
    nonlinear: tuple[int, ...] = ()
    tangent: TangentBlocks | None = None
    recursive_form: Callable[[], System] | None = None

    @cached_property
    def recursive(self) -> System | None:
        """A sparse matrix whose elimination gives a and λ, for a full M; None if none is known.

        Its first coordinates are this System's, the others velocities that are defined one after
        the other by its first constraints. The other constraints are this System's, with the
        velocities in them and without right sides. Its dynamics take this System's state.
        """
        return None if self.recursive_form is None else self.recursive_form()

    @property
    def motion(self) -> System:
        """The System without derivatives of the motion."""
        return self if self.tangent is None else self.tangent.motion

    @cached_property
    def held_at_start(self) -> tuple[int, ...]:
        """The constraints that the initial state satisfies."""
        rows = self.switching.rows if self.switching else ()
        free = {row.row for row in rows if not row.holds_at_start}
        return tuple(i for i in range(len(self.constraints)) if i not in free)

    @cached_property
    def constraining(self) -> frozenset[int]:
        """The parameters on which constraints depend."""
        first = self.sample_layout.a.start
        return frozenset(i - first for i in self.constraint.read if i >= first)

    @cached_property
    def has_kinks(self) -> bool:
        """Whether the equations have comparisons, `floor` or `ceil`."""
        tapes = [self.dynamics, self.constraint]
        if self.switching is not None:
            s = self.switching
            tapes += filter(None, [s.limits, s.forces, s.force_conditions])
        return any(line[0] in KINKS for tape in tapes for line in tape.code)

    @cached_property
    def counts(self) -> Counts:
        """Numbers of coordinates, constraints and nonzero entries."""
        return Counts(
            nq=len(self.coordinates),
            nc=len(self.constraints),
            nh=len(self.holonomic),
            nm=len(self.mass_pattern),
            nb=len(self.jacobian_pattern),
        )

    @cached_property
    def sample_layout(self) -> SampleLayout:
        """Where t, q, v, a, λ and W stand in a sample row."""
        return SampleLayout(self.counts)

    @cached_property
    def dynamics_layout(self) -> DynamicsLayout:
        """Where M, f, B, γ and the power stand in the outputs of the dynamics tape."""
        return DynamicsLayout(self.counts)

    @cached_property
    def constraint_layout(self) -> ConstraintLayout:
        """Where φ, B, b_0 and the scales stand in the outputs of the constraint tape."""
        return ConstraintLayout(self.counts)

    def inertia(self, mass_diagonal: Array) -> Array:
        """Return the inertia by which coordinates are compared, (..., nq).

        M_jj or, among coordinates with the same unit, the largest: a quaternion has no inertia
        along itself.
        """
        inertia = mass_diagonal
        if self.same_unit:
            inertia = mass_diagonal.copy()
            for group in map(list, self.same_unit):
                inertia[..., group] = mass_diagonal[..., group].max(axis=-1)[..., None]
        return inertia

    @property
    def families(self) -> list[str | None]:
        """Labels of the tapes' inputs t, q, v, parameters: a coordinate's name without its numbers.

        Coordinates with the same label are likely to be used in the same way.
        """
        kinds = [without_numbers(name) for name in self.coordinates]
        return [None, *kinds, *(kind + "'" for kind in kinds), *[None for _ in range(self.held)]]


def without_numbers(name: str) -> str:
    """Return a name without its numbers."""
    return "".join(x for x in name if not x.isdecimal())
