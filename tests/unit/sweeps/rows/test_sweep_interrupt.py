"""An interrupt acts wherever the rows of a sweep are."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.engine.contract import Interrupted
from lagcli.settings.settings import SettingsOverrides
from lagcli.sweeps.plan.plan import Spec, make_plan
from lagcli.sweeps.rows.rows import run_rows

CRANK = str(Path(__file__).parents[4] / "models" / "slider_crank.yaml")


@pytest.mark.parametrize("method", ["auto", "Rodas5P"])
def test_endless_rows_end(method: str) -> None:
    model = lagcli.load(CRANK)
    settings = SettingsOverrides(t_end=1e7, method=method)
    plan = make_plan(model, ["m=1:2:0.1"])
    spec = Spec(model.text, CRANK, {}, {}, settings, plan, (("a", "max(phi)"),), "measures")
    began = time.process_time()

    def check_cancelled() -> None:
        if time.process_time() - began > 0.3:
            raise Interrupted

    with pytest.raises(Interrupted):
        run_rows(spec, np.arange(plan.length), check_cancelled)
    # several times in 0.1 s are promised
    assert time.process_time() - began < 5
