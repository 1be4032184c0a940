"""Reading of model files: names of shipped models, what a file must be to be read."""

from pathlib import Path

import pytest

from lagcli.errors import FileError, ModelError, UsageError
from lagcli.model.loader import load, load_text
from lagcli.model.reading import check_text, find_model, read_text, shipped_model, shipped_models
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


MODEL = """name: {name}
title: {title}
description: {description}
coordinates: {{x: {unit}}}
parameters: {{m: {value}, {key}: 2}}
outputs: {{o: {output}}}
T: {T}
constraints: {{c: {constraint}}}
initial: {{x: 0, x': 0}}
"""
TEXTS = {
    "name": "a",
    "title": "a",
    "description": "a",
    "unit": "m",
    "value": "1 kg",
    "key": "k",
    "output": "x",
    "T": "m*x'^2/2",
    "constraint": "x = 0",
}


@pytest.mark.parametrize("place", TEXTS)
@pytest.mark.parametrize("escape", ["0", "x00", "u0000", "U00000000", "e", "a", "x7f", "uFFFF"])
def test_escape_sequences_of_characters_that_are_not_text(place: str, escape: str) -> None:
    before = f'"{TEXTS[place]}'
    text = MODEL.format(**TEXTS | {place: rf'{before}\{escape}"'})
    with pytest.raises(ModelError, match=r"U\+[0-9A-F]{4}, which is not text") as found:
        load_text(text)
    (diagnostic,) = found.value.diagnostics
    assert diagnostic.location is not None
    where = text.index(f"\\{escape}")
    line = text.count("\n", 0, where)
    assert diagnostic.location.line == line + 1
    assert diagnostic.location.column == where - len("".join(text.splitlines(True)[:line])) + 1
    load_text(MODEL.format(**TEXTS))
    if place != "key":  # a blank is text
        load_text(MODEL.format(**TEXTS | {place: rf'{before}\t"'}))


def test_a_name_denotes_a_shipped_model():
    assert load("slider_crank").name == "slider_crank"
    assert load("slider_crank", set={"m": 2}).parameter_values["m"] == 2
    assert "chain" in shipped_models()


def test_a_file_takes_precedence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "chain").write_text("name: mine")
    assert find_model("chain") == find_model("./chain")
    assert find_model("atwood") == shipped_models()["atwood"]


def test_a_path_is_not_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for path in ("./atwood", "atwood.yaml", tmp_path / "atwood"):
        with pytest.raises(FileError, match="there is no file"):
            load(path)


def test_a_similar_name_is_suggested(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileError, match="did you mean `atwood`, which is shipped"):
        load("atwod")
    with pytest.raises(UsageError, match="did you mean `atwood`"):
        shipped_model("atwod")
