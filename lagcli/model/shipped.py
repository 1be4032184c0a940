"""Models that are installed with lagcli."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from lagcli.errors import UsageError
from lagcli.model.spelling import did_you_mean, nearest

_PACKAGE = Path(__file__).parents[1]
#: Folders in an installed package, and in a checkout.
_FOLDERS = (_PACKAGE / "models", _PACKAGE.parent / "models")
_NAME = re.compile(r"\w+")


@cache
def shipped_models() -> dict[str, Path]:
    """Return the files of the shipped models by name, sorted."""
    folder = next((f for f in _FOLDERS if f.is_dir()), None)
    found = () if folder is None else folder.rglob("*.yaml")
    return {path.stem: path for path in sorted(found, key=lambda path: path.stem)}


def shipped_model(name: str) -> Path:
    """Return the file of a shipped model.

    Raises
    ------
    UsageError
        There is no shipped model of this name.
    """
    found = shipped_models()
    if name not in found:
        help_ = did_you_mean(nearest(name, list(found))) or "`lagcli models` lists them"
        raise UsageError(f"there is no shipped model `{name}`; {help_}")
    return found[name]


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
    found = shipped_models().get(str(path)) if _NAME.fullmatch(str(path)) else None
    return given if found is None or given.exists() else found
