"""Outputs in HDF5: the members of a family share a dataset, for speed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from copy import copy
from itertools import groupby
from typing import Any, NamedTuple

import h5py
import numpy as np

from lagcli.arrays import Array
from lagcli.results.hdf5.structure import group, is_texts, numbers, read_texts


class OutputFamily(NamedTuple):
    """Outputs that share a dataset, or a single output.

    Parameters
    ----------
    dataset : str
        Name in the group ``outputs``: that of the family or of the output.
    members : tuple of str
        Names of the outputs, in order.
    axis : str
        The dataset with the names of the members; empty for a single output.
    """

    dataset: str
    members: tuple[str, ...]
    axis: str = ""


def output_families(names: Iterable[str]) -> list[OutputFamily]:
    """Return the datasets for some outputs, in their order.

    Parameters
    ----------
    names : iterable of str
        Names of outputs; the members of a family, ``e[1]``, ``e[2]``, …, are consecutive.

    Returns
    -------
    list of OutputFamily
        If the name of a family, or of its axis, already exists, each member has its own dataset.
    """
    names = list(names)
    taken = set(names)
    families: list[OutputFamily] = []
    for base, those in groupby(names, _base):
        members = tuple(those)
        axis = member_axis(base)
        if members == (base,) or not taken.isdisjoint((base, axis)):
            families += [OutputFamily(name, (name,)) for name in members]
        else:
            families.append(OutputFamily(base, members, axis))
            taken |= {base, axis}
    return families


def member_axis(family: str) -> str:
    """Return the name of the axis along the members of a family."""
    return f"member_of_{family}"


def _base(name: str) -> str:
    """Return the name of the family of an output; the output's name if it is in none."""
    return name.partition("[")[0] if name.endswith("]") else name


class OutputDatasets:
    """The outputs of an open file, by name.

    Parameters
    ----------
    root : h5py.Group
    lead : int
        Number of axes of each dataset before that of the members.

    Attributes
    ----------
    families : list of OutputFamily
    names : tuple of str
        Names of all outputs, in order.

    Raises
    ------
    ValueError
        As `lagcli.results.hdf5.structure.numbers`.
    """

    def __init__(self, root: h5py.Group, lead: int):
        self._group, self._lead = group(root, "outputs"), lead
        self.families = list(self._read_families())
        self.names = tuple(name for family in self.families for name in family.members)
        self._places: dict[str, tuple[str, int | None]] = {}
        for family in self.families:
            for i, name in enumerate(family.members):
                self._places[name] = family.dataset, i if family.axis else None
        if len(self._places) != len(self.names):
            raise ValueError("outputs have two of one name")

    def _read_families(self) -> Iterator[OutputFamily]:
        names = set(self._group)
        for name in self._group:
            if is_texts(self._group, name):
                continue  # names of members
            shape = numbers(self._group, name).shape
            axis = member_axis(name)
            if len(shape) == self._lead:
                yield OutputFamily(name, (name,))
            elif len(shape) == self._lead + 1 and axis in names:
                members = read_texts(self._group, axis)
                if len(members) != shape[-1]:
                    raise ValueError(f"outputs/{name} has shape {shape} for {len(members)} members")
                yield OutputFamily(name, members, axis)
            else:
                raise ValueError(f"outputs/{name} has shape {shape}")

    def within(self, root: h5py.Group) -> OutputDatasets:
        """Return the same outputs in the same file, open once more."""
        outputs = copy(self)
        outputs._group = group(root, "outputs")
        return outputs

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of an output, without the axis of members."""
        return tuple(numbers(self._group, self._place(name)[0]).shape[: self._lead])

    def read(self, name: str, rows: Any) -> Array:
        """Return some rows of an output."""
        dataset, place = self._place(name)
        at = rows if place is None else (*np.index_exp[rows], ..., place)
        return np.asarray(self._group[dataset][at], dtype=np.float64)

    def all(self, count: int) -> dict[str, Array]:
        """Return all outputs, by name; raise ValueError unless each has the expected number of
        samples."""
        outputs: dict[str, Array] = {}
        for family in self.families:
            values = np.asarray(self._group[family.dataset][()], dtype=np.float64)
            if len(values) != count:
                raise ValueError(f"outputs/{family.dataset} has {len(values)} samples, not {count}")
            together = np.ascontiguousarray(values.T) if family.axis else values[None]
            outputs |= dict(zip(family.members, together, strict=True))
        return outputs

    def _place(self, name: str) -> tuple[str, int | None]:
        if name not in self._places:
            raise ValueError(f"outputs/{name} is missing")
        return self._places[name]
