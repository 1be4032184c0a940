"""Conversion of files of layout 1, which have texts in HDF5's global heap and no checksum.

Layout 1 stores texts of variable length, and ``constraint_force_by`` of trajectories as (nt, nc,
nq). A damaged heap can make the HDF5 library loop, so this module runs as a separate process:
``python -m lagcli.results.hdf5.layout1 FILE COPY VERSION``; see `lagcli.results.hdf5.opening`.
"""

from __future__ import annotations

import json
import math
import mmap
import struct
import sys
from typing import Any

import h5py
import numpy as np

from lagcli.arrays import Array
from lagcli.columns import BY_NAME, SAMPLED, ResultQuantity
from lagcli.errors import FileError
from lagcli.results.hdf5.container import add_array, add_texts, new_file, set_text
from lagcli.results.hdf5.opening import damage, not_of_lagcli
from lagcli.results.hdf5.structure import group, numbers, read_quantity, stored_within
from lagcli.results.metadata import KIND, TEXTS, from_metadata
from lagcli.trajectory.samples import Record, Samples, Terms

_VERSION = "1"
#: The mappings of layout 1; later ones are empty in the copy.
_MAPPINGS = ("units", "parameters", "options", "counts", "seconds", "initial_correction")
#: Signature of a heap of texts.
_HEAP = b"GCOL\1\0\0\0"
#: Number of values that are read at once.
_SLAB = 1 << 20
#: Datasets of a sweep with integer values.
_INTEGERS = {"run": "<i8", "status": "i1", "steps": "<i8", "rejected": "<i8", "evaluations": "<i8"}


def copy(path: str, target: str, version: str) -> None:
    """Convert a file of layout 1 to the current layout.

    Parameters
    ----------
    path, target : str
    version : str
        The current layout of sweep files.

    Raises
    ------
    FileError
        The file has another layout, is damaged, or was not written by lagcli.
    """
    try:
        _check_heaps(path)
        with h5py.File(path, "r", locking=False) as root:
            kind = _check_origin(path, root)
            if kind == KIND:
                _copy_trajectory(root, target)
            else:
                _copy_sweep(root, target, version)
    except (OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError) as error:
        raise damage(path, error) from error
    except (ArithmeticError, MemoryError) as error:
        raise damage(path, error) from error


def _check_heaps(path: str) -> None:
    """Raise ValueError if the library could loop in a heap of texts."""
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        start = data.find(_HEAP)
        while start >= 0:
            if start + 16 <= len(data):
                (size,) = struct.unpack_from("<Q", data, start + 8)
                if not 16 < size <= len(data) - start:
                    raise ValueError("the size of a heap of texts is wrong")
                _check_heap(data[start : start + size])
            start = data.find(_HEAP, start + 1)


def _check_heap(heap: bytes) -> None:
    """Raise ValueError unless the texts of a heap, and its free space, fill it exactly."""
    place = 16
    while place + 16 <= len(heap):
        number, size = struct.unpack_from("<H6xQ", heap, place)
        if number == 0:  # the free space, which is last
            if place + size != len(heap):
                raise ValueError("the free space of a heap of texts is wrong")
            return
        place += 16 + (size + 7) // 8 * 8
    if place > len(heap):
        raise ValueError("a text is longer than its heap")


def _check_origin(path: str, root: h5py.File) -> str:
    """Return the kind of a file of layout 1."""
    names = ("lagcli_version", "schema_version", "kind")
    if not all(name in root.attrs for name in names):
        raise not_of_lagcli(path)
    if root.attrs.get_id("schema_version").dtype.kind == "S":
        raise FileError(
            f"cannot read {path}: the file is damaged, or was changed after lagcli wrote it (the"
            " checksum at its end is missing); copy it again, or run lagcli again"
        )
    version, kind = _attribute(root, "schema_version"), _attribute(root, "kind")
    if version != _VERSION:
        raise FileError(
            f"cannot read {path}: its layout has version {version}, which this lagcli does not"
            f" support; read it with lagcli {_attribute(root, 'lagcli_version')}"
        )
    if kind not in (KIND, "sweep"):
        raise FileError(f"cannot read {path}: it holds a {kind} and not one {KIND}")
    return kind


def _attribute(root: h5py.Group, name: str) -> str:
    """Return a text attribute of variable length."""
    attribute = root.attrs.get_id(name)
    if attribute.shape != () or h5py.check_string_dtype(attribute.dtype) is None:
        raise ValueError(f"the attribute {name} is not a text")
    value = root.attrs[name]
    if not isinstance(value, str):
        raise ValueError(f"the attribute {name} is not a text of variable length")
    value.encode()  # texts must be UTF-8
    return value


