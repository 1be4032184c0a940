"""Fits to data made with noise: what is recovered, what cannot be, and how sure it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.analysis.fit.result import FitResult
from lagcli.errors import ModelError, NumericalError, UsageError
from lagcli.model.model import Model

MODELS = Path(__file__).parents[2] / "models"

OSCILLATOR = """
coordinates: [x, y]
parameters: {m: 1, k: 10, c: 0.2}
T: m*(x'^2 + y'^2)/2
V: k*x^2/2
Q: {x: -c*x'}
constraints: {wire: y = 0.5*x}
initial: {x: 1, y: {guess: 0.5}, x': 0, y': {guess: 0}}
"""
TRUTH = {"m": 1.3, "k": 12.0, "c": 0.3}


def measured(
    folder: Path, name: str = "run.csv", seed: int = 0, noise: float = 1e-3, **options: object
) -> Model:
    """Write data of the oscillator with noise, and return it; λ has a hundred times the noise."""
    truth = lagcli.load_text(OSCILLATOR, set={**TRUTH, **options})
    run = lagcli.simulate(truth, t_end=4, samples=81)
    rng = np.random.default_rng(seed)
    x = run.q[:, 0] + noise * rng.normal(size=81)
    force = run.multipliers[:, 0] + 100 * noise * rng.normal(size=81)
    lines = [
        f"{t!r},{a!r},{b!r}"
        for t, a, b in zip(*map(np.ndarray.tolist, (run.time, x, force)), strict=True)
    ]
    (folder / name).write_text("t,x,load\n" + "\n".join(lines) + "\n")
    return truth


def model(folder: Path, block: str, text: str = OSCILLATOR, **options: object) -> Model:
    return lagcli.load_text(text + "fit:\n" + block, str(folder / "model.yaml"), **options)


BOTH = """
  data: {file: run.csv}
  observe: {x: {sigma: 1e-3}, lambda.wire: {column: load, sigma: 0.1}}
  parameters: {m: {min: 0.1}, k: {min: 0}, c: {}, x: {}}
"""
ALONE = """
  data: {file: run.csv}
  observe: {x: {sigma: 1e-3}}
  parameters: {m: {min: 0.1}, k: {min: 0}, c: {min: 0}}
"""


def standard_scores(found: FitResult) -> np.ndarray:
    truth = np.array([{**TRUTH, "x": 1.0}[name] for name in found.names])
    return np.asarray((found.values - truth) / found.standard_errors)


def test_parameters_are_recovered_within_their_errors(tmp_path: Path) -> None:
    measured(tmp_path)
    found = lagcli.fit(model(tmp_path, BOTH))
    assert found.converged
    assert not found.warnings
    assert np.abs(standard_scores(found)).max() < 3.5
    # chi-square of 158 degrees of freedom: 158 ± 3.5 √316
    assert abs(found.chi_square - 158) < 62
    assert found.freedom == 158
    assert found.parameters["k"] == found.values[1]


def test_exact_data_give_back_the_exact_values(tmp_path: Path) -> None:
    measured(tmp_path, noise=0.0)
    found = lagcli.fit(model(tmp_path, BOTH), rtol=1e-11)
    np.testing.assert_allclose(found.values, [1.3, 12.0, 0.3, 1.0], rtol=1e-7)


@pytest.mark.parametrize("start", [0.0, 0.2])
def test_damping_that_is_found_to_be_zero_has_an_error(tmp_path: Path, start: float) -> None:
    """Errors depend continuously on the values: they are those next to c = 0."""
    errors = []
    for c in (0.0, 1e-4):
        measured(tmp_path, noise=0.0, c=c)
        found = lagcli.fit(model(tmp_path, BOTH, set={"c": start}), rtol=1e-11)
        assert found.values[2] == pytest.approx(c, abs=1e-9)
        errors.append(found.standard_errors)
    np.testing.assert_allclose(errors[0], errors[1], rtol=1e-3)


def test_the_jacobian_is_that_of_the_residuals(tmp_path: Path) -> None:
    from lagcli.analysis.fit.experiment import experiments_of, read_measured
    from lagcli.settings.settings import SettingsOverrides, resolve

    measured(tmp_path)
    fitted = model(tmp_path, BOTH)
    assert fitted.fit is not None
    data = read_measured(fitted.fit.data[0], tmp_path, fitted, fitted.fit.observed)
    settings = resolve(SettingsOverrides(rtol=1e-12), fitted.settings)
    (experiment,) = experiments_of([fitted], [settings], [data], ("m", "k", "c", "x"))
    values = np.array([1.1, 11.0, 0.25, 0.9])
    jacobian = experiment(values.tolist()).jacobian
    for i in range(4):
        h = 1e-4 * values[i] * np.eye(4)[i]
        far, near = (
            (
                experiment((values + k * h).tolist()).residuals
                - experiment((values - k * h).tolist()).residuals
            )
            / (2 * k * h[i])
            for k in (2, 1)
        )
        scale = np.abs(jacobian[:, i]).max()
        np.testing.assert_allclose(jacobian[:, i], (4 * near - far) / 3, atol=1e-7 * scale)


def test_a_pair_that_the_motion_does_not_identify_is_named(tmp_path: Path) -> None:
    """Of x alone, only k/m and c/m are determined: all three may grow together."""
    measured(tmp_path)
    found = lagcli.fit(model(tmp_path, ALONE))
    (combination,) = found.combinations
    assert combination.names == ("m", "k", "c")
    np.testing.assert_allclose(combination.changes, 1.0, rtol=1e-3)
    assert np.isnan(found.standard_errors).all()
    assert "do not identify m, k, c" in found.warnings[0]
    np.testing.assert_allclose(found.values[1] / found.values[0], 12 / 1.3, rtol=1e-3)


def test_several_experiments_with_values_of_their_own(tmp_path: Path) -> None:
    measured(tmp_path, "light.csv", seed=1)
    measured(tmp_path, "soft.csv", seed=2, k=6.0)
    block = """
  data:
    - {file: light.csv, set: {k: 12}}
    - {file: soft.csv, set: {k: 6}}
  observe: {x: {sigma: 1e-3}}
  parameters: {m: {min: 0.1}, c: {}}
"""
    found = lagcli.fit(model(tmp_path, block))
    assert [x.path for x in found.data] == [str(tmp_path / n) for n in ("light.csv", "soft.csv")]
    assert found.count == 162
    assert np.abs(standard_scores(found)).max() < 3.5


def test_sigma_is_estimated_where_it_is_not_given(tmp_path: Path) -> None:
    measured(tmp_path)
    block = "  data: {file: run.csv}\n  observe: {x: x}\n  parameters: {k: {}, c: {}}\n"
    known = block.replace("x: x", "x: {sigma: 1e-3}")
    found = lagcli.fit(model(tmp_path, block, set={"m": 1.3}))
    again = lagcli.fit(model(tmp_path, known, set={"m": 1.3}))
    assert found.sigma_estimated
    sigma = found.data[0].sigmas[0]
    assert sigma == pytest.approx(1e-3, rel=0.3)
    np.testing.assert_allclose(found.values, again.values, rtol=1e-7)
    np.testing.assert_allclose(
        found.standard_errors / sigma, again.standard_errors / 1e-3, rtol=1e-4
    )
    assert found.chi_square == pytest.approx(found.freedom)


def test_a_bound_that_is_active_is_reported(tmp_path: Path) -> None:
    measured(tmp_path)
    block = BOTH.replace("c: {}", "c: {max: 0.25}")
    found = lagcli.fit(model(tmp_path, block))
    assert found.active == ("", "", "max", "")
    assert found.values[2] == 0.25
    assert np.isnan(found.standard_errors[2])
    assert np.isfinite(found.standard_errors[:2]).all()
    assert any("c lies on its bound `max` 0.25" in x for x in found.warnings)


def test_a_value_on_its_bound_is_the_bound(tmp_path: Path) -> None:
    # the search only approaches the bound: "on its bound `min` 3.9e-39"
    measured(tmp_path, c=-0.05)
    block = BOTH.replace("c: {}", "c: {min: 0}")
    for start in (0.2, 1e-9):
        found = lagcli.fit(model(tmp_path, block, set={"c": start}))
        assert found.active[2] == "min"
        assert found.values[2] == found.parameters["c"] == 0.0
        assert any("c lies on its bound `min` 0;" in x for x in found.warnings)


def test_a_small_value_that_the_data_tell_from_its_bound_is_not_the_bound(tmp_path: Path) -> None:
    # x = a t²/2 with a = 5e-7, far below the 1 where the search begins
    times = np.linspace(0.5, 3.0, 6)
    rows = "".join(f"{t},{float(5e-7 * t**2 / 2)!r}\n" for t in times)
    (tmp_path / "run.csv").write_text("t,x\n" + rows)
    (tmp_path / "model.yaml").write_text(
        "coordinates: [x]\nparameters: {a: 1}\nT: x'^2/2\nQ: {x: a}\ninitial: {x: 0, x': 0}\n"
        "fit:\n  data: {file: run.csv}\n  observe: {x: {sigma: 1e-10}}\n"
        "  parameters: {a: {min: 0}}\n"
    )
    found = lagcli.fit(lagcli.load(tmp_path / "model.yaml"))
    assert found.active == ("",)
    assert found.values[0] == pytest.approx(5e-7, rel=1e-3)
    assert found.chi_square < 10


def test_profile_intervals_are_walds_where_the_model_is_almost_linear(tmp_path: Path) -> None:
    measured(tmp_path)
    wald = lagcli.fit(model(tmp_path, BOTH))
    profile = lagcli.fit(model(tmp_path, BOTH), ci="profile")
    width = wald.high - wald.low
    assert np.abs(profile.low - wald.low).max() < 1.0
    np.testing.assert_allclose((profile.low - wald.low) / width, 0.0, atol=0.05)
    np.testing.assert_allclose((profile.high - wald.high) / width, 0.0, atol=0.05)


def test_searches_from_many_starts_find_the_same_minimum(tmp_path: Path) -> None:
    measured(tmp_path)
    block = BOTH.replace("m: {min: 0.1}", "m: {min: 0.5, max: 3}")
    found = lagcli.fit(model(tmp_path, block), starts=4)
    assert found.starts.shape == found.ends.shape == (4, 4)
    assert found.agreeing_starts >= 1
    assert np.abs(standard_scores(found)).max() < 3.5


BOUNDED = """
coordinates: [x]
parameters: {a: 0.8}
T: x'^2/2
V: 5*x^2 + 0*sqrt(1 - a)
initial: {x: a, x': 0}
"""


BALL = """
coordinates: [y]
parameters: {g: 9.81, e: 0.6, h: 1}
T: y'^2/2
V: g*y
constraints: {floor: {expr: y >= 0, restitution: e}}
initial: {y: h, y': 0}
fit:
  data: {file: run.csv}
  observe: {y: {sigma: 5e-3}}
  parameters: {e: {min: 0.1, max: 0.99}, h: {min: 0.2}}
"""


def test_the_restitution_of_a_ball_from_noisy_heights(tmp_path: Path) -> None:
    run = lagcli.simulate(
        lagcli.load_text(BALL, set={"e": "0.72", "h": "1.1"}), t_end=1.5, samples=61
    )
    assert run.events is not None
    assert run.events.counts() == {"floor": {"impact": 2}}
    y = run.q[:, 0] + 5e-3 * np.random.default_rng(3).normal(size=61)
    lines = (f"{a!r},{b!r}" for a, b in zip(run.time.tolist(), y.tolist(), strict=True))
    (tmp_path / "run.csv").write_text("t,y\n" + "\n".join(lines))
    found = lagcli.fit(lagcli.load_text(BALL, str(tmp_path / "model.yaml")))
    assert found.converged
    scores = (found.values - [0.72, 1.1]) / found.standard_errors
    assert np.abs(scores).max() < 3.5
    assert found.standard_errors.max() < 3e-3
    # 59 ± 3.5 √118
    assert abs(found.chi_square - 59) < 38


def test_what_an_event_sets_is_not_observed(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("t,e\n0,1\n1,2\n2,3\n")
    text = BALL.replace("y: {sigma: 5e-3}", "e*y: {column: e, sigma: 5e-3}").replace(
        "initial:", "events: {later: {when: t >= 0.5, set: {e: 0.3}}}\ninitial:"
    )
    with pytest.raises(UsageError, match="depends on `e`, which an event sets"):
        lagcli.fit(lagcli.load_text(text, str(tmp_path / "model.yaml")))


def test_a_failed_run_is_never_a_fit(tmp_path: Path) -> None:
    """Beyond a = 1 nothing runs; the data ask for 1.2. A residual of 0 there would win."""
    times = np.linspace(0, 1, 21)
    x = 1.2 * np.cos(np.sqrt(10) * times)
    lines = [f"{t},{y}" for t, y in zip(times, x, strict=True)]
    (tmp_path / "run.csv").write_text("t,x\n" + "\n".join(lines) + "\n")
    text = BOUNDED.replace("0*sqrt(1 - a)", "1e-9*sqrt(1 - a)*x")
    block = "  data: {file: run.csv}\n  observe: {x: {sigma: 0.01}}\n  parameters: {a: {}}\n"
    found = lagcli.fit(model(tmp_path, block, text))
    assert found.failures
    assert found.values[0] <= 1.0
    assert found.chi_square > 100
    assert any("does not fit" in x for x in found.warnings)


def test_where_no_run_succeeds_there_is_no_fit(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("t,x\n0,1\n1,1\n")
    text = BOUNDED.replace("0*sqrt(1 - a)", "sqrt(1 - a)*x").replace("a: 0.8", "a: 1.5")
    block = "  data: {file: run.csv}\n  observe: {x: {sigma: 0.01}}\n  parameters: {a: {}}\n"
    with pytest.raises(NumericalError, match="every search failed at its first run"):
        lagcli.fit(model(tmp_path, block, text))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"starts": 0}, "starts must be at least 1"),
        ({"ci": "bayes"}, "no 'bayes' intervals"),
        ({"level": 1.0}, "level must lie between 0 and 1"),
        ({"method": "Rodas5P"}, "second derivatives"),
    ],
)
def test_wrong_arguments(tmp_path: Path, options: dict[str, object], said: str) -> None:
    measured(tmp_path)
    with pytest.raises(UsageError, match=said):
        lagcli.fit(model(tmp_path, BOTH), **options)


def test_what_is_missing_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="has no `fit` block"):
        lagcli.fit(lagcli.load_text(OSCILLATOR))
    measured(tmp_path)
    with pytest.raises(ModelError, match="lies outside"):
        lagcli.fit(model(tmp_path, BOTH.replace("min: 0.1", "min: 2")))
    with pytest.raises(UsageError, match="before the run"):
        lagcli.fit(model(tmp_path, BOTH), t_start=0.5)


@pytest.mark.slow
def test_intervals_cover_the_truth_in_95_of_100_fits(tmp_path: Path) -> None:
    """Of 200 fits; outside 90 to 99 %, the binomial chance is below 1 in 300 for each quantity."""
    covered = np.zeros(4)
    truth = np.array([1.3, 12.0, 0.3, 1.0])
    for seed in range(200):
        measured(tmp_path, seed=seed)
        found = lagcli.fit(model(tmp_path, BOTH))
        covered += (found.low <= truth) & (truth <= found.high)
    assert (covered >= 180).all(), covered
    assert (covered <= 198).all(), covered


def test_a_mistake_in_the_values_of_an_experiment_names_its_line(tmp_path: Path) -> None:
    measured(tmp_path)
    block = BOTH.replace("{file: run.csv}", "{file: run.csv, set: {nothing: 3}}")
    with pytest.raises(ModelError, match=r"no parameter `nothing`(.|\n)*model\.yaml:\d+\)"):
        lagcli.fit(model(tmp_path, block))
