"""Errors of event times over rtol for contact cases with closed forms: a figure of docs/contact.md.

    python -m tests.benchmark.contact_convergence [FIGURE]

Each case of tests/benchmark/contact runs with rtol from 1e-3 to 1e-13; an error is
the distance of an event's time from its closed form. Prints the table and writes the figure.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from lagcli.arrays import Array
from lagcli.engine.event_entries import Occurrence
from lagcli.pictures.style import PALETTE
from tests.support.contact_cases import ContactRun, contact_model, read_case, run_contact

FIGURE = Path(__file__).parents[2] / "docs" / "contact_convergence.png"
TOLERANCES = tuple(10.0**-k for k in range(3, 14))
#: Below this errors are drawn at it.
LEAST = 1e-17


class TimedEvent(NamedTuple):
    """One event of a case: the quantity of the reference, and the entry of the log it is."""

    case: str
    quantity: str
    occurrence: Occurrence
    row: str | None
    place: int
    label: str


EVENTS = (
    TimedEvent("bouncing_ball", "t of impact 10", "impact", "floor", 9, "bouncing ball, impact 10"),
    TimedEvent("rocking_block", "t of impact 10", "impact", None, 9, "rocking block, impact 10"),
    TimedEvent("backlash", "t of impact 5 (front)", "impact", "front", 4, "backlash, impact 5"),
    TimedEvent("rope_pendulum", "t of opening.rope", "opens", "rope", 0, "rope, goes slack"),
    TimedEvent("rope_pendulum", "t of impact.rope", "impact", "rope", 0, "rope, becomes taut"),
    TimedEvent("sliding_ladder", "t of opening.wall", "opens", "wall", 0, "ladder leaves the wall"),
    TimedEvent(
        "coulomb_oscillator", "t of sticking", "sticks", None, 0, "Coulomb friction, sticks"
    ),
    TimedEvent("bowling_ball", "t of rolling", "sticks", "lane.slip", 0, "bowling ball rolls"),
    TimedEvent("clutch", "t of locking", "sticks", "clutch", 0, "clutch locks"),
)


def error(event: TimedEvent, found: ContactRun, reference: float) -> float:
    """Return the error of an event's time, s; NaN if it did not happen."""
    entries = found.entries(event.occurrence, event.row)
    return abs(entries[event.place].time - reference) if len(entries) > event.place else np.nan


def errors(tolerances: Sequence[float], say: Callable[[str], None]) -> Array:
    """Return the errors of all events, (tolerances, events), s."""
    found = np.full((len(tolerances), len(EVENTS)), np.nan)
    cases = dict.fromkeys(event.case for event in EVENTS)
    for case in cases:
        described = read_case(case)
        for i, rtol in enumerate(tolerances):
            # few samples: they do not limit the steps
            done = run_contact(contact_model(case, simulation={"samples": 2}), rtol=rtol)
            for k, event in enumerate(EVENTS):
                if event.case == case:
                    found[i, k] = error(event, done, described["reference"][event.quantity])
        say(case)
    return found


def draw(values: Array, path: Path) -> None:
    """Write the figure."""
    with mpl.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(7, 4), layout="constrained")
        panel = figure.subplots()
        for k, event in enumerate(EVENTS):
            style, color = ("o-", "s--")[k // len(PALETTE)], PALETTE[k % len(PALETTE)]
            shown = np.fmax(values[:, k], LEAST)
            panel.loglog(TOLERANCES, shown, style, c=color, ms=3.5, lw=1.2, label=event.label)
        panel.loglog(TOLERANCES, TOLERANCES, ":", color="#777777", lw=1, label="rtol · 1 s")
        panel.set_xlabel("rtol")
        panel.invert_xaxis()
        panel.grid(alpha=0.25)
        panel.set_ylabel("error of the event's time, s")
        lines, labels = panel.get_legend_handles_labels()
        figure.legend(lines, labels, loc="outside right center", frameon=False)
        figure.savefig(path, dpi=110)


def main() -> None:
    """Print the errors, and write the figure."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else FIGURE
    found = errors(TOLERANCES, lambda text: print(text, file=sys.stderr))
    print(f"{'rtol':32}" + "".join(f"{rtol:9.0e}" for rtol in TOLERANCES))
    for k, event in enumerate(EVENTS):
        print(f"{event.label:32}" + "".join(f"{x:9.1e}" for x in found[:, k]))
    draw(found, path)


if __name__ == "__main__":
    main()
