"""Plots over time in a real browser: their axes, legends, gaps, and other data."""

import json

import numpy as np
import pytest

from lagcli.pictures.page import asset, page
from lagcli.pictures.style import spread

TIME = [0.0, 1.0, 2.0, 3.0, 4.0]


@pytest.fixture
def plotted(visit, tmp_path):
    """Return a page with one plot, `plot`, and the TimeLink `time`."""

    def of(**data):
        start = f"""
const time = new TimeLink();
const figure = document.querySelector("figure");
const options = {{ link: time, palette: ["#0072B2", "#D55E00"] }};
const plot = new TimePlot(figure, {json.dumps(data)}, options);
"""
        text = page(
            "plot",
            "<figure></figure>",
            styles=[asset("vendor/uplot/uPlot.min.css"), asset("plots.css")],
            scripts=[
                asset(f) for f in ("vendor/uplot/uPlot.iife.min.js", "instants.js", "plots.js")
            ],
            start=start,
        )
        (tmp_path / "plot.html").write_text(text, encoding="utf-8")
        return visit(tmp_path / "plot.html")

    return of


def curve(name, values, **more):
    return {"name": name, "values": values, **more}


def legend(opened):
    return opened.locator(".plot-legend button").evaluate_all(
        "all => all.map(b => b.querySelector('.plot-value').textContent)"
    )


def test_values_at_a_time_are_those_of_the_drawn_curve(plotted):
    opened = plotted(
        time=TIME, series=[curve("x", [0, 1, 4, 9, 16]), curve("y", [5, 4, 3, 2, -1e-7])]
    )
    opened.evaluate("time.setTime(1.9)")
    assert legend(opened) == ["3.7", "3.1"]
    opened.evaluate("time.setTime(4)")
    assert legend(opened) == ["16", "−1·10⁻⁷"]


def test_gaps_are_not_drawn_and_have_no_value(plotted):
    opened = plotted(time=TIME, series=[curve("x", [1, None, None, 2, 3])])
    opened.evaluate("time.setTime(1)")
    assert legend(opened) == ["–"]
    # neither does the gap pull the axis to zero
    assert opened.evaluate("plot.chart.scales.y.min") > 0.5


def test_other_values_keep_the_zoom_and_other_curves_take_their_place(plotted, until):
    opened = plotted(time=TIME, series=[curve("x", [0, 1, 2, 3, 4], label="x_A")])
    opened.evaluate("time.setRange([1, 2]); time.setTime(2)")
    opened.evaluate(
        "plot.setData({time: [0, 1, 2, 3], series: [{name: 'x', values: [9, 8, 7, 6]}]})"
    )
    assert legend(opened) == ["7"]
    assert opened.evaluate("[plot.chart.scales.x.min, plot.chart.scales.x.max]") == [1, 2]
    assert opened.locator(".plot-label sub").text_content() == "A"
    opened.evaluate("time.setRange(null)")
    until(opened, "plot.chart.scales.x.min === 0 && plot.chart.scales.x.max === 3")
    opened.evaluate(
        "plot.setData({time: [0, 1], series: [{name: 'y', values: [1, 2]},"
        " {name: 'z', values: [3, 4]}]})"
    )
    opened.evaluate("time.setTime(1)")
    assert legend(opened) == ["2", "4"]


def test_magnitudes_on_a_logarithmic_axis(plotted):
    opened = plotted(time=TIME, log=True, series=[curve("r", [0, 1e-16, -1e-12, 1e-14, 3e-13])])
    low, high = opened.evaluate("[plot.chart.scales.y.min, plot.chart.scales.y.max]")
    assert 0 < low <= 1e-16
    assert high >= 1e-12
    opened.evaluate("time.setTime(0)")
    assert legend(opened) == ["0"]  # what is drawn at the foot is still said to be zero
    opened.evaluate("time.setTime(2)")
    assert legend(opened) == ["−1·10⁻¹²"]


def test_a_constant_is_not_blown_up_to_its_rounding(plotted):
    opened = plotted(time=TIME, series=[curve("c", [5, 5, 5 + 1e-15, 5, 5])])
    low, high = opened.evaluate("[plot.chart.scales.y.min, plot.chart.scales.y.max]")
    assert low < 4.9
    assert high > 5.1


