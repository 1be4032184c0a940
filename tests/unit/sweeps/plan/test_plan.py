"""Plans of sweeps: what the texts of --vary and --sample stand for, row by row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import lagcli
from lagcli.errors import FileError, LagcliError, ModelError, UsageError
from lagcli.sweeps.plan.plan import make_plan

MODELS = Path(__file__).parents[4] / "models"
CRANK = lagcli.load(MODELS / "slider_crank.yaml")


def values(*vary: str, **options: object) -> np.ndarray:
    plan = make_plan(CRANK, vary, **options)  # type: ignore[arg-type]
    return plan.rows(np.arange(plan.length))


def test_steps_include_the_end_and_are_exact() -> None:
    assert values("m=1:2:0.1")[:, 0].tolist() == [
        *(1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 2.0)
    ]
    assert values("m=1:2:0.3")[:, 0].tolist() == [1.0, 1.3, 1.6, 1.9]
    assert values("m=2:1:-0.5")[:, 0].tolist() == [2.0, 1.5, 1.0]
    assert values("phi=0:pi:pi/4")[-1, 0] == np.pi
    assert len(values("m=1:2:1/3")) == 4


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("m=0.2, 0.3", [0.2, 0.3]),
        ("m=linspace(1, 2, 5)", [1, 1.25, 1.5, 1.75, 2]),
        ("m=linspace(3, 4, 1)", [3]),
        ("m=logspace(0.01, 1, 3)", [0.01, 0.1, 1]),
        ("l=20:40:10 cm", [0.2, 0.3, 0.4]),
        ("l=20,30 cm", [0.2, 0.3]),
        ("l=20 cm, 0.3 m", [0.2, 0.3]),
        ("l=linspace(20, 40, 3) cm", [0.2, 0.3, 0.4]),
        ("l=logspace(1, 100, 3) cm", [0.01, 0.1, 1]),
        ("phi=30,60 deg", [np.pi / 6, np.pi / 3]),
        ("phi'=8", [8]),
        ("phi_dot=8", [8]),
        ("m=2*3, sqrt(4), 1e-3", [6, 2, 0.001]),
    ],
)
def test_grids(text: str, expected: list[float]) -> None:
    assert values(text)[:, 0] == pytest.approx(expected, rel=1e-15)


def test_names_are_canonical() -> None:
    assert make_plan(CRANK, ["phi_dot=1", " m = 1"]).columns == ("phi'", "m")


def test_crossed_the_last_runs_fastest_and_zipped_together() -> None:
    assert values("m=1,2", "l=3,4,5")[:, :].tolist() == [
        *([1, 3], [1, 4], [1, 5], [2, 3], [2, 4], [2, 5])
    ]
    assert values("m=1,2", "l=3,4", zipped=True).tolist() == [[1, 3], [2, 4]]


def test_rows_are_functions_of_their_numbers() -> None:
    for sample in ("sobol:9000", "lhs:9000", "random:9000"):
        plan = make_plan(CRANK, ["m=1..2", "l=loguniform(1, 10)", "g=9,10"], sample, 5)
        whole = plan.rows(np.arange(plan.length))
        some = np.array([17_000, 3, 8192, 8191, 3])
        assert np.array_equal(plan.rows(some), whole[some])


@pytest.mark.parametrize("kind", ["sobol", "lhs", "random"])
def test_samples_follow_their_distributions(kind: str) -> None:
    plan = make_plan(
        CRANK, ["m=1..2", "l=loguniform(10, 1000) cm", "g=normal(9.8, 0.1)"], f"{kind}:2048", 1
    )
    m, l, g = plan.rows(np.arange(2048)).T
    # SciPy's own distributions and test: a wrong one has p far below
    assert stats.kstest(m, stats.uniform(1, 1).cdf).pvalue > 1e-3
    assert stats.kstest(l, stats.loguniform(0.1, 10).cdf).pvalue > 1e-3
    assert stats.kstest(g, stats.norm(9.8, 0.1).cdf).pvalue > 1e-3


def test_sobol_points_are_those_of_scipy() -> None:
    found = values("m=0..1", "l=0..1", sample="sobol:512", seed=7)
    assert np.array_equal(found, stats.qmc.Sobol(2, seed=7).random(512))


def test_seeds_differ_and_repeat() -> None:
    def first(seed: int) -> list[float]:
        return values("m=1..2", sample="random:8", seed=seed)[:, 0].tolist()

    assert first(1) == first(1)
    assert first(1) != first(2)


def test_a_table_brings_names_and_units(tmp_path: Path) -> None:
    file = tmp_path / "values.csv"
    file.write_text("m,l [cm],phi_dot\n1,20,8\n\n2,30,9\n")
    plan = make_plan(CRANK, [f"@{file}", "g=9,10"])
    assert plan.columns == ("m", "l", "phi'", "g")
    assert plan.rows(np.arange(4)).tolist() == [
        *([1, 0.2, 8, 9], [1, 0.2, 8, 10], [2, 0.3, 9, 9], [2, 0.3, 9, 10])
    ]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("m,zz\n1,2\n", "`zz`"),
        ("m\n", "no values"),
        ("", "is empty"),
        ("m,l\n1\n", ":2: 1 value under 2 names"),
        ("m\n1\nx\n", ":3: `m`: 'x' is not a finite number"),
        ("m\ninf\n", "not a finite number"),
        ("m,m\n1,2\n", "two columns"),
        ("l [foo]\n1\n", "foo"),
    ],
)
def test_bad_tables(tmp_path: Path, content: str, said: str) -> None:
    file = tmp_path / "values.csv"
    file.write_text(content)
    with pytest.raises((FileError, UsageError)) as error:
        make_plan(CRANK, [f"@{file}"])
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        ("m", "NAME=VALUES"),
        ("mm=1", "did you mean `m`"),
        ("m=1:2", "1:2:0.1"),
        ("m=1:2:-1", "do not lead from 1 to 2"),
        ("m=1:2:0", "do not lead"),
        ("m=1:2:1e-12", "more than 10^9"),
        ("m=1,,2", "missing"),
        ("m=1:x:2", "`x`"),
        ("m=logspace(0, 1, 3)", "greater than 0"),
        ("m=linspace(1, 2)", "linspace(first, last, count)"),
        ("m=linspace(1, 2, 2.5)", "whole number"),
        ("m=1..2", "--sample"),
        ("l=1, 2 cm, 3", "unit"),
        ("l=1 parsnip", "parsnip"),
        ("m=1e999", "beyond"),
        ("m=1e-999999999", "beyond"),
        ("m=@x.csv", "--vary @x.csv"),
        ("m=[1, 2]", "`[`"),
        ("m=9^9^9^9", "power"),
    ],
)
def test_what_is_wrong_is_reported(vary: str, said: str) -> None:
    with pytest.raises(LagcliError) as error:
        make_plan(CRANK, [vary])
    assert "--vary" in str(error.value)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("vary", "options", "said"),
    [
        (["m=1..2"], {"sample": "sobol"}, "sobol:N"),
        (["m=1..2"], {"sample": "halton:10"}, "sobol:N"),
        (["m=1..2"], {"sample": "lhs:0"}, "sobol:N"),
        (["m=1..2"], {"sample": "sobol:٤"}, "sobol:N"),
        (["m=1..2"], {"sample": "random:" + "9" * 5000}, "sobol:N"),
        (["m=1,2"], {"sample": "lhs:5"}, "nothing to draw from"),
        (["m=2..1"], {"sample": "lhs:5"}, "empty"),
        (["m=normal(1, 0)"], {"sample": "lhs:5"}, "greater than 0"),
        (["m=1..2"], {"sample": "lhs:99999999"}, "sobol:99999999"),
        (["m=1..2"], {"sample": "random:5", "seed": -1}, "negative"),
        (["m=1,2", "m=3"], {}, "twice"),
        (["m=1,2", "l=1,2,3"], {"zipped": True}, "m has 2, l has 3"),
        (["m=1,2"], {"taken": {"m": "3"}}, "both varied and set"),
        ([], {}, "nothing is varied"),
    ],
)
def test_options_that_do_not_fit(vary: list[str], options: dict, said: str) -> None:
    with pytest.raises((UsageError, ModelError)) as error:
        make_plan(CRANK, vary, **options)
    assert said in str(error.value)


def test_a_parameter_in_another_unit_needs_its_unit(tmp_path: Path) -> None:
    text = (MODELS / "slider_crank.yaml").read_text().replace("value: 0.3 m,", "value: 30 cm,")
    model = lagcli.load_text(text)
    assert make_plan(model, ["l=20,30 cm"]).rows(np.arange(2))[:, 0].tolist() == [0.2, 0.3]
    with pytest.raises(UsageError, match="given in cm"):
        make_plan(model, ["l=20,30"])
