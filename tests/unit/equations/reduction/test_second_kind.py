"""The second kind: named functions, implicit roots, assemblies, and where there is none."""

from __future__ import annotations

from pathlib import Path

import pytest
import symengine as se

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.reduction.partition import number
from lagcli.equations.reduction.second_kind import Maggi, second_kind, second_kind_is_short
from lagcli.equations.render import render
from lagcli.errors import UsageError
from lagcli.model.loader import load, load_text
from lagcli.simulations.partition import partition

MODELS = Path(__file__).parents[4] / "models"

# x has no closed form in φ
CAM = """\
coordinates: [x, phi]
parameters: {m: 1, J: 0.1, a: 0.1, g: 9.81, k: 2, e: 0.3}
T: m/2*x'^2 + J/2*phi'^2
V: m*g*x
constraints: {cam: x + e*sin(k*x)*a - a*cos(phi) - a*phi}
initial: {phi: 0.3, phi': 1, x: {guess: 0.1}, x': {guess: 0}}
"""


def test_an_implicit_root_is_differentiated_by_the_chain_rule() -> None:
    found = partition(derive(load_text(CAM)))
    second = second_kind(found)
    assert [block.solutions for block in second.blocks] == [()]
    assert second.named == (0,)
    maggi = Maggi(found)
    at = dict(found.values)
    assert number(second.mass_matrix[0][0], at) == pytest.approx(
        number(maggi.mass_matrix[0][0], at), rel=1e-13
    )
    assert number(second.forcing[0], at) == pytest.approx(number(maggi.forcing[0], at), rel=1e-13)


def test_the_textbooks_lagrangian() -> None:
    second = second_kind(partition(derive(load(MODELS / "slider_crank_textbook.yaml")), ["phi"]))
    phi, v, m, r, l, g = map(se.Symbol, ("phi", "phi'", "m", "r", "l", "g"))
    rate = r * v * se.cos(phi) / se.sqrt(l**2 - r**2 * se.sin(phi) ** 2)
    assert se.expand(second.rates[1] - rate) == 0
    wanted = m / 2 * (r**2 * v**2 + r**2 * se.sin(phi) ** 2 * (v + rate) ** 2)
    wanted -= m * g * r * se.sin(phi)
    assert se.expand(second.lagrangian - wanted) == 0


@pytest.mark.parametrize(("guess", "sign"), [(0.8, 1), (-0.8, -1)])
def test_the_initial_values_choose_the_assembly(guess: float, sign: int) -> None:
    text = (MODELS / "four_bar.yaml").read_text(encoding="utf-8")
    text = text.replace("theta_2: {guess: 0.8 rad}", f"theta_2: {{guess: {guess} rad}}")
    text = text.replace("theta_3: {guess: 1.5 rad}", f"theta_3: {{guess: {1.5 * sign} rad}}")
    found = partition(derive(load_text(text)))
    second = second_kind(found)
    for solution in second.blocks[0].solutions:
        assert number(solution.value, found.values) == pytest.approx(
            found.values[solution.unknown], rel=1e-12
        )
    assert [s.sign for s in second.blocks[0].solutions if s.sign] == [sign]


def test_nonholonomic_constraints_have_no_second_kind() -> None:
    with pytest.raises(UsageError, match="`knife` is nonholonomic") as refused:
        second_kind(partition(derive(load(MODELS / "chaplygin_sleigh.yaml"))))
    assert "use --kind maggi" in str(refused.value)


@pytest.mark.parametrize(
    ("name", "short"),
    [
        ("slider_crank", True),
        ("pendulum_cartesian", True),
        ("four_bar", False),
        ("rolling_disk", False),
        ("pendulum_chain", False),
        ("driven_slider_crank", False),
    ],
)
def test_where_the_second_kind_is_short(name: str, short: bool) -> None:
    assert second_kind_is_short(partition(derive(load(MODELS / f"{name}.yaml")))) is short


# the crank is driven, and no coordinate is independent
DRIVEN = """\
coordinates: [a, x]
parameters: {w: 2, k: 0.1}
T: x'^2/2 + a'^2/2
constraints:
  drive: a = w*t
  cam: x + k*sin(x) = cos(a) + DELAY
initial: {a: {guess: 0}, a': {guess: 2}, x: {guess: 1}, x': {guess: 0}}
"""


@pytest.mark.parametrize("start", ["0", "-1"])
def test_roots_of_a_driven_mechanism_are_functions_of_time(start: str) -> None:
    driven = load_text(DRIVEN.replace("DELAY", start))
    text = render(derive(driven), kinds=("second",), partition=partition(derive(driven)))
    near = "0.920415\n" if start == "0" else "0\n"
    assert f"x = R_x(t)   implicit: the root of cam near {near}" in text
