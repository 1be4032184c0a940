"""Files appear whole or not at all, whatever happens to the writer."""

from __future__ import annotations

import errno
import os
import random
import signal
import stat
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import h5py  # noqa: F401  here, so that the forked writers need not import it
import pytest
from patience import children_time
from random_cases import some
from trajectories import assert_same_arrays, environment, make, make_for_csv, make_with_log

from lagcli.errors import FileError, UsageError
from lagcli.results import atomic, check_target, read, write
from lagcli.results.atomic import check_writable, whole_file

resource = pytest.importorskip("resource", reason="limits on file sizes are POSIX")

FORMATS = (".h5", ".csv")


def _refuse(*args: object, **options: object) -> None:
    raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))


@pytest.fixture(params=["unnamed", "unnamed that cannot be linked", "hidden", "no hard links"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each way in which a system lets a file appear whole."""
    if request.param == "unnamed that cannot be linked":
        monkeypatch.setattr(atomic, "_link_followed", _refuse)
    if request.param in ("hidden", "no hard links"):
        monkeypatch.setattr(atomic, "_open_unnamed", lambda folder: None)
    if request.param == "no hard links":
        monkeypatch.setattr(os, "link", _refuse)
    return request.param


def _in_child(action: Callable[[], object]) -> int:
    """Run the action in a forked process; return its id. It exits with the status of a command."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            action()
            status = 0
        except FileError as error:
            status = 4 if "exists already" in str(error) else 5
        finally:
            os._exit(status)
    return child


def _killed_after(seconds: float, action: Callable[[], object]) -> None:
    """Run the action in a process that a signal ends after so much time of the processor."""
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    action()


def _status(child: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _write_bytes(
    path: Path, data: bytes, force: bool = False, then: Callable[[], object] = lambda: None
) -> None:
    with whole_file(str(path), force) as file:
        file.write(data)
        then()


def _interrupt() -> None:
    raise KeyboardInterrupt


def test_the_block_writes_reads_and_seeks(tmp_path: Path, way: str) -> None:
    with whole_file(str(tmp_path / "run")) as file:
        file.write(b"0123456789")
        file.seek(4)
        file.write(b"four")
        file.seek(0)
        assert file.read(6) == b"0123fo"
    assert (tmp_path / "run").read_bytes() == b"0123four89"
    assert os.listdir(tmp_path) == ["run"]


def test_no_name_exists_before_the_end(tmp_path: Path) -> None:
    if atomic._open_unnamed(str(tmp_path)) is None:
        pytest.skip("no unnamed files on this file system")
    with whole_file(str(tmp_path / "run")) as file:
        file.write(b"data")
        assert os.listdir(tmp_path) == []


def test_an_existing_file_stays_without_force(tmp_path: Path, way: str) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(b"precious")
    with pytest.raises(FileError, match=r"run\.h5 exists already; give --force .* another name"):
        _write_bytes(path, b"new")
    assert path.read_bytes() == b"precious"
    assert os.listdir(tmp_path) == ["run.h5"]


def test_a_file_that_appears_meanwhile_stays(tmp_path: Path, way: str) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(FileError, match="exists already"):
        _write_bytes(path, b"new", then=lambda: path.write_bytes(b"precious"))
    assert path.read_bytes() == b"precious"
    assert os.listdir(tmp_path) == ["run.h5"]


def test_force_replaces(tmp_path: Path, way: str) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(b"old and longer")
    _write_bytes(path, b"new", force=True)
    assert path.read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["run.h5"]


def test_force_keeps_the_old_file_when_the_block_fails(tmp_path: Path, way: str) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt):
        _write_bytes(path, b"new", force=True, then=_interrupt)
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["run.h5"]


def test_an_interrupt_in_the_block_leaves_nothing(tmp_path: Path, way: str) -> None:
    with pytest.raises(KeyboardInterrupt):
        _write_bytes(tmp_path / "run", b"data", then=_interrupt)
    assert os.listdir(tmp_path) == []


def test_the_umask_decides_the_mode(tmp_path: Path, way: str) -> None:
    before = os.umask(0o027)
    try:
        _write_bytes(tmp_path / "run", b"")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "run").stat().st_mode) == 0o640


def test_a_symbolic_link_is_followed(tmp_path: Path, way: str) -> None:
    (tmp_path / "disk").mkdir()
    (tmp_path / "run.h5").symlink_to(tmp_path / "disk" / "real.h5")
    _write_bytes(tmp_path / "run.h5", b"one")  # the link dangles: nothing is overwritten
    _write_bytes(tmp_path / "run.h5", b"two", force=True)
    assert (tmp_path / "run.h5").is_symlink()
    assert (tmp_path / "disk" / "real.h5").read_bytes() == b"two"
    assert os.listdir(tmp_path / "disk") == ["real.h5"]


def test_file_and_folder_are_synced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced = []
    monkeypatch.setattr(os, "fsync", lambda fd: synced.append(stat.S_IFMT(os.fstat(fd).st_mode)))
    _write_bytes(tmp_path / "run", b"data")
    assert synced == [stat.S_IFREG, stat.S_IFDIR]


