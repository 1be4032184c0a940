"""Whatever stands behind --vary, --sample and --measure: a plan, a measure, or an error of ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import lagcli
from lagcli.errors import LagcliError
from lagcli.model.measures import read_measures
from lagcli.sweeps.columns import measure_columns, named_measure
from lagcli.sweeps.plan.plan import make_plan

MODEL = lagcli.load(Path(__file__).parents[2] / "models" / "slider_crank.yaml")
PIECES = st.sampled_from(
    [
        *"0123456789.,:()[]=+-*/^' @#\"²é\n",
        *("..", "e9", "1e-400", "pi", "m", "l", "t", "phi", "phi'", "psi", "slider", "x_B'"),
        *("linspace(", "logspace(", "uniform(", "loguniform(", "normal(", " cm", " kg"),
        *("max(", "min(", "at(", "rms(", "time_of(", "final(", "mean(", "if(", ">", "and"),
        *("lambda.guide", "Qc.phi", "energy_balance", "residual_position", ".guide"),
        *("sum(", "i = 1..3"),
    ]
)
TEXTS = st.lists(PIECES, max_size=12).map("".join) | st.text(max_size=12)


@given(st.sampled_from(["m=", "l=", "phi'=", "", "@"]), TEXTS, st.none() | TEXTS)
@settings(max_examples=60, deadline=None)
def test_plans(name: str, text: str, sample: str | None) -> None:
    for drawn in {sample, None, "sobol:16"}:
        try:
            plan = make_plan(MODEL, [name + text], drawn)
        except LagcliError:
            continue
        rows = plan.rows(np.arange(min(plan.length, 9)))
        assert np.isfinite(rows).all()


@given(TEXTS)
@settings(max_examples=60, deadline=None)
def test_measures(text: str) -> None:
    try:
        named = named_measure(text)
        read_measures(MODEL, [named])
    except LagcliError:
        return
    measure_columns(MODEL, (named,))
