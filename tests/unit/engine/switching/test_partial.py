"""Functions that are undefined beyond a kink: which comparisons are not frozen because of them."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.engine.lowering.lower import lower
from lagcli.engine.switching.kinks import RELATIONS, frozen_of
from lagcli.engine.switching.partial import PartialFunctions
from lagcli.engine.system import System
from lagcli.engine.tape.operations import ARITY
from lagcli.equations.derivation.lagrange import derive


def system(force: str) -> System:
    """Return a particle in a plane with a force along x."""
    text = (
        "coordinates: [x, y]\nparameters: {m: 2, c: 3}\nT: m/2*(x'^2 + y'^2)\n"
        f"Q: {{x: \"{force}\"}}\ninitial: {{x: 1, y: 0, x': 0, y': 0}}\n"
    )
    return lower(derive(lagcli.load_text(text)))


@pytest.mark.parametrize(
    ("force", "count"),
    [
        ("c*max(-x, 0)^1.5", 0),  # the power of a negative number has no value
        ("if(x > 0, sqrt(x), 0)", 0),
        ("if(x > 0, sqrt(y), 0)", 1),
        ("if(x > 0, sqrt(x^2 + c^2), 0)", 1),
        ("log(abs(x)) + abs(y)", 1),
        ("cbrt(x)", 0),
        ("if(x > c, 1/(x - c), 0)", 0),  # the divisor vanishes at the kink
        ("if(x > 0, 1/(x + c), 0)", 1),
        ("if(x > 0, 1/y, 0)", 1),
        ("if(abs(x) < c, exp(-1/(1 - (x/c)^2)), 0)", 1),  # that of abs
        ("if(x > 5.02, exp(-0.01/(1 - (x - 4.02)^8)), 0)", 0),
        ("if(x^2 + y^2 < c^2, exp(-1/(c^2 - x^2 - y^2)^2), 0)", 0),
        ("if(sqrt(x^2 + y^2) < c, x/sqrt(x^2 + y^2), 0)", 1),
    ],
)
def test_branches_beside_which_functions_are_undefined_stay(force: str, count: int) -> None:
    found = frozen_of(system(force))
    assert len(found.kinks if found else ()) == count


def test_comparisons_are_told_apart() -> None:
    """Of two comparisons, the one whose branch has the pole."""
    tape = system("if(x > c, 1/(x - c), 0) + if(y > c, 1/(x - c), 0)").dynamics
    needs: list[frozenset[int]] = []
    partial, state = PartialFunctions(needs, tape, 5), {i: frozenset((i,)) for i in range(5)}
    for op, to, *rest in tape.code:
        operands = rest[: ARITY[op]]
        state[to] = frozenset().union(*(state.get(x, frozenset()) for x in operands))
        if op in RELATIONS:
            partial.comparison(to, len(needs))
            needs.append(state[to])
        partial.operation(op, to, operands, state[to])
    (x,) = partial.excluded
    assert len(needs) == 2
    assert needs[x] == frozenset((1,))
