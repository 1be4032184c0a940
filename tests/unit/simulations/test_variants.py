"""Variants against models loaded and derived with the same values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.errors import ModelError, NumericalError
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare
from lagcli.simulations.variants import Variants

MODELS = Path(__file__).parents[3] / "models"
SETTINGS = SettingsOverrides(t_end=0.2, samples=5)


def final_state(simulation):
    blocks = []
    record = simulation.run(blocks.append)
    assert record.status == "completed"
    return np.concatenate([blocks[-1].q[-1], blocks[-1].v[-1], blocks[-1].multipliers[-1]])


@pytest.mark.parametrize(
    ("model", "values", "initial"),
    [
        ("slider_crank", {"m": "2 kg", "r": 0.12}, {"phi'": 9}),
        ("slider_crank", {}, {"phi": "20 deg"}),
        ("rolling_disk", {"m": 3, "theta_0": 0.3}, {}),
        ("pendulum_chain", {"N": 3}, {}),
    ],
)
def test_equals_the_model_loaded_with_the_values(model, values, initial):
    path = MODELS / f"{model}.yaml"
    variant = Variants(lagcli.load(path), SETTINGS).varied(values, initial)
    loaded = lagcli.load(path, set=values, set_initial=initial)
    assert variant.model.parameter_values == loaded.parameter_values
    np.testing.assert_array_equal(final_state(variant), final_state(prepare(loaded, SETTINGS)))


def test_derives_once():
    variants = Variants(lagcli.load(MODELS / "slider_crank.yaml"))
    first, second = variants.varied({"m": 2}), variants.varied({"m": 3})
    assert first.system is second.system
    assert first.start.state.p != second.start.state.p


def test_keeps_what_the_model_was_loaded_with():
    model = lagcli.load(MODELS / "slider_crank.yaml", set={"m": 5}, set_initial={"phi": 0.2})
    variant = Variants(model).varied({"r": 0.2}, {"phi'": 1})
    assert variant.model.parameters["m"].value == 5
    assert variant.model.initial_positions["phi"].value == 0.2


@pytest.mark.parametrize(
    ("model", "names"),
    [
        ("slider_crank", ["m", "phi'", "psi"]),
        ("rolling_disk", ["m", "r", "theta_0", "phi"]),
        ("heavy_top", ["g"]),
    ],
)
def test_many_values_at_once(model, names):
    variants = Variants(lagcli.load(MODELS / f"{model}.yaml"))
    assert variants.together(names)
    table = np.random.default_rng(1).uniform(0.2, 0.9, (5, len(names)))
    values = variants.values(names, table)
    for k, row in enumerate(table):
        given = dict(zip(names, row.tolist(), strict=True))
        loaded = lagcli.load(
            MODELS / f"{model}.yaml",
            set={n: x for n, x in given.items() if n in variants.model.parameters},
            set_initial={n: x for n, x in given.items() if n not in variants.model.parameters},
        )
        expected = list(loaded.parameter_values.values())
        np.testing.assert_allclose(values.parameters[k], expected, rtol=1e-14, atol=1e-15)
        for found, flags, table_ in (
            (values.q[k], values.fixed_q, loaded.initial_positions),
            (values.v[k], values.fixed_v, loaded.initial_velocities),
        ):
            expected = [x.value for x in table_.values()]
            np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)
            assert flags.tolist() == [x.fixed for x in table_.values()]


def test_untouched_values_are_the_models_to_the_last_bit():
    variants = Variants(lagcli.load(MODELS / "rolling_disk.yaml"))
    values = variants.values(["kick"], np.array([[0.1]]))
    expected = variants.model.parameter_values | {"kick": 0.1}
    assert values.parameters[0].tolist() == list(expected.values())


def test_what_changes_the_kind_of_run_is_not_taken_together(tmp_path):
    assert not Variants(lagcli.load(MODELS / "pendulum_chain.yaml")).together(["N"])
    path = tmp_path / "m.yaml"
    path.write_text(
        "coordinates: [x]\n"
        "parameters: {m: 1, k: 4, omega: sqrt(k/m), a: 1}\n"
        "T: m/2*x'^2\nV: k/2*x^2\ninitial: {x: a, x': 0}\n"
        "simulation: {t_end: 2*pi/omega}\n"
    )
    variants = Variants(lagcli.load(path))
    assert variants.together(["a"])
    assert not variants.together(["k"])
    assert variants.varied({"k": 1}).settings.t_end == pytest.approx(2 * np.pi)


def test_a_value_that_has_no_sense_is_not_finite(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text(
        "coordinates: [x]\nparameters: {m: 1, k: 1/m}\n"
        "T: x'^2/2\nV: k/2*x^2\ninitial: {x: 1, x': 0}\n"
    )
    variants = Variants(lagcli.load(path))
    values = variants.values(["m"], np.array([[0.0], [2.0]]))
    assert values.parameters[:, 1].tolist() == [np.inf, 0.5]
    with pytest.raises(ModelError):
        variants.varied({"m": 0})


def test_bad_values_raise_as_in_a_single_run():
    variants = Variants(lagcli.load(MODELS / "slider_crank.yaml"))
    with pytest.raises(ModelError, match="no parameter"):
        variants.varied({"mm": 1})
    with pytest.raises((ModelError, NumericalError)):
        variants.varied({"l": 0.01}, {"phi": 1.5})
