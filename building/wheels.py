"""Make the wheels of all platforms from one of any platform: `make wheels`.

They differ in the core's library alone, which Zig compiles for each. A wheel serves every Python
of its platform.

    python building/wheels.py dist/lagcli-0.1.0-py3-none-linux_x86_64.whl
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from core_library import MACOS, build, core, zig

#: The oldest glibc on which the library runs; NumPy's own wheels need it, too.
GLIBC = "2.17"


class Platform(NamedTuple):
    """What a wheel is for.

    Parameters
    ----------
    tag : str
        The platform's tag in the wheel's name, which states the oldest system.
    target : str
        Zig's name of it.
    """

    tag: str
    target: str


def _platforms() -> Iterator[Platform]:
    for machine in ("x86_64", "aarch64"):
        yield Platform(f"manylinux_{GLIBC}_{machine}", f"{machine}-linux-gnu.{GLIBC}")
    for machine, zigs in (("x86_64", "x86_64"), ("arm64", "aarch64")):
        yield Platform(f"macosx_{MACOS}_{machine}", f"{zigs}-macos.{MACOS}")
    yield Platform("win_amd64", "x86_64-windows-gnu")


PLATFORMS = [p._replace(tag=p.tag.replace(".", "_")) for p in _platforms()]


def retag(folder: Path, tag: str) -> None:
    """Write the platform's tag into the metadata of an unpacked wheel."""
    [metadata] = folder.glob("*.dist-info/WHEEL")
    text, count = re.subn(r"^Tag: .*\n", f"Tag: py3-none-{tag}\n", metadata.read_text(), flags=re.M)
    assert count == 1, text
    metadata.write_text(text)


def make(given: Path) -> None:
    """Make the wheels beside a given one, and remove that."""
    with tempfile.TemporaryDirectory() as name:
        _wheel("unpack", "--dest", name, str(given))
        given.unlink()
        [folder] = Path(name).iterdir()
        place = folder / core.CORE.relative_to(core.CORE.parents[2])
        for tag, target in PLATFORMS:
            for other in place.glob("liblagcore.*"):
                other.unlink()
            compiler = zig(target)
            # names of the core's hidden functions are two thirds of the library
            compiler = compiler._replace(command=[*compiler.command, "-s"])
            build(core.library_in(place, compiler.system), compiler)
            retag(folder, tag)
            _wheel("pack", "--dest-dir", str(given.parent), str(folder))


def _wheel(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "wheel", *arguments], check=True)


if __name__ == "__main__":
    make(Path(sys.argv[1]))
