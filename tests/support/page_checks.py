"""What a machine can see of a page: texts and axes, contrast, focus, motion, paper.

The checks are functions of page_checks.js, in texts that a browser evaluates.
"""

from pathlib import Path

_SOURCE = Path(__file__).with_suffix(".js").read_text(encoding="utf-8")


def _check(name: str) -> str:
    return f"() => {{ {_SOURCE}\nreturn {name}(); }}"


TEXTS = _check("texts")
AXES = _check("axes")
CONTRAST = _check("contrast")
GRAPHICS = _check("graphics")
FOCUSED = _check("focused")
FIRST = _check("first")
REACHABLE = _check("reachable")
MOVING = _check("moving")
PAPER = _check("paper")
