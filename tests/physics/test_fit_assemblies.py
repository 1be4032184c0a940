"""Fits of mechanisms that can be assembled in several ways."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.analysis.fit.experiment import FailedRun
from lagcli.analysis.fit.file import read_fit, write_fit, write_model
from lagcli.analysis.fit.fit import prepared
from lagcli.analysis.fit.result import format_fit

FOUND = Path(__file__).parents[1] / "found"

FOUR_BAR = """
coordinates: {al: rad, be: rad}
parameters: {r: 60 mm, a: 150 mm, b: 140 mm, d: 180 mm, u: 70 mm, w: 40 mm, n: 60 rpm, m: 1 kg}
definitions:
  A: [r*cos(n*t), r*sin(n*t)]
  P: A + [u*cos(al) - w*sin(al), u*sin(al) + w*cos(al)]
T: m/2*dot(P', P') + m/2*b^2*be'^2
constraints: {rod: "A + a*[cos(al), sin(al)] = [d + b*cos(be), b*sin(be)]"}
initial: {al: {guess: 0.9}, be: {guess: 1.9}, al': {guess: 0}, be': {guess: 0}}  # open
outputs: {x: P.x, y: P.y}
fit:
  data: {file: run.csv}
  observe: {x: {sigma: 1e-4}, y: {sigma: 1e-4}}
  parameters:
    a: {min: 120 mm, max: 200 mm}
    u: {min: 20 mm, max: 100 mm}
    w: {min: 10 mm, max: 100 mm}
