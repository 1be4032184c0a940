"""The variation tape against differences of the equations themselves."""

from __future__ import annotations

import functools
import time
from pathlib import Path

import numpy as np
import pytest
from growth import assert_growth
from lowered import Lowered, lowered
from random_cases import seeds

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.system import JacobianTapes
from lagcli.engine.tape.interpreter import ScalarTape

MODELS = sorted((Path(__file__).parents[3] / "models").glob("*.yaml"))
DRIVEN = """
coordinates: [x, y, phi]
parameters: {k: 30, c: 0.4, w: 2.0, mu: 0.3}
T: (x'^2 + y'^2)/2 + phi'^2*(1 + x^2)/2 + x'*sin(phi)*phi'
V: 9.81*y + k*abs(x)^3 + cos(w*t)*phi
Q: {x: -c*abs(x')*x' + sin(w*t), phi: -mu*sign(phi')*phi'^2 + floor(y)}
constraints:
  rod: x^2 + y^2 = (2 + sin(w*t)/2)^2
  wheel: x' + cos(phi)*y' = t*phi'
initial: {x: 1.1, y: 0.5, phi: 0.3, x': 0, y': 0, phi': 0}
"""


#: Every function that can have its own slope, in energies, forces and constraints.
FUNCTIONS = """
coordinates: [x, y, z]
parameters: {a: 0.7}
definitions:
  u: abs(x*y) + floor(3*x) + cbrt(y - z) + max(x, y^2, t) + step(x - t)*z^2
  w: if(x > y*t and not (z > 2), sin(x)*z, cos(y)) + ceil(y*t) + sign(x - a)*y + min(x, z)*t
  e: erf(x) + erfc(y) + atan2(x, z) + asinh(y) + acosh(2 + z^2) + atanh(0.4*x) + log1p(y^2)
  h: hypot(x, y, z) + exp2(x) + expm1(y) + log2(1 + z^2) + log10(2 + x) + radians(y) + degrees(z/9)
T: (x'^2 + y'^2 + z'^2)*(3 + u/9)/2 + (w')^2/50 + abs(x')*x'^2 + e*x'*y'/20
V: u*w + abs(t - x)*y' + h + e
Q: {x: "max(x', y')*w", y: e*sign(z'), u: "if(t > x', y', h)"}
constraints:
  c: w + h = e*t
  n: (5 + u)*x' + abs(y)*y' + if(x > t, z', y'*w) = floor(5*t) + max(x, y)
initial: {x: 1.1, y: 0.5, z: 0.3, x': 0, y': 0, z': 0}
"""


class Defects:
    """G, Γ and the power at fixed a and λ, and their derivatives."""

    def __init__(self, case: Lowered, seed: int):
        system = case.system
        rng = np.random.default_rng(seed)
        assert system.variation is not None
        self.system, self.variation = system, system.variation()
        self.nq, self.nc = len(system.coordinates), len(system.constraints)
        self.evaluator = Evaluator(system, case.p)
        self.tape = ScalarTape(self.variation.tape)
        self.t = 0.37
        self.state = rng.uniform(0.3, 1.2, 2 * self.nq)
        self.a, self.multipliers = rng.normal(size=self.nq), rng.normal(size=self.nc)

    def values(self, t: float, state: np.ndarray) -> np.ndarray:
        q, v = np.split(state, 2)
        d = self.evaluator.dynamics(t, q, v)
        force = d.forcing - d.mass_matrix @ self.a + d.jacobian.T @ self.multipliers
        power = d.power + self.multipliers @ (d.jacobian @ v)
        return np.concatenate([force, d.rhs - d.jacobian @ self.a, [power]])

    def derivatives(self) -> tuple[np.ndarray, np.ndarray]:
        """Return ∂(G, Γ, power)/∂(q, v) and ∂/∂t from the tape."""
        nq, nc, w = self.nq, self.nc, self.variation
        inputs = (self.t, *self.state, *self.a, *self.multipliers, *self.evaluator.p)
        out = iter(self.tape(inputs))
        jacobian = np.zeros((nq + nc + 1, 2 * nq))
        for row, column, pattern in (
            (0, 0, w.force_position),
            (0, nq, w.force_velocity),
            (nq, 0, w.rhs_position),
            (nq, nq, w.rhs_velocity),
            (nq + nc, 0, [(0, j) for j in w.power_position]),
            (nq + nc, nq, [(0, j) for j in w.power_velocity]),
        ):
            for i, j in pattern:
                jacobian[row + i, column + j] = next(out)
        rates = np.array(list(out))
        assert len(rates) == nq + nc + 1
        return jacobian, rates

    def differences(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the same by fourth-order differences."""

        def slope(f) -> np.ndarray:
            h = 1e-3
            return (8 * (f(h) - f(-h)) - f(2 * h) + f(-2 * h)) / (12 * h)

        units = np.eye(2 * self.nq)
        columns = [slope(lambda h, e=e: self.values(self.t, self.state + h * e)) for e in units]
        return np.array(columns).T, slope(lambda h: self.values(self.t + h, self.state))


@functools.cache
def compiled(text_or_path: str | Path) -> Lowered:
    load = lagcli.load if isinstance(text_or_path, Path) else lagcli.load_text
    return lowered(load(text_or_path))


@pytest.mark.parametrize("seed", seeds(1, 3))
@pytest.mark.parametrize(
    "source",
    [pytest.param(DRIVEN, id="driven"), pytest.param(FUNCTIONS, id="functions")]
    + [pytest.param(path, id=path.stem) for path in MODELS],
)
def test_derivatives_are_those_of_the_equations(source: str | Path, seed: int) -> None:
    defects = Defects(compiled(source), seed)
    for found, expected in zip(defects.derivatives(), defects.differences(), strict=True):
        size = np.abs(expected).max()
        # the differences' own error: h⁴ of derivatives that grow with the model's stiffness
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-7 * size)


def chain(n: int) -> str:
    """Return n masses in the plane, joined by rods and by stiff dampers."""
    names = [f"{c}{i}" for i in range(n) for c in "xy"]
    rods = "\n".join(
        f"  r{i}: (x{i} - {f'x{i - 1}' if i else 0})^2 + (y{i} - {f'y{i - 1}' if i else 0})^2 = 1"
        for i in range(n)
    )
    kinetic = " + ".join(f"x{i}'^2 + y{i}'^2" for i in range(n))
    springs = " + ".join(f"(x{i}*y{i - 1} - y{i}*x{i - 1})^2" for i in range(1, n))
    initial = ", ".join(f"x{i}: {i + 1}, y{i}: 0, x{i}': 0, y{i}': 0" for i in range(n))
    return f"""
coordinates: [{", ".join(names)}]
T: ({kinetic})/2
V: 9.81*({" + ".join(f"y{i}" for i in range(n))}) + 50*({springs})
constraints:
{rods}
initial: {{{initial}}}
"""


def test_cost_grows_like_the_number_of_bodies() -> None:
    tapes: dict[int, JacobianTapes] = {}

    def seconds(n: int) -> float:
        system = lowered(lagcli.load_text(chain(n))).system  # not derived before
        assert system.variation is not None
        began = time.process_time()
        tapes[n] = system.variation()
        return time.process_time() - began

    # eight times as long; square growth would be sixty-four
    assert_growth(seconds, (20, 160), factor=24)
    few, many = tapes[20], tapes[160]
    assert len(many.tape.code) < 9 * len(few.tape.code)
    assert len(many.force_position) < 9 * len(few.force_position)
