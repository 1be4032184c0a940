"""Why derivatives end, in words."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.engine.lowering import lower
from lagcli.engine.sensitivity.losses import Loss, why_lost
from lagcli.engine.switching.splitting import SplitSystem
from tests.support.switching_models import BLOCK

#: Kinds of watched functions: the gap of a contact, the force of a row, a condition.
GAP, STICK, TIME = 0, 2, 9


@pytest.mark.parametrize(
    ("reason", "culprits", "words"),
    [
        (Loss.GRAZES, [(GAP, 0)], "`floor` is only touched, without a rate"),
        (Loss.SHARES, [(STICK, 1)], "`floor.slip` shares its force with others"),
        (Loss.COINCIDE, [(GAP, 0), (TIME, 0)], "`floor` and `tick` occur simultaneously"),
        (Loss.CLOSE_TOGETHER, [(GAP, 0)], "contacts close simultaneously there, `floor` among"),
        (Loss.RESTS, [(GAP, 0)], "infinitely many impacts of `floor` end there"),
        (Loss.ONLY_HERE, [(GAP, 0)], "`floor` holds there only for this value"),
        (Loss.WITHIN_TOLERANCE, [(GAP, 0)], "`floor` holds from there on within a tolerance"),
        (Loss.UNKNOWN, [], "they have no finite value"),
    ],
)
def test_each_reason_names_its_culprits(
    reason: Loss, culprits: list[tuple[int, int]], words: str
) -> None:
    split = SplitSystem(lower(lagcli.derive(lagcli.load_text(BLOCK))))
    assert why_lost(split, None, reason, culprits).startswith(words)
