"""Frozen branches: which comparisons are frozen, and that tapes are the same beside them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import lagcli
from lagcli.engine.lowering.lower import lower
from lagcli.engine.switching.kinks import (
    FrozenSystem,
    Kink,
    freeze,
    frozen_of,
    no_switching,
    side_of,
)
from lagcli.engine.system import State, System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.lagrange import derive


def model(force: str, rest: str = "") -> System:
    """Return a particle in a plane with a force along x."""
    text = (
        "coordinates: [x, y]\nparameters: {m: 2, c: 3}\nT: m/2*(x'^2 + y'^2)\n"
        f"Q: {{x: \"{force}\"}}\ninitial: {{x: 1, y: 0, x': 0, y': 0}}\n{rest}"
    )
    return lower(derive(lagcli.load_text(text)))


def frozen(force: str, rest: str = "") -> FrozenSystem:
    found = frozen_of(model(force, rest))
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("force", "kinks"),
    [
        ("-c*abs(x')", [(0, False, ("x'",))]),
        ("-c*sign(x' - y')", [(0, False, ("x'", "y'"))]),
        ("min(x, y)", [(0, False, ("x", "y"))]),
        ("if(t < c, 1, x)", [(0, True, ())]),
        ("floor(x) + ceil(y)", [(1, False, ("x",)), (-1, False, ("y",))]),
        ("abs(x) + sign(-x) + max(x, 0) + step(x)", [(0, False, ("x",))]),
        ("if(x > 0 and y > 1, x, y)", [(0, False, ("x",)), (0, False, ("y",))]),
        ("max(abs(x) - 1, 0)", [(0, False, ("x",)), (0, False, ("x",))]),
    ],
)
def test_each_surface_has_one_branch(force: str, kinks: list[Kink]) -> None:
    assert set(frozen(force).kinks) == set(kinks)
    assert len(frozen(force).kinks) == len(kinks)


@pytest.mark.parametrize("force", ["c*x^2", "abs(c)*x", "if(c > 1, x, y)", "max(m, c)"])
def test_comparisons_of_parameters_are_no_kinks(force: str) -> None:
    assert frozen_of(model(force)) is None


def test_a_frozen_system_is_the_same_on_its_branches() -> None:
    system = model("abs(x')*y + floor(x*c) - sign(y - x')", 'V: "max(x, y)*c*x"\n')
    kinks = freeze(system)
    assert kinks is not None
    rng = np.random.default_rng(5)
    for _ in range(50):
        q, v = rng.normal(size=(2, 2))
        state = State(0.3, q, v, (2.0, 3.0))
        on = kinks.frozen(state)
        inputs = (state.t, *q, *v)
        for name in ("dynamics", "constraint"):
            expected = ScalarTape(getattr(system, name))((*inputs, *state.p))
            found = ScalarTape(getattr(kinks.system, name))((*inputs, *on.p))
            assert found == expected
        assert system.variation is not None
        assert kinks.system.variation is not None
        more = (*inputs, *rng.normal(size=2))
        expected = ScalarTape(system.variation().tape)((*more, *state.p))
        assert ScalarTape(kinks.system.variation().tape)((*more, *on.p)) == expected


def test_a_frozen_branch_is_smooth_beyond_its_kink() -> None:
    found = frozen("abs(x)*y")
    at = found.frozen(State(0.0, np.array([1.0, 2.0]), np.zeros(2), (2.0, 3.0)))
    tape = ScalarTape(found.system.dynamics)
    force = [tape((0.0, x, 2.0, 0.0, 0.0, *at.p))[2] for x in (1.0, 0.0, -1.0)]
    assert force == [2.0, 0.0, -2.0]


@pytest.mark.parametrize(
    ("whole", "value", "side"),
    [(0, -2.0, -1), (0, 0.0, 1), (1, 1.5, 1), (1, -0.5, -1), (-1, 1.5, 2), (-1, 2.0, 2)],
)
def test_sides_of_values(whole: int, value: float, side: int) -> None:
    assert side_of(Kink(whole, False, ()), value) == side


def test_functions_follow_earlier_branches() -> None:
    found = frozen("max(abs(x) - 1, 0)")
    inputs = (0.0, -3.0, 0.0, 0.0, 0.0, 2.0, 3.0)
    values = ScalarTape(found.functions)
    # on the branch of x > 0, |x| is x
    assert values((*inputs, 1.0, 1.0))[:2] == [-3.0, -4.0]
    assert values((*inputs, -1.0, 1.0))[:2] == [-3.0, 2.0]
    assert found.frozen(State(0.0, np.array([-3.0, 0.0]), np.zeros(2), (2.0, 3.0))).p[2:] == (-1, 1)


def test_a_system_without_switches_has_an_empty_switching() -> None:
    system = model("x")
    switching = no_switching(system)
    assert switching.rows == ()
    assert ScalarTape(switching.limits)((0.0,) * switching.limits.inputs) == []
    assert frozen_of(dataclasses.replace(system, switching=switching)) is None
