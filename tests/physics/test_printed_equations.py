"""The printed equations of motion, read as text, are those that SymPy derives.

The systems are stated here a second time, and SymPy's `LagrangesMethod` derives their equations.
The residual of each printed equation has the value of SymPy's at random states and multipliers.
"""

from __future__ import annotations

import random
import unicodedata
from pathlib import Path

import pytest
import sympy as sp
from printed_formulas import printed_value
from random_cases import some
from sympy.physics.mechanics import LagrangesMethod, ReferenceFrame, dynamicsymbols

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.render import render
from lagcli.model.loader import load

MODELS = Path(__file__).parents[2] / "models"
T = dynamicsymbols._t
sin, cos = sp.sin, sp.cos


def names(text: str) -> list[sp.Symbol]:
    return list(sp.symbols(text))


def moving(text: str) -> list[sp.Expr]:
    return list(dynamicsymbols(text))


def slider_crank():
    q = phi, psi = moving("φ ψ")
    m, r, le, g, tau, c = names("m r l g τ c")
    x = r * cos(phi) + le * cos(psi)
    y = r * sin(phi) - le * sin(psi)
    kinetic = m * (r**2 * phi.diff(T) ** 2 + x.diff(T) ** 2 + y.diff(T) ** 2) / 2
    force = -c * x.diff(T)
    applied = [tau + force * x.diff(phi), force * x.diff(psi)]
    return q, kinetic - m * g * (r * sin(phi) + y), [r * sin(phi) - le * sin(psi)], [], applied


def four_bar():
    q = a, b, c = moving("θ₁ θ₂ θ₃")
    m, n, p, ra, rb, rc, d, g, tau = names("m₁ m₂ m₃ a b c d g τ")
    x, y = ra * cos(a) + rb * cos(b) / 2, ra * sin(a) + rb * sin(b) / 2
    kinetic = m * (ra * a.diff(T)) ** 2 / 6 + n * (x.diff(T) ** 2 + y.diff(T) ** 2) / 2
    kinetic += n * (rb * b.diff(T)) ** 2 / 24 + p * (rc * c.diff(T)) ** 2 / 6
    potential = g * (m * ra * sin(a) / 2 + n * y + p * rc * sin(c) / 2)
    loop = [
        ra * cos(a) + rb * cos(b) - d - rc * cos(c),
        ra * sin(a) + rb * sin(b) - rc * sin(c),
    ]
    return q, kinetic - potential, loop, [], [tau, 0, 0]


def bead_on_rotating_hoop():
    q = r, theta, phi = moving("r θ φ")
    m, g, radius, rate = names("m g R Ω")
    x, y = r * sin(theta) * cos(phi), r * sin(theta) * sin(phi)
    z = -r * cos(theta)
    kinetic = m * (x.diff(T) ** 2 + y.diff(T) ** 2 + z.diff(T) ** 2) / 2
    return q, kinetic - m * g * z, [r - radius, phi - rate * T], [], [0, 0, 0]


def rolling_disk():
    q = x, y, z, psi, theta, phi = moving("x y z ψ θ φ")
    m, g, r, about, axle = names("m g r A C")
    spin = phi.diff(T) + psi.diff(T) * sin(theta)
    kinetic = m * sum(s.diff(T) ** 2 for s in (x, y, z)) / 2 + axle * spin**2 / 2
    kinetic += about * (theta.diff(T) ** 2 + (psi.diff(T) * cos(theta)) ** 2) / 2
    tilt = r * theta.diff(T) * cos(theta)
    rolls = [
        x.diff(T) - r * spin * cos(psi) - tilt * sin(psi),
        y.diff(T) - r * spin * sin(psi) + tilt * cos(psi),
    ]
    return q, kinetic - m * g * z, [z - r * cos(theta)], rolls, [0] * 6


