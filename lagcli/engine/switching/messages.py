"""Why a run with contacts stops, for the user."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lagcli.engine.contract import EventEntry
from lagcli.engine.core.status import Status
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.system import System

#: Gap of a contact that is named.
_TOUCHING = 1e-6


def no_end(system: System, t: float, log: Sequence[EventEntry]) -> str:
    """Return the message for an instant whose events do not end."""
    assert system.switching is not None
    rules, names = system.switching.events, system.constraints
    last = [
        rules[e.which].name if e.occurrence == "event" else f"{names[e.which]} {e.occurrence}"
        for e in log
        if e.time >= t
    ]
    listed = ", ".join(f"`{name}`" for name in dict.fromkeys(last[-6:]))
    return f"events do not end at t = {t:.9g} s" + (f": {listed}" if listed else "")


def refusal(split: SplitSystem, status: int, core: Any, impacts: str) -> str:
    """Return the message for a contact problem without one solution.

    Parameters
    ----------
    split : SplitSystem
    status : Status
        Of the core.
    core : binding.SwitchingIntegrator
    impacts : str
        The law of impacts.
    """
    t, gaps = core.t, core.contacts[0]
    names = [split.system.constraints[k] for k in split.rows]
    contacts = [i for i, row in enumerate(split.switching.rows) if row.limit is None]
    contacts += range(len(split.switching.rows), len(names))
    touching = [f"`{names[i]}`" for i in contacts if abs(gaps[i]) <= _TOUCHING]
    where = ", ".join(touching) or "the contacts"
    if status == Status.GAINS:
        law = "sequential impacts" if impacts == "sequential" else f"{impacts.capitalize()}'s law"
        return (
            f"an impact at t = {t:.9g} s would gain {core.gained:.3g} J ({law} with friction):"
            " use `impacts: poisson`"
        )
    if status == Status.JAMMED:
        return (
            f"the force at {where} grows without bound while it slides at t = {t:.9g} s"
            " (dynamic jam); the motion beyond is not determined"
        )
    if status == Status.TWO_MODES:
        return f"two motions are possible at {where} at t = {t:.9g} s (Painlevé)"
    if status == Status.NO_MODE:
        return f"no motion is possible at {where} at t = {t:.9g} s (Painlevé)"
    return f"the impact at t = {t:.9g} s has no solution"
