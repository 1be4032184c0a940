"""Why a motion that switches has no derivatives from an instant on: the core's reasons in words."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from lagcli.engine.switching.kinks import FrozenSystem
from lagcli.engine.switching.splitting import SplitSystem


class Loss(IntEnum):
    """The reasons: ``lag_reason`` in core/derivatives/derivatives.h."""

    UNKNOWN = 0
    GRAZES = 1
    SHARES = 2
    COINCIDE = 3
    CLOSE_TOGETHER = 4
    RESTS = 5
    ONLY_HERE = 6
    WITHIN_TOLERANCE = 7


#: Kinds of watched functions that are not of rows: ``lag_watched`` in core/switching/switching.h.
_KINKS, _FIRST_CONDITION = (6, 7), 8


def why_lost(
    split: SplitSystem,
    frozen: FrozenSystem | None,
    reason: int,
    culprits: Sequence[tuple[int, int]],
) -> str:
    """Return why there is no derivative.

    Parameters
    ----------
    split : SplitSystem
    frozen : FrozenSystem or None
        With the kinks, if there are any.
    reason : int
        `Loss`.
    culprits : sequence of (int, int)
        Kinds and numbers of the functions that it is about.
    """
    names = [*dict.fromkeys(_name(split, frozen, what, which) for what, which in culprits)]
    first = names[0] if names else ""
    if reason == Loss.GRAZES:
        return f"{first} is only touched, without a rate, and the time has no derivative"
    if reason == Loss.SHARES:
        return f"{first} shares its force with others, so that the time has no derivative"
    if reason == Loss.COINCIDE:
        return f"{' and '.join(names)} occur simultaneously, and their order decides what follows"
    if reason == Loss.CLOSE_TOGETHER:
        return f"contacts close simultaneously there, {first} among them, and their order decides"
    if reason == Loss.RESTS:
        return f"infinitely many impacts of {first} end there"
    if reason == Loss.ONLY_HERE:
        return f"{first} holds there only for this value"
    if reason == Loss.WITHIN_TOLERANCE:
        return f"{first} holds from there on within a tolerance, and not exactly"
    return "they have no finite value"


def _name(split: SplitSystem, frozen: FrozenSystem | None, what: int, which: int) -> str:
    if what in _KINKS:
        assert frozen is not None
        names = frozen.kinks[which].names or ("t",)
        return "the kink of a function of " + ", ".join(f"`{name}`" for name in names)
    if what < _FIRST_CONDITION:
        return f"`{split.system.constraints[split.rows[which]]}`"
    rules = split.switching.events
    return f"`{next(rule.name for rule in rules if rule.condition == which)}`"
