"""The search for symmetries: its extent, and what it does with large systems."""

from __future__ import annotations

from pathlib import Path

import lagcli
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.symmetry.linear import linear_symmetries

MODELS = Path(__file__).parents[4] / "models"

FREE = """
coordinates: [x, y, s]
parameters: {m: 1}
T: m/2*(x'^2 + y'^2 + s'^2)
V: m*sqrt(x^2 + y^2)
initial: {x: 1, y: 0, s: 0, x': 0, y': 1, s': 1}
"""


def found(equations: Equations, effort: float) -> tuple[list[set[str]], str]:
    symmetries, extent = linear_symmetries(equations, equations.model.parameter_values, effort)
    names = equations.model.coordinate_names
    moved = [{names[i] for i, _ in s.linear} | {names[i] for i in s.shift} for s in symmetries]
    return moved, extent


def test_less_is_searched_where_there_is_more_to_do() -> None:
    equations = lagcli.derive(lagcli.load_text(FREE))
    assert found(equations, 1e5) == ([{"s"}, {"x", "y"}, set()], "linear")
    assert found(equations, 10) == ([{"s"}, set()], "absent coordinates")
    top = lagcli.derive(lagcli.load(MODELS / "heavy_top.yaml"))
    quaternion = {"e0", "e1", "e2", "e3"}
    assert found(top, 1e3) == ([{"X", "Y"} | quaternion, quaternion, set()], "linear")
    assert found(top, 600) == ([set()], "translations")
    assert found(top, 400) == ([set()], "absent coordinates")


def test_a_large_model_is_not_searched_for_long() -> None:
    chain = lagcli.load(MODELS / "pendulum_chain.yaml", set={"N": "40"})
    moved, extent = found(lagcli.derive(chain), 1e3)
    assert extent == "absent coordinates"
    assert moved == [set()]


def test_forces_and_rheonomic_constraints_end_the_conservation_of_energy() -> None:
    for change in ("Q: {s: -0.1*s'}", "constraints: {drive: s = t}"):
        text = FREE.replace("s: 0,", "s: {guess: 0},").replace("s': 1", "s': {guess: 1}")
        equations = lagcli.derive(lagcli.load_text(f"{text}{change}\n"))
        for effort in (1e5, 10):
            assert set() not in found(equations, effort)[0]
