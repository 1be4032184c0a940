"""Events with clocks, as of sampled controllers, which analyses of small motions leave out."""

from __future__ import annotations

from lagcli.model.model import EventAction, Model
from lagcli.model.names.members import families


def clocked_notes(model: Model) -> tuple[str, ...]:
    """Return a note on each clocked event that acts on the motion.

    Equilibria and linear models are those of the equations between the events, with the parameters
    at their values at the start.
    """
    return tuple(
        f"event `{event.name}`, {event.when}, is left out, and what it sets keeps its value: the"
        f" motion with it ({acts}) may be stable where this is not, and unstable where this is"
        " stable"
        for event in model.events
        if event.clock is not None and (acts := _acts(event.action))
    )


def _acts(action: EventAction) -> str:
    parts = {
        "set ": families(action.set),
        "impulse on ": families(action.impulse),
        "release ": families(action.release),
        "engage ": families(action.engage),
    }
    return "; ".join(f"{what}{', '.join(names)}" for what, names in parts.items() if names)