def _folder_missing(folder: Path) -> Path:
    return folder / "no such" / "run.h5"


def _folder_is_a_file(folder: Path) -> Path:
    (folder / "file").touch()
    return folder / "file" / "run.h5"


def _folder_is_closed(folder: Path) -> Path:
    if os.geteuid() == 0:
        pytest.skip("root may write anywhere")
    (folder / "closed").mkdir(mode=0o555)
    return folder / "closed" / "run.h5"


def _target_is_a_folder(folder: Path) -> Path:
    (folder / "run.h5").mkdir()
    return folder / "run.h5"


def _target_is_a_pipe(folder: Path) -> Path:
    os.mkfifo(folder / "run.h5")
    return folder / "run.h5"


def _name_too_long(folder: Path) -> Path:
    return folder / ("x" * 300 + ".h5")


def _system_refuses(folder: Path) -> Path:
    return Path("/proc/run.h5")


@pytest.mark.parametrize(
    ("case", "reason"),
    [
        (_folder_missing, r"there is no folder .*no such; create it with: mkdir -p '.*no such'"),
        (_folder_is_a_file, "is not a folder"),
        (_folder_is_closed, "no permission to write in .*closed"),
        (_target_is_a_folder, "it is a folder; give the name of a file in it"),
        (_target_is_a_pipe, "not a regular file"),
        (_name_too_long, "too long"),
        (_system_refuses, "cannot write /proc/run.h5"),
    ],
)
@pytest.mark.parametrize("force", [False, True])
def test_what_cannot_be_written_is_reported_before_and_after(
    tmp_path: Path, case: Callable[[Path], Path], reason: str, force: bool
) -> None:
    path = str(case(tmp_path))
    with pytest.raises(FileError, match=reason) as caught:
        check_writable(path, force)
    assert path in str(caught.value)
    assert caught.value.exit_status == 4
    with pytest.raises(FileError, match=reason):
        _write_bytes(Path(path), b"", force)


def test_a_check_leaves_nothing(tmp_path: Path, way: str) -> None:
    check_writable(str(tmp_path / "run.h5"))
    assert os.listdir(tmp_path) == []


def test_check_target_checks_suffixes_sidecars_and_standard_output(tmp_path: Path) -> None:
    check_target("-")
    check_target(tmp_path / "run.HDF5")
    check_target(tmp_path / "run.csv", meta=True)
    with pytest.raises(UsageError, match=r"run\.txt.* \.txt .*run\.h5 .*run\.csv"):
        check_target("run.txt")
    with pytest.raises(UsageError, match="no sidecar"):
        check_target("-", meta=True)
    (tmp_path / "run.csv.json").touch()
    for meta in (False, True):
        with pytest.raises(FileError, match=r"run\.csv\.json exists already"):
            check_target(tmp_path / "run.csv", meta=meta)
        check_target(tmp_path / "run.csv", force=True, meta=meta)
    (tmp_path / "run.h5").touch()
    with pytest.raises(FileError, match=r"run\.h5 exists already"):
        check_target(tmp_path / "run.h5")


@pytest.mark.parametrize("kills", some([10, 20], 1))
@pytest.mark.parametrize("suffix", FORMATS)
def test_a_killed_writer_leaves_nothing_or_a_whole_file(
    tmp_path: Path, suffix: str, kills: int
) -> None:
    if atomic._open_unnamed(str(tmp_path)) is None:
        pytest.skip("without unnamed files a kill leaves a hidden one")
    samples = {".h5": 15_000, ".csv": 1_000}[suffix]
    trajectory = make_for_csv(samples, constraints=("rod", "guide", "pin"))

    before = children_time()
    assert _status(_in_child(lambda: write(trajectory, tmp_path / f"whole{suffix}"))) == 0
    duration = children_time() - before

    found = []
    for kill in range(kills):
        folder = tmp_path / str(kill)
        folder.mkdir()
        path = folder / f"run{suffix}"
        moment = random.Random(kill).uniform(0, duration)
        _status(_in_child(partial(_killed_after, moment, partial(write, trajectory, path))))
        left = os.listdir(folder)
        assert left in ([], [path.name])
        if left:
            assert_same_arrays(trajectory, read(path))
        found += left
    assert len(found) < kills  # else no kill came in time, and the test says nothing


def _race(writers: list[Callable[[], object]]) -> list[int]:
    """Start all writers at one moment; return their exit statuses."""
    ready, go = os.pipe()

    def wait_and(write_it: Callable[[], object]) -> None:
        os.close(go)
        os.read(ready, 1)  # returns when the parent closes its end
        write_it()

    children = [_in_child(lambda writer=writer: wait_and(writer)) for writer in writers]
    os.close(ready)
    os.close(go)
    return [_status(child) for child in children]


@pytest.mark.parametrize("suffix", FORMATS)
def test_of_many_runs_exactly_one_wins(tmp_path: Path, suffix: str) -> None:
    runs = [make_for_csv(50, seed=seed) for seed in range(8)]
    path = tmp_path / f"run{suffix}"
    statuses = _race([lambda run=run: write(run, path) for run in runs])
    assert sorted(statuses) == [0] + 7 * [4]
    assert_same_arrays(runs[statuses.index(0)], read(path))
    assert os.listdir(tmp_path) == [path.name]


