"""Signs of functions of forces: which comparisons they replace, and the tapes on both sides."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.lowering.lower import lower
from lagcli.engine.switching.signs import SignedLaws, with_signs
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.lagrange import derive


def system(law: str) -> System:
    """Return a body with a force that depends on the multipliers a, b of two guides."""
    return lower(
        derive(
            lagcli.load_text(
                "coordinates: [x, y, z]\nparameters: {c: 3}\nT: (x'^2 + y'^2 + z'^2)/2\n"
                f'Q: {{x: "{law}"}}\nconstraints: {{a: y = 0, b: z = 0}}\n'
                "initial: {x: 1, y: 0, z: 0, x': 0, y': 0, z': 0}\n"
            )
        )
    )


def signed(law: str) -> tuple[System, SignedLaws]:
    found = system(law)
    assert found.switching is not None
    assert found.switching.forces is not None
    return found, with_signs(found.switching, range(7, 12))


@pytest.mark.parametrize(
    ("law", "count"),
    [
        ("c*abs(lambda.a)", 1),
        ("c*abs(lambda.a) + max(-lambda.a, 0)", 1),
        ("min(lambda.a, lambda.b) + max(lambda.b, lambda.a)", 1),
        ("abs(abs(lambda.a) - c)", 2),
        ("if(lambda.a > x, lambda.a, x)", 1),
        ("lambda.a*c", 0),
        ("abs(x')*lambda.a", 0),
        ("sqrt(lambda.a^2 + c)", 0),
        ("sqrt(max(lambda.a, 0))", 0),
        ("max(lambda.a, 0)^1.5 + abs(lambda.b)", 1),
    ],
)
def test_comparisons_of_forces_are_replaced(law: str, count: int) -> None:
    """Not those of the state, nor those beyond which a function is undefined."""
    assert signed(law)[1].signs == count


@pytest.mark.parametrize(
    ("law", "one_side", "other_side"),
    [
        ("c*abs(lambda.a)", lambda a, b: 3 * a, lambda a, b: -3 * a),
        ("max(a_ - b_, 0)", lambda a, b: a - b, lambda a, b: 0.0),
        ("min(-a_, b_)", lambda a, b: -a, lambda a, b: b),
        ("if(a_ >= 2*b_, a_, 5)", lambda a, b: a, lambda a, b: 5.0),
    ],
)
def test_laws_are_smooth_with_a_fixed_sign(law: str, one_side, other_side) -> None:  # type: ignore[no-untyped-def]
    """Each sign selects one of two expressions, whatever the multipliers are."""
    found, laws = signed(law.replace("a_", "lambda.a").replace("b_", "lambda.b"))
    assert found.switching is not None
    assert found.switching.forces is not None
    assert laws.forces is not None
    original, replaced = ScalarTape(found.switching.forces), ScalarTape(laws.forces)
    function = ScalarTape(laws.functions)
    rng = np.random.default_rng(1)
    for _ in range(50):
        a, b = rng.normal(size=2).tolist()
        before, p = [0.0] * 10, found.dynamics.inputs - 7
        values = {s: replaced((*before, a, b, s, *[3.0] * p))[0] for s in (1.0, -1.0)}
        expected = {one_side(a, b), other_side(a, b)}
        assert set(values.values()) == expected or sorted(values.values()) == pytest.approx(
            sorted(expected)
        )
        g = function((*before, a, b, 1.0, *[3.0] * p))
        assert values[-1.0 if g[0] < 0 else 1.0] == original((*before, a, b, *[3.0] * p))[0]
        assert g[1] >= abs(g[0])


def test_a_function_follows_the_signs_of_those_within() -> None:
    """|λ| − c is smooth where λ changes its sign."""
    _, laws = signed("abs(abs(lambda.a) - c)")
    function = ScalarTape(laws.functions)
    values = {
        (a, s): function((*[0.0] * 10, a, 0.0, s, 1.0, 3.0))[1]
        for a in (2.0, -2.0)
        for s in (1.0, -1.0)
    }
    assert values == {(2.0, 1.0): -1.0, (2.0, -1.0): -5.0, (-2.0, 1.0): -5.0, (-2.0, -1.0): -1.0}
