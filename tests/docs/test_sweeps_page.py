"""The examples of docs/sweeps.md are run as they stand."""

from __future__ import annotations

import re
from pathlib import Path

from documented import Examples

PAGE = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")
VOLATILE = ("time", "file", "model", "options", "seconds", "  time", "     ")


def test_all_examples_in_their_order(examples: Examples) -> None:
    found = re.findall(r"```(console|sh|python)\n(.*?)```", PAGE, re.S)
    assert [kind for kind, _ in found].count("console") == 2
    said = {}
    for kind, text in found:
        if kind == "console":
            command, _, expected = text.removeprefix("$ ").partition("\n")
            alike(examples.run("sh", command), expected)
        else:
            said[text] = examples.run(kind, text)
    out = list(said.values())
    assert len(out[1].strip("[]\n").split()) == 3  # the largest force for each of three rods
    assert out[3].endswith("status 3\n")
    assert out[-1] == "18 {}\n"
    written = {"sweep.h5", "sample.h5", "sweep.csv", "some.h5", "long.h5", "python.h5"}
    assert written == {x.name for x in examples.place.iterdir() if x.is_file()}


def alike(got: str, shown: str) -> None:
    """Hold a command's lines to those of the page, but for times and sizes."""
    lines, expected = got.rstrip().split("\n"), shown.rstrip().split("\n")
    kept = [x for x in lines if not x.startswith(VOLATILE)]
    wanted = [x for x in expected if not x.startswith(VOLATILE)]
    assert [x.split() for x in kept] == [x.split() for x in wanted]
