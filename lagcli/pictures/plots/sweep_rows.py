"""Rows of a sweep file as runs for plots."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from lagcli.arrays import Array
from lagcli.column_units import NOT_STATED
from lagcli.errors import UsageError
from lagcli.model.loader import load, load_text
from lagcli.model.model import Model
from lagcli.model.result_units import result_units
from lagcli.pictures.plots.thinning import evenly
from lagcli.pictures.run_file import RunFile
from lagcli.simulations.inputs import input_data
from lagcli.sweeps.row_results import COMPLETED
from lagcli.trajectory.samples import Record

#: Largest number of rows that are drawn: more curves would cover each other.
MOST = 200


class Rows:
    """The stored trajectories of a sweep file.

    Parameters
    ----------
    path : str
    model : str, optional
        See `RunFile`.

    Attributes
    ----------
    runs : list of Run
        The completed rows, at most `MOST`, evenly selected.
    good : int
        Number of completed rows.

    Raises
    ------
    UsageError
        The file contains no trajectories, or no row was completed.
    FileError
        As `lagcli.sweeps.file.store.open_sweep`.
    """

    def __init__(self, path: str, model: str | None = None):
        from lagcli.sweeps.file.store import open_sweep

        self.path, self._model_file = path, model
        with open_sweep(path) as file:
            if not file.kept:
                measures = ", ".join(f"`{c.name}`" for c in file.measures)
                raise UsageError(
                    f"{path} contains measures, but no trajectories: plot {measures}, or sweep with"
                    " --keep trajectories"
                )
            good = np.flatnonzero(file.read("status") == COMPLETED)
            if not len(good):
                raise UsageError(f"{path}: no row was completed: there is nothing to plot")
            facts = file.facts
            self.names = {name: file.names(name) for name in ("coordinate", "constraint")}
            self.outputs, self.fields = file.outputs, file.fields
            self.count = len(file.times)
            self.inputs = file.inputs
            self.text, self.parameters = str(facts["model"]), dict(facts["parameters"])
            columns = file.columns
            values = np.stack([file.read(c.dataset)[good] for c in columns], axis=1)
        self.good = len(good)
        self.units = {c.name: c.unit for c in columns if c.unit != NOT_STATED}
        chosen = evenly(self.good, MOST)
        self.runs: list[RunFile] = [
            SweepRow(self, int(good[i]), dict(zip([c.name for c in columns], v, strict=True)))
            for i, v in zip(chosen, values[chosen].tolist(), strict=True)
        ]

    @cached_property
    def model(self) -> Model:
        """The model with the values common to all rows.

        Raises
        ------
        ModelError, FileError
            As `RunFile.model`.
        """
        parameters = {name: f"{value!r}*1" for name, value in self.parameters.items()}
        if self._model_file is not None:
            return load(self._model_file, parameters)
        return load_text(self.text, f"{self.path}:model", parameters, data=input_data(self.inputs))


class SweepRow(RunFile):
    """One row of a sweep file; see `RunFile`."""

    def __init__(self, rows: Rows, number: int, varied: Mapping[str, float]):
        self._rows, self._number = rows, number
        self.name = rows.path
        self.coordinates, self.constraints = rows.names["coordinate"], rows.names["constraint"]
        self.outputs, self.count = rows.outputs, rows.count
        self.conserved_names, self.sensitivity = (), ()
        self.varied = varied
        self.fields = frozenset(rows.fields) | {f"outputs/{name}" for name in rows.outputs}
        model = rows.model
        unknown = np.full(len(self.constraints), np.nan)
        self.record = Record(
            scale_position=unknown,
            scale_velocity=unknown,
            units=result_units(model) | rows.units,
            model=rows.text,
            parameters={**rows.parameters, **varied},
        )

    def blocks(self, names: Sequence[str]) -> Iterator[Mapping[str, Array]]:
        """Yield fields of `Samples` by name, all samples at once."""
        from lagcli.sweeps.file.store import open_sweep

        with open_sweep(self.name) as file:
            yield {
                name: file.times if name == "time" else file.read(name, self._number)
                for name in names
            }

    @property
    def model(self) -> Model:
        """The model, the same for all rows."""
        return self._rows.model
