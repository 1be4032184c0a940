"""Access to a run and its model for drawing."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.equations.typesetting.notation import Notation
from lagcli.errors import LagcliError, ModelError, UsageError
from lagcli.files import shown_path
from lagcli.results.formats import open_reader
from lagcli.trajectory.samples import Record
from lagcli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from lagcli.equations.presentation.formulas import Formulas
    from lagcli.model.model import Model

_NONE = np.empty(0)
#: Rounding of a value that an expression gives, relative.
_SAME = 1e-12


def check_source(function: str, source: object) -> None:
    """Raise UsageError if the argument of a function of the package is no run and no file name."""
    if not isinstance(source, (str, os.PathLike, Trajectory)):
        raise UsageError(
            f"lagcli.{function}: the argument is of type {type(source).__name__}, neither a run nor"
            " the name of a file; lagcli.write writes files of runs and analyses"
        )


class RunFile:
    """The columns of one run, and its model.

    Parameters
    ----------
    source : path or Trajectory
        A result file, HDF5 or CSV, or a run in memory.
    model : path, optional
        A model file instead of the text in the result: the same model, with another view.

    Attributes
    ----------
    name : str
        Name in messages.
    coordinates, constraints, outputs, conserved_names, sensitivity : tuples of str
    terms : Terms
    count : int
        Number of samples.
    record : Record
    varied : mapping of str to float
        Varied quantities of a row of a sweep, by name.
    fields : frozenset of str or None
        The available fields; None for all.

    Raises
    ------
    FileError, UsageError
        As `lagcli.read`.
    """

    varied: Mapping[str, float] = MappingProxyType({})
    fields: frozenset[str] | None = None
    sensitivity: tuple[str, ...] = ()

    def __init__(self, source: str | os.PathLike[str] | Trajectory, model: str | None = None):
        self._source, self._model_file = source, model
        if isinstance(source, Trajectory):
            self.name = "the run"
            self.coordinates, self.constraints = source.coordinates, source.constraints
            self.outputs, self.terms = tuple(source.outputs), source.terms
            self.conserved_names = source.conserved_names
            self.sensitivity = source.sensitivity
            self.record: Record = source
            self.count = len(source.time)
            return
        self.name = shown_path(source)
        with open_reader(source) as reader:
            self.coordinates, self.constraints = reader.coordinates, reader.constraints
            self.outputs, self.terms = reader.outputs, reader.terms
            self.conserved_names = reader.conserved_names
            self.sensitivity = reader.sensitivity
            self.record = reader.record
            self.count = reader.count()

    def columns(self, names: Iterable[str], samples: Indices | None = None) -> dict[str, Array]:
        """Return fields of `Samples`, by name.

        Parameters
        ----------
        names : iterable of str
            Fields of `lagcli.trajectory.samples.Samples`; an output is ``outputs/NAME``.
        samples : (m,) array of int, optional
            Indices of samples, increasing; all by default.

        Returns
        -------
        dict of str to (m, …) array
        """
        wanted = list(dict.fromkeys(names))
        if not wanted:
            return {}
        pieces: dict[str, list[Array]] = {name: [] for name in wanted}
        start = 0
        for block in self.blocks(wanted):
            length = len(next(iter(block.values())))
            chosen: slice | Indices = slice(None)
            if samples is not None:
                first, last = np.searchsorted(samples, (start, start + length))
                chosen = samples[first:last] - start
            start += length
            for name, values in block.items():
                pieces[name].append(values[chosen])
        return {name: np.concatenate(values or [_NONE]) for name, values in pieces.items()}

    def blocks(self, names: Sequence[str]) -> Iterator[Mapping[str, Array]]:
        """Yield fields of `Samples` by name, in blocks that fit in memory."""
        if isinstance(self._source, Trajectory):
            yield {name: _field(self._source, name) for name in names}
            return
        with open_reader(self._source) as reader:
            yield from reader.columns(names)

    @property
    def knows_model(self) -> bool:
        """Whether there is a model: in the result, or in another file."""
        return bool(self._model_file or self.record.model)

    @cached_property
    def model(self) -> Model:
        """The model with the values of this run.

        Raises
        ------
        UsageError
            The result contains no model, or the other file contains a different one.
        ModelError
            The text is invalid for this version.
        FileError
            The model file cannot be read.
        """
        record = self.record
        from lagcli.model.loader import load_text
        from lagcli.simulations.inputs import input_data

        # as expressions, which are in SI regardless of the file's unit
        parameters = {name: f"{value!r}*1" for name, value in record.parameters.items()}
        # the text may lack some of them
        initial = self.initial
        if self._model_file is not None:
            model = self._other_model(self._model_file, parameters, initial)
        elif not record.model:
            raise UsageError(
                f"{self.name} contains no model: CSV cannot store it; write HDF5 (-o run.h5), or"
                " a sidecar beside the CSV file (--meta), or name the model file with --model"
            )
        else:
            model = load_text(
                record.model,
                f"{self.name}:model",
                parameters,
                initial,
                input_data(record.inputs),
            )
        if (model.coordinate_names, model.constraint_names) != (self.coordinates, self.constraints):
            raise UsageError(
                f"{model.path} is not the model of {self.name}: its coordinates or constraints"
                f" differ; the run has {', '.join((*self.coordinates, *self.constraints))}"
            )
        return model

    def _other_model(
        self, path: str, parameters: Mapping[str, str], initial: Mapping[str, float]
    ) -> Model:
        from lagcli.model.loader import load

        try:
            return load(path, parameters, initial)
        except ModelError as error:
            options = [d for d in error.diagnostics if d.location and not d.location.line]
            if not options:
                raise
            raise UsageError(
                f"{path} is not the model of {self.name}: {options[0].message}"
            ) from None

    @cached_property
    def notation(self) -> Notation | None:
        """The notation of the model's names; None if the result does not describe them."""
        if self._model_file is not None:
            try:
                return Notation(self.model)
            except LagcliError:
                return None  # the names as typed are sufficient
        display = self.record.display
        if not display:
            return None
        declared = (*self.coordinates, *self.record.parameters, *display.get("definitions", ()))
        return Notation.of_names(declared, self.constraints, display.get("latex", {}))

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters, and initial values by name, in SI."""
        return {**self.record.parameters, **self.initial}

    @property
    def initial(self) -> Mapping[str, float]:
        """The first sample as initial values by name (``phi'``); none without samples."""
        if not self.count:
            return {}
        first = self.columns(("q", "v"), np.zeros(1, dtype=np.intp))
        names = self.coordinates
        positions = dict(zip(names, first["q"][0].tolist(), strict=True))
        return positions | dict(zip((f"{q}'" for q in names), first["v"][0].tolist(), strict=True))


def with_expressions(model: Model) -> tuple[Model, dict[str, str]]:
    """Return what the file of a run's model says, and the values to give it for the same run.

    Parameters
    ----------
    model : Model
        That of a run: all its values are given.

    Returns
    -------
    written : Model
        The model without these values, except for those that determine the number of members.
    given : dict of str to str
        Values of parameters, for `lagcli.load_text`. Those whose expressions have the value of the
        run are omitted: they follow the others, as they did there.
    """
    import symengine as se

    from lagcli.model.loader import load_text
    from lagcli.model.values import dependent_values, independent_parameters

    known = model.declared_values
    sizes = {name: f"{known[name]!r}*1" for name in model.structural_parameters}
    written = load_text(model.text, model.path, sizes, data=model.data)
    own = independent_parameters(written)
    given = sizes | {name: in_unit(known[name], written.parameters[name].unit) for name in own}
    following, values = dependent_values(written, own), {se.Symbol(n): known[n] for n in own}
    for name in known:
        if name in given:
            continue
        parameter = written.parameters[name]
        value = float(following[name].subs(values)) if name in following else parameter.value
        if not math.isclose(value, known[name], rel_tol=_SAME, abs_tol=0.0):
            given[name] = in_unit(known[name], parameter.unit)
    return written, given


def in_unit(value: float, unit: str | None) -> str:
    """Return an SI value in the unit of the file, as the command line takes it."""
    from lagcli.model.expression.units import to_si

    factor = float(to_si(unit)) if unit else 1.0
    return f"{value!r}*1" if factor == 1.0 else f"{value / factor!r} {unit}"


def formulas_of(run: RunFile, model: Model) -> Formulas:
    """Return the formulas of a run's model, with the degrees of freedom that the run has."""
    from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom
    from lagcli.equations.derivation.lagrange import derive
    from lagcli.equations.presentation.formulas import Formulas

    recorded = run.record.freedom
    return Formulas(
        derive(model), freedom=DegreesOfFreedom.from_mapping(recorded) if recorded else None
    )


def _field(trajectory: Trajectory, name: str) -> Array:
    group, _, output = name.partition("/")
    return trajectory.outputs[output] if output else np.asarray(getattr(trajectory, group))
