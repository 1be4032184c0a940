"""The core as a WebAssembly module."""

from __future__ import annotations

from pathlib import Path

import pytest

from lagcli.cli.app import run
from lagcli.errors import FileError
from lagcli.live import module as live_module


@pytest.fixture
def assets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder in which the module is looked for; it is empty."""
    monkeypatch.setattr(live_module, "files", lambda package: tmp_path)
    folder = tmp_path / "assets"
    folder.mkdir()
    return folder


def test_a_missing_or_an_old_module_is_an_error_with_a_remedy(
    assets: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(FileError, match="no core for pages") as missing:
        live_module.module()
    assert "make wasm" in str(missing.value)
    (assets / "core.wasm").write_bytes(b"\0asm of other sources")
    with pytest.raises(FileError, match="other sources"):
        live_module.module()
    assert run(["export", "atwood", "-o", str(tmp_path / "page.html")]) == 4
    assert "make wasm" in capsys.readouterr().err
    assert not (tmp_path / "page.html").exists()


def test_an_installation_names_the_remedy_that_it_has(
    assets: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Without the sources, as after `pip install .`: also an old module is not used silently."""
    monkeypatch.setattr(live_module.fingerprint, "sources_are_here", lambda: False)
    for problem in ("no core for pages", "other sources"):
        assert run(["export", "atwood", "-o", str(tmp_path / "page.html")]) == 4
        printed = capsys.readouterr().err
        assert problem in printed
        assert "install a wheel of lagcli" in printed
        assert "make wasm" not in printed
        (assets / "core.wasm").write_bytes(b"\0asm of other sources")
