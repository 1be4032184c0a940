"""Messages for the compiled engine's statuses at contacts, from `stops`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lagcli.engine.contract import EventEntry, Stop
from lagcli.engine.core.status import Status
from lagcli.engine.switching import stops
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.switching.switching import RowMode


def refusal(
    split: SplitSystem, status: int, core: Any, impacts: str, log: Sequence[EventEntry]
) -> Stop | None:
    """Return the end of a run at a contact; None if its steps become small for another reason.

    Parameters
    ----------
    split : SplitSystem
    status : Status
        Status of the core.
    core : binding.SwitchingIntegrator
    impacts : str
        The law of impacts.
    log : sequence of EventEntry
        Number of occurrences so far.
    """
    t, rows = core.t, split.switching.rows
    names = [split.system.constraints[k] for k in split.rows]
    if status == Status.ENDLESS:
        return stops.endless(t, split.system, log)
    if status == Status.VIOLATED:
        depth = {i: -core.contacts[0][i] for i, row in enumerate(rows) if row.sign}
        deepest = max(depth, key=lambda i: depth[i])
        return stops.sets_violation(t, names[deepest], depth[deepest], rows[deepest])
    if status in (Status.GAINS, Status.NO_IMPACT):
        contacts = [names[i] for i in core.struck if i < len(rows) and rows[i].sign]
        if status == Status.NO_IMPACT:
            return stops.no_impact(t, contacts)
        return stops.gains_energy(t, contacts, core.gain[0], impacts, *core.gain[1:])
    if status in (Status.JAMMED, Status.FLOOR):
        slipping = [row for row, mode in zip(rows, core.modes, strict=False) if RowMode(mode).slips]
        if status == Status.FLOOR and not stops.jamming(core.margin, slipping):
            return None
        return stops.jams(t, split.system, slipping)
    taking, problem, motions = core.problem
    failure = stops.two_motions if motions else stops.no_motion
    return failure(t, [names[i] for i in taking], problem, motions)
