"""Derivatives of functions of the state along runs with derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.pictures.curves import Catalogue, read_curves
from lagcli.pictures.plots.bands import linear_bands
from lagcli.pictures.run_file import RunFile
from lagcli.simulations.directions import Directions
from lagcli.simulations.slopes import slopes_along

#: J depends on m.
BEAM = """
coordinates: [x, y, phi]
parameters: {m: 2 kg, l: 0.4 m, J: m*l^2/3, g: 9.81 m/s^2, k: 0.2 N*m*s}
T: m/2*(x'^2 + y'^2) + J/2*phi'^2
V: m*g*y
Q: {phi: -k*phi'}
constraints:
  pin_x: x - l*sin(phi) = 0
  pin_y: y + l*cos(phi) = 0
initial: {phi: 0.7, phi': 1, x: {guess: 0}, y: {guess: 0}, x': {guess: 0}, y': {guess: 0}}
outputs: {h: y + l, pull: norm([Qc.x, Qc.y]), spin: J*phi'', s: m^2*x''}
"""


@pytest.mark.parametrize("redundant", [False, True])
def test_functions_of_the_state_have_the_derivatives_of_differences(redundant: bool) -> None:
    options: dict[str, Any] = {"t_end": 0.4, "samples": 5, "rtol": 1e-11, "atol": 1e-12}
    names: tuple[str, ...] = ("h", "spin", "s", "phi_ddot", "energy_kinetic", "energy_total")
    text = BEAM
    if redundant:  # multipliers, of which some are not unique, have no derivatives
        text = BEAM.replace("initial:", "  twice: 2*x - 2*l*sin(phi) = 0\ninitial:")
    else:
        names += ("pull", "Qc.x", "Qc.y")

    def run_of(value: float, **more: Any) -> RunFile:
        return RunFile(lagcli.simulate(lagcli.load_text(text, set={"m": value}), **options, **more))

    run = run_of(2, sensitivity=["m"])
    curves = [c for name in names for c in Catalogue(run).find(name)]
    found = linear_bands(run, curves, read_curves(run, curves), {"m": 1.0})
    step = 1e-4
    above, below = (read_curves(run_of(2 + x), curves) for x in (step, -step))
    for name in names:
        expected = (above[name] - below[name]) / (2 * step)
        # differences of second order: their error is about 1e-8 of the value
        np.testing.assert_allclose(
            found.changes[name][:, 0], expected, rtol=1e-6, atol=1e-6, err_msg=name
        )


def test_a_replaced_parameter_does_not_depend_on_others() -> None:
    model = lagcli.load_text(BEAM, set={"J": 0.5})
    run = RunFile(lagcli.simulate(model, t_end=0.1, samples=2, sensitivity=["m"]))
    (curve,) = Catalogue(run).find("energy_kinetic")
    found = linear_bands(run, [curve], read_curves(run, [curve]), {"m": 1.0})
    v = run.columns(["v"])["v"][0]
    assert found.changes["energy_kinetic"][0, 0] == pytest.approx((v[0] ** 2 + v[1] ** 2) / 2)


def test_accelerations_have_no_slope_where_constraints_switch() -> None:
    model = lagcli.load("bouncing_ball")
    run = lagcli.simulate(model, t_end=0.1, samples=2, sensitivity=["h"])
    equations = lagcli.derive(model)
    columns = {name: getattr(run, name) for name in ("time", "q", "v", "a", "multipliers")}
    columns |= {name: getattr(run, name) for name in ("dq", "dv", "dmultipliers")}
    expressions = {"a": equations.a[0], "double": 2 * equations.q[0]}
    found = slopes_along(equations, Directions(model, ("h",)), columns, expressions)
    assert set(found) == {"double"}
    np.testing.assert_allclose(found["double"], 2 * columns["dq"][:, 0])