def car_axis():
    q = a, b, c, d = moving("x_l y_l x_r y_r")
    m, k, free, length, r, w, g = names("m k L₀ L r w g")
    y = r * sin(w * T)
    x = sp.sqrt(length**2 - y**2)
    kinetic = m * sum(s.diff(T) ** 2 for s in q) / 2
    left, right = sp.sqrt(a**2 + b**2), sp.sqrt((c - x) ** 2 + (d - y) ** 2)
    potential = k * ((left - free) ** 2 + (right - free) ** 2) / 2 + m * g * (b + d)
    held = [a * x + b * y, (a - c) ** 2 + (b - d) ** 2 - length**2]
    return q, kinetic - potential, held, [], [0] * 4


MULTIPLIERS = {
    "slider_crank": ["λ"],
    "four_bar": ["λ_joint_x", "λ_joint_y"],
    "bead_on_rotating_hoop": ["λ_hoop", "λ_drive"],
    "rolling_disk": ["λ_contact", "λ_roll_x", "λ_roll_y"],
    "car_axis": ["λ_upright", "λ_axis"],
}
SYSTEMS = (slider_crank, four_bar, bead_on_rotating_hoop, rolling_disk, car_axis)


def printed_equations(text: str) -> dict[str, str]:
    """Return the equations of motion by coordinate."""
    block = text.split("Equations of motion\n")[1].split("\n\n")[0]
    pairs = (line.strip().split(":  ", 1) for line in block.splitlines())
    return {name: equation.strip() for name, equation in pairs}


def dotted(name: str, dots: int) -> str:
    mark = ("", "\u0307", "\u0308")[dots]
    return unicodedata.normalize("NFC", name[0] + mark + name[1:])


@pytest.mark.parametrize("system", some(SYSTEMS, 3), ids=lambda s: s.__name__)
def test_printed_equations_are_those_of_sympy(system):
    q, lagrangian, holonomic, nonholonomic, applied = system()
    frame = ReferenceFrame("N")
    method = LagrangesMethod(
        lagrangian, q, hol_coneqs=holonomic, nonhol_coneqs=nonholonomic, forcelist=[], frame=frame
    )
    eom = method.form_lagranges_equations()
    path = next(p for p in MODELS.rglob("*.yaml") if p.stem == system.__name__)
    text = render(derive(load(path)), width=1000)
    shown = printed_equations(text)
    definitions = []
    if "Definitions used below\n" in text and not nonholonomic:
        definitions = text.split("Definitions used below\n")[1].split("\n\n")[0].splitlines()
    assert list(shown) == [x.name for x in q]
    rng = random.Random(system.__name__)
    lam = list(method.lam_vec)
    for _ in range(3):
        values: dict[str, float] = {"t": rng.uniform(0.2, 1)}
        point: dict[sp.Expr, float] = {}
        for x in q:
            for dots in (2, 1, 0):
                number = rng.uniform(0.2, 1.5)
                values[dotted(x.name, dots)] = number
                point[x.diff(T, dots) if dots else x] = number
        for name, symbol in zip(MULTIPLIERS[system.__name__], lam, strict=True):
            values[name] = rng.uniform(-2, 2)
            point[symbol] = -values[name]  # SymPy has the opposite sign
        free = set().union(*(e.free_symbols for e in (*eom, *map(sp.sympify, applied)))) - {T}
        for symbol in sorted(free, key=str):
            values[symbol.name] = point[symbol] = rng.uniform(0.3, 0.9)
        for line in definitions:  # those that are printed, as printed
            name, value = line.strip().split(" = ")
            values[name.strip()] = printed_value(value, values)
        for x, residual, force in zip(q, eom, applied, strict=True):
            wanted = (residual - force).xreplace({**point, T: sp.Float(values["t"])}).evalf()
            left, right = shown[x.name].split(" = ")
            found = printed_value(left, values) - printed_value(right, values)
            assert found == pytest.approx(float(wanted), rel=1e-9, abs=1e-9), x
