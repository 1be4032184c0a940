"""Access to parts of an open HDF5 file, each checked before its contents are read.

Files may come from untrusted sources. Data outside of the file (external links, external storage,
virtual datasets) is rejected, and so is an array that is larger than the file can contain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5z

from lagcli.arrays import Array
from lagcli.columns import REQUIRED, ResultQuantity

#: Largest ratio of uncompressed to compressed bytes, a limit of DEFLATE.
_DEFLATED = 1040
_FILTERS = {h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE}


def group(parent: h5py.Group, name: str) -> h5py.Group:
    """Return a group of a file.

    Raises
    ------
    ValueError
        It is missing, external, or not a group.
    """
    member = _own(parent, name)
    if not isinstance(member, h5py.Group):
        raise ValueError(f"{name} is not a group")
    return member


def numbers(parent: h5py.Group, name: str, kind: str = "<f8") -> h5py.Dataset:
    """Return a dataset of numbers stored in the file.

    Parameters
    ----------
    parent : h5py.Group
    name : str
    kind : str
        The type code of NumPy.

    Raises
    ------
    ValueError
        It is missing, external, of another type, or larger than the file.
    """
    dataset = _dataset(parent, name)
    if dataset.dtype != np.dtype(kind):
        raise ValueError(f"{name} holds {dataset.dtype} and not {np.dtype(kind)}")
    return dataset


def read_quantity(
    root: h5py.Group, quantity: ResultQuantity, lengths: Mapping[str, int], rows: slice
) -> Array:
    """Return some rows of a quantity; NaN if the file is older than the quantity.

    Parameters
    ----------
    root : h5py.Group
    quantity : ResultQuantity
    lengths : mapping of str to int
        Lengths of its axes, by name.
    rows : slice

    Raises
    ------
    ValueError
        As `numbers`; also if its shape does not match its axes.
    """
    expected = tuple(lengths[axis] for axis in quantity.axes)
    if quantity.name not in root and quantity.name not in REQUIRED:
        return np.full(expected, np.nan)[rows]
    dataset = numbers(root, quantity.name)
    if dataset.shape != expected:
        raise ValueError(f"{quantity.name} has shape {dataset.shape}, not {expected}")
    return np.asarray(dataset[rows], dtype=np.float64)


def read_arrays(
    parent: h5py.Group, layout: Mapping[str, Sequence[str]], lengths: dict[str, int]
) -> dict[str, Array]:
    """Return arrays of numbers, by name.

    Parameters
    ----------
    parent : h5py.Group
    layout : mapping of str to sequence of str
        The axes of each dataset.
    lengths : dict of str to int
        Lengths of axes by name; those that it lacks are added, as the first dataset has them.

    Raises
    ------
    ValueError
        As `numbers`; also if the shape of a dataset does not match its axes.
    """
    arrays = {}
    for name, axes in layout.items():
        dataset = numbers(parent, name)
        shape = dataset.shape
        if len(shape) == len(axes):
            for axis, length in zip(axes, shape, strict=True):
                lengths.setdefault(axis, length)
        expected = tuple(lengths.get(axis, "any") for axis in axes)
        if shape != expected:
            where = f"{parent.name}/{name}".lstrip("/")
            raise ValueError(f"{where} has shape {shape}, not {expected} ({', '.join(axes)})")
        arrays[name] = np.asarray(dataset[()], dtype=np.float64)
    return arrays


def texts(parent: h5py.Group, name: str) -> h5py.Dataset:
    """Return a dataset of texts of fixed length; for the errors see `numbers`."""
    dataset = _dataset(parent, name)
    if dataset.dtype.kind != "S":
        raise ValueError(f"{name} holds {dataset.dtype} and not texts")
    return dataset


def is_texts(parent: h5py.Group, name: str) -> bool:
    """Return whether a dataset contains texts of fixed length; for the errors see `numbers`."""
    return bool(_dataset(parent, name).dtype.kind == "S")


def read_texts(parent: h5py.Group, name: str) -> tuple[str, ...]:
    """Return a list of texts; for the errors see `numbers`."""
    dataset = texts(parent, name)
    if dataset.ndim != 1:
        raise ValueError(f"{name} has shape {dataset.shape} and not one axis")
    return tuple(x.decode() for x in dataset[()].tolist())


def text_attribute(root: h5py.Group, name: str) -> str | None:
    """Return a text attribute; None if there is none.

    Raises
    ------
    ValueError
        It is not a text of fixed length.
    """
    attributes = root.attrs
    if name not in attributes:
        return None
    attribute = attributes.get_id(name)
    if attribute.dtype.kind != "S" or attribute.shape != ():
        raise ValueError(f"the attribute {name} is not a text of a fixed length")
    value: bytes = attributes[name]
    return value.decode()


def stored_within(dataset: h5py.Dataset, name: str) -> None:
    """Raise ValueError unless a dataset is stored in its file, with a possible compression
    ratio."""
    creation = dataset.id.get_create_plist()
    if creation.get_external_count():
        raise ValueError(f"{name} lies in another file (external storage), which is not read")
    layout = creation.get_layout()
    if layout == h5d.VIRTUAL:
        raise ValueError(f"{name} is a view of other datasets (virtual), which is not read")
    filters = {creation.get_filter(i)[0] for i in range(creation.get_nfilters())}
    if not filters <= _FILTERS:
        raise ValueError(f"{name} has filters that lagcli does not use: {sorted(filters)}")
    itemsize = dataset.dtype.itemsize
    size = math.prod(dataset.shape) * itemsize
    if layout == h5d.COMPACT:
        return
    stored = dataset.id.get_storage_size()
    largest = dataset.file.id.get_filesize()
    room = min(stored, largest) * (_DEFLATED if h5z.FILTER_DEFLATE in filters else 1)
    if stored > largest or size > room:
        raise ValueError(
            f"{name} declares {size} bytes, and the file holds {min(stored, largest)} of it"
        )
    chunk = dataset.chunks
    if chunk and math.prod(chunk) * itemsize > max(room, 1 << 24):
        raise ValueError(f"{name} has chunks that are larger than the file can hold")


def _dataset(parent: h5py.Group, name: str) -> h5py.Dataset:
    member = _own(parent, name)
    if not isinstance(member, h5py.Dataset):
        raise ValueError(f"{name} is not a dataset")
    if member.shape is None:
        raise ValueError(f"{name} is empty")
    stored_within(member, name)
    return member


def _own(parent: h5py.Group, name: str) -> Any:
    """Return the object of a hard link; other links may point outside of the file."""
    link = parent.get(name, getlink=True)
    if link is None:
        raise ValueError(f"{name} is missing")
    if not isinstance(link, h5py.HardLink):
        kind = "an external link" if isinstance(link, h5py.ExternalLink) else "a soft link"
        raise ValueError(f"{name} is {kind}, which is not followed")
    return parent[name]
