"""Trajectories as NumPy archives."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from typing import Any

import numpy as np

from lagcli.columns import Columns
from lagcli.results.atomic import check_writable, whole_file
from lagcli.results.metadata import from_metadata, to_json, to_metadata
from lagcli.trajectory.samples import SCHEMA_VERSION, Array, Record, Samples, Terms
from lagcli.trajectory.trajectory import Trajectory, joined

_NAMES = ("coordinates", "constraints")
_SCALES = ("scale_position", "scale_velocity")


def check_npz_target(path: str, force: bool = False, meta: bool = False) -> None:
    """Raise FileError if `NpzWriter` could not write there now."""
    check_writable(path, force)


class NpzWriter:
    """Collects a run and writes it at its end."""

    def __init__(self, path: str, force: bool = False, meta: bool = False):
        self._path, self._force = path, force
        self._blocks: list[Samples] = []

    def __enter__(self) -> NpzWriter:
        return self

    def __exit__(self, *error: object) -> None: ...

    def append(self, samples: Samples) -> None:
        """Take the next samples."""
        self._blocks.append(samples)

    def finish(self, record: Record) -> None:
        """Write the file."""
        run = joined(self._blocks)
        about = {**to_metadata(record), **{n: getattr(run, n) for n in _NAMES}}
        about |= {"terms": run.terms, "names of outputs": list(run.outputs)}
        arrays: dict[str, Any] = {f.name: getattr(run, f.name) for f in fields(Columns)}
        arrays |= {f"outputs/{name}": values for name, values in run.outputs.items()}
        arrays |= {name: getattr(record, name) for name in _SCALES}
        with whole_file(self._path, self._force) as file:
            np.savez(file, about=to_json(about), **arrays)


class NpzReader:
    """An open archive."""

    layout = SCHEMA_VERSION

    def __init__(self, arrays: Mapping[str, Array], about: dict[str, Any]):
        self._arrays = arrays
        self.coordinates, self.constraints = (tuple(about[name]) for name in _NAMES)
        self.outputs = tuple(about["names of outputs"])
        constraint, coordinate, shape = about["terms"]
        rows, columns = (np.array(x, dtype=np.intp) for x in (constraint, coordinate))
        self.terms = Terms(rows, columns, tuple(shape))
        scales: dict[str, Any] = {name: arrays[name] for name in _SCALES}
        self.record = Record(**scales, **from_metadata(about))

    def count(self) -> int:
        """Return the number of samples."""
        return len(self._arrays["time"])

    def columns(self, names: Sequence[str]) -> Iterator[Mapping[str, Array]]:
        """Yield the columns at once."""
        yield {name: self._arrays[name] for name in names}

    def trajectory(self) -> Trajectory:
        """Return all of it."""
        arrays: dict[str, Any] = {f.name: self._arrays[f.name] for f in fields(Columns)}
        return Trajectory(
            coordinates=self.coordinates,
            constraints=self.constraints,
            terms=self.terms,
            outputs={name: self._arrays[f"outputs/{name}"] for name in self.outputs},
            **arrays,
            **vars(self.record),
        )


@contextmanager
def open_npz(path: str) -> Iterator[NpzReader]:
    """Open an archive."""
    with np.load(path) as arrays:
        yield NpzReader(arrays, json.loads(str(arrays["about"])))
