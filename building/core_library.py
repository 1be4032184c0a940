"""Compile the core to a shared library.

By the C compiler of the machine: that of the variable CC, or `cc`, `gcc` or `clang`; where none of
them works, by Zig's, which is installed from the package index as `ziglang`. Only what has changed
is compiled again: objects are kept in ``build/core``, by the compiler and its flags.

    python building/core_library.py
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
# a build is isolated from the directory that it is run in
sys.path.insert(0, str(ROOT))
from lagcli.engine.core import fingerprint as core  # noqa: E402
from lagcli.engine.core.headers import headers  # noqa: E402

#: The release of Zig that compiles the core where nothing else does.
ZIG = "ziglang==0.15.2"
#: The oldest macOS on which the library runs.
MACOS = "11.0"

# No -ffast-math: NaN and the order of operations mean something here; nor may a processor that
# multiplies and adds at once change them, but for `make test-fma`. Nobody reads errno, and with it
# no root is a vector's. Jumps through tables cost the evaluator dearly where they cannot be
# predicted. What is hidden from outside is called without a detour.
FLAGS = (
    "-O3",
    "-fno-math-errno",
    "-fno-jump-tables",
    "-fvisibility=hidden",
    "-Wno-psabi",  # vectors are passed within one file alone
)

# A library of macOS contains its own name: by default the path where it was linked.
_NAMED = {"darwin": ["-Wl,-install_name,@rpath/liblagcore.dylib"]}


class CannotCompile(Exception):
    """No C compiler works, or one rejects the core."""


class Compiler(NamedTuple):
    """A compiler with the flags of the core.

    Parameters
    ----------
    command : list of str
        The program, and what it always needs.
    system : str
        The system that the library is for, as `sys.platform` names it.
    """

    command: list[str]
    system: str = sys.platform

    @property
    def compiling(self) -> list[str]:
        """The command that compiles a file."""
        own = os.environ.get("LAGCLI_CONTRACTION", "-ffp-contract=off").split()
        relocatable = [] if self.system == "win32" else ["-fPIC"]
        given = shlex.split(os.environ.get("CFLAGS", ""))
        return [*self.command, "-c", *FLAGS, *own, *relocatable, *self.target, *given]

    @property
    def linking(self) -> list[str]:
        """The command that links a library."""
        given = shlex.split(os.environ.get("LDFLAGS", ""))
        return [*self.command, "-shared", *self.target, *_NAMED.get(self.system, []), *given]

    @property
    def libraries(self) -> list[str]:
        """What a library is linked with, after its objects."""
        return [] if self.system == "win32" else ["-lm"]

    @property
    def target(self) -> list[str]:
        """The flags of the oldest system on which the library runs."""
        oldest = self.system == "darwin" and "ziglang" not in self.command
        return [f"-mmacosx-version-min={MACOS}"] if oldest else []

    def works(self) -> str:
        """Return what is wrong with the compiler, nothing if it makes a library."""
        with tempfile.TemporaryDirectory() as folder:
            source, made = Path(folder) / "tried.c", Path(folder) / "tried.o"
            source.write_text("#include <math.h>\nint tried(double x) { return isnan(x); }\n")
            for command in (
                [*self.compiling, str(source), "-o", str(made)],
                [*self.linking, str(made), "-o", str(made.with_suffix(".so")), *self.libraries],
            ):
                try:
                    subprocess.run(command, check=True, capture_output=True, text=True)
                except OSError as error:
                    return error.strerror or str(error)
                except subprocess.CalledProcessError as error:
                    return str(error.stderr).strip() or f"exit status {error.returncode}"
        return ""


def _zig_target() -> str:
    """Return Zig's name of this machine, with the oldest system that the library needs."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine()
    )
    if sys.platform == "win32":
        return f"{machine}-windows-gnu"
    if sys.platform == "darwin":
        return f"{machine}-macos.{MACOS}"
    return f"{machine}-linux-{'gnu' if platform.libc_ver()[0] == 'glibc' else 'musl'}"


def zig(target: str) -> Compiler:
    """Return Zig's compiler for a target, of the package `ziglang`."""
    system = target.split("-")[1].partition(".")[0]
    return Compiler(
        [sys.executable, "-m", "ziglang", "cc", "-target", target],
        {"windows": "win32", "macos": "darwin"}.get(system, system),
    )


