"""Damaged copies of result files: changed bytes, changed structures, changed text."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

Change = Callable[[bytearray, random.Random], None]


# bytes


def _flip(data: bytearray, r: random.Random) -> None:
    for _ in range(r.choice((1, 1, 1, 2, 20))):
        data[r.randrange(len(data))] ^= 1 << r.randrange(8)


def _set(data: bytearray, r: random.Random) -> None:
    value = r.choice((0, 1, 0x7F, 0x80, 0xFF, r.randrange(256)))
    data[r.randrange(len(data))] = value


def _fill(data: bytearray, r: random.Random) -> None:
    start, length = r.randrange(len(data)), r.choice((2, 4, 8, 64, 512, 4096))
    end = min(len(data), start + length)
    data[start:end] = bytes([r.choice((0, 0xFF, 0x20))]) * (end - start)


def _cut(data: bytearray, r: random.Random) -> None:
    del data[r.randrange(len(data)) :]


def _remove(data: bytearray, r: random.Random) -> None:
    start = r.randrange(len(data))
    del data[start : start + r.choice((1, 2, 8, 100))]


def _insert(data: bytearray, r: random.Random) -> None:
    start = r.randrange(len(data) + 1)
    data[start:start] = r.randbytes(r.choice((1, 2, 8, 100)))


def _swap(data: bytearray, r: random.Random) -> None:
    length = r.choice((1, 8, 64, 512))
    a, b = (r.randrange(max(1, len(data) - length)) for _ in range(2))
    data[a : a + length], data[b : b + length] = data[b : b + length], data[a : a + length]


def _number(data: bytearray, r: random.Random) -> None:
    """Overwrite eight bytes by a number that is an extreme one as a float or as a size."""
    values = (0.0, -0.0, np.nan, np.inf, 1e308, -1e308, 5e-324)
    sizes = (0, 1, 2**31 - 1, 2**32, 2**63 - 1, 2**64 - 1, len(data))
    new = r.choice(
        [np.float64(x).tobytes() for x in values] + [x.to_bytes(8, "little") for x in sizes]
    )
    start = r.randrange(max(1, len(data) - 8))
    data[start : start + 8] = new


BYTES: tuple[Change, ...] = (_flip, _set, _fill, _cut, _remove, _insert, _swap, _number)


def changed_bytes(data: bytes, r: random.Random, changes: Iterable[Change] = BYTES) -> bytes:
    """Return bytes with one change."""
    new = bytearray(data)
    r.choice(tuple(changes))(new, r)
    return bytes(new)


# structures


def _names(root: h5py.File) -> list[str]:
    found: list[str] = []
    root.visit(found.append)
    return found


def _value(r: random.Random) -> Any:
    """Return something to stand instead of a dataset or an attribute."""
    return r.choice(
        (
            *(
                0.0,
                1,
                -1,
                np.nan,
                1e308,
                b"",
                b"x",
                "x",
                "\u03c6",
                True,
                np.float32(1),
                np.int8(-1),
            ),
            *([], [1.0], [np.nan] * 3, np.zeros((2, 2)), np.zeros((0, 3)), np.zeros((1, 1, 1))),
            *(["a", "b"], [b"a", b"b"], np.full(11, 1e308), np.full(21, -1e308), np.arange(21.0)),
            *("{}", "[]", "null", "1e999", '{"a": NaN}', '{"a": {"b": [1]}}', "[" * 3000, "1"),
            *(h5py.Empty("f"), np.array([(1, 2.0)], dtype=[("a", "i4"), ("b", "f8")])),
            *(
                np.zeros(3, "c16"),
                np.zeros(3, "?"),
                np.zeros(3, "V5"),
                np.datetime64("now").astype(int),
            ),
        )
    )


def _change_structure(root: h5py.File, r: random.Random, outside: str) -> None:
    names = _names(root)
    name = r.choice(names)
    parent = root if "/" not in name else root[name.rpartition("/")[0]]
    last = name.rpartition("/")[2]
    item = root[name]
    shape = getattr(item, "shape", (2,)) or (2,)
    match r.randrange(13):
        case 0:
            del parent[last]
        case 1:
            del parent[last]
            parent.create_dataset(last, data=_value(r))
        case 2:
            new = f"{last}_moved" if r.random() < 0.5 else r.choice(names).rpartition("/")[2]
            if new not in parent:
                parent.move(last, new)
        case 3:
            del parent[last]
            parent[last] = r.choice(
                (
                    h5py.SoftLink(f"/{r.choice(names)}"),
                    h5py.SoftLink("/nowhere"),
                    h5py.SoftLink(name),
                    h5py.ExternalLink(outside, "/x"),
                    h5py.ExternalLink("/dev/zero", "/x"),
                    h5py.ExternalLink(outside + ".fifo", "/x"),
                )
            )
        case 4:
            del parent[last]
            parent[last] = root[r.choice([n for n in names if n != name and n in root] or ["/"])]
        case 5:
            del parent[last]
            where = [(outside, 0, h5py.h5f.UNLIMITED)]
            parent.create_dataset(last, tuple(shape), "<f8", external=where)
        case 6:
            del parent[last]
            layout = h5py.VirtualLayout(tuple(shape), "<f8")
            layout[...] = h5py.VirtualSource(outside, "x", tuple(shape))
            parent.create_virtual_dataset(last, layout)
        case 7:
            del parent[last]
            longer = tuple(n * r.choice((0, 1, 2, 10**6)) + r.choice((0, 1)) for n in shape)
            chunks = tuple(max(1, min(n, 16)) for n in longer) if r.random() < 0.5 else None
            parent.create_dataset(last, longer, r.choice(("<f8", "<i8", "S4")), chunks=chunks)
        case 8:
            del parent[last]
            parent.create_group(last)
        case 9 if isinstance(item, h5py.Dataset) and item.dtype.kind == "f" and item.size:
            data = item[()]
            at = tuple(r.randrange(n) for n in data.shape)
            new = r.choice((np.nan, np.inf, 1e308, -1e308, 0.0, 1.0, 5e-324))
            item[at] = new
        case 10 if isinstance(item, h5py.Dataset) and item.shape:
            data = item[()]
            del parent[last]
            try:
                data = data.astype(r.choice(("<f4", ">f8", "<i4", "S8", "?")))
            except (ValueError, TypeError):
                data = data[:0]
            parent.create_dataset(last, data=data, compression=r.choice((None, "gzip", "lzf")))
        case _:
            place = root if r.random() < 0.8 else item
            known = list(place.attrs)
            at = r.choice(known or ["kind"])
            if r.random() < 0.2 and known:
                del place.attrs[at]
            elif r.random() < 0.3 and isinstance(old := place.attrs.get(at), bytes | str):
                _change_text(place, at, old, r)
            else:
                place.attrs[at] = _value(r)


def _change_text(place: Any, name: str, old: bytes | str, r: random.Random) -> None:
    """Change a text attribute, as JSON where it is that."""
    text = old.decode() if isinstance(old, bytes) else old
    try:
        value = json.loads(text)
        if isinstance(value, dict) and value:
            key = r.choice(list(value))
            value[key] = r.choice(([], {}, None, True, "x", 1e308, -1, 10**400, {"a": [1]}, [[]]))
        text = json.dumps(value)
    except ValueError:
        at = r.randrange(len(text) + 1)
        text = (
            text[:at] + r.choice(("x", "\u202e", "1", "\x1b[31m", "")) + text[at + r.randrange(2) :]
        )
    new = text.encode()
    place.attrs.create(name, np.bytes_(new) if isinstance(old, bytes) and new else text)


def changed_structure(path: Path, r: random.Random, outside: str) -> bool:
    """Change a file by the HDF5 library; return whether it could be done."""
    try:
        with h5py.File(path, "a") as root:
            for _ in range(r.choice((1, 1, 2))):
                _change_structure(root, r, outside)
    except (OSError, ValueError, TypeError, KeyError, RuntimeError, AttributeError):
        return False
    return True


# contents

_VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 7, 2**40, 10**400, 0.5, -0.5, 1e308, -1e308, 5e-324),
    *(float("nan"), float("inf"), "", "x", "1", "inf", "\u03c6", "$x_{", "\u202e", "<b>"),
    *([], {}, [None], [1.0], [[]], [[1.0, 2.0]], ["x"], [1, "x"], {"a": 1}, {"a": [1]}, {"": None}),
)


def _places(value: Any) -> list[Any]:
    """Return all lists and objects with items within a JSON value."""
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    found = [value] if isinstance(value, dict | list) and value else []
    for item in items:
        found += _places(item)
    return found


def changed_json(value: Any, r: random.Random) -> str:
    """Return a JSON value as text, with one item anywhere in it changed."""
    value = json.loads(json.dumps(value))
    # the outer ones are few, and matter most
    places = sorted(_places(value), key=lambda x: -len(json.dumps(x)))
    if not places:
        return json.dumps(r.choice(_VALUES))
    place = r.choice(places[:8] if r.random() < 0.5 else places)
    key = r.choice(list(place) if isinstance(place, dict) else range(len(place)))
    match r.randrange(8):
        case 0:
            del place[key]
        case 1 if isinstance(place, dict):
            place[r.choice(("x", "", "\u03c6", f"{key}2", str(key)[:-1]))] = place.pop(key)
        case 1 | 2 if isinstance(place, list):
            place.insert(key, place[key] if r.random() < 0.5 else r.choice(_VALUES))
        case 2:
            other = r.choice(list(place))
            place[key], place[other] = place[other], place[key]
        case 3:
            place[key] = r.choice(r.choice(places) and _items(r.choice(places)))
        case 4 if isinstance(place[key], int | float):
            place[key] = r.choice((-place[key], place[key] * 1e9, float(place[key]), 0, str(place)))
        case _:
            place[key] = r.choice(_VALUES)
    return json.dumps(value)


def _items(place: Any) -> list[Any]:
    return list(place.values()) if isinstance(place, dict) else place


def _change_array(parent: h5py.Group, name: str, r: random.Random) -> None:
    """Change shape, type or values of a dataset."""
    data = parent[name][()]
    values = np.asarray(data)
    match r.randrange(7):
        case 0 if values.ndim and len(values):
            new = values[: r.randrange(len(values))]
        case 1 if values.ndim and len(values):
            new = np.concatenate([values, values[:1]])
        case 2:
            new = r.choice((values[..., None], values.reshape(-1), values.T, np.zeros((2, 2))))
        case 3:
            kind = r.choice(("<f4", ">f8", "<i4", "<i8", "i1", "S8", "?"))
            with np.errstate(all="ignore"):
                new = (
                    np.zeros(values.shape, kind)
                    if values.dtype.kind == "S"
                    else values.astype(kind)
                )
        case 4 if values.dtype.kind == "S" and values.size:
            new = values.astype(f"S{max(4, values.dtype.itemsize)}")
            new[r.randrange(len(new))] = r.choice((b"", b"x", b"\xff", new[0], b"$_{", b"a b"))
        case _ if values.dtype.kind in "fi" and values.size:
            new = values.copy()
            small = (
                (0, 1, -1, 7, 100)
                if values.dtype.itemsize == 1
                else (0, 1, -1, 2**31 - 1, -(2**31))
            )
            floats = (np.nan, np.inf, -np.inf, 1e308, -1e308, 0.0, -1.0, 5e-324)
            value = r.choice(floats if values.dtype.kind == "f" else small)
            if r.random() < 0.3:
                new[...] = value
            else:
                new[tuple(r.randrange(n) for n in new.shape)] = value
        case _:
            new = values[:0] if values.ndim else values.reshape(1)
    del parent[name]
    parent.create_dataset(name, data=new)


def changed_content(path: Path, r: random.Random) -> str:
    """Change what an HDF5 file says: its attributes, as JSON where they are that, or an array.

    Returns
    -------
    str
        Where; empty if it could not be done.
    """
    try:
        with h5py.File(path, "a") as root:
            arrays = [name for name in _names(root) if isinstance(root[name], h5py.Dataset)]
            texts = [name for name in root.attrs if isinstance(root.attrs[name], bytes)]
            if arrays and r.random() < (0.2 if "content" in texts else 0.5):
                name = r.choice(arrays)
                place, _, last = name.rpartition("/")
                if r.random() < 0.15:
                    del root[name]
                elif r.random() < 0.1:
                    root.move(name, f"{name}2")
                else:
                    _change_array(root[place or "/"], last, r)
                return name
            name = "content" if "content" in texts and r.random() < 0.8 else r.choice(texts)
            text = root.attrs[name].decode()
            if r.random() < 0.05:
                del root.attrs[name]
                return name
            try:
                new = changed_json(json.loads(text), r)
            except ValueError:
                new = r.choice((text[: len(text) // 2], "x", "", text * 2, text.replace("1", "")))
            root.attrs.create(name, np.bytes_(new.encode() or b"\0"))
            return name
    except (OSError, ValueError, TypeError, KeyError, RuntimeError, OverflowError):
        return ""


# CSV

_CELLS = (
    *("", "nan", "inf", "-inf", "1e999", "1e308", "-1e308", "0x10", "1_0", "x", '"', '"1"', '"1'),
    *(" 1", "1 ", "\u0661", "\u22121", "1,5", "1;5", "\x00", "\r", "9" * 400, "1e", "--1", "=1+1"),
)


def changed_table(data: bytes, r: random.Random) -> bytes:
    """Return CSV text with lines, columns or cells changed."""
    lines = [line.split(",") for line in data.decode().split("\n")]
    i = r.randrange(len(lines))
    line = lines[i]
    match r.randrange(9):
        case 0:
            del lines[i]
        case 1:
            lines.insert(r.randrange(len(lines) + 1), list(line))
        case 2:
            j = r.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
        case 3:
            del line[r.randrange(len(line))]
        case 4:
            line.insert(r.randrange(len(line) + 1), r.choice(_CELLS))
        case 5:
            column = r.randrange(len(lines[0]))
            for other in lines:
                if len(other) > column:
                    del other[column]
        case 6:
            a, b = (r.randrange(len(line)) for _ in range(2))
            line[a], line[b] = line[b], line[a]
        case 7:
            lines = lines[: r.randrange(1, len(lines) + 1)]
        case _:
            line[r.randrange(len(line))] = r.choice(_CELLS)
    return "\n".join(",".join(line) for line in lines).encode("utf-8", "surrogatepass")