def _texts(root: h5py.Group, name: str) -> list[str]:
    """Return a list of texts of variable length."""
    if not isinstance(root.get(name, getlink=True), h5py.HardLink):
        raise ValueError(f"{name} is missing, or not in the file")
    dataset = root[name]
    if not isinstance(dataset, h5py.Dataset) or dataset.ndim != 1:
        raise ValueError(f"{name} is not a list")
    stored_within(dataset, name)
    string = h5py.check_string_dtype(dataset.dtype)
    if string is None or string.length is not None:
        raise ValueError(f"{name} holds {dataset.dtype} and not texts")
    return [text.decode() for text in dataset[()].tolist()]


# trajectories


def _copy_trajectory(root: h5py.File, target: str) -> None:
    from lagcli.results.hdf5.trajectories import Hdf5Writer

    metadata: dict[str, Any] = {name: _attribute(root, name) for name in TEXTS}
    metadata |= {name: json.loads(_attribute(root, name)) for name in _MAPPINGS}
    fields = from_metadata(metadata)
    names = {name: tuple(_texts(root, name)) for name in ("coordinate", "constraint")}
    length = {"time": numbers(root, "time").shape[0], **{k: len(v) for k, v in names.items()}}
    nt, nq, nc = length.values()

    def read(quantity: ResultQuantity, rows: slice = slice(None)) -> Array:
        return read_quantity(root, quantity, length, rows)

    outputs = group(root, "outputs")
    dense = BY_NAME["constraint_force_by"]._replace(axes=("time", "constraint", "coordinate"))
    slab = max(1, _SLAB // max(1, nc * nq, 10 * (nq + nc) + len(outputs)))
    slabs = [slice(start, min(start + slab, nt)) for start in range(0, nt, slab)] or [slice(0, 0)]
    acting = np.zeros((nc, nq), dtype=bool)
    for rows in slabs:
        acting |= (read(dense, rows) != 0).any(axis=0)
    terms = Terms.of(np.argwhere(acting), (nc, nq))
    columns = [q for q in SAMPLED if q.name not in ("constraint_force", "conserved")]
    with Hdf5Writer(target) as writer:
        for rows in slabs:
            arrays: dict[str, Any] = {
                q.name: read(q, rows) for q in columns if "term" not in q.axes
            }
            by = read(dense, rows)
            writer.append(
                Samples(
                    coordinates=names["coordinate"],
                    constraints=names["constraint"],
                    terms=terms,
                    constraint_force_by=by[:, terms.constraint, terms.coordinate],
                    conserved_names=(),
                    conserved=np.empty((len(by), 0)),
                    outputs={n: _output(outputs, n, nt, rows) for n in outputs},
                    **arrays,
                )
            )
        scales: dict[str, Any] = {n: read(BY_NAME[n]) for n in ("scale_position", "scale_velocity")}
        writer.finish(Record(**scales, **fields))


def _output(outputs: h5py.Group, name: str, count: int, rows: slice) -> Array:
    dataset = numbers(outputs, name)
    if dataset.shape != (count,):
        raise ValueError(f"outputs/{name} has shape {dataset.shape}, not {(count,)}")
    return np.asarray(dataset[rows], dtype=np.float64)


# sweeps


def _copy_sweep(root: h5py.File, target: str, version: str) -> None:
    with new_file(target, force=False) as (copied, _):
        for name in root.attrs:
            text = version if name == "schema_version" else _attribute(root, name)
            set_text(copied["/"].id, name, text)
        for name in root:
            if name == "outputs":
                continue
            if name in _INTEGERS:
                copied.create_dataset(name, data=numbers(root, name, _INTEGERS[name])[()])
            elif name in ("coordinate", "constraint", "message"):
                add_texts(copied, name, _texts(root, name))
            else:
                _copy_numbers(root, name, copied)
        if "outputs" in root:
            into = copied.create_group("outputs", track_order=True)
            outputs = group(root, "outputs")
            for name in outputs:
                _copy_numbers(outputs, name, into)


def _copy_numbers(parent: h5py.Group, name: str, into: h5py.Group) -> None:
    """Copy a dataset in blocks of rows."""
    source = numbers(parent, name)
    if not source.shape or source.size * 8 <= _SLAB:
        add_array(into, name, source[()])
        return
    copied = into.create_dataset(name, source.shape, "<f8")
    rows = max(1, _SLAB // max(1, math.prod(source.shape[1:])))
    for start in range(0, source.shape[0], rows):
        copied[start : start + rows] = source[start : start + rows]


def main() -> int:
    """Convert the file given on the command line; print the reason of a failure."""
    try:
        copy(*sys.argv[1:4])
    except FileError as error:
        sys.stdout.buffer.write(str(error).encode(errors="replace"))
        return error.exit_status
    return 0


if __name__ == "__main__":
    sys.exit(main())
