"""Terms of printed equations: their kinds, and their values against differences of L."""

from __future__ import annotations

import numpy as np
import pytest
import symengine as se
from shipped import PATHS

import lagcli
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.terms import equation_terms, term_expressions
from lagcli.model.loader import load

MODELS = ("slider_crank", "four_bar", "rolling_disk", "woodpecker", "bead_on_rotating_hoop")


def lagrangian_force(model, q, v, a, i, t):
    """Return d/dt ∂L/∂v_i − ∂L/∂q_i on the parabola q + v s + a s²/2, by central differences."""
    names = [x for n in model.coordinate_names for x in (n, f"{n}'")]
    given = {se.Symbol(n): x for n, x in model.parameter_values.items()}
    lagrangian = (model.kinetic - model.potential).subs(given)
    value = se.Lambdify([se.Symbol(n) for n in ("t", *names)], [lagrangian])

    def at(s, dq=0.0, dv=0.0):
        here, rate = q + v * s + a * s * s / 2, v + a * s
        here, rate = here.copy(), rate.copy()
        here[i] += dq
        rate[i] += dv
        return float(value([t + s, *np.stack([here, rate], axis=1).ravel()])[0])

    h = 1e-3

    def slope(f):  # of fourth order
        return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)

    return slope(lambda s: slope(lambda e: at(s, dv=e))) - slope(lambda e: at(0.0, dq=e))


@pytest.mark.parametrize("name", MODELS)
def test_terms_add_up_to_the_derivatives_of_the_lagrangian(name: str) -> None:
    model = load(str(PATHS[name]))
    equations = derive(model)
    n, m = len(equations.q), len(equations.constraints)
    rng = np.random.default_rng(7)
    q, v, a = rng.uniform(0.3, 1.0, (3, n))
    multipliers, t = rng.normal(size=m), 0.4
    symbols = [se.Symbol("t"), *equations.q, *equations.v, *equations.a, *equations.multipliers]
    values = dict(zip(symbols, [t, *q, *v, *a, *multipliers], strict=True))
    values |= {se.Symbol(x): value for x, value in model.parameter_values.items()}
    formulas = Formulas(equations)
    for i in range(n):
        terms = equation_terms(formulas.equation_line(i))
        numbers = [float(x.subs(values)) for x in term_expressions(terms, model)]
        left, right = (
            sum(x for x, term in zip(numbers, terms, strict=True) if term.side == side)
            for side in (0, 1)
        )
        applied = float(se.sympify(equations.applied_forces[i]).subs(values))
        rows = [c.row.get(i, 0) for c in equations.constraints]
        forces = [float(se.sympify(b).subs(values)) for b in rows]
        assert right == pytest.approx(applied + multipliers @ forces, abs=1e-12)
        expected = lagrangian_force(model, q, v, a, i, t)
        assert left == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_kinds_of_terms() -> None:
    text = """
coordinates: [x, y]
parameters: {m: 1, k: 2, c: 3, F: 4}
T: m/2*(x'^2 + y'^2)
V: k/2*x^2
Q: {x: F - c*x'}
constraints: {rod: x^2 + y^2 = 1, line: x = y*y}
initial: {x: 0.5, y: {guess: 0.8}, x': {guess: 0}, y': {guess: 0}}
"""
    formulas = Formulas(derive(lagcli.load_text(text)))
    terms = equation_terms(formulas.equation_line(0))
    assert [(term.side, term.sign, term.kind, term.constraints) for term in terms] == [
        (0, 1, "inertia", ()),
        (0, 1, "potential", ()),
        (1, 1, "applied", ()),
        (1, -1, "applied", ()),
        (1, 1, "constraint", ("rod",)),
        (1, 1, "constraint", ("line",)),
    ]
    numbers = [
        float(x.subs(dict.fromkeys(x.free_symbols, 1)))
        for x in term_expressions(terms, formulas.model)
    ]
    assert numbers == [1, 1, 1, -1, 2, 1]


def test_an_equation_without_terms_on_the_right() -> None:
    text = "coordinates: [x]\nT: x'^2/2\nV: x^2/2\ninitial: {x: 1, x': 0}\n"
    terms = equation_terms(Formulas(derive(lagcli.load_text(text))).equation_line(0))
    assert [(term.side, term.kind) for term in terms] == [(0, "inertia"), (0, "potential")]
