"""Compiling the core: what a user meets on a machine without a compiler, or with one that fails."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import backend
import core_library
import pytest

NO_COMPILER = "a-compiler-that-nobody-has"

needs_compiler = pytest.mark.skipif(core_library.needs_zig(), reason="no C compiler works")


class Checkout:
    """A checkout whose core is two small files and a header."""

    def __init__(self, root: Path, monkeypatch: pytest.MonkeyPatch):
        self.root, self.core = root, root / "core"
        self.library = self.core / "libsmall.so"
        self.monkeypatch = monkeypatch
        self.core.mkdir(parents=True)
        self.write("number.h", "int number(void);\n")
        self.write("number.c", '#include "number.h"\nint number(void) { return 1; }\n')
        self.write("fingerprint.c", "const char *mark(void) { return LAGCLI_FINGERPRINT; }\n")

    def write(self, name: str, text: str) -> None:
        (self.core / name).write_text(text)

    def use(self) -> None:
        """Let `core_library` build this one."""
        set_ = self.monkeypatch.setattr
        set_(core_library, "ROOT", self.root)
        set_(core_library.core, "CORE", self.core)
        set_(core_library.core, "c_files", lambda: sorted(map(str, self.core.glob("*.c"))))
        set_(core_library.core, "sources", list)
        set_(core_library.core, "fingerprint", lambda: "0123")
        set_(core_library, "write_headers", lambda: None)

    def build(self, compiler: core_library.Compiler | None = None) -> int:
        """Build the library; return its number."""
        self.use()
        visible = "-fvisibility=default"
        self.monkeypatch.setenv("CFLAGS", visible)
        core_library.build(self.library, compiler)
        command = [
            sys.executable,
            "-c",
            "import ctypes, sys; print(ctypes.CDLL(sys.argv[1]).number())",
        ]
        done = subprocess.run([*command, self.library], capture_output=True, text=True, check=True)
        return int(done.stdout)

    def objects(self) -> dict[str, int]:
        """Return when each object was written."""
        return {path.name: path.stat().st_mtime_ns for path in self.root.rglob("*.o")}


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Checkout:
    return Checkout(tmp_path / "checkout", monkeypatch)


@needs_compiler
def test_only_what_has_changed_is_compiled_again(checkout: Checkout) -> None:
    assert checkout.build() == 1
    first = checkout.objects()
    assert checkout.build() == 1
    assert checkout.objects() == first
    checkout.write("number.c", '#include "number.h"\nint number(void) { return 2; }\n')
    assert checkout.build() == 2
    changed = {name for name, time in checkout.objects().items() if time != first[name]}
    assert changed == {"number.c.o"}
    checkout.write("number.h", "#define ONE 1\nint number(void);\n")
    assert checkout.build() == 2
    second = checkout.objects()
    assert second["fingerprint.c.o"] == first["fingerprint.c.o"]
    assert second["number.c.o"] != first["number.c.o"]


@needs_compiler
def test_objects_that_were_copied_with_another_checkout_are_not_used(
    checkout: Checkout, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They state the files of the other one, which have not changed."""
    assert checkout.build() == 1
    other = Checkout(tmp_path / "other", monkeypatch)
    shutil.copytree(checkout.root / "build", other.root / "build")
    other.write("number.c", "int number(void) { return 3; }\n")
    assert other.build() == 3


@needs_compiler
def test_a_program_that_uses_the_library_keeps_the_last_one(checkout: Checkout) -> None:
    checkout.build()
    held = checkout.library.stat().st_ino
    library = ctypes.CDLL(str(checkout.library))
    checkout.write("number.c", "int number(void) { return 4; }\n")
    assert checkout.build() == 4
    assert checkout.library.stat().st_ino != held
    assert library.number() == 1


