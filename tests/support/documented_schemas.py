"""The JSON schemas of the documentation, compiled once in a process."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import fastjsonschema

FOLDER = Path(__file__).parents[2] / "docs" / "schemas"


@cache
def schema(name: str) -> Callable[[Any], Any]:
    """Return a function that raises for an object that has not the schema of this name."""
    text = (FOLDER / f"{name}.json").read_text(encoding="utf-8")
    found: Callable[[Any], Any] = fastjsonschema.compile(json.loads(text))
    return found
