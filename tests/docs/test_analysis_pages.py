"""The examples of docs/sensitivity.md and docs/fit.md are run as they stand, in their order."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from documented import Examples

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize(
    ("page", "files", "said"),
    [
        (
            "sensitivity.md",
            ("sensitivity.h5", "sensitivity.png", "band.png", "tornado.png"),
            "('m', 'l') (601, 2, 2) (601, 1, 2)",
        ),
        ("fit.md", ("fit.h5", "fit.png", "fitted.yaml", "fitted.h5"), "phi' 1"),
    ],
)
def test_all_examples(examples: Examples, page: str, files: tuple[str, ...], said: str) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    found = re.findall(r"```(sh|python)\n(.*?)```", text, re.S)
    assert {kind for kind, _ in found} == {"sh", "python"}
    found = [(kind, text) for kind, text in found if shutil.which("jq") or "| jq" not in text]
    assert said in "".join(examples.run(kind, example) for kind, example in found)
    assert [name for name in files if not (examples.place / name).exists()] == []
