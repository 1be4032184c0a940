"""Panels of plots: which curves are drawn together."""

import numpy as np
import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.pictures.curves import Catalogue, Curve
from lagcli.pictures.plots import run_plot
from lagcli.pictures.plots.run_plot import Panel, asked, split_by_scale, usual
from lagcli.pictures.run_file import RunFile


def curves(*names, **more):
    return tuple(Curve(name, "q", (0,), "coordinates", "rad", name, **more) for name in names)


def split(panels, **largest):
    return [[c.name for c in panel.curves] for panel in split_by_scale(panels, largest)]


@pytest.mark.parametrize(
    ("largest", "expected"),
    [
        ({"a": 40, "b": 0.3, "c": 35}, [["a", "c"], ["b"]]),
        ({"a": 0.3, "b": 40, "c": 0.1}, [["a", "c"], ["b"]]),
        ({"a": 1, "b": 0.1, "c": 0.01}, [["a", "b"], ["c"]]),
        ({"a": 1, "b": 0, "c": 0.5}, [["a", "b", "c"]]),
        ({"a": 1e6, "b": 1, "c": 0.01}, [["a"], ["b"], ["c"]]),
        # 0 but for errors: drawn as 0
        ({"a": 0.3, "b": 40, "c": 1e-9}, [["a"], ["b", "c"]]),
        ({"a": 0, "b": 0, "c": 0}, [["a", "b", "c"]]),
    ],
)
def test_curves_of_other_scales_have_panels_of_their_own(largest, expected):
    assert split([Panel(curves("a", "b", "c"))], **largest) == expected


def test_what_the_user_joined_stays_together():
    sizes = {"a": 1, "b": 1e-9}
    both = curves("a", "b")
    kept = [Panel(both, joined=True), Panel(both, over=both), Panel(curves("a", "b", log=True))]
    assert split(kept, **sizes) == [["a", "b"]] * 3


def test_families_stay_together():
    names = [f"x{i}" for i in range(20)]
    assert split([Panel(curves(*names))], **{n: 10.0**-i for i, n in enumerate(names)}) == [names]


POINTS = """
coordinates: {x[1..N]: m, y[1..N]: m}
parameters: {N: 7, m: 1 kg, g: 9.81 m/s^2}
T: sum(m*(x[i]'^2 + y[i]'^2)/2, i = 1..N)
V: sum(m*g*y[i], i = 1..N)
initial:
  x[i = 1..N]: i*0.1
  y[i = 1..N]: 1 m
  x[i = 1..N]': 1 m/s
  y[i = 1..N]': 0 m/s
"""


def test_large_families_have_panels_and_colours_of_their_own():
    run = lagcli.simulate(lagcli.load_text(POINTS), t_end=0.1, samples=3)
    panels = asked(Catalogue(RunFile(run)), run.coordinates)
    assert [[c.name for c in panel.curves] for panel in panels] == [
        [f"{letter}[{i}]" for i in range(1, 8)] for letter in "xy"
    ]
    assert [panel.members for panel in panels] == [list(range(1, 8))] * 2
    (joined,) = asked(Catalogue(RunFile(run)), ["x,y"])
    assert len(joined.curves) == 14


BALL = """
coordinates: {y: m}
parameters: {m: 2 kg, g: 9.81 m/s^2, h: 1 m, e: 0.5}
T: m*y'^2/2
V: m*g*y
constraints: {floor: {expr: y >= 0, restitution: e}}
initial: {y: 1 m, y': 0 m/s}
"""


def test_impulses_are_those_of_the_closed_form(tmp_path):
    run = lagcli.simulate(lagcli.load_text(BALL), t_end=1.0, samples=11)
    (panel,) = [p for p in usual(Catalogue(RunFile(run)), impulses=True) if p.impulses]
    (curve,) = panel.curves
    assert (curve.name, curve.unit) == ("impulse.floor", "N*s")
    times, values = run.events.struck(0)
    speed, first = np.sqrt(2 * 9.81), np.sqrt(2 / 9.81)
    # each bounce has half the speed and takes half the time of the one before
    np.testing.assert_allclose(times, [first, first * 2], rtol=1e-9)
    np.testing.assert_allclose(values, 2 * 1.5 * speed * np.array([1, 0.5]), rtol=1e-8)
    assert run.events.named_at(times[0]) == "floor impact"
    assert not [p for p in usual(Catalogue(RunFile(run)), impulses=False) if p.impulses]
    pytest.importorskip("matplotlib")
    lagcli.plot(run, tmp_path / "a.svg", ["impulse.floor"])
    picture = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert "floor impact" in picture
    # a map: the state after each impact, where the run located it
    fall = run_plot.at_event(RunFile(run), Catalogue(RunFile(run)).named("y_dot"), "floor")
    np.testing.assert_allclose(fall, speed * np.array([0.5, 0.25]), rtol=1e-8)
    lagcli.plot(run, tmp_path / "map.svg", ["y:y_dot@floor"])
    with pytest.raises(UsageError, match=r"nothing of `wall`.*floor"):
        lagcli.plot(run, tmp_path / "b.svg", ["y:y_dot@wall"])
    with pytest.raises(UsageError, match=r"does not record `lambda\.floor`"):
        lagcli.plot(run, tmp_path / "b.svg", ["y:lambda.floor@floor"])
    with pytest.raises(UsageError, match="pairs are drawn"):
        lagcli.plot(run, tmp_path / "b.svg", ["y@floor"])
    for wrong in ("y,impulse.floor", "y:impulse.floor"):
        with pytest.raises(UsageError, match="panels of their own"):
            lagcli.plot(run, tmp_path / "b.svg", [wrong])
