"""M, f, B, γ and the energy against SymPy's derivatives of the model's T, V and constraints.

lagcli takes squares of velocities apart and lets what cancels never arise; here L is differentiated
as it stands, by another program.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest
import sympy
from random_cases import some

import lagcli
from lagcli.equations.derivation.lagrange import Equations
from lagcli.model.model import Model

MODELS = Path(__file__).parents[2] / "models"

HEAD = "parameters: {m: 1.3, l: 0.7, g: 9.81, w: 0.6, N: 3}\n"
OWN = {
    "relativistic": """
coordinates: [x, y]
T: -m*l^2*sqrt(1 - (x'^2 + y'^2)/l^2/20)
V: m*g*y
initial: {x: 0, y: 0, x': 0, y': 0}
""",
    "mass that depends on position and time": """
coordinates: [x, y]
T: (m + l*x^2 + w*t)/2*(x' - y*y')^2 + (1 + sin(y))*x'*y' + x'*t*cos(x) + y'^2*x'^2/7
V: x'*y*w + t*x
Q: {x: -x'*abs(x'), y: t}
constraints: {c: (x - y*t)^2*sin(t) + (x*y - 1)^2/3 = x*t^2}
initial: {x: 0, y: 0, x': 0, y': 0}
""",
    "rotating frame and product of inertia": """
coordinates: [a, b, c]
definitions:
  R: rot_z(a + w*t)*rot_x(b)*rot_z(c)
  J: [[2, 0.1, 0.3], [0.1, 1, 0.2], [0.3, 0.2, 3]]
  p: R*[l, 0, l]
T: 1/2*dot(omega(R), J*omega(R)) + m/2*dot(p', p')
V: m*g*l*cos(b)
constraints: {n: {expr: "a'*sin(b) + c'*t = cos(a)"}}
initial: {a: 0, b: 0, c: 0, a': 0, b': 0, c': 0}
""",
    "links in angles": """
coordinates: [theta[1..N]]
definitions:
  X[0]: 0
  Y[0]: 0
  X[i = 1..N]: X[i-1] + l*i*sin(theta[i] + w*t)
  Y[i = 1..N]: Y[i-1] - l*i*cos(theta[i] + w*t)
T: sum(m*i/2*(X[i]'^2 + Y[i]'^2), i = 1..N) + sum(floor(i/2)*theta[i]'^2, i = 1..N)
V: sum(m*g*Y[i]*if(Y[i] > 0, 1, 2), i = 1..N)
initial: {theta[1..N]: 0, theta[1..N]': 0}
""",
    "written with L": """
coordinates: [r, phi]
L: m/2*(r'^2 + r^2*(phi' + w)^2) + m*g/r + l*phi'
initial: {r: 1, phi: 0, r': 0, phi': 0}
""",
}
SHIPPED = (
    *("charged_pendulum", "driven_slider_crank", "heavy_top", "rolling_disk", "pendulum_chain"),
    *("andrews_squeezer", "bead_on_rotating_hoop", "car_axis", "chain", "chaplygin_sleigh"),
)


def load(name: str) -> Model:
    if name in OWN:
        return lagcli.load_text(HEAD + OWN[name], name)
    few = {"N": 3} if "chain" in name else {}
    return lagcli.load(MODELS / f"{name}.yaml", set=few)


class Independent:
    """The system by SymPy, from L and the constraints alone."""

    def __init__(self, e: Equations):
        model = e.model
        q, v = ([self.symbol(s.name) for s in symbols] for symbols in (e.q, e.v))
        t = self.symbol("t")
        lagrangian = self.sympy(e.lagrangian)
        p = [sympy.diff(lagrangian, x) for x in v]

        def rate(x: sympy.Expr) -> sympy.Expr:
            """Return the rate without accelerations."""
            parts = [sympy.diff(x, a) * b for a, b in zip(q, v, strict=True)]
            return sum(parts, sympy.diff(x, t))

        self.expressions = {"energy": sum(a * b for a, b in zip(v, p, strict=True)) - lagrangian}
        self.expressions["time power"] = -sympy.diff(lagrangian, t)
        for i, (x, momentum) in enumerate(zip(q, p, strict=True)):
            applied = self.sympy(e.applied_forces[i])
            self.expressions[f"f {i}"] = sympy.diff(lagrangian, x) - rate(momentum) + applied
            for j, y in enumerate(v):
                self.expressions[f"M {i} {j}"] = sympy.diff(momentum, y)
        for c in model.constraints:
            phi = self.sympy(c.expression)
            psi = rate(phi) if c.kind == "holonomic" else phi
            self.expressions[f"gamma {c.name}"] = -rate(psi)
            for j, y in enumerate(v):
                self.expressions[f"B {c.name} {j}"] = sympy.diff(psi, y)

    def symbol(self, name: str) -> sympy.Symbol:
        return sympy.Symbol(name)

    def sympy(self, expression: object) -> sympy.Expr:
        return sympy.sympify(expression)  # of a SymEngine object, not of text


def derived(e: Equations) -> dict[str, object]:
    found: dict[str, object] = {"energy": e.energy, "time power": e.time_power}
    for i, row in enumerate(e.mass_matrix):
        found[f"f {i}"] = e.forcing[i]
        found |= {f"M {i} {j}": row.get(j, 0) for j in range(len(e.q))}
    for c in e.constraints:
        found[f"gamma {c.constraint.name}"] = c.rhs
        found |= {f"B {c.constraint.name} {j}": c.row.get(j, 0) for j in range(len(e.q))}
    return found


@pytest.mark.parametrize("name", [*OWN, *some(SHIPPED, 4)])
def test_equations_are_those_of_another_derivation(name: str) -> None:
    model = load(name)
    equations = lagcli.derive(model)
    expected, found = Independent(equations).expressions, derived(equations)
    assert expected.keys() == found.keys()
    chance = random.Random(5)
    symbols = [*equations.q, *equations.v, "t"]
    arguments = [sympy.Symbol(str(getattr(s, "name", s))) for s in symbols]
    parameters = {sympy.Symbol(k): x for k, x in model.parameter_values.items()}
    every = [*arguments, *parameters]
    values = [[sympy.sympify(x) for x in side.values()] for side in (expected, found)]
    plain = sympy.symbols(f"s:{len(every)}")
    renamed = dict(zip(every, plain, strict=True))
    functions = [
        sympy.lambdify(plain, [x.xreplace(renamed) for x in side], "math") for side in values
    ]
    for _ in range(3):
        state = [chance.uniform(0.2, 1.1) for _ in arguments]
        there, here = (f(*state, *parameters.values()) for f in functions)
        for key, a, b in zip(expected, there, here, strict=True):
            assert a == pytest.approx(b, rel=1e-9, abs=1e-9 * max(map(abs, there))), key
