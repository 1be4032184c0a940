"""Whatever became of a journal: resuming makes the file of a whole sweep, or says why not."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import pytest
from random_cases import FUZZ_COUNT

import lagcli
from lagcli.errors import LagcliError
from lagcli.sweeps.file.journal import Journal, journal_of

BALL = """\
name: ball
coordinates: [y]
parameters: {m: 1, g: 9.81}
T: m*y'^2/2
V: m*g*y
initial: {y: 0, y': 3}
"""
OPTIONS = {
    "vary": ["m=0:11:1", "g=1,2,3"],  # rows without mass fail
    "measures": {"peak": "max(y)", "last": "final(y')"},
    "t_end": 0.1,
    "samples": 5,
    "jobs": 1,
}


class Swept(NamedTuple):
    """A finished sweep: its journal, where its parts end, and what its file holds."""

    model: Path
    journal: bytes
    ends: list[int]
    contents: dict[str, object]


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Swept:
    folder = tmp_path_factory.mktemp("swept")
    model = folder / "ball.yaml"
    model.write_text(BALL)
    output = folder / "s.h5"
    ends: list[int] = []
    with pytest.MonkeyPatch.context() as patch:
        from lagcli.sweeps.rows import workers

        add = Journal._add

        def noted(self: Journal, record: bytes) -> None:
            add(self, record)
            ends.append(self._end.place)

        patch.setattr(workers, "_FIRST", 4)
        patch.setattr(workers, "_MOST", 4)
        patch.setattr(Journal, "_add", noted)
        patch.setattr(Journal, "remove", Journal.close)
        lagcli.sweep(model, output=output, **OPTIONS)
    assert len(ends) == 10
    return Swept(model, Path(journal_of(str(output))).read_bytes(), ends, contents(output))


def contents(path: Path) -> dict[str, object]:
    """Return the datasets and attributes of a sweep file, without times of the clock."""
    found: dict[str, object] = {}

    def take(name: str, item: h5py.Dataset | h5py.Group) -> None:
        found[name] = item[()].tobytes() if isinstance(item, h5py.Dataset) else "a group"

    with h5py.File(path) as root:
        root.visititems(take)
        for name in ("rows", "failures", "sweep", "columns", "measures"):
            found[f"attribute {name}"] = root.attrs[name]
    return found


def parts(data: bytes, ends: list[int]) -> list[bytes]:
    """Return the magic line with the header, and the records."""
    return [data[a:b] for a, b in zip([0, *ends], ends, strict=False)]


# Each mutation takes a journal, where its parts end, and a source of random numbers.


def truncate(data: bytes, ends: list[int], r: random.Random) -> bytes:
    return data[: r.randrange(len(data))]


def zero_end(data: bytes, ends: list[int], r: random.Random) -> bytes:
    return truncate(data, ends, r) + bytes(r.choice([1, 12, 24, 4096]))


def append_zeros(data: bytes, ends: list[int], r: random.Random) -> bytes:
    return data[: r.choice(ends)] + bytes(r.choice([1, 11, 12, 13, 24, 36, 512, 4096]))


def zero_block(data: bytes, ends: list[int], r: random.Random) -> bytes:
    start = r.randrange(len(data))
    end = min(len(data), start + r.choice([1, 8, 12, 100, 512]))
    return data[:start] + bytes(end - start) + data[end:]


def flip(data: bytes, ends: list[int], r: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(r.choice([1, 1, 1, 2, 8])):
        changed[r.randrange(len(data))] ^= 1 << r.randrange(8)
    return bytes(changed)


def flip_a_frame(data: bytes, ends: list[int], r: random.Random) -> bytes:
    changed = bytearray(data)
    changed[r.choice(ends[:-1]) + r.randrange(12)] ^= 1 << r.randrange(8)
    return bytes(changed)


def duplicate(data: bytes, ends: list[int], r: random.Random) -> bytes:
    given = parts(data, ends)
    given.insert(r.randrange(1, len(given) + 1), r.choice(given[1:]))
    return b"".join(given)


def swap(data: bytes, ends: list[int], r: random.Random) -> bytes:
    given = parts(data, ends)
    i, j = r.sample(range(len(given)), 2)
    given[i], given[j] = given[j], given[i]
    return b"".join(given)


def drop(data: bytes, ends: list[int], r: random.Random) -> bytes:
    given = parts(data, ends)
    del given[r.randrange(len(given))]
    return b"".join(given)


def header_inside(data: bytes, ends: list[int], r: random.Random) -> bytes:
    given = parts(data, ends)
    header = given[0][r.choice([0, data.index(b"\n") + 1]) :]
    given.insert(r.randrange(1, len(given) + 1), header)
    return b"".join(given)


def insert_noise(data: bytes, ends: list[int], r: random.Random) -> bytes:
    place = r.randrange(len(data) + 1)
    return data[:place] + r.randbytes(r.choice([1, 12, 300])) + data[place:]


MUTATIONS: list[Callable[[bytes, list[int], random.Random], bytes]] = [
    *(truncate, zero_end, append_zeros, zero_block, flip, flip_a_frame),
    *(duplicate, swap, drop, header_inside, insert_noise),
]


def resume(swept: Swept, mutant: bytes, folder: Path) -> str:
    """Resume from a mutant; return what became of it."""
    output = folder / "s.h5"
    journal = Path(journal_of(str(output)))
    journal.write_bytes(mutant)
    try:
        summary = lagcli.sweep(swept.model, output=output, resume=True, **OPTIONS)
    except LagcliError as error:
        names_it, untouched = str(journal) in str(error), journal.read_bytes() == mutant
        journal.unlink()
        assert (names_it, untouched) == (True, True)
        return "refused"
    assert contents(output) == swept.contents
    assert not journal.exists()
    output.unlink()
    assert summary.rows == summary.done == 36
    return "cut" if summary.notes else "whole"


def check(swept: Swept, folder: Path, mutation: Callable[..., bytes], count: int) -> None:
    """Hold mutants to the file of the uninterrupted sweep, or to an error of ours."""
    r = random.Random(mutation.__name__)
    model = folder / "ball.yaml"
    shutil.copy(swept.model, model)
    ends = set()
    for _ in range(count):
        mutant = mutation(swept.journal, swept.ends, r)
        found = resume(swept, mutant, folder)
        ends.add(found)
        if found == "whole":  # nothing was lost: cut between records, or zeros after the header
            size = len(mutant)
            assert size in swept.ends or len(mutant.rstrip(b"\0")) <= swept.ends[0]
    assert "cut" in ends or count < 5


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda f: f.__name__)
def test_mutants_of_journals(swept: Swept, tmp_path: Path, mutation: Callable[..., bytes]) -> None:
    check(swept, tmp_path, mutation, 4)


@pytest.mark.fuzz
@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda f: f.__name__)
def test_many_mutants_of_journals(
    swept: Swept, tmp_path: Path, mutation: Callable[..., bytes]
) -> None:
    check(swept, tmp_path, mutation, max(1, FUZZ_COUNT // len(MUTATIONS)))


def test_a_whole_journal_needs_no_runs(swept: Swept, tmp_path: Path) -> None:
    assert resume(swept, swept.journal, tmp_path) == "whole"


def test_failed_rows_are_among_them(swept: Swept) -> None:
    assert np.frombuffer(swept.contents["status"], "i1").tolist().count(0) == 33
