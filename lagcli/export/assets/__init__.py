"""The parts of exported code that are the same for all models."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path


@cache
def asset(name: str) -> str:
    """Return the text of a file of this folder, without the suffix ``.in``."""
    return (Path(__file__).parent / f"{name}.in").read_text(encoding="utf-8")


def filled(text: str, **parts: str) -> str:
    """Return a text whose marks, such as ``@equations@``, are replaced by parts."""
    return re.sub(r"@(\w+)@", lambda mark: parts[mark[1]], text)
