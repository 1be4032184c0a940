"""The core's library: its path, its sources, and their fingerprint.

The build stores the fingerprint in the library and in the module of pages, and
`lagcli.engine.core.library` compares it where the sources are there; so this module imports only
the standard library at its top.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path

#: The folder of the core: of its sources, and of its library once that is built.
CORE = Path(__file__).parent
_PACKAGE = CORE.parents[1]

#: Headers that `lagcli.engine.core.headers` generates.
GENERATED = ("tables.h", "layout.h", "settings.h")


def library_in(folder: Path, system: str = sys.platform) -> Path:
    """Return the path of the library in a folder, for a system as `sys.platform` names it."""
    suffix = {"win32": "dll", "darwin": "dylib"}.get(system, "so")
    return folder / f"liblagcore.{suffix}"


def c_files(suffix: str | tuple[str, ...] = ".c") -> list[str]:
    """Return the paths of the core's files with a suffix, in the same order on every system."""
    paths = []
    for folder, _, names in os.walk(CORE):
        paths += [os.path.join(folder, name) for name in names if name.endswith(suffix)]
    return sorted(paths, key=lambda path: path.replace(os.sep, "/"))


def _written() -> list[str]:
    """Return the paths of the files in C that are written by hand."""
    return [path for path in c_files((".c", ".h")) if not path.endswith(GENERATED)]


def _tables() -> list[str]:
    """Return the paths of the Python modules that the generated headers come from."""
    paths, waiting = set(), [CORE / "headers.py"]
    while waiting:
        path = waiting.pop()
        if str(path) in paths:
            continue
        paths.add(str(path))
        for module, names in re.findall(
            r"^from (lagcli\S*) import (.*)$", path.read_text("utf-8"), re.M
        ):
            folder = _PACKAGE.parent / module.replace(".", "/")
            if folder.is_dir():
                waiting += [folder / f"{name}.py" for name in names.split(", ")]
            else:
                waiting.append(folder.with_suffix(".py"))
    return sorted(paths)


def sources_are_here() -> bool:
    """Return whether the sources are installed; wheels do not contain them."""
    return (CORE / "lagcore.h").exists()


def sources() -> list[str]:
    """Return the paths of what the library can depend on, relative to the core."""
    return [os.path.relpath(path, CORE) for path in (*_written(), *_tables())]


def fingerprint() -> str:
    """Return the fingerprint of what is compiled: the files in C and the generated headers."""
    import hashlib

    from lagcli.engine.core.headers import headers

    digest = hashlib.sha256()
    for path in _written():
        digest.update(Path(path).read_bytes() + b"\0")
    for text in headers().values():
        digest.update(text.encode() + b"\0")
    return digest.hexdigest()


def record(paths: Iterable[str]) -> str:
    """Return a line for each source: its path, its size, and the time of its last change.

    The build keeps the record beside the library: while it is true, the sources need not be read.
    """
    lines = []
    for path in paths:
        status = os.stat(f"{CORE}/{path}")
        lines.append(f"{path} {status.st_size} {status.st_mtime_ns}")
    return "\n".join(lines)


def record_in(folder: Path) -> Path:
    """Return the path of the record in a folder."""
    return folder / "liblagcore.sources"


def unchanged() -> bool:
    """Return whether the sources have not changed since the last build."""
    try:
        known = record_in(CORE).read_text("utf-8")
        return record(line.rsplit(" ", 2)[0] for line in known.splitlines()) == known
    except OSError:
        return False
