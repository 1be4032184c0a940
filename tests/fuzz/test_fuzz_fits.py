"""Fits of random mechanisms from ten starts, beside SciPy with a closed-form closure."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from random_cases import FUZZ_COUNT
from scipy.optimize import least_squares

import lagcli
from lagcli.analysis.fit.file import write_model
from lagcli.analysis.fit.fit import prepared

#: Where the coupler ends: on a rocker, and on a slider whose line has the offset b.
END = {False: "[d + b*cos(end), b*sin(end)]", True: "[end, b]"}
MODEL = """\
coordinates: {{al: rad, end: {unit}}}
parameters: {{{parameters}}}
definitions:
  A: [r*cos(n*t), r*sin(n*t)]
  P: A + [u*cos(al) - w*sin(al), u*sin(al) + w*cos(al)]
T: m/2*dot(P', P') + I/2*end'^2
constraints: {{rod: "A + a*[cos(al), sin(al)] = {closed}"}}
initial: {{al: {{guess: {al}}}, end: {{guess: {end}}}, al': {{guess: 0}}, end': {{guess: 0}}}}
outputs: {{X: P.x, Y: P.y}}
fit:
  data: {{file: run.csv}}
  observe: {{X: {{sigma: 0.1 mm}}, Y: {{sigma: 0.1 mm}}}}
  parameters: {{{bounds}}}
