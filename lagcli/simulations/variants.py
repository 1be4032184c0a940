"""Variants: one model, derived once, for many values of its parameters and initial values."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import symengine as se

from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.initial import Spin
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.compiler import compile_tape
from lagcli.engine.lowering.lower import lower
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.lagrange import Equations, derive
from lagcli.errors import ModelError, NumericalError
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.model.names.members import family_of
from lagcli.model.values import dependent_values
from lagcli.settings.settings import SettingsOverrides, resolve
from lagcli.simulations.simulation import Simulation, ready
from lagcli.simulations.start import find_start, spins_of

if TYPE_CHECKING:
    from lagcli.engine.integrate.prepared import Prepared


class Values(NamedTuple):
    """Parameters and initial values of n variants, in SI, in the model's order.

    Parameters
    ----------
    parameters : (n, np) array
    q, v : (n, nq) arrays
        Given values: fixed ones and guesses, not yet consistent.
    fixed_q, fixed_v : (nq,) arrays of bool
        Which initial values are fixed.
    spins : tuple of Spin
        The quaternions whose initial angular velocities are given.
    """

    parameters: Array
    q: Array
    v: Array
    fixed_q: Flags
    fixed_v: Flags
    spins: tuple[Spin, ...] = ()


class Variants:
    """A prepared model that can be simulated with other values without a new derivation.

    Parameters
    ----------
    model : Model
        The model, with the values that no variant changes.
    settings : SettingsOverrides, optional
        See `lagcli.simulations.simulation.prepare`.

    Raises
    ------
    UsageError
        A setting is out of its range.
    """

    def __init__(self, model: Model, settings: SettingsOverrides | None = None):
        self.model, self._given = model, settings or SettingsOverrides()
        self.settings = resolve(self._given, model.settings)
        self._followers: dict[tuple[str, ...], _Followers] = {}

    @cached_property
    def equations(self) -> Equations:
        """The model's equations."""
        return derive(self.model)

    @cached_property
    def system(self) -> System:
        """Their System."""
        return lower(self.equations)

    @cached_property
    def prepared(self) -> Prepared | None:
        """Prepared programs that all variants share.

        None if the model's own values have no initial state, or if the model switches: the engine
        caches it then.
        """
        if self.system.switching is not None:
            return None
        from lagcli.engine.integrate.prepared import find_elimination, prepare, unrolled

        try:
            start = find_start(
                self.equations, self.system, self.settings.t_start, self.settings.closed
            )
        except (ModelError, NumericalError):
            return None
        evaluator = Evaluator(self.system, start.state.p)
        order = start.elimination or find_elimination(evaluator, [start.state])
        return unrolled(self.system, prepare(self.system, order))

    def varied(
        self,
        set: Mapping[str, object] | None = None,
        set_initial: Mapping[str, object] | None = None,
    ) -> Simulation:
        """Return the simulation of one variant.

        Parameters
        ----------
        set, set_initial : mapping of str to numbers or text, optional
            As for `lagcli.load`, in addition to the values with which the model was loaded. Only
            another value of a structural parameter, which determines the number of members of a
            family, requires a new derivation.

        Raises
        ------
        ModelError, UsageError, NumericalError
            As `load` and `prepare` do.
        """
        model = load_text(
            self.model.text,
            self.model.path,
            {**self.model.set, **(set or {})},
            {**self.model.set_initial, **(set_initial or {})},
            self.model.data,
        )
        settings = resolve(self._given, model.settings)
        prepared = None
        if model.coordinate_names == self.model.coordinate_names and self._same_structure(model):
            equations = dataclasses.replace(self.equations, model=model)
            system = self.system
            prepared = self.prepared
        else:
            equations = derive(model)
            system = lower(equations)
        return ready(equations, system, settings, {}, prepared)

    def _same_structure(self, model: Model) -> bool:
        return all(
            model.parameters[name].value == self.model.parameters[name].value
            for name in self.model.structural_parameters
        )

    def together(self, names: Sequence[str]) -> bool:
        """Return whether `values` supports these parameters and initial values.

        Not structural parameters, nor those that the settings depend on: their values give
        different kinds of runs. Nor those from which the bodies of a machine are placed.

        Parameters
        ----------
        names : sequence of str
            Names of parameters, coordinates and velocities (``phi'``) in the model.
        """
        model, placing = self.model, self.model.names.placing
        needs = {family_of(name) for name in model.settings_need}
        if placing is not None:  # each variant places its bodies
            needs |= {family_of(name) for name in (*placing, *model.coordinate_names)}
        return not any(
            name in model.structural_parameters or family_of(name) in needs
            for name in self._following(names).names
        )

    def values(self, names: Sequence[str], table: Array) -> Values:
        """Return the parameters and initial values of many variants at once.

        Parameters
        ----------
        names : sequence of k str
            Names for which `together` is true.
        table : (n, k) array
            Values of each variant, in SI. Results that are not finite are errors, which `varied`
            explains.

        Returns
        -------
        Values
        """
        model, following, n = self.model, self._following(names), len(table)
        results = run_arrays(following.tape, np.ascontiguousarray(table.T), n)
        by_name = dict(zip(following.names, results, strict=True))

        def columns(values: Mapping[str, float]) -> Array:
            columns = np.empty((n, len(values)))
            for i, (name, value) in enumerate(values.items()):
                columns[:, i] = by_name.get(name, value)
            return columns

        positions, velocities = model.initial_positions, model.initial_velocities
        return Values(
            columns(model.parameter_values),
            columns({q: x.value for q, x in positions.items()}),
            columns({f"{q}'": x.value for q, x in velocities.items()}),
            np.array([x.fixed or q in names for q, x in positions.items()]),
            np.array([x.fixed or f"{q}'" in names for q, x in velocities.items()]),
            spins_of(model, names),
        )

    def _following(self, names: Sequence[str]) -> _Followers:
        key = tuple(names)
        if key not in self._followers:
            values = dependent_values(self.model, key)
            tape = compile_tape(values.values(), [se.Symbol(name) for name in key])
            self._followers[key] = _Followers(tuple(values), tape)
        return self._followers[key]


class _Followers(NamedTuple):
    """Quantities that depend on the varied values, and the tape that computes them."""

    names: tuple[str, ...]
    tape: Tape
