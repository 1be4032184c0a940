"""Comparison of formulations: against closed forms, and against each other."""

import math
from pathlib import Path

import numpy as np
import pytest
from random_cases import some
from scipy.special import ellipj, ellipk

import lagcli
from lagcli.errors import UsageError
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides

MODELS = Path(__file__).parents[4] / "models"
FOUND = Path(__file__).parents[3] / "found"
PENDULUM = """
coordinates: [x, y]
parameters: {g: 9.81, l: 0.7, m: 1.3}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: l*sin(2), y: -l*cos(2), x': 0, y': 0}
simulation: {t_end: 2, samples: 21}
"""


def load(name: str) -> Model:
    return lagcli.load(str(MODELS / f"{name}.yaml"))


@pytest.mark.parametrize("formulation", ["index1", "baumgarte", "ggl", "maggi", "second"])
def test_a_pendulum_agrees_with_elliptic_functions(formulation: str) -> None:
    model = lagcli.load_text(PENDULUM)
    (run,) = lagcli.compare(model, formulations=[formulation]).runs
    assert run.status == "completed"
    samples = run.samples
    assert samples is not None
    # sin(theta/2) = k sn(K - w t): it starts at rest, at 2 rad from below
    k, w = math.sin(1.0), math.sqrt(9.81 / 0.7)
    sn, _, _, _ = ellipj(ellipk(k * k) - w * samples.time, k * k)
    theta = 2 * np.arcsin(k * sn)
    np.testing.assert_allclose(samples.q[:, 0], 0.7 * np.sin(theta), atol=2e-6)
    # lambda (2x, 2y) is the rod's force, m (g cos theta + l theta'^2) towards the pivot
    square = 2 * w * w * (np.cos(theta) - math.cos(2.0))
    force = 1.3 * (9.81 * np.cos(theta) + 0.7 * square)
    np.testing.assert_allclose(-2 * 0.7 * samples.multipliers[:, 0], force, atol=2e-5)


@pytest.mark.parametrize("formulation", ["ggl", "maggi", "second"])
@pytest.mark.parametrize(
    ("start", "rtol"),
    [
        ("phi: 0.2, phi': 5", 1e-6),
        ("phi: -2.5, phi': -17", 1e-9),
        pytest.param("phi: 0.2, phi': 5", 1e-9, marks=pytest.mark.slow),
        pytest.param("phi: 1, phi': 9", 1e-6, marks=pytest.mark.slow),
        pytest.param("phi: -2.5, phi': -17", 1e-6, marks=pytest.mark.slow),
        pytest.param("phi: 1, phi': 9", 1e-9, marks=pytest.mark.slow),
    ],
)
def test_a_coordinate_without_mass(start: str, formulation: str, rtol: float) -> None:
    """The slot's coordinate s has no mass: M is singular, and the constraints determine it."""
    text = (FOUND / "ggl_slot.yaml").read_text()
    phi, speed = start.split(", ")
    text = text.replace("phi: 0.2", phi).replace("phi': 5", speed)
    settings = SettingsOverrides(rtol=rtol, samples=101)
    (run,) = lagcli.compare(lagcli.load_text(text), settings, [formulation]).runs
    assert run.status == "completed"
    assert run.samples is not None
    phi, theta, s = run.samples.q.T
    r, d, inertia, other = 0.1, 0.25, 0.02, 0.1
    near = {"rtol": 0, "atol": 1e3 * rtol}
    np.testing.assert_allclose(s, np.sqrt(r**2 + d**2 + 2 * r * d * np.sin(phi)), **near)
    exact = np.arctan2(r * np.cos(phi), d + r * np.sin(phi))
    np.testing.assert_allclose(np.exp(1j * theta), np.exp(1j * exact), **near)
    # theta' = -r (r + d sin phi)/s^2 phi', and the energy determines phi'
    ratio = -r * (r + d * np.sin(phi)) / s**2
    energy = (inertia + other * ratio**2) * run.samples.v[:, 0] ** 2
    np.testing.assert_allclose(energy, energy[0], rtol=1e4 * rtol)
    assert max(run.difference_q, run.drift_velocity) < 1e3 * rtol
    assert run.steps < 1000


def test_what_each_formulation_holds() -> None:
    names = ["projection", "index1", "ggl", "maggi", "second"]
    settings = SettingsOverrides(t_end=2.0)
    found = lagcli.compare(load("pendulum_cartesian"), settings, names).runs
    runs = dict(zip(names, found, strict=True))
    assert runs["projection"].drift_position < 1e-13 > runs["projection"].drift_velocity
    assert runs["second"].drift_position < 1e-13 > runs["second"].drift_velocity
    assert runs["maggi"].drift_velocity < 1e-13
    # without anything, the positions drift most
    assert runs["index1"].drift_position > 10 * runs["ggl"].drift_position > 0


@pytest.mark.parametrize(
    "name",
    some(["slider_crank", "rolling_disk", "parallelogram", "heavy_top", "andrews_squeezer"], 3),
)
def test_all_formulations_have_one_motion(name: str) -> None:
    model = load(name)
    end = {"andrews_squeezer": 0.02, "heavy_top": 0.1}.get(name, 0.5)
    settings = SettingsOverrides(t_end=end, samples=11)
    found = lagcli.compare(model, settings, ["index1", "ggl", "maggi", "second"])
    nonholonomic = name == "rolling_disk"
    for run in found.runs:
        if nonholonomic and run.row.formulation == "second":
            assert run.status == "not available"
            assert "nonholonomic" in run.message
            continue
        assert run.status == "completed", run.message
        assert run.difference_q < 1e-6
        if found.unique:
            assert run.difference_lambda < 1e-6
    assert found.unique == (name != "parallelogram")


def test_default_rows_have_every_formulation_and_method_once() -> None:
    settings = SettingsOverrides(t_end=0.1, samples=3)
    rows = [run.row for run in lagcli.compare(load("atwood"), settings).runs]
    assert len(rows) == len(set(rows))
    formulations = {"projection", "baumgarte", "index1", "ggl", "maggi", "second"}
    assert {row.formulation for row in rows} == formulations
    assert {"DOP853", "Taylor", "Rodas5P", "Radau"} <= {row.method for row in rows}


def test_wrong_names_are_rejected_with_the_nearest() -> None:
    model = load("atwood")
    with pytest.raises(UsageError, match="did you mean `maggi`"):
        lagcli.compare(model, formulations=["magi"])
    with pytest.raises(UsageError, match="did you mean `Radau`"):
        lagcli.compare(model, methods=["Radauu"])
    with pytest.raises(UsageError, match="DOP853 has all"):
        lagcli.compare(model, formulations=["second"], methods=["Taylor"])


@pytest.mark.parametrize("name", ["block_on_incline", "bouncing_ball"])
def test_multipliers_of_contacts_are_compared(name: str) -> None:
    model = lagcli.load(MODELS / "contact" / f"{name}.yaml")
    found = lagcli.compare(
        model, SettingsOverrides(t_end=0.3, samples=31), ["projection", "ggl"], ["DOP853"], [1e-9]
    )
    assert found.unique
    run, reduced = found.runs
    # λ of a block that slides and of a ball in the air is constant
    assert run.difference_lambda < 1e-9
    assert (reduced.status, reduced.message) == ("not available", "not for contacts and events")
