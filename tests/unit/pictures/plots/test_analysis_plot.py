"""Plots of analyses."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import pytest

from lagcli.cli.app import run
from lagcli.pictures import style

MODEL = """
name: {name}
coordinates: [x, y]
T: x'^2/2 + y'^2/2
V: y^2
{constraints}
initial: {{x: 1, x': 0, y: 1, y': 0}}
"""


@pytest.mark.parametrize(
    ("constraints", "legend"), [("", None), ("constraints: {line: y = x}", ["_one", "_other"])]
)
def test_the_legend_of_two_models_has_their_names(
    constraints: str, legend: list[str] | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without common multipliers there is one curve, and matplotlib hides labels with `_`."""
    monkeypatch.chdir(tmp_path)
    drawn = []
    beside = style.legend_beside

    def legend_beside(ax: Any, handles: list[Any], labels: list[str]) -> None:
        drawn.append(labels)
        beside(ax, handles, labels)

    monkeypatch.setattr(style, "legend_beside", legend_beside)
    for name in ("_one", "_other"):
        Path(f"{name}.yaml").write_text(MODEL.format(name=name, constraints=constraints))
    assert run(["compare", "_one.yaml", "_other.yaml", "--t-end", "0.1", "-o", "c.h5"]) == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert run(["plot", "c.h5", "-o", "c.svg"]) == 0
    assert drawn == ([] if legend is None else [legend])
