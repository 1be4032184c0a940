"""The balance of terms beneath the equations of a report, in a real browser."""

import numpy as np
import pytest

import lagcli
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.formulas import Formulas
from lagcli.pictures.balance import Balance
from lagcli.pictures.report import report

#: Returns for each equation the values of its terms at a time, and the places of the sums, %.
SHOWN = """(time) => {
  document.querySelector("#player input").value = time;
  document.querySelector("#player input").dispatchEvent(new Event("input"));
  return [...document.querySelectorAll(".live")].map((live) => ({
    name: live.dataset.coordinate,
    values: [...live.querySelectorAll(".balance-key .balance-value")].map((v) => v.textContent),
    rest: live.querySelector(".balance-rest .balance-value").textContent,
    sums: [...live.querySelectorAll(".balance-sum")].map((mark) => parseFloat(mark.style.left)),
    formula: [...live.querySelectorAll(".equation [data-term]")]
      .map((e) => e.dataset.term)
      .filter((x, i, every) => every.indexOf(x) === i),
  }));
}"""


def number(text):
    text = (
        text.split(" ")[0].replace("−", "-").translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-"))
    )
    return float(text.replace("·10", "e"))


@pytest.fixture
def friction(reports, visit):
    opened = visit(reports("slider_crank_friction"))
    opened.wait_for_selector(".balance")
    # only balances in sight follow the time
    opened.set_viewport_size({"width": 1300, "height": 1600})
    opened.wait_for_function(
        "() => [...document.querySelectorAll('.live')].every((live) => live.balance.seen)"
    )
    return opened


def test_terms_balance_at_ten_instants(friction, result):
    run = lagcli.read(result("slider_crank_friction"))
    for k in np.linspace(3, len(run.time) - 4, 10).astype(int):
        shown = friction.evaluate(SHOWN, float(run.time[k]))
        assert [x["name"] for x in shown] == ["phi", "psi"]
        phi, psi = run.q[k]
        weight, inertia = 2 * 9.81 * 0.1 * np.cos(phi), 2 * 0.1**2 * run.a[k, 0]
        m, r, length = 1.0, 0.1, 0.3
        other = (
            -m
            * r
            * length
            * (run.a[k, 1] * np.cos(phi + psi) - run.v[k, 1] ** 2 * np.sin(phi + psi))
        )
        guide, slip = run.multipliers[k]
        expected = [inertia, other, weight, guide * r * np.cos(phi), -slip * r * np.sin(phi)]
        assert [number(x) for x in shown[0]["values"]] == pytest.approx(
            expected, rel=2e-3, abs=1e-6
        )
        for equation in shown:
            # the printed numbers of terms exist in the formula
            assert equation["formula"] == [str(i) for i in range(len(equation["values"]))]
            assert abs(number(equation["rest"])) < 1e-12
            assert equation["sums"][0] == pytest.approx(equation["sums"][1], abs=1e-9)


def test_pointing_links_term_arrow_and_curve(friction):
    def lit(selector):
        return friction.locator(f"{selector}.lit").count()

    def faint():
        """Return the opacities of the curves of λ beneath the animation."""
        return friction.evaluate(
            "document.querySelector('#lambda').plot.chart.series.slice(1).map((s) => s.alpha)"
        )

    assert not lit(".term")
    assert faint() == [1, 1]
    friction.locator(".live .balance-key", has_text="slip").first.hover()
    assert lit(".balance-key") == 2  # in both equations
    assert lit(".balance-segment") == 2
    assert faint() == [0.25, 1]
    before = friction.locator("#player canvas").evaluate("c => c.toDataURL()")
    friction.mouse.move(1, 1)
    assert not lit(".term")
    assert faint() == [1, 1]
    assert friction.locator("#player canvas").evaluate("c => c.toDataURL()") != before
    # the arrow
    friction.evaluate("""() => {
      const { stage } = document.querySelector("#player").player;
      const arrow = stage.data.shapes.find((s) => s.kind === "vector" && s.constraint === "guide");
      const [from, to] = stage.ends(arrow), box = stage.canvas.getBoundingClientRect();
      const at = [0, 1].map((axis) => (from[axis] + 2 * to[axis]) / 3);
      window.middle = [box.left + at[0], box.top + at[1]];
    }""")
    friction.mouse.move(*friction.evaluate("window.middle"))
    assert faint() == [1, 0.25]
    assert lit(".balance-key") == 2
    # the curve
    friction.mouse.move(1, 1)
    friction.locator("#plots-multipliers .plot-legend button").nth(1).focus()
    assert lit(".balance-key") == 2
    assert faint() == [0.25, 1]


def test_clicks_and_keys_keep_a_term_emphasized(friction):
    key = friction.locator(".live .balance-key").first
    key.focus()
    key.press("Enter")
    friction.locator("#player input").focus()
    assert key.get_attribute("aria-pressed") == "true"
    assert "lit" in key.get_attribute("class")
    key.focus()
    key.press("Enter")
    friction.locator("#player input").focus()
    assert "lit" not in key.get_attribute("class")


def test_terms_over_time_are_drawn_when_asked_for(friction):
    live = friction.locator(".live").first
    assert not live.locator(".uplot").count()
    live.get_by_text("Terms over time").click()
    live.locator(".uplot").wait_for()
    assert live.locator(".plot-legend button").count() == live.locator(".balance-key").count()


def test_between_samples_the_numbers_are_those_of_the_nearest(friction, result):
    """λ in the plot, in the equation and at the arrow is one number, which the file has."""
    run = lagcli.read(result("slider_crank_friction"))
    t = 0.6 * run.time[40] + 0.4 * run.time[41]
    (shown, *_) = friction.evaluate(SHOWN, t)
    value = friction.locator("#plots-multipliers .plot-value").first.text_content()
    assert number(value) == pytest.approx(run.multipliers[40, 0], rel=1e-5)
    term = run.multipliers[40, 0] * 0.1 * np.cos(run.q[40, 0])
    assert number(shown["values"][3]) == pytest.approx(term, rel=1e-3)
    assert number(friction.locator(".player-time").text_content()) == run.time[40]


def test_no_balance_where_a_value_is_not_in_the_result(tmp_path):
    # events set M, whose values along the run no column contains
    text = """
coordinates: [x]
parameters: {m: 1, M: 0}
T: m/2*x'^2
Q: {x: M}
events: {push: {when: t >= 0.5, set: {M: 1}}}
initial: {x: 0, x': 0}
simulation: {t_end: 1, samples: 11}
"""
    model = lagcli.load_text(text)
    formulas = Formulas(derive(model))
    assert not Balance(formulas, {0: formulas.equation_line(0)}).terms
    page = tmp_path / "page.html"
    report(lagcli.simulate(model), page)
    assert "data-term" not in page.read_text().split("<script>")[0]
