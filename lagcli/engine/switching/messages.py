"""Messages for the core's statuses at contacts, from `stops`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lagcli.engine.contract import EventEntry, Occurrence, Stop
from lagcli.engine.core.status import Status
from lagcli.engine.switching import stops
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.switching.switching import RowMode, SwitchedRow


def refusal(
    split: SplitSystem,
    status: int,
    core: Any,
    impacts: str,
    log: Sequence[EventEntry],
    branches: Sequence[Sequence[str]] = (),
) -> Stop | None:
    """Return the end of a run at a contact; None if its steps become small for another reason.

    Parameters
    ----------
    split : SplitSystem
    status : Status
        Status of the core.
    core : SwitchingIntegrator
    impacts : str
        The law of impacts.
    log : sequence of EventEntry
    branches : sequence of sequences of str
        Names on which each branch depends that changes at the instant.
    """
    t, rows = core.t, split.switching.rows
    names = [split.system.constraints[k] for k in split.rows]
    if status == Status.ENDLESS:
        return stops.endless(t, split.system, log, _unlogged(names, rows, core, branches))
    if status == Status.VIOLATED:
        depth = {i: -core.contacts[0][i] for i, row in enumerate(rows) if row.sign}
        deepest = max(depth, key=lambda i: depth[i])
        return stops.sets_violation(t, names[deepest], depth[deepest], rows[deepest])
    if status in (Status.GAINS, Status.NO_IMPACT):
        struck = {i: i < len(rows) and rows[i].sign for i in core.struck if not _slips(rows, i)}
        contacts = [names[i] for i, unilateral in struck.items() if unilateral]
        contacts = contacts or [names[i] for i in struck]
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


def ending(split: SplitSystem, status: int, core: Any) -> tuple[Occurrence, int] | None:
    """Return the log's last entry for a run that ends at a contact: its kind, and the constraint.

    None if the motion is unique, as where an impact would gain energy.
    """
    if status in (Status.JAMMED, Status.FLOOR):
        rows = zip(split.switching.rows, core.modes, strict=False)
        return "jams", stops.jammed([row for row, mode in rows if RowMode(mode).slips])
    if status in (Status.NO_MODE, Status.TWO_MODES):
        taking, problem, motions = core.problem
        kind: Occurrence = "two motions" if motions else "no motion"
        return kind, split.rows[taking[stops.bearing(problem)]]
    if status == Status.NO_IMPACT:
        return "no motion", split.rows[core.struck[0]]
    return None


def _slips(rows: Sequence[SwitchedRow], i: int) -> bool:
    """Return whether a row of the layer is one of friction, or another with a limit."""
    return i < len(rows) and rows[i].limit is not None


def _unlogged(
    names: Sequence[str],
    rows: Sequence[SwitchedRow],
    core: Any,
    branches: Sequence[Sequence[str]],
) -> list[str]:
    """Return what may repeat at an instant without an entry in the log."""
    gaps, speeds, _ = core.contacts
    approaching = [
        f"`{name} impacts`"
        for i, name in enumerate(names)
        if not _slips(rows, i)
        and (speeds[i] < 0.0 if i < len(rows) and rows[i].sign else speeds[i] != 0.0)
        and gaps[i] <= core.no_gap(i)
    ]
    changes = (", ".join(f"`{name}`" for name in of) or "time" for of in branches)
    return approaching + [f"a branch of {of} changes" for of in dict.fromkeys(changes)]