"""
SIGMA = 1e-4
#: Smallest and largest crank, coupler, rocker or offset, and ground, of a size.
LENGTHS = {
    False: [(0.2, 0.7), (0.7, 2.0), (0.7, 2.0), (0.8, 2.0)],
    True: [(0.2, 0.7), (0.9, 2.5), (-0.5, 0.5), (1.0, 1.0)],
}


class Mechanism(NamedTuple):
    """A driven four-bar linkage or slider-crank, with a point on its coupler."""

    slider: bool
    values: Mapping[str, float]
    times: np.ndarray

    def motion(self, branch: int, values: Mapping[str, float]) -> np.ndarray:
        """Return (n, 4) angle of the coupler, end, x, y; NaN where the mechanism does not close."""
        p = {**self.values, **values}
        x, y = p["r"] * np.cos(p["n"] * self.times), p["r"] * np.sin(p["n"] * self.times)
        with np.errstate(invalid="ignore"):
            if self.slider:
                angle = np.arcsin((p["b"] - y) / p["a"])
                angle = angle if branch == 1 else np.pi - angle
                end = x + p["a"] * np.cos(angle)
            else:
                gap = np.hypot(p["d"] - x, y)
                half = np.arccos((p["a"] ** 2 + gap**2 - p["b"] ** 2) / (2 * p["a"] * gap))
                angle = np.arctan2(-y, p["d"] - x) + branch * half
                end = np.arctan2(y + p["a"] * np.sin(angle), x + p["a"] * np.cos(angle) - p["d"])
        cos, sin = np.cos(angle), np.sin(angle)
        point = [x + p["u"] * cos - p["w"] * sin, y + p["u"] * sin + p["w"] * cos]
        return np.column_stack([angle, end, *point])


def random_mechanism(rng: np.random.Generator) -> Mechanism:
    """Return a mechanism whose crank turns without meeting a singular configuration."""
    slider = bool(rng.random() < 0.4)
    size = 10 ** rng.uniform(-1.5, 0)
    while True:
        r, a, b, d = (rng.uniform(low, high) for low, high in LENGTHS[slider])
        closes = abs(b) + r < a if slider else abs(a - b) + 0.05 < d - r and d + r < a + b - 0.05
        if closes:
            break
    u, w = rng.uniform(-1, 1, 2)
    lengths = {"r": r, "a": a, "b": b, "d": d, "u": u, "w": w}
    speed = round(float(rng.choice([-1, 1]) * rng.uniform(2, 20)), 3)
    values = {name: round(float(size * x), 6) for name, x in lengths.items()} | {"n": speed}
    turns = rng.choice([0.6, 1.0, 1.5])
    times = np.linspace(0, turns * 2 * np.pi / abs(speed), int(rng.integers(8, 30)))
    return Mechanism(slider, values, times.round(6))


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(max(10, FUZZ_COUNT // 5)))
def test_ten_starts_find_what_scipy_finds(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    mechanism = random_mechanism(rng)
    fitted = ["u", "w", *(name for name in ("a", "b", "r") if rng.random() < 0.4)]
    branch, guessed = (int(x) for x in rng.choice([1, -1], 2))
    data = mechanism.motion(branch, {})[:, 2:]
    data = data + SIGMA * rng.standard_normal(data.shape)
    near = mechanism.motion(guessed, {})[0, :2]
    size = mechanism.values["a"]
    span = {name: 0.25 if name in "abr" else 1.0 for name in fitted}
    away = {x: size * span[x] * float(rng.uniform(-0.4, 0.4)) for x in fitted}
    first = {x: mechanism.values[x] + away[x] for x in fitted}
    low = np.array([mechanism.values[x] - size * span[x] for x in fitted])
    high = np.array([mechanism.values[x] + size * span[x] for x in fitted])
    parameters = {**mechanism.values, **first, "m": 1.0, "I": 1.0}
    units = {"n": "rad/s", "m": "kg", "I": "kg" if mechanism.slider else "kg*m^2"}
    rows = zip(mechanism.times.tolist(), data.tolist(), strict=True)
    (tmp_path / "run.csv").write_text(
        "t,X [m],Y [m]\n" + "".join(f"{t!r},{x!r},{y!r}\n" for t, (x, y) in rows)
    )
    (tmp_path / "model.yaml").write_text(
        MODEL.format(
            unit="m" if mechanism.slider else "rad",
            parameters=", ".join(f"{x}: {v!r} {units.get(x, 'm')}" for x, v in parameters.items()),
            closed=END[mechanism.slider],
            al=near[0] + rng.uniform(-0.2, 0.2),
            end=near[1] + (size if mechanism.slider else 1.0) * rng.uniform(-0.2, 0.2),
            bounds=", ".join(
                f"{x}: {{min: {a!r} m, max: {b!r} m}}"
                for x, a, b in zip(fitted, low.tolist(), high.tolist(), strict=True)
            ),
        )
    )
    model = lagcli.load(tmp_path / "model.yaml")

    def residuals(values: np.ndarray, side: int) -> np.ndarray:
        named = dict(zip(fitted, (values * size).tolist(), strict=True))
        return ((mechanism.motion(side, named)[:, 2:] - data) / SIGMA).ravel()

    problem, _ = prepared(model)
    costs = []
    for start in problem.starts(np.array([*first.values()]), 10):
        for side in (1, -1):
            if not np.isfinite(residuals(start / size, side)).all():
                continue
            # a difference of SciPy's may cross the edge beyond which the mechanism does not close
            with contextlib.suppress(ValueError):
                found = least_squares(
                    residuals,
                    np.clip(start / size, low / size, high / size),
                    bounds=(low / size, high / size),
                    args=(side,),
                    **dict.fromkeys(("ftol", "xtol", "gtol"), 1e-13),
                )
                costs.append(2 * found.cost)

    fit = lagcli.fit(model, starts=10)
    assert fit.chi_square <= min(costs) + 1e-5 * max(1, min(costs))
    closed = min(np.sum(residuals(fit.values / size, side) ** 2) for side in (1, -1))
    assert fit.chi_square == pytest.approx(closed, rel=1e-5, abs=1e-5)
    # the written model has the fit's motion in a run of its own
    write_model(model, fit, tmp_path / "fitted.yaml", True)
    run = lagcli.simulate(lagcli.load(tmp_path / "fitted.yaml"), times=mechanism.times.tolist())
    moved = np.column_stack([run.outputs["X"], run.outputs["Y"]])
    assert np.sum(((moved - data) / SIGMA) ** 2) == pytest.approx(closed, rel=1e-5, abs=1e-5)
