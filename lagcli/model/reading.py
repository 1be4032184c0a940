"""Reading of model files: names of shipped models, file → text."""

from __future__ import annotations

import re
import sys
from codecs import BOM_UTF8
from functools import cache
from itertools import islice
from pathlib import Path

from lagcli.errors import Diagnostic, FileError, ModelError, SourceLocation, UsageError
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import NOT_TEXT, Source

_PACKAGE = Path(__file__).parents[1]
#: Folders in an installed package, and in a checkout.
_FOLDERS = (_PACKAGE / "models", _PACKAGE.parent / "models")


@cache
def shipped_models() -> dict[str, Path]:
    """Return the files of the shipped models by name, sorted."""
    folder = next((f for f in _FOLDERS if f.is_dir()), None)
    paths = () if folder is None else folder.rglob("*.yaml")
    return {path.stem: path for path in sorted(paths, key=lambda path: path.stem)}


def shipped_model(name: str) -> Path:
    """Return the file of a shipped model.

    Raises
    ------
    UsageError
        There is no shipped model of this name.
    """
    models = shipped_models()
    if name not in models:
        help_ = did_you_mean(nearest(name, list(models))) or "`lagcli models` lists them"
        raise UsageError(f"there is no shipped model `{name}`; {help_}")
    return models[name]


def find_model(path: str | Path) -> Path:
    """Return the file of a path or of a shipped model's name.

    A file takes precedence over a shipped model of the same name.

    Parameters
    ----------
    path : path or str

    Returns
    -------
    Path
        The path itself if it is not the name of a shipped model.
    """
    given = Path(path)
    shipped = shipped_models().get(str(path)) if re.fullmatch(r"\w+", str(path)) else None
    return given if shipped is None or given.exists() else shipped


MAX_BYTES = 10_000_000
#: Words, numbers and signs of a file. Reading one takes some 10 µs.
MAX_WORDS = 1_000_000

_WORD = r"[\w.]+|[^\w\s]"
_IS_IT = "is it a model file at all?"
_UTF16 = (b"\xff\xfe", b"\xfe\xff")


def read_text(path: str | Path) -> tuple[str, str]:
    """Read a file, a shipped model by its name, or standard input for "-".

    Returns
    -------
    text, name : str
        The name identifies the file in messages.

    Raises
    ------
    FileError
        The file cannot be read.
    ModelError
        The content is not text.
    """
    if str(path) != "-":
        path = find_model(path)
    name = "<stdin>" if str(path) == "-" else str(path)
    try:
        if str(path) == "-":
            data = sys.stdin.buffer.read(MAX_BYTES + 1) if sys.stdin else b""
        else:
            with Path(path).open("rb") as file:
                data = file.read(MAX_BYTES + 1)
    except IsADirectoryError:
        raise FileError(f"{name} is a folder; give the model file in it") from None
    except FileNotFoundError:
        raise FileError(_missing(Path(path))) from None
    except PermissionError:
        raise FileError(f"cannot read {name}: permission denied") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"cannot read {name}: {reason}") from None
    return _decode(data, name), name


def _missing(path: Path) -> str:
    """Return the error for a missing file, with similar names."""
    try:
        candidates = {p.stem: p for p in path.parent.iterdir() if p.suffix in (".yaml", ".yml")}
    except OSError:
        candidates = {}
    # compared without suffixes, which would make any two names look similar
    close = nearest(path.stem, list(candidates))
    if close:
        return f"there is no file {path}; did you mean {candidates[close[0]]}?"
    shipped = shipped_models()
    if path.stem in shipped:
        return f"there is no file {path}; the name of the shipped model is `{path.stem}`"
    if not path.parent.is_dir():
        return f"there is no folder {path.parent}"
    close = nearest(path.stem, list(shipped))
    if close and path.parent == Path():
        return f"there is no file {path}; did you mean `{close[0]}`, which is shipped with lagcli?"
    return f"there is no file {path}; `lagcli models` lists the shipped ones"


def _not_text(
    name: str, message: str, help_: str, location: SourceLocation | None = None
) -> ModelError:
    location = location or SourceLocation(name, 1, 1)
    return ModelError([Diagnostic("not-text", message, location, help_)])


def _decode(data: bytes, name: str) -> str:
    if data.startswith(b"\x89HDF\r\n"):
        raise _not_text(
            name,
            "this is a result file, not a model",
            f"`lagcli info {name}` describes it; `plot`, `animate` and `report` show it",
        )
    if name.lower().endswith(".csv") and not re.match(rb"\s*(?:#|[^\n]*:)", data):
        raise _not_text(
            name,
            "this is a table, not a model",
            f"`lagcli info {name}` describes results; inputs and data are named in the model file",
        )
    if len(data) > MAX_BYTES:
        raise _not_text(name, f"the file is larger than {MAX_BYTES // 10**6} MB", _IS_IT)
    even, odd = any(data[:8:2]), any(data[1:8:2])
    if data.startswith(_UTF16) or (len(data) >= 8 and even != odd):
        raise _not_text(
            name, "the file is UTF-16 text, not UTF-8", "save it as UTF-8 in your editor"
        )
    try:
        return data.removeprefix(BOM_UTF8).decode("utf-8")
    except UnicodeDecodeError as error:
        before = Source(error.object[: error.start].decode("utf-8"), name).lines
        source = Source(error.object.decode("utf-8", errors="replace"), name)
        raise _not_text(
            name,
            f"the file is not UTF-8 text: byte 0x{error.object[error.start]:02X}",
            f"save it as UTF-8 in your editor; {_IS_IT}",
            source.location(len(before) - 1, len(before[-1])),
        ) from None


def check_text(source: Source) -> None:
    """Reject control characters and others that YAML does not allow, and texts that are too long.

    Raises
    ------
    ModelError
    """
    if len(source.text) > MAX_WORDS:
        beyond = next(islice(re.finditer(_WORD, source.text), MAX_WORDS, None), None)
        if beyond is not None:
            message = f"the model has more than {MAX_WORDS:,} words, numbers and signs"
            help_ = "write what repeats as a family, x[i = 1..N], and its sums as sum(…, i = 1..N)"
            location = SourceLocation(shorten(source.path, 200), 1, 1)
            raise ModelError([Diagnostic("too-large", message, location, help_)])
    if all(char.isprintable() or char in "\t\n\r" for char in set(source.text)):
        return
    match = re.search(NOT_TEXT, source.text)
    if match is None:
        return
    line = next(i for i, text in enumerate(source.lines) if re.search(NOT_TEXT, text))
    column = re.search(NOT_TEXT, source.lines[line])
    assert column is not None
    raise _not_text(
        shorten(source.path, 200),
        f"the file contains the character U+{ord(match[0]):04X}, which is not text",
        f"remove it; {_IS_IT}",
        source.location(line, column.start()),
    )
