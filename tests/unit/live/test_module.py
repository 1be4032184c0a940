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
    """Without the sources, as after `pip install .` of a checkout whose core was changed."""
    monkeypatch.setattr(live_module.fingerprint, "sources_are_here", lambda: False)
    for problem in ("no core for pages", "other sources"):
        assert run(["export", "atwood", "-o", str(tmp_path / "page.html")]) == 4
        printed = capsys.readouterr().err
        assert problem in printed
        assert "run `make wasm` in the checkout" in printed
        assert "install lagcli from there again" in printed
        (assets / "core.wasm").write_bytes(b"\0asm of other sources")


def test_the_module_is_that_of_the_sources() -> None:
    """It is committed: a change of the core needs `make wasm`."""
    assert live_module.module().startswith(b"\0asm")
