"""Trajectory: all samples of one run in memory, with everything needed to reproduce it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.columns import DERIVATIVES, Columns
from lagcli.trajectory.samples import Record, Samples


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Trajectory(Record, Samples):
    """All samples of one run and its record; see `Samples` and `Record` for the fields."""

    def __repr__(self) -> str:
        return f"<Trajectory: {self.extent}, {self.status}>"

    @property
    def modes(self) -> Indices | None:
        """The modes of the switched rows at each sample.

        (nt, ns) indices into `lagcli.trajectory.event_log.MODES`, of the rows ``events.rows``,
        right after the sample's time; None for a model without switching.
        """
        return None if self.events is None else self.events.modes_at(self.time)

    def to_xarray(self) -> Any:
        """Return the run as an `xarray.Dataset` with named coordinates and constraints.

        ``dataset.multipliers.sel(constraint="guide")`` is λ of the guide over time.

        Returns
        -------
        xarray.Dataset
            The arrays of `Columns` and the outputs, over ``time``, ``coordinate``, ``constraint``
            and ``term``, with units if the model gives them. Arrays are not copied. For a model
            with contacts or events also ``mode`` over ``time`` and ``row``, and the log,
            ``event_time``, ``event_name``, …, over ``event``.

        Raises
        ------
        UsageError
            xarray is not installed.
        """
        from lagcli.trajectory.dataset import to_dataset

        return to_dataset(self)


def joined(blocks: Sequence[Samples]) -> Samples:
    """Return consecutive blocks of samples as one.

    Parameters
    ----------
    blocks : sequence of Samples
        Blocks in order, at least one.

    Returns
    -------
    Samples
        A single block itself, or copies.
    """
    first = blocks[0]
    if len(blocks) == 1:
        return first

    def column(name: str) -> Array:
        return np.concatenate([getattr(block, name) for block in blocks])

    arrays = {f.name: column(f.name) for f in fields(Columns)}
    derivatives = {q.name: column(q.name) for q in DERIVATIVES if first.sensitivity}
    outputs = {n: np.concatenate([block.outputs[n] for block in blocks]) for n in first.outputs}
    return Samples(
        coordinates=first.coordinates,
        constraints=first.constraints,
        terms=first.terms,
        conserved_names=first.conserved_names,
        outputs=outputs,
        sensitivity=first.sensitivity,
        **derivatives,
        **arrays,
    )


def complete(samples: Samples, record: Record) -> Trajectory:
    """Combine samples and record into a Trajectory."""
    return Trajectory(**vars(samples), **vars(record))
