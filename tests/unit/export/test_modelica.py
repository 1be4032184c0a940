"""Models in Modelica have the accelerations and multipliers of the engine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from exported import close, exported, points
from modelica import ModelicaModel
from shipped import every_model

import lagcli
from lagcli.export.formats import code
from lagcli.export.modelica import write_modelica


def solved(own: ModelicaModel, t: float, q: Any, v: Any, p: Any, rate: float) -> Any:
    """Return v, a, λ and the outputs at a state."""
    nq = len(q)
    parameters = dict(zip([*own.parameters][1:], p, strict=True)) | {"stabilization": rate}
    state = dict(zip(own.start, [*q, *v], strict=True))
    found = own.solution(float(t), state, parameters)
    rates = [found[f"der({name})"] for name in own.start]
    return np.array(rates), [found[name] for name in own.variables[2 * nq :]]


@pytest.mark.parametrize("name", every_model(smooth=True))
def test_a_model_in_modelica_has_the_values_of_the_engine(name: str) -> None:
    own = ModelicaModel(write_modelica(exported(name)))
    nc = len(exported(name).system.constraints)
    for point in points(name):
        rates, rest = solved(own, *point.state, rate=0.0)
        assert close(rates, [*point.v, *point.a])
        nq = len(point.q)
        assert close(rest[nq : nq + nc], point.multipliers)
        assert close(rest[nq + nc :][: len(point.outputs)], point.outputs)


def test_residuals_decay_with_the_rate_of_stabilization() -> None:
    """B a = γ − 2 s ψ − s² φ, at a state off the constraints."""
    own = ModelicaModel(write_modelica(exported("slider_crank")))
    for point in points("slider_crank"):
        rates, _ = solved(own, *point.state, rate=7.0)
        rest = point.jacobian @ rates[len(point.q) :] - point.rhs
        assert close(rest, -2 * 7.0 * point.velocity - 7.0**2 * point.position)


@pytest.mark.parametrize("t", [0.0, 1.5])
def test_a_choice_does_not_swallow_the_terms_behind_it(t: float) -> None:
    """The last value of a choice reaches as far as it can: over λ, and over what decays."""
    model = lagcli.load_text("""
coordinates: [x, y, z]
T: (x'^2 + y'^2 + z'^2)/2
Q: {x: 'if(t > 1, -3, 2)'}
constraints: {bar: x + y = 1, drive: "z' = t*if(t > 1, 3, 2)"}
initial: {x: 0.4, y: {guess: 0}, z: 0, x': {guess: 0}, y': {guess: 0}, z': {guess: 0}}
simulation: {t_end: 1.5}
""")
    f, own = lagcli.dynamics(model), ModelicaModel(code(model, "modelica"))
    q, v = np.array([0.4, 0.8, 0.0]), np.array([0.0, 0.0, 5.0])
    # x'' = F + λ, y'' = λ, x'' + y'' = 0; z'' = γ
    force, slope = (-3.0, 3.0) if t > 1 else (2.0, 2.0)
    assert close(f(t, q, v).a, [force / 2, -force / 2, slope])
    rates, _ = solved(own, t, q, v, [], rate=7.0)
    decays = [0.2 * 7.0**2 / 2] * 2 + [2 * 7.0 * (5.0 - slope * t)]
    assert close(rates[3:], np.array([force / 2, -force / 2, slope]) - decays)
