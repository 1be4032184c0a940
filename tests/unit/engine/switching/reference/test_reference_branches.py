"""Branches of the reference engine: sides at an instant, and motions on surfaces."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.contract import Stop
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering import lower
from lagcli.engine.state import State
from lagcli.engine.switching.kinks import frozen_of
from lagcli.engine.switching.reference.branches import Branches
from lagcli.equations.derivation.lagrange import derive

ORIGIN = np.zeros(1)


def branches(force: str) -> tuple[Branches, Index1]:
    """Return the branches of a particle of mass 1 along x, at rest at 0, and its motion."""
    text = f"coordinates: [x]\nT: x'^2/2\nQ: {{x: \"{force}\"}}\ninitial: {{x: 0, x': 0}}\n"
    frozen = frozen_of(lower(derive(lagcli.load_text(text))))
    assert frozen is not None
    full = Evaluator(frozen.system, frozen.frozen(State(0.0, ORIGIN, ORIGIN)).p)
    return Branches(frozen, full, 1.0), Index1(full, 0)


@pytest.mark.parametrize(("force", "side"), [("1 - abs(x')*x'", 1), ("-1 - abs(x')*x'", -1)])
def test_from_rest_the_side_is_that_of_the_motion(force: str, side: int) -> None:
    found, motion = branches(force)
    found.choose(0.0, ORIGIN, ORIGIN, motion.accelerations)
    assert found.sides == (side,)
    assert found.slides is None
    assert found.watched() == [(0, side < 0)]


def test_a_force_below_friction_sticks() -> None:
    found, motion = branches("3 - if(x' > 0, 5, -5)")
    found.choose(0.0, ORIGIN, ORIGIN, motion.accelerations)
    assert found.slides == 0
    assert found.weight == pytest.approx(0.8)  # 3 − 5 (2 w − 1) = 0
    a, _, power = found.combined(0, 0.0, ORIGIN, ORIGIN, motion.accelerations)
    assert a == pytest.approx([0], abs=1e-14)
    assert power == 0
    assert found.watched() == [(0, False), (0, True)]
    assert found.distance(found.values(0.0, ORIGIN, ORIGIN), 0, True) == pytest.approx(0.2)
    v = found.held(0.0, ORIGIN, np.array([1e-9]), motion.accelerations)
    assert v == pytest.approx([0], abs=1e-20)


def test_a_motion_leaves_a_surface_to_the_side_that_ends() -> None:
    found, motion = branches("3 - if(x' > 0, 5, -5)")
    found.choose(0.0, ORIGIN, ORIGIN, motion.accelerations)
    found.reach(0, True)
    found.choose(0.0, ORIGIN, ORIGIN, motion.accelerations)
    assert (found.slides, found.sides) == (None, (1.0,))
    assert found.crossed == 0


def test_whole_parts_end_in_both_directions() -> None:
    found, motion = branches("floor(x)")
    at = np.array([1.5])
    found.choose(0.0, at, ORIGIN, motion.accelerations)
    assert found.sides == (1.0,)
    values = found.values(0.0, at, ORIGIN)
    assert [found.distance(values, 0, up) for up in (False, True)] == [0.5, 0.5]
    found.reach(0, True)
    found.choose(0.0, np.array([2.0]), np.ones(1), motion.accelerations)
    assert found.sides == (2.0,)


def test_forces_that_push_away_on_both_sides_are_rejected() -> None:
    found, motion = branches("if(x' > 0, 1, -1)")
    with pytest.raises(Stop, match="two motions are possible"):
        found.choose(0.0, ORIGIN, ORIGIN, motion.accelerations)
