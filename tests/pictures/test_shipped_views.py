"""The models that stand for all have what any shipped model has."""

from __future__ import annotations

from pathlib import Path

import yaml
from shipped import PATHS, REPRESENTATIVES


def parts(path: Path) -> set[str]:
    """Return the sections of a model file, and the kinds of shapes that its view draws."""
    model = yaml.safe_load(path.read_text(encoding="utf-8"))
    found = set(model)
    for kind, shapes in model.get("view", {}).items():
        found.add(f"view: {kind}")
        each = shapes.values() if isinstance(shapes, dict) else ()
        found |= {f"view: {kind}: {key}" for s in each if isinstance(s, dict) for key in s}
    return found


def test_representatives_have_every_section_and_every_shape() -> None:
    every = set().union(*map(parts, PATHS.values()))
    assert every - set().union(*(parts(PATHS[name]) for name in REPRESENTATIVES)) == set()
