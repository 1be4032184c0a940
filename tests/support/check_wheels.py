"""Check wheels: their files, their tags, and what the core's library needs and exports.

python tests/support/check_wheels.py dist/*.whl
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import re
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any

ROOT = Path(__file__).parents[2]
CORE = PurePosixPath("lagcli/engine/core")
#: What each system brings: libraries that the core's may need.
SYSTEM_LIBRARIES = (
    r"libm\.so\.6|libc\.so\.6|/usr/lib/libSystem\.B\.dylib|KERNEL32\.dll|api-ms-win-crt-.*"
)
#: What Zig's run-time support exports on some systems.
SUPPORT = {
    *("_CRT_INIT", "___chkstk", "__mingw_module_is_dll", "atexit"),
    *("__mh_dylib_header", "___dso_handle"),
}
#: Functions of the standard, which a library has for FMUs.
FMI = ("fmi2", "fmi3")
MACHINES = {
    "x86_64": ("X86_64",),
    "aarch64": ("AARCH64",),
    "arm64": ("ARM64",),
    "amd64": ("AMD64",),
}


class WrongWheel(Exception):
    """A wheel that is not as it should be."""


def demand(condition: object, problem: str) -> None:
    """Raise WrongWheel if a condition does not hold."""
    if not condition:
        raise WrongWheel(problem)


class Wheel:
    """A wheel's files.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path):
        self.name, self.version, *tags = path.name.removesuffix(".whl").split("-")
        self.tag = "-".join(tags)
        self.platform = tags[-1]
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            demand(len(names) == len(set(names)), "a file is there twice")
            self.files = {name: archive.read(name) for name in names if not name.endswith("/")}
        self.information = f"{self.name}-{self.version}.dist-info"

    def text(self, name: str) -> str:
        """Return a file of the wheel's own information."""
        return self.files[f"{self.information}/{name}"].decode()

    @property
    def library(self) -> str:
        """The name of the only library."""
        found = [name for name in self.files if re.search(r"\.(so|dll|dylib|pyd)\b", name)]
        demand(len(found) == 1, f"libraries: {found}")
        return found[0]


def check_record(wheel: Wheel) -> None:
    """RECORD lists every file with its digest and size, and nothing else."""
    listed = {}
    for name, digest, size in csv.reader(io.StringIO(wheel.text("RECORD"))):
        demand(name not in listed, f"{name} is listed twice in RECORD")
        listed[name] = (digest, size)
    for name in listed.keys() ^ wheel.files.keys():
        raise WrongWheel(f"{name} is {'missing' if name in listed else 'not in RECORD'}")
    for name, content in wheel.files.items():
        if not name.endswith(".dist-info/RECORD"):
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip("=")
            demand(listed[name] == (f"sha256={digest}", str(len(content))), f"{name} was changed")


def check_tags(wheel: Wheel) -> None:
    """The metadata state the tags of the file's name, and that there is compiled code."""
    lines = wheel.text("WHEEL").splitlines()
    tags = [line.removeprefix("Tag: ") for line in lines if line.startswith("Tag: ")]
    demand(tags == [wheel.tag], f"tags {tags} in {wheel.tag}")
    demand(wheel.tag.startswith("py3-none-"), wheel.tag)
    demand("Root-Is-Purelib: false" in lines, "said to be without compiled code")
    demand(f"\nVersion: {wheel.version}\n" in wheel.text("METADATA"), "another version inside")


def check_files(wheel: Wheel) -> None:
    """All modules, models and schemas of the checkout are there; sources in C are not."""
    expected = {str(path.relative_to(ROOT)) for path in (ROOT / "lagcli").rglob("*.py")}
    for folder, place in (("models", "models"), ("docs/schemas", "schemas")):
        found = [p for p in (ROOT / folder).rglob("*") if p.suffix in (".yaml", ".csv", ".json")]
        expected |= {f"lagcli/{place}/{path.name}" for path in found}
    missing = sorted(expected - wheel.files.keys())
    demand(not missing, f"missing: {missing}")
    extra = [name for name in wheel.files if name.endswith((".c", ".h", ".sources", ".pyc"))]
    demand(not extra, f"not for users: {extra}")
    library = PurePosixPath(wheel.library)
    suffix = {"w": ".dll", "m": ".so", "mac": ".dylib"}
    kind = "mac" if wheel.platform.startswith("mac") else wheel.platform[0]
    demand(library == CORE / f"liblagcore{suffix[kind]}", f"the library is {library}")


def check_module(wheel: Wheel, fingerprint: str) -> None:
    """The core for pages is there, and that of the library's sources."""
    module = wheel.files.get("lagcli/live/assets/core.wasm", b"")
    demand(module.startswith(b"\0asm"), "core.wasm is missing: run `make wasm` before")
    demand(fingerprint.encode() in module, "core.wasm is that of other sources")