TICKS = [
    ([0, 2.5, 5, 7.5], ["0.0", "2.5", "5.0", "7.5"]),
    ([-20000, 0, 20000], ["−20000", "0", "20000"]),
    ([0, 2.5e-9, 5e-9], ["0", "2.5·10⁻⁹", "5.0·10⁻⁹"]),
    ([1e6, 1.5e6], ["1.0·10⁶", "1.5·10⁶"]),
    ([0.30000000000000004, 0.4], ["0.3", "0.4"]),
    ([100.001, 100.002], ["100.001", "100.002"]),
]


def test_ticks_say_their_numbers(plotted):
    opened = plotted(time=TIME, series=[curve("x", [0, 1, 2, 3, 4])])
    for ticks, shown in TICKS:
        assert opened.evaluate(f"PlotNumbers.ticks({ticks})") == shown


@pytest.mark.parametrize("count", [0, 1])
def test_hardly_any_samples(plotted, count):
    opened = plotted(time=TIME[:count], series=[curve("x", [7.5][:count])])
    opened.evaluate("time.setTime(0)")
    assert legend(opened) == (["7.5"] if count else ["–"])


def test_names_are_no_html(plotted):
    opened = plotted(title="<i>t</i>", time=TIME, series=[curve("x", TIME, label="<b>x</b>_<i>")])
    assert opened.locator("figcaption").text_content() == "<i>t</i>"
    assert opened.locator(".plot-legend :is(b, i)").count() == 0


def test_curves_are_named_at_their_ends_where_there_is_room(plotted):
    series = [curve("x_a", [0, 1, 2, 3, 4]), curve("y", [4, 3, 2, 1, 0])]
    opened = plotted(time=TIME, series=series)
    names = "[...document.querySelectorAll('.plot-end')].map((e) => [e.innerHTML, e.offsetTop])"

    def named():
        opened.evaluate("new Promise((done) => setTimeout(done))")  # it is drawn in a microtask
        return opened.evaluate(names)

    (x, high), (y, low) = named()
    assert (x, y) == ("x<sub>a</sub>", "y")
    ends = opened.evaluate("[4, 0].map((v) => plot.chart.valToPos(v, 'y'))")
    assert [high, low] == pytest.approx([end + plot_top(opened) for end in ends], abs=1)
    edge = opened.locator(".plot-end").first.bounding_box()
    assert edge["x"] + edge["width"] <= opened.locator(".plot-drawing").bounding_box()["width"] + 8
    opened.locator(".plot-legend button").first.click()  # one curve needs no name
    assert named() == []
    opened.locator(".plot-legend button").first.click()
    opened.evaluate("time.setRange([0, 2])")  # there they meet
    assert named() == []
    opened.evaluate("time.setRange([0, 1])")
    assert [name for name, _ in named()] == ["x<sub>a</sub>", "y"]


def plot_top(opened):
    return opened.evaluate("plot.chart.bbox.top / devicePixelRatio")


def test_names_have_the_places_of_plots(plotted):
    opened = plotted(time=TIME, series=[curve("x", TIME)])
    rng = np.random.default_rng(1)
    cases = [rng.uniform(-5, 105, rng.integers(2, 8)).tolist() for _ in range(200)]
    found = opened.evaluate("(cases) => cases.map((at) => CurveEnds.spread(at, 14, 80))", cases)
    for at, places in zip(cases, found, strict=True):
        expected = spread(np.array(at), 14, 80)
        assert (places is None) == (expected is None)
        assert expected is None or places == pytest.approx(expected.tolist())


def test_a_run_with_other_instants_is_read_at_its_own_samples(plotted):
    kept = {"time": [0.0, 1.5, 2.0, 3.0], "ghostOf": 0}
    series = [curve("x", [0, 1, 4, 9, 16]), curve("x (kept)", [7, 5, 3, 2], **kept)]
    opened = plotted(time=TIME, series=series)
    for time, values in {1: ["1", "≈ 5"], 2: ["4", "3"], 4: ["16", "–"]}.items():
        opened.evaluate("(at) => time.setTime(at)", time)
        assert legend(opened) == values
    times, own, other = opened.evaluate("plot.chart.data.map((column) => [...column])")
    assert times == sorted(TIME + kept["time"])
    assert [x for x in own if x is not None] == [0, 1, 4, 9, 16]
    assert [x for x in other if x is not None] == [7, 5, 3, 2]