def test_of_many_writers_exactly_one_wins(tmp_path: Path, way: str) -> None:
    path = tmp_path / "run.h5"
    for _ in range(2):
        statuses = _race([lambda n=n: _write_bytes(path, b"%d" % n) for n in range(8)])
        assert sorted(statuses) == [0] + 7 * [4]
        assert path.read_bytes() == b"%d" % statuses.index(0)
        assert os.listdir(tmp_path) == [path.name]
        path.unlink()


def test_many_writers_with_force_leave_one_whole_file(tmp_path: Path, way: str) -> None:
    path = tmp_path / "run.h5"
    data = [b"%d" % n * 100_000 for n in range(8)]
    statuses = _race([lambda d=d: _write_bytes(path, d, force=True) for d in data])
    assert statuses == 8 * [0]
    assert path.read_bytes() in data
    assert os.listdir(tmp_path) == [path.name]


def _within(limit: int, action: Callable[[], object]) -> int:
    """Return the exit status of a child whose files may not grow beyond the limit."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        action()

    return _status(_in_child(limited))


@pytest.mark.parametrize(("suffix", "meta"), [(".h5", False), (".csv", False), (".csv", True)])
def test_a_full_disk_leaves_no_file(tmp_path: Path, suffix: str, meta: bool) -> None:
    run = make(300, constraints=("rod", "guide"), model="x" * 70_000)
    path = tmp_path / f"run{suffix}"
    write(run, path)
    size = path.stat().st_size
    path.unlink()
    for limit in (0, 1000, 5000, size // 2, size - 1):
        assert _within(limit, lambda: write(run, path, meta=meta)) == 5
        assert os.listdir(tmp_path) == []


def test_a_full_disk_leaves_no_file_on_any_system(tmp_path: Path, way: str) -> None:
    path = tmp_path / "run.h5"
    for limit in (0, 99_999):
        assert _within(limit, lambda: _write_bytes(path, b"x" * 100_000)) == 5
        assert os.listdir(tmp_path) == []
    assert _within(100_000, lambda: _write_bytes(path, b"x" * 100_000)) == 0


def test_a_disk_too_full_for_the_sidecar_leaves_neither(tmp_path: Path) -> None:
    run = make(model="x" * 70_000)
    assert _within(50_000, lambda: write(run, tmp_path / "run.csv")) == 0
    (tmp_path / "run.csv").unlink()
    assert _within(50_000, lambda: write(run, tmp_path / "run.csv", meta=True)) == 5
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("meta", [False, True])
@pytest.mark.parametrize("short", [1, 100, 5000])
def test_a_full_disk_changes_none_of_several_files(tmp_path: Path, meta: bool, short: int) -> None:
    """The last part of the samples reaches the disk after the event table."""
    path = tmp_path / "run.csv"
    new = make_with_log(nt=300, seed=1)
    write(new, path, meta=meta)
    size = path.stat().st_size
    write(make_with_log(nt=300, seed=2), path, meta=meta, force=True)
    old = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    limit = size - short
    assert all(len(old[name]) < limit for name in old if name != "run.csv")
    assert _within(limit, lambda: write(new, path, meta=meta, force=True)) == 5
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == old
    assert _within(limit, lambda: write(new, tmp_path / "other.csv", meta=meta)) == 5
    assert {file.name for file in tmp_path.iterdir()} == {*old}


@pytest.mark.parametrize("name", ["a\0.h5", "a\ud800.h5"])
def test_what_no_file_can_be_named_is_an_error(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError, match="cannot write"):
        write(make(), tmp_path / name)


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_full_disk_is_one_line_and_a_status(tmp_path: Path, suffix: str) -> None:
    """HDF5 itself would crash or chatter when the process ends."""
    script = """
import resource, sys
from trajectories import make
from lagcli.errors import FileError
from lagcli.results import write
resource.setrlimit(resource.RLIMIT_FSIZE, (9000, 9000))
try:
    write(make(1000), sys.argv[1])
except FileError as error:
    print(error)
    sys.exit(error.exit_status)
"""
    path = str(tmp_path / f"run{suffix}")
    done = subprocess.run(
        [sys.executable, "-c", script, path], capture_output=True, text=True, env=environment()
    )
    assert (done.returncode, done.stderr) == (4, "")
    assert done.stdout == (
        f"cannot write {path}: the file is larger than allowed here; raise the limit (ulimit -f)\n"
    )
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (errno.ENOSPC, "the disk is full"),
        (errno.EDQUOT, "quota"),
        (errno.EROFS, "read-only"),
        (errno.EIO, os.strerror(errno.EIO)),
    ],
)
def test_the_reason_of_the_system_is_told(tmp_path: Path, code: int, reason: str) -> None:
    with pytest.raises(FileError, match=reason) as caught, whole_file(str(tmp_path / "run")):
        raise OSError(code, os.strerror(code))
    assert str(tmp_path / "run") in str(caught.value)
    assert os.listdir(tmp_path) == []