def _of_the_machine() -> tuple[Compiler | None, list[str]]:
    """Return the compiler of the machine that works, and why those before it do not."""
    given = os.environ.get("CC")
    problems = []
    for name in [given] if given else ["cc", "gcc", "clang"]:
        compiler = Compiler(shlex.split(name))
        problem = compiler.works()
        if not problem:
            return compiler, []
        problems.append(f"{name}: {problem}")
    return None, problems


def needs_zig() -> bool:
    """Return whether no compiler of the machine works."""
    return _of_the_machine()[0] is None


def find_compiler() -> Compiler:
    """Return the compiler to use; raise CannotCompile where nothing works."""
    compiler, problems = _of_the_machine()
    if compiler is None and find_spec("ziglang"):
        compiler = zig(_zig_target())
        problem = compiler.works()
        if problem:
            problems.append(f"ziglang: {problem}")
            compiler = None
    elif compiler is None:
        problems.append("ziglang: not installed")
    if compiler is None:
        raise CannotCompile(
            "lagcli needs a C compiler to build its core, and none works here:\n"
            + "".join(f"  {problem}\n" for problem in problems)
            + f"Install gcc or clang, name a compiler in the variable CC, or install `{ZIG}`."
        )
    return compiler


def write_headers() -> None:
    """Write the headers that come from Python modules, where they have changed."""
    for name, text in headers().items():
        path = core.CORE / name
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, encoding="utf-8")


def _run(command: Iterable[str]) -> None:
    done = subprocess.run([*command], capture_output=True, text=True)
    if done.returncode:
        raise CannotCompile(f"{shlex.join(command)}\n{done.stderr}")
    sys.stderr.write(done.stderr)


def _compiled(compiler: Compiler, source: str, folder: Path, extra: list[str]) -> tuple[Path, bool]:
    """Return a file's object, and whether it has been compiled now."""
    name = os.path.relpath(source, core.CORE).replace(os.sep, "_")
    made = folder / f"{name}.o"
    included, key = made.with_suffix(".d"), made.with_suffix(".key")

    def state() -> str:
        """Return a digest of the options and of the files that the object depends on."""
        # an object that was copied with its folder depends on the files of another checkout
        digest = hashlib.sha256(repr((source, extra)).encode())
        paths = re.sub(r"\\\n", " ", included.read_text("utf-8")).partition(": ")[2]
        for path in shlex.split(paths):
            digest.update(Path(path).read_bytes() + b"\0")
        return digest.hexdigest()

    try:
        if made.exists() and key.read_text() == state():
            return made, False
    except OSError:  # never compiled, or a file that it included is gone
        pass
    key.unlink(missing_ok=True)
    _run([*compiler.compiling, *extra, "-MMD", "-MF", str(included), f"-I{core.CORE}", source,
          "-o", str(made)])  # fmt: skip
    key.write_text(state())
    return made, True


def build(library: Path, compiler: Compiler | None = None) -> None:
    """Compile the core to a library.

    Parameters
    ----------
    library : Path
        Replaced, not written over: a program may be using the last one.
    compiler : Compiler, optional
        By default the one of `find_compiler`.
    """
    compiler = compiler or find_compiler()
    write_headers()
    options = hashlib.sha256(repr((compiler.compiling, compiler.linking)).encode()).hexdigest()
    folder = ROOT / "build" / "core" / options[:16]
    folder.mkdir(parents=True, exist_ok=True)
    # one file alone knows the fingerprint
    marked = [f'-DLAGCLI_FINGERPRINT="{core.fingerprint()}"']
    sources, record = core.c_files(), core.record(core.sources())
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        objects = list(
            pool.map(
                lambda source: _compiled(
                    compiler, source, folder, marked if source.endswith("fingerprint.c") else []
                ),
                sources,
            )
        )
    linked = folder / library.name
    if any(new for _, new in objects) or not linked.exists():
        paths = [str(path) for path, _ in objects]
        _run([*compiler.linking, *paths, *compiler.libraries, "-o", str(linked)])
    library.parent.mkdir(parents=True, exist_ok=True)
    partial = library.with_name(f"{library.name}.{os.getpid()}")
    partial.write_bytes(linked.read_bytes())
    partial.chmod(0o755)
    partial.replace(library)
    if library.parent == core.CORE:
        core.record_in(core.CORE).write_text(record, encoding="utf-8")


if __name__ == "__main__":
    try:
        build(core.library_in(core.CORE))
    except CannotCompile as error:
        sys.exit(str(error))
