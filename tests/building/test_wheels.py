"""Wheels of other platforms, what is checked in them, and the files that state the release."""

from __future__ import annotations

import base64
import hashlib
import re
import tomllib
import zipfile
from pathlib import Path

import check_wheels
import pytest
import wheels
import yaml
from check_wheels import Wheel, WrongWheel

from lagcli.engine.core.fingerprint import fingerprint
from lagcli.engine.core.library import LIBRARY
from lagcli.version import __version__

ROOT = Path(__file__).parents[2]
INFORMATION = "lagcli-1.0.dist-info"
TAG = "py3-none-manylinux_2_17_x86_64"


def write(folder: Path, record: str = "", tag: str = TAG, **extra: bytes) -> Wheel:
    """Return a wheel of one module, with its RECORD or a given one."""
    files = {
        "lagcli/one.py": b"ONE = 1\n",
        f"{INFORMATION}/WHEEL": f"Root-Is-Purelib: false\nTag: {tag}\n".encode(),
        f"{INFORMATION}/METADATA": b"Name: lagcli\nVersion: 1.0\n\n",
    }
    lines = []
    for name, content in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode()
        lines.append(f"{name},sha256={digest.rstrip('=')},{len(content)}\n")
    files[f"{INFORMATION}/RECORD"] = ("".join(lines) + f"{INFORMATION}/RECORD,,\n{record}").encode()
    path = folder / f"lagcli-1.0-{TAG}.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in (files | extra).items():
            archive.writestr(name, content)
    return Wheel(path)


def test_a_record_that_is_true_is_accepted(tmp_path: Path) -> None:
    check_wheels.check_record(write(tmp_path))
    check_wheels.check_tags(write(tmp_path))


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"lagcli/one.py": b"ONE = 2\n"}, "lagcli/one.py was changed"),
        ({"lagcli/two.py": b""}, "lagcli/two.py is not in RECORD"),
        ({"record": "lagcli/three.py,sha256=,0\n"}, "lagcli/three.py is missing"),
        ({"record": "lagcli/one.py,,\n"}, "lagcli/one.py is listed twice"),
    ],
)
def test_a_record_that_is_not_true_is_refused(tmp_path: Path, given, problem: str) -> None:
    with pytest.raises(WrongWheel, match=problem):
        check_wheels.check_record(write(tmp_path, **given))


def test_the_tag_of_another_platform_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WrongWheel, match="win_amd64"):
        check_wheels.check_tags(write(tmp_path, tag="py3-none-win_amd64"))


def test_a_new_tag_replaces_that_of_the_given_wheel(tmp_path: Path) -> None:
    (tmp_path / INFORMATION).mkdir()
    metadata = tmp_path / INFORMATION / "WHEEL"
    metadata.write_text("Wheel-Version: 1.0\nTag: py3-none-linux_x86_64\n\n")
    wheels.retag(tmp_path, "win_amd64")
    assert metadata.read_text() == "Wheel-Version: 1.0\nTag: py3-none-win_amd64\n\n"


def test_the_platforms() -> None:
    assert {p.tag: p.target for p in wheels.PLATFORMS} == {
        "manylinux_2_17_x86_64": "x86_64-linux-gnu.2.17",
        "manylinux_2_17_aarch64": "aarch64-linux-gnu.2.17",
        "macosx_11_0_x86_64": "x86_64-macos.11.0",
        "macosx_11_0_arm64": "aarch64-macos.11.0",
        "win_amd64": "x86_64-windows-gnu",
    }


def test_the_core_for_pages_is_there_and_of_the_same_sources(tmp_path: Path) -> None:
    place = "lagcli/live/assets/core.wasm"
    for content, problem in (
        ({}, "core.wasm is missing"),
        ({place: b"<html>"}, "core.wasm is missing"),
        ({place: b"\0asm of others"}, "core.wasm is that of other sources"),
    ):
        with pytest.raises(WrongWheel, match=problem):
            check_wheels.check_module(write(tmp_path, **content), fingerprint())
    check_wheels.check_module(
        write(tmp_path, **{place: b"\0asm " + fingerprint().encode()}), fingerprint()
    )


class OfLibrary(Wheel):
    """A wheel that contains one library and nothing else."""

    def __init__(self, content: bytes, platform: str):
        self.files, self.platform = {"liblagcore.so": content}, platform


def test_the_library_is_checked_against_its_platform() -> None:
    """Of this machine, for which it was compiled, whatever the tag says."""
    pytest.importorskip("lief", reason="`make wheels` installs lief")
    content = LIBRARY.read_bytes()
    machine, exports, _, _ = check_wheels.described(content)
    # GCC exports its versions of a loop for processors, too
    assert exports >= check_wheels.declared()
    assert len(check_wheels.declared()) > 90
    machine = {"X86_64": "x86_64", "AARCH64": "aarch64", "ARM64": "arm64"}[machine]
    other = "aarch64" if machine == "x86_64" else "x86_64"
    for platform, source, problem in (
        (f"manylinux_2_1_{machine}", fingerprint(), "the tag says"),
        (f"manylinux_2_99_{other}", fingerprint(), "the library is for"),
        (f"linux_{machine}", fingerprint(), "says nothing of the oldest system"),
        (f"manylinux_2_99_{machine}", "0" * 64, "other sources"),
    ):
        with pytest.raises(WrongWheel, match=problem):
            check_wheels.check_library(OfLibrary(content, platform), source)


def test_files_of_the_release_state_its_version_and_needs() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == __version__
    recipe = yaml.safe_load((ROOT / "conda" / "recipe.yaml").read_text("utf-8"))
    assert recipe["context"]["version"] == __version__
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    names = {"symengine": "python-symengine"}  # conda-forge's own name
    needs = set()
    for line in project["dependencies"]:
        name, bound = re.fullmatch(r"([\w-]+)(>=[\d.]+(?:,<[\d.]+)?)", line).groups()
        needs.add(f"{names.get(name, name)} {bound}")
    assert set(recipe["requirements"]["run"]) == {"python", *needs}


def test_nothing_is_published_before_every_platform_was_tried() -> None:
    text = (ROOT / ".github" / "workflows" / "wheels.yml").read_text("utf-8")
    jobs = yaml.safe_load(text)["jobs"]
    assert jobs["publish"]["needs"] == "try"
    assert jobs["try"]["needs"] == "build"
    systems = {"ubuntu": "manylinux", "macos": "macosx", "windows": "win"}
    for tag in (platform.tag for platform in wheels.PLATFORMS):
        system = next(name for name, start in systems.items() if tag.startswith(start))
        assert any(runner.startswith(system) for runner in jobs["try"]["strategy"]["matrix"]["os"])
    assert jobs["publish"]["permissions"] == {"id-token": "write"}
