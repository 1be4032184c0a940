"""Models of live pages: what a page would hold, and runs of it by Node.js."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.live.content import LiveContent, live_content
from lagcli.model.model import Model
from lagcli.simulations.sampling import sample_times
from lagcli.simulations.simulation import prepare

ASSETS = Path(lagcli.__file__).parent / "live" / "assets"
RUNNER = Path(__file__).with_name("live_runs.mjs")


class Live:
    """The model of a page, simulated without a browser.

    Parameters
    ----------
    model : Model
    folder : Path
        For its files.
    """

    def __init__(self, model: Model, folder: Path):
        if shutil.which("node") is None:
            pytest.skip("node is not installed")
        self.model, self.folder = model, folder
        self.content: LiveContent = live_content(model)
        for name, data in self.content.resources._asdict().items():
            (folder / name).write_bytes(data)

    def case(
        self,
        parameters: Mapping[str, float] = {},
        initial: Mapping[str, tuple[float, bool]] = {},
        **more: Any,
    ) -> dict[str, Any]:
        """Return a case: values in SI, and whether initial ones are guesses."""
        names = self.content.data["names"]
        states = [*names["coordinates"], *(f"{q}'" for q in names["coordinates"])]
        settings = prepare(self.model).settings
        return {
            "parameters": [[names["parameters"].index(k), x] for k, x in parameters.items()],
            "initial": [[states.index(k), x, guess] for k, (x, guess) in initial.items()],
            "times": sample_times(settings).tolist(),
            "t_end": settings.t_end,
            **more,
        }

    def run(self, cases: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Run cases; return their outcomes, with columns as arrays."""
        request = {
            "scripts": [str(ASSETS / "core.js")],
            "wasm": str(ASSETS / "core.wasm"),
            **{name: str(self.folder / name) for name in ("model", "values")},
            "cases": list(cases),
        }
        done = subprocess.run(
            ["node", str(RUNNER)], input=json.dumps(request), capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        assert found["imports"] == []
        for made in found["made"]:
            if "columns" in made:
                made["columns"] = np.array(made["columns"], dtype=float)
        return found["made"]

    @property
    def drawn(self) -> dict[str, int]:
        """The places of the columns that the page draws: of many outputs, some."""
        plots = self.content.data["plots"].values()
        return {curve["name"]: curve["column"] for plot in plots for curve in plot["series"]}

    def quantities(self, made: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return t, q, v and λ of an outcome."""
        columns = made["columns"]
        nq, nc = len(self.model.coordinates), len(self.model.constraints)
        return {
            "time": columns[0],
            "q": columns[1 : 1 + nq].T,
            "v": columns[1 + nq : 1 + 2 * nq].T,
            "multipliers": columns[1 + 3 * nq : 1 + 3 * nq + nc].T,
        }