"""
TIMES = np.linspace(0, 1, 13)


def coupler_point(branch: int, a: float, u: float, w: float) -> np.ndarray:
    """Return x, y of P by the intersection of two circles; 1: the coupler is above the line."""
    x, y = 0.06 * np.cos(2 * np.pi * TIMES), 0.06 * np.sin(2 * np.pi * TIMES)
    g = np.hypot(0.18 - x, y)
    al = np.arctan2(-y, 0.18 - x) + branch * np.arccos((a * a + g * g - 0.14**2) / (2 * a * g))
    cos, sin = np.cos(al), np.sin(al)
    return np.column_stack([x + u * cos - w * sin, y + u * sin + w * cos])


def written(folder: Path, branch: int, name: str = "run.csv", seed: int = 1) -> np.ndarray:
    """Write measured points of an assembly."""
    points = coupler_point(branch, 0.16, 0.06, 0.03)
    points = points + 1e-4 * np.random.default_rng(seed).standard_normal(points.shape)
    pairs = zip(TIMES.tolist(), points.tolist(), strict=True)
    rows = "".join(f"{t!r},{x!r},{y!r}\n" for t, (x, y) in pairs)
    (folder / name).write_text("t,x [m],y [m]\n" + rows)
    return points


def load(folder: Path, text: str = FOUR_BAR, **options: Any) -> lagcli.Model:
    (folder / "model.yaml").write_text(text)
    return lagcli.load(folder / "model.yaml", **options)


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("starts", [1, 3])
def test_the_assembly_of_the_data_is_found(branch: int, starts: int, tmp_path: Path) -> None:
    measured = written(tmp_path, branch)
    found = lagcli.fit(load(tmp_path), starts=starts)
    values = dict(zip(found.names, found.values.tolist(), strict=True))
    closed = coupler_point(branch, **values)
    assert found.chi_square == pytest.approx((((closed - measured) / 1e-4) ** 2).sum(), rel=1e-4)
    assert found.chi_square < 50
    assert bool(found.guesses) == (branch == -1)  # the model's guesses are open
    if branch == -1:
        assert list(found.guesses) == ["al", "be"]
        assert "not that of the model's guesses: begin at al " in format_fit(found)
    again = lagcli.fit(load(tmp_path), starts=starts)
    np.testing.assert_array_equal(again.values, found.values)


@pytest.mark.parametrize("branch", [1, -1])
def test_the_written_model_reproduces_the_result(branch: int, tmp_path: Path) -> None:
    measured = written(tmp_path, branch)
    model = load(tmp_path)
    found = lagcli.fit(model, starts=2)
    write_model(model, found, tmp_path / "fitted.yaml", force=False)
    again = lagcli.load(tmp_path / "fitted.yaml")
    assert all(not again.initial[x].fixed for x in ("al", "be", "al'", "be'"))
    assert again.initial["al"].value == pytest.approx(found.guesses.get("al", 0.9), rel=1e-14)
    run = lagcli.simulate(again, times=tuple(TIMES.tolist()))
    points = np.column_stack([run.outputs["x"], run.outputs["y"]])
    square = (((points - measured) / 1e-4) ** 2).sum()
    assert square == pytest.approx(found.chi_square, rel=1e-6)
    refitted = lagcli.fit(again)
    assert refitted.costs[0] == pytest.approx(found.chi_square, rel=1e-6)
    assert refitted.guesses == {}
    write_fit(found, tmp_path / "fit.h5")
    assert read_fit(tmp_path / "fit.h5").guesses == pytest.approx(found.guesses)


def test_a_search_has_its_own_assembly(tmp_path: Path) -> None:
    """Its result is that of a search alone, whatever has run before."""
    written(tmp_path, -1)
    model = load(tmp_path)
    problem, _ = prepared(model)
    starts = problem.starts(np.array(problem.experiments[0].directions.values), 3)
    together = [problem.search(start) for start in starts]
    for start, found in zip(starts[::-1], together[::-1], strict=True):
        alone = prepared(model)[0].search(start)
        assert alone.converged == found.converged
        np.testing.assert_allclose(alone.cost, found.cost, rtol=1e-6)
        crossed = problem.others(start, alone.evaluation.assembly)[0]
        other = problem.search(start, near=crossed)
        assert other.cost < 0.01 * alone.cost
        assert problem.search(start).cost == pytest.approx(alone.cost, rel=1e-6)


def test_data_of_two_assemblies_need_guesses_of_their_own(tmp_path: Path) -> None:
    written(tmp_path, 1)
    written(tmp_path, -1, "crossed.csv", 2)
    crossed = "al: '{guess: -1.4}', be: '{guess: -2.2}'"
    data = f"[{{file: run.csv}}, {{file: crossed.csv, initial: {{{crossed}}}}}]"
    text = FOUR_BAR.replace("data: {file: run.csv}", f"data: {data}")
    found = lagcli.fit(load(tmp_path, text))
    assert found.chi_square < 90
    assert (found.guesses, found.apart) == ({}, ())
    text = text.replace(f", initial: {{{crossed}}}", "")
    named = lagcli.fit(load(tmp_path, text))
    assert named.chi_square == pytest.approx(found.chi_square, rel=1e-6)
    assert [Path(x).name for x in named.apart] == ["crossed.csv"]
    assert any("crossed.csv" in x and "initial" in x for x in named.warnings)


def test_more_starts_are_never_worse() -> None:
    """44.4 from one start in the assembly of the guesses; 4.69 in the other one."""
    model = lagcli.load(FOUND / "synth.yaml")
    found = lagcli.fit(model, starts=2)
    assert found.chi_square <= 4.6909
    assert found.costs[0] == pytest.approx(44.4431, rel=1e-4)


@pytest.mark.slow
def test_twenty_starts_find_the_four_bar_linkage() -> None:
    best = lagcli.fit(lagcli.load(FOUND / "s3.yaml")).chi_square
    assert best == pytest.approx(0.16938, rel=1e-4)
    found = lagcli.fit(lagcli.load(FOUND / "synth.yaml"), starts=20)
    assert found.chi_square == pytest.approx(best, rel=1e-4)


def test_a_run_with_derivatives_recognizes_a_singular_configuration(tmp_path: Path) -> None:
    """The crank of a linkage without full turns: it stops where the motion alone does."""
    model = load(tmp_path, FOUR_BAR, set={"d": "240 mm", "r": "100 mm"})
    plain = lagcli.simulate(model, t_end=1)
    found = lagcli.simulate(model, t_end=1, sensitivity=["a", "u"])
    assert plain.status == found.status == "failed"
    assert plain.message.startswith("singular configuration at t = ")
    assert found.message.startswith("singular configuration at t = ")
    assert "`rod.x`, `rod.y` become dependent" in found.message
    # A, 0.1 from 0, is a + b from (0.24, 0)
    x = (0.24**2 + 0.1**2 - 0.29**2) / (2 * 0.24 * 0.1)
    time = math.acos(x) / (2 * math.pi)
    for message in (plain.message, found.message):
        assert float(message.split("t = ")[1].split()[0]) == pytest.approx(time, rel=1e-5)


def test_a_run_with_derivatives_ends_where_rounding_errors_limit_its_steps() -> None:
    """Next to a dead point; two of these runs took as many steps as they may."""
    experiment = prepared(lagcli.load(FOUND / "dead_point.yaml"))[0].experiments[0]
    # an approach takes 60 to 120 steps
    experiment.settings = experiment.settings.replace(max_steps=1000)
    least = np.array([0.02033762826198046, 0.09654585847595835, -0.07620827178132243])
    random, ends = np.random.default_rng(1), list[str]()
    for _ in range(20):
        try:
            experiment((least * (1 + 1e-5 * random.standard_normal(3))).tolist())
        except FailedRun as failure:
            ends.append(str(failure))
    assert len(ends) > 5
    for message in ends:
        assert "singular configuration" in message
