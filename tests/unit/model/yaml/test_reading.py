"""Reading of model files: encodings, what is no text, and files that are not there."""

from pathlib import Path

import pytest

from lagcli.errors import FileError, ModelError
from lagcli.model.yaml.reading import check_text, read_text
from lagcli.model.yaml.source import Source


def written(folder: Path, data: bytes) -> Path:
    path = folder / "model.yaml"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("data", ["T: φ'^2\n".encode(), "T: φ'^2\n".encode("utf-8-sig")])
def test_text_is_utf_8_with_or_without_a_mark(tmp_path: Path, data: bytes) -> None:
    path = written(tmp_path, data)
    assert read_text(path) == ("T: φ'^2\n", str(path))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("T: x'^2\n".encode("utf-16"), "UTF-16 text, not UTF-8"),
        ("T: x'^2 + 1\n".encode("utf-16-le"), "UTF-16 text, not UTF-8"),
        ("a: 1\nb: größe\n".encode("latin-1"), "not UTF-8 text: byte 0xF6"),
        (b"\x89HDF\r\n\x1a\n", "a result file, not a model"),
    ],
)
def test_other_encodings_and_files(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        read_text(written(tmp_path, data))


def test_a_wrong_byte_is_located(tmp_path: Path) -> None:
    with pytest.raises(ModelError) as found:
        read_text(written(tmp_path, "a: 1\nb: größe\n".encode("latin-1")))
    (diagnostic,) = found.value.diagnostics
    assert diagnostic.location is not None
    assert (diagnostic.location.line, diagnostic.location.column) == (2, 6)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("model2.yaml", "did you mean .*model.yaml"),
        ("nowhere/model.yaml", "there is no folder"),
        ("", "is a folder"),
    ],
)
def test_files_that_are_not_there(tmp_path: Path, name: str, message: str) -> None:
    written(tmp_path, b"T: 0\n")
    with pytest.raises(FileError, match=message):
        read_text(tmp_path / name)


def test_characters_that_are_not_text() -> None:
    check_text(Source("a: 1\tφ 🙂\n", "model.yaml"))
    with pytest.raises(ModelError, match="U\\+0007") as found:
        check_text(Source("a: 1\nb: \x07\n", "model.yaml"))
    (diagnostic,) = found.value.diagnostics
    assert diagnostic.location is not None
    assert (diagnostic.location.line, diagnostic.location.column) == (2, 4)
