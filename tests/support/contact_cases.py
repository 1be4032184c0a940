"""The cases of contact, friction and events in tests/benchmark/contact, run by the core."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lagcli.arrays import Array
from lagcli.engine.contract import Block, Outcome
from lagcli.engine.event_entries import EventEntry, Occurrence
from lagcli.engine.integrate.engine import integrate
from lagcli.engine.system import System
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare

FOLDER = Path(__file__).parent.parent / "benchmark" / "contact"


def read_case(name: str) -> dict[str, Any]:
    """Return a case: its model, and values by quantity."""
    case: dict[str, Any] = yaml.safe_load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"))
    case["reference"] = {x["quantity"]: float(x["value"]) for x in case["reference"]}
    return case


def contact_model(name: str, **changes: Any) -> Model:
    """Return the model of a case.

    Parameters
    ----------
    name : str
    **changes
        Values of parameters, or mappings that replace entries of a section.
    """
    described = read_case(name)["model"]
    for key, value in changes.items():
        if isinstance(value, dict):
            described[key] = {**described.get(key, {}), **value}
        else:
            described["parameters"][key] = value
    return load_text(yaml.safe_dump(described, allow_unicode=True, sort_keys=False), name)


@dataclass
class ContactRun:
    """The run of a model: its samples, its entries, and how it ended."""

    model: Model
    system: System
    outcome: Outcome
    rows: Array

    @cached_property
    def block(self) -> Block:
        """The samples."""
        return Block.of_rows(self.rows, self.system.sample_layout)

    def at(self, t: float, name: str) -> float:
        """Return a coordinate, velocity or multiplier (``lambda.NAME``) at a sample time."""
        (k,) = np.flatnonzero(self.block.time == t)
        if name.startswith("lambda."):
            return float(self.block.multipliers[k, self.row(name.removeprefix("lambda."))])
        values = self.block.v if name.endswith("'") else self.block.q
        return float(values[k, self.system.coordinates.index(name.removesuffix("'"))])

    def row(self, name: str) -> int:
        """Return the number of a constraint."""
        return self.system.constraints.index(name)

    def entries(self, occurrence: Occurrence, name: str | None = None) -> list[EventEntry]:
        """Return the entries of a kind, of a constraint or an event."""
        events = [] if self.system.switching is None else self.system.switching.events
        names = [x.name for x in events] if occurrence == "event" else self.system.constraints
        found = [x for x in self.outcome.events if x.occurrence == occurrence]
        return [x for x in found if name is None or names[x.which] == name]

    def value(self, entry: EventEntry, name: str, before: bool = False) -> float:
        """Return a coordinate or velocity at an entry; velocities are those after it."""
        place = self.system.coordinates.index(name.removesuffix("'"))
        if not name.endswith("'"):
            return float(entry.q[place])
        return float((entry.before if before else entry.after)[place])

    def impulse(self, entry: EventEntry, name: str) -> float:
        """Return the impulse of a constraint at an entry."""
        return float(entry.impulse[self.row(name)])


def run_contact(model: Model, **settings: Any) -> ContactRun:
    """Run a model with DOP853."""
    given = SettingsOverrides(**{"method": "DOP853", "rtol": 1e-12, **settings})
    simulation = prepare(model, given)
    blocks: list[Array] = []
    outcome = integrate(
        simulation.system, simulation.request, lambda x: blocks.append(np.column_stack(x))
    )
    width = simulation.system.sample_layout.size
    rows = np.vstack(blocks) if blocks else np.empty((0, width))
    return ContactRun(model, simulation.system, outcome, rows)


def run_case(name: str, **settings: Any) -> ContactRun:
    """Run the model of a case as it is."""
    return run_contact(contact_model(name), **settings)
