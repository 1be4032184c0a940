"""The shipped models, and those that stand for all where a test takes long for each."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import pytest

MODELS = Path(__file__).parents[2] / "models"
PATHS = {path.stem: path for path in sorted(MODELS.rglob("*.yaml"))}
#: Together they have every section of model files, and draw every shape, that shipped models do:
#: `tests/pictures/test_shipped_views.py`.
REPRESENTATIVES = (
    "car_on_road",
    "four_bar",
    "heavy_top",
    "pendulum_chain",
    "rolling_disk",
    "rope_pendulum",
    "slider_crank",
    "stick_slip_belt",
    "woodpecker",
)
#: Of these, those that differ in their equations: inputs and contacts, vectors in space, families,
#: rows that are not integrable, a closed loop.
WRITTEN = ("car_on_road", "heavy_top", "pendulum_chain", "rolling_disk", "slider_crank")


def every_model(*, smooth: bool = False, few: Collection[str] = REPRESENTATIVES) -> list[Any]:
    """Return the models' names as parameters; those that others, the ``few``, stand for are slow.

    Those that are ``smooth`` have neither contacts nor events.
    """
    return [
        pytest.param(name, marks=[] if name in few else [pytest.mark.slow])
        for name, path in PATHS.items()
        if not smooth or path.parent == MODELS
    ]
