"""Low-level writing of HDF5 files: datasets, attributes, dimension scales.

h5py's low-level functions create an ordinary file in half the time of the high-level ones.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, BinaryIO

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5p, h5s, h5t

from lagcli.arrays import Array, Indices
from lagcli.results.atomic import whole_file
from lagcli.results.hdf5.seal import seal
from lagcli.results.metadata import storable

_SCALAR = h5s.create(h5s.SCALAR)
_NAMES = h5p.create(h5p.LINK_CREATE)
_NAMES.set_char_encoding(h5t.CSET_UTF8)

#: Size of HDF5's chunk cache for each dataset, bytes.
_CACHE = 1 << 20


@contextmanager
def new_file(path: str, force: bool) -> Iterator[tuple[h5py.File, Sink]]:
    """Create an HDF5 file that is sealed and named if the block succeeds; see `whole_file`.

    Yields
    ------
    root : h5py.File
    sink : Sink
        `Sink.check` raises an error if a write has failed.
    """
    with whole_file(path, force) as file:
        sink = Sink(file)
        try:
            # The HDF5 1.8 format (2008), whose checksums cover everything except the numbers.
            with h5py.File(sink, "w", libver="v108", rdcc_nbytes=_CACHE) as root:
                yield root, sink
        finally:
            sink.check()
        seal(file)


class Sink:
    """Binary file for HDF5 that records the first failure until HDF5 is done.

    The HDF5 library does not recover from a full disk (with h5py 3.10 the process crashes).
    Therefore failures are not reported to it, and later writes are discarded.
    """

    def __init__(self, file: BinaryIO):
        self.file = file
        self.failure: BaseException | None = None
        self.position = 0
        self.size = 0

    def check(self) -> None:
        """Raise the first failure, if any."""
        if self.failure is not None:
            raise self.failure

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set the position."""
        self.position = offset + (self.size if whence == os.SEEK_END else 0)
        return self.position

    def tell(self) -> int:
        """Return the position."""
        return self.position

    def read(self, size: int) -> bytes:
        """Return bytes from the position; zeros after a failure."""
        return bytes(self._attempt(lambda: self.file.read(size)) or b"").ljust(size, b"\0")

    def write(self, data: memoryview) -> int:
        """Write bytes at the position."""
        self._attempt(lambda: self.file.write(data))
        self.size = max(self.size, self.position + len(data))
        return len(data)

    def truncate(self, size: int) -> int:
        """Set the length."""
        self._attempt(lambda: self.file.truncate(size))
        self.size = size
        return size

    def flush(self) -> None:
        """Do nothing: `whole_file` syncs once."""

    def _attempt(self, action: Callable[[], Any]) -> Any:
        """Perform an action at the position, unless one has failed before."""
        if self.failure is None:
            try:
                self.file.seek(self.position)
                return action()
            except BaseException as error:  # including Ctrl-C
                self.failure = error
        return None


def add_array(group: h5py.Group, name: str, values: Array) -> h5d.DatasetID:
    """Write an array of numbers at once."""
    values = np.ascontiguousarray(values, dtype=np.float64)
    space = h5s.create_simple(values.shape)
    dataset = h5d.create(group.id, name.encode(), h5t.IEEE_F64LE, space, _creation(), _NAMES)
    if values.size:
        dataset.write(h5s.ALL, h5s.ALL, values)
    return dataset


def add_growing(
    group: h5py.Group, name: str, shape: Sequence[int], rows: int, compressed: bool
) -> h5d.DatasetID:
    """Create an empty, resizable dataset with the given chunks of rows."""
    creation = _creation()
    creation.set_chunk((rows, *shape))
    if compressed:
        creation.set_shuffle()
        creation.set_deflate(1)
    space = h5s.create_simple((0, *shape), (h5s.UNLIMITED, *shape))
    return h5d.create(group.id, name.encode(), h5t.IEEE_F64LE, space, creation, _NAMES)


def append(dataset: h5d.DatasetID, start: int, values: Array) -> None:
    """Write rows of a resizable dataset from ``start`` on."""
    values = np.ascontiguousarray(values, dtype=np.float64)
    dataset.set_extent((start + len(values), *values.shape[1:]))
    space = dataset.get_space()
    space.select_hyperslab((start,) + (0,) * (values.ndim - 1), values.shape)
    dataset.write(h5s.create_simple(values.shape), space, values)


def add_indices(group: h5py.Group, name: str, values: Indices) -> h5d.DatasetID:
    """Write a list of indices."""
    places = np.asarray(values, dtype="<i4")
    space = h5s.create_simple(places.shape)
    dataset = h5d.create(group.id, name.encode(), h5t.STD_I32LE, space, _creation(), _NAMES)
    if places.size:
        dataset.write(h5s.ALL, h5s.ALL, places)
    return dataset


def add_texts(group: h5py.Group, name: str, texts: Sequence[str]) -> h5d.DatasetID:
    """Write a list of texts, all of the same length in bytes."""
    encoded = [text.encode() for text in texts]
    # xarray joins the texts of a list whose type has one byte
    kind = text_type(max(map(len, encoded), default=0), least=2)
    space = h5s.create_simple((len(encoded),))
    dataset = h5d.create(group.id, name.encode(), kind, space, _creation(), _NAMES)
    if encoded:
        dataset.write(h5s.ALL, h5s.ALL, np.array(encoded, dtype=f"S{kind.get_size()}"), kind)
    set_text(dataset, "_Encoding", "utf-8")  # tells xarray that they are not bytes
    return dataset


def set_text(place: Any, name: str, text: str) -> None:
    """Write an attribute of a dataset, or of a file, without characters that it cannot store."""
    data = storable(text).encode()
    kind = text_type(len(data))
    attribute = h5a.create(place, name.encode(), kind, _SCALAR)
    attribute.write(np.array(data, dtype=f"S{kind.get_size()}"), kind)


def text_type(length: int, least: int = 1) -> h5t.TypeStringID:
    """Return the type of texts of a number of bytes; shorter ones are padded with zeros.

    Texts of variable length would be stored in a heap of the file, which has no checksum: one
    changed byte there can make the library loop.
    """
    kind = h5t.C_S1.copy()
    kind.set_size(max(length, least))
    kind.set_cset(h5t.CSET_UTF8)
    kind.set_strpad(h5t.STR_NULLPAD)
    return kind


def make_axis(dataset: h5d.DatasetID, name: str) -> None:
    """Make a dataset a dimension scale."""
    h5ds.set_scale(dataset, name.encode())


def attach_axes(dataset: h5d.DatasetID, axes: Sequence[h5d.DatasetID]) -> None:
    """Attach the dimension scales of a dataset."""
    for dimension, axis in enumerate(axes):
        h5ds.attach_scale(dataset, axis, dimension)


def _creation() -> h5p.PropDCID:
    """Return the creation properties of datasets: each number is written once, without time
    stamps."""
    creation = h5p.create(h5p.DATASET_CREATE)
    creation.set_obj_track_times(False)
    creation.set_fill_time(h5d.FILL_TIME_NEVER)
    return creation
