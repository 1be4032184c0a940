"""Whatever stands behind --vary, --sample and --measure: a plan, a measure, or an error of ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lagcli
from lagcli.errors import LagcliError
from lagcli.model.measures import read_measures
from lagcli.simulations.variants import Variants
from lagcli.sweeps.columns import measure_columns, named_measure
from lagcli.sweeps.plan.plan import make_plan
from tests.support.rows_alone import check_equal_alone

SWITCHING = sorted((Path(__file__).parents[2] / "models" / "contact").glob("*.yaml"))
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


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("path", SWITCHING, ids=lambda path: path.stem)
def test_rows_that_switch_are_single_runs(path: Path, seed: int) -> None:
    model, rng = lagcli.load(path), np.random.default_rng(seed)
    variants = Variants(model)
    names = [k for k, x in model.parameters.items() if x.value and variants.together([k])]
    columns = rng.permutation(names)[:3].tolist()
    own = np.array([model.parameters[name].value for name in columns])
    table = own * (1 + 0.1 * rng.uniform(-1, 1, (6, len(columns))))
    check_equal_alone(model, columns, table, t_end=min(2.0, model.settings.t_end or 2.0))