@needs_compiler
def test_an_error_of_the_compiler_is_shown_with_its_command(checkout: Checkout) -> None:
    checkout.write("number.c", "int number(void) { return missing; }\n")
    with pytest.raises(core_library.CannotCompile) as raised:
        checkout.build()
    command, *message = str(raised.value).splitlines()
    assert command.endswith("number.c.o")
    assert "-O3" in command
    assert any("number.c:1:" in line and "missing" in line for line in message)
    # and nothing that could be taken for a library
    assert not checkout.library.exists()
    checkout.write("number.c", "int number(void) { return 5; }\n")
    assert checkout.build() == 5


def test_without_a_compiler_the_message_says_what_was_tried_and_what_helps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CC", NO_COMPILER)
    monkeypatch.setattr(core_library, "find_spec", lambda name: None)
    with pytest.raises(core_library.CannotCompile) as raised:
        core_library.find_compiler()
    message = str(raised.value)
    assert f"{NO_COMPILER}: No such file or directory" in message
    assert "ziglang: not installed" in message
    assert "Install gcc or clang, name a compiler in the variable CC" in message
    assert core_library.ZIG in message


def test_the_compilers_of_the_machine_are_tried_in_order(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(core_library, "find_spec", lambda name: None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(core_library.CannotCompile) as raised:
        core_library.find_compiler()
    lines = str(raised.value).splitlines()
    assert [line.split(":")[0].strip() for line in lines[1:5]] == ["cc", "gcc", "clang", "ziglang"]


@pytest.mark.skipif(sys.platform == "win32", reason="a compiler of the shell")
def test_a_compiler_that_fails_is_named_with_what_it_says(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    broken = tmp_path / "broken-cc"
    broken.write_text("#!/bin/sh\necho 'licence expired' >&2\nexit 3\n")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    assert core_library.needs_zig()
    monkeypatch.setattr(core_library, "find_spec", lambda name: None)
    with pytest.raises(core_library.CannotCompile, match="broken-cc: licence expired"):
        core_library.find_compiler()


def test_an_installation_asks_for_zig_only_where_no_compiler_works(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("get_requires_for_build_wheel", "get_requires_for_build_editable"):
        monkeypatch.setattr(backend.build_meta, name, lambda settings: ["wheel"])
    hooks = (backend.get_requires_for_build_wheel, backend.get_requires_for_build_editable)
    monkeypatch.setenv("CC", NO_COMPILER)
    for requires in hooks:
        assert requires() == ["wheel", core_library.ZIG]
    monkeypatch.setattr(backend, "needs_zig", lambda: False)
    for requires in hooks:
        assert requires() == ["wheel"]


@needs_compiler
@pytest.mark.skipif(sys.platform != "linux", reason="stands in for Zig's compiler on Linux")
def test_zig_compiles_where_no_compiler_works(
    checkout: Checkout, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A package `ziglang` that passes its arguments to the machine's compiler."""
    own = core_library.find_compiler().command
    package = tmp_path / "packages" / "ziglang"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text(
        "import pathlib, subprocess, sys\n"
        "assert sys.argv[1:3] == ['cc', '-target']\n"
        "pathlib.Path(__file__).with_name('target').write_text(sys.argv[3])\n"
        f"sys.exit(subprocess.run([*{own!r}, *sys.argv[4:]]).returncode)\n"
    )
    monkeypatch.setenv("CC", NO_COMPILER)
    monkeypatch.setenv("PYTHONPATH", str(package.parent), prepend=os.pathsep)
    monkeypatch.syspath_prepend(str(package.parent))
    assert "ziglang" in core_library.find_compiler().command
    assert checkout.build() == 1
    target = (package / "target").read_text()
    assert target.split("-")[1] == "linux"


def test_the_command_prints_what_is_wrong_without_a_traceback(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-S", core_library.__file__],  # without what is installed, ziglang too
        env={**os.environ, "CC": NO_COMPILER, "PYTHONPATH": ""},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert done.stderr.startswith("lagcli needs a C compiler to build its core")
