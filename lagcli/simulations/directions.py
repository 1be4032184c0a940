"""Directions of differentiation: parameters and initial values, by name."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import symengine as se

from lagcli.arrays import Array, Flags
from lagcli.engine.lowering.compiler import compile_tape
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.system import State
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.jacobians import Rates
from lagcli.errors import UsageError
from lagcli.model.expression.functions import derivative
from lagcli.model.model import Model
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.values import dependent_values

_SHOWN = 12


def direction_names(model: Model, given: Iterable[str], where: str) -> tuple[str, ...]:
    """Return the model's names of parameters and initial values.

    Parameters
    ----------
    model : Model
    given : iterable of str
        ``m``, ``phi``, ``phi'`` or ``phi_dot``.
    where : str
        Source of the names, for messages.

    Raises
    ------
    UsageError
        There is no such parameter or initial value, it is structural, or it is given twice.
    """
    texts: dict[str, str] = {}
    for text in given:
        name = _known(model, "".join(text.split()), where)
        if name in texts:
            raise UsageError(f"{where} names `{name}` twice; keep one of them")
        texts[name] = text
    return tuple(texts)


def _known(model: Model, name: str, where: str) -> str:
    if name in model.parameters:
        if model.parameters[name].structural:
            raise UsageError(
                f"{where}: `{name}` determines the number of coordinates or constraints, and the"
                " motion"
                " has no derivative with respect to it; name another parameter"
            )
        return name
    initial = model.initial
    for ending, primes in (("", ""), ("_dot", "'")):
        base = name.removesuffix(ending) if ending else name
        if base + primes in initial and (not ending or base != name):
            return base + primes
    known = [*model.parameters, *initial]
    shown = ", ".join(f"`{x}`" for x in known[:_SHOWN]) + (", …" if len(known) > _SHOWN else "")
    help_ = did_you_mean(nearest(name, known)) or f"there are {shown}"
    raise UsageError(
        f"{where}: the model has no parameter or initial value `{shorten(name)}`; {help_}"
    )


@dataclass(frozen=True, eq=False)
class Directions:
    """Parameters and initial values with respect to which a model's motion is differentiated.

    Parameters and initial values that are expressions of others are differentiated through them; a
    named initial value counts as fixed, as with ``--set-initial``.

    Parameters
    ----------
    model : Model
    names : tuple of n str
        Result of `direction_names`.
    """

    model: Model
    names: tuple[str, ...]

    @cached_property
    def values(self) -> Array:
        """The model's values, (n,)."""
        initial = {name: x.value for name, x in self.model.initial.items()}
        known = {**self.model.parameter_values, **initial}
        return np.array([known[name] for name in self.names])

    @cached_property
    def scales(self) -> Array:
        """Sizes of the values, 1 for 0: derivatives are integrated with respect to θ / scale."""
        return np.where(self.values != 0, np.abs(self.values), 1.0)

    @cached_property
    def rates(self) -> tuple[Rates, ...]:
        """∂p/∂θ times the scale of θ, by parameter, for each direction."""
        return tuple(
            {
                name: slope * se.RealDouble(float(scale))
                for name, slope in self._slopes(direction).items()
                if name in self.model.parameters
            }
            for direction, scale in zip(self.names, self.scales, strict=True)
        )

    @cached_property
    def fixed(self) -> tuple[Flags, Flags]:
        """Which initial positions and velocities are fixed, (nq,) each."""
        tables = self.model.initial_positions, self.model.initial_velocities
        positions, velocities = (
            np.array([x.fixed or q + primes in self.names for q, x in table.items()], dtype=bool)
            for table, primes in zip(tables, ("", "'"), strict=True)
        )
        return positions, velocities

    def given(self, values: Sequence[float]) -> StartDerivatives:
        """Return the derivatives of the given initial values with respect to θ / scale.

        Parameters
        ----------
        values : sequence of n float
            Values of θ.
        """
        n, nq = len(self.names), len(self.model.coordinates)
        flat = np.array(self._initial(tuple(map(float, values))))
        derivatives = flat.reshape(n, 2 * nq) * self.scales[:, None]
        return StartDerivatives(derivatives[:, :nq], derivatives[:, nq:])

    def parameters(self, values: Sequence[float]) -> Array:
        """Return the derivatives of the parameters with respect to θ / scale, (n, np).

        Parameters
        ----------
        values : sequence of n float
            Values of θ.
        """
        n = len(self.names)
        flat = np.array(self._parameters(tuple(map(float, values))), dtype=float)
        return flat.reshape(n, len(self.model.parameters)) * self.scales[:, None]

    def state(self, t: float, values: Sequence[float]) -> State:
        """Return the given initial values, fixed ones and guesses, and parameters for values of θ.

        Parameters
        ----------
        t : float
            s.
        values : sequence of n float
            Values of θ.
        """
        completed = self._given(tuple(map(float, values)))
        first, nq = len(self.model.parameters), len(self.model.coordinates)
        q, v = np.array(completed[first : first + nq]), np.array(completed[first + nq :])
        return State(t, q, v, tuple(completed[:first]))

    @cached_property
    def _given(self) -> ScalarTape:
        return ScalarTape(start_tape(self.model, self.names))

    @cached_property
    def _dependent(self) -> dict[str, se.Basic]:
        return dependent_values(self.model, self.names)

    def _slopes(self, direction: str) -> dict[str, se.Basic]:
        symbol = se.Symbol(direction)
        slopes = {name: derivative(x, symbol) for name, x in self._dependent.items()}
        return {name: slope for name, slope in slopes.items() if slope != 0}

    @cached_property
    def _initial(self) -> ScalarTape:
        names = list(self.model.coordinate_names)
        return self._tape([*names, *(f"{q}'" for q in names)])

    @cached_property
    def _parameters(self) -> ScalarTape:
        return self._tape(list(self.model.parameters))

    def _tape(self, entries: Sequence[str]) -> ScalarTape:
        """Return the tape of the derivatives of parameters or initial values, by direction."""
        slopes = [self._slopes(direction) for direction in self.names]
        values = [slope.get(entry, se.Integer(0)) for slope in slopes for entry in entries]
        return ScalarTape(compile_tape(values, [se.Symbol(name) for name in self.names]))


def start_tape(model: Model, names: Sequence[str]) -> Tape:
    """Return the tape (values of the names) → (parameters, initial values of q and v), in SI.

    Parameters
    ----------
    model : Model
    names : sequence of str
        Names of parameters, not structural ones, and of initial values.
    """
    dependent = dependent_values(model, names)
    known = {**model.parameter_values, **{k: x.value for k, x in model.initial.items()}}
    values = [dependent.get(name, se.RealDouble(x)) for name, x in known.items()]
    return compile_tape(values, [se.Symbol(name) for name in names])