def declared() -> set[str]:
    """Return the functions that the core's public headers declare."""
    names = set()
    for path in (ROOT / CORE).glob("*.h"):
        text = path.read_text("utf-8")
        if "visibility push(default)" in text:
            text = re.sub(r"/\*.*?\*/|^#.*?$", "", text, flags=re.S | re.M)
            names |= set(re.findall(r"^[a-z][\w ]*?[ *]+(lag_\w+)\([^)]*\);", text, flags=re.M))
    return names


def described(content: bytes) -> tuple[str, set[str], list[str], tuple[int, ...]]:
    """Return a library's machine, its exports, what it needs, and the oldest system for it.

    The system is the version of glibc of its newest symbol, or that of macOS; for Windows, whose
    tags have none, it is empty.
    """
    import lief

    lief.logging.disable()

    library: Any = lief.parse(list(content))
    if isinstance(library, lief.ELF.Binary):
        symbols = [
            auxiliary.name
            for requirement in library.symbols_version_requirement
            for auxiliary in requirement.get_auxiliary_symbols()
        ]
        versions = [tuple(map(int, name.removeprefix("GLIBC_").split("."))) for name in symbols]
        exports = {symbol.name for symbol in library.exported_symbols}
        return library.header.machine_type.name, exports, list(library.libraries), max(versions)
    if isinstance(library, lief.PE.Binary):
        exports = {entry.name for entry in library.get_export().entries}
        return library.header.machine.name, exports, [i.name for i in library.imports], ()
    demand(isinstance(library, lief.MachO.Binary), "not a library of any system")
    exports = {symbol.name for symbol in library.exported_symbols}
    exports = {name if name in SUPPORT else name.removeprefix("_") for name in exports}
    own = "@rpath/liblagcore.dylib"
    needs = [entry.name for entry in library.libraries if entry.name != own]
    # the processors of Apple run nothing that is not signed
    signed = library.has_code_signature or library.header.cpu_type.name != "ARM64"
    demand(signed, "the library is not signed")
    return library.header.cpu_type.name, exports, needs, tuple(library.build_version.minos[:2])


def check_library(wheel: Wheel, fingerprint: str) -> None:
    """The library is for the platform, of these sources, exports the public functions alone."""
    content = wheel.files[wheel.library]
    demand(fingerprint.encode() in content, "the library is that of other sources")
    for place in (str(ROOT), str(Path.home())):
        demand(place.encode() not in content, f"{place} is in the library")
    machine, exports, needs, oldest = described(content)
    tag = re.fullmatch(r"(?:(?:manylinux|macosx)_(\d+)_(\d+)|win)_(.*)", wheel.platform)
    demand(tag, f"the platform {wheel.platform} says nothing of the oldest system")
    assert tag
    demand(machine in MACHINES[tag[3]], f"the library is for {machine}")
    if tag[1]:
        stated = int(tag[1]), int(tag[2])
        demand(oldest <= stated, f"needs {oldest}, and the tag says {stated}")
    own = {name for name in exports - SUPPORT if not name.startswith(FMI)}
    demand(own == declared(), f"exports: {sorted(own ^ declared())}")
    strange = [name for name in needs if not re.fullmatch(SYSTEM_LIBRARIES, name)]
    demand(not strange, f"needs {strange}")


def check_installation(path: Path, platform: str) -> None:
    """pip accepts the wheel for its platform, and installs all files."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
        command += ["--disable-pip-version-check", "--only-binary=:all:", "--target", folder]
        done = subprocess.run(
            [*command, "--platform", platform, str(path)], capture_output=True, text=True
        )
        demand(done.returncode == 0, done.stderr)
        demand(len([*(Path(folder) / CORE).glob("liblagcore.*")]) == 1, "no library installed")


def main(paths: list[str]) -> None:
    """Check each wheel, and that they differ in their libraries and tags alone."""
    sys.path.insert(0, str(ROOT))
    from lagcli.engine.core.fingerprint import fingerprint

    common = functions = None
    for path in map(Path, paths):
        wheel = Wheel(path)
        try:
            check_record(wheel)
            check_tags(wheel)
            check_files(wheel)
            check_library(wheel, fingerprint())
            check_module(wheel, fingerprint())
            check_installation(path, wheel.platform)
            own = {wheel.library, *(f"{wheel.information}/{n}" for n in ("WHEEL", "RECORD"))}
            rest = {name: content for name, content in wheel.files.items() if name not in own}
            demand(common in (None, rest), "other modules than those of the first wheel")
            machine, exports, needs, oldest = described(wheel.files[wheel.library])
            exports -= SUPPORT
            demand(functions in (None, exports), "other functions than those of the first wheel")
        except WrongWheel as problem:
            sys.exit(f"{path.name}: {problem}")
        common, functions = rest, exports
        size = len(wheel.files[wheel.library]) // 1000
        print(
            f"{path.name}: {path.stat().st_size // 1000} kB; library {size} kB, {machine},"
            f" {len(exports)} functions, needs {', '.join(needs)}"
            + (f", from {'.'.join(map(str, oldest))}" if oldest else "")
        )


if __name__ == "__main__":
    main(sys.argv[1:])
