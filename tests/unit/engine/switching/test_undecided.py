"""Redundant contacts that let go by multipliers of least norm."""

import numpy as np
import pytest

from lagcli.engine.contract import EventEntry
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering import lower
from lagcli.engine.switching.messages import lets_go_undecided
from lagcli.engine.switching.switching import RowMode
from lagcli.engine.switching.undecided import undecided
from lagcli.equations.derivation.lagrange import derive
from lagcli.model.loader import load_text

# a block on one foot with friction, or on two, one above the other
BLOCK = """
coordinates: [x, y]
parameters: {mu: 0.4}
T: (x'^2 + y'^2)/2
V: 10*y
constraints:
  one: {expr: y >= 0, friction: mu, slip: x'}
  two: {expr: 2*y >= 0, friction: mu, slip: x'}
initial: {x: 0, y: 0, x': 0, y': 0}
"""


@pytest.mark.parametrize(
    ("held", "occurrence", "found"),
    [
        (("one", "one.slip"), "slips", False),
        (("one", "one.slip", "two", "two.slip"), "slips", True),
        (("one", "two"), "opens", True),
        (("one", "one.slip", "two", "two.slip"), "event", False),
    ],
)
def test_what_lets_go_is_undecided_where_others_hold_the_same(
    held: tuple[str, ...], occurrence: str, found: bool
) -> None:
    system = lower(derive(load_text(BLOCK)))
    assert system.switching is not None
    names = [system.constraints[row.row] for row in system.switching.rows]
    modes = [int(RowMode.HOLDS) if name in held else int(RowMode.OPEN) for name in names]
    which = system.constraints.index("one.slip" if occurrence == "slips" else "one")
    nothing = np.zeros(2)
    entry = EventEntry(
        0.5,
        occurrence,
        which,
        nothing,
        nothing,
        nothing,
        np.zeros(4),
        0.0,
        0.0,
        0.0,
        np.array(modes),
    )  # type: ignore[arg-type]
    evaluator = Evaluator(system, (0.4,))
    answer = undecided(evaluator, system.switching, modes, [entry])
    assert (answer is entry) is found
    if found:
        assert "--engine scipy" in lets_go_undecided(system, entry)
