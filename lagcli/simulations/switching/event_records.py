"""Recorded columns of events: values right before and right after each instant."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import SAMPLED, column_names
from lagcli.engine.contract import Block, OneSidedLimits
from lagcli.engine.switching.switching import EventRule
from lagcli.engine.system import System
from lagcli.simulations.derived import DerivedColumns
from lagcli.trajectory.event_log import NOTHING_RECORDED, EventRecords
from lagcli.trajectory.samples import Samples


def event_records(
    system: System,
    derived: DerivedColumns,
    limits: Sequence[OneSidedLimits],
    rules: Sequence[EventRule],
) -> EventRecords:
    """Return the recorded columns of events.

    Parameters
    ----------
    system : System
    derived : DerivedColumns
        The evaluator that completed the samples of the run; it is not changed.
    limits : sequence of OneSidedLimits
        Limits of the events that record something.
    rules : sequence of EventRule
        Names of columns to record for each limit.
    """
    if not limits:
        return NOTHING_RECORDED
    left = _columns(system, derived, [(x.left, x.left_p) for x in limits])
    right = _columns(system, derived, [(x.right, x.right_p) for x in limits])
    every = tuple(name for name in left if name not in _TIMES)
    asked = [every if rule.record is None else rule.record for rule in rules]
    named = dict.fromkeys(name for names in asked for name in names)
    columns = tuple(sorted(named, key=[*left, *named].index))
    recorded = np.array([[name in names for name in columns] for names in map(set, asked)])
    nothing = np.zeros(len(limits))  # a constraint's force on a coordinate that it does not act on
    before, after = (
        np.where(
            recorded,
            np.column_stack([found.get(name, nothing) for name in columns]),
            np.nan,
        )
        for found in (left, right)
    )
    return EventRecords(
        columns=columns,
        entry=np.array([x.entry for x in limits], dtype=np.intp),
        before=before,
        after=after,
    )


#: Names of the time, which every entry has.
_TIMES = ("t", "time")


def _columns(
    system: System, derived: DerivedColumns, states: Sequence[tuple[Array, tuple[float, ...]]]
) -> dict[str, Array]:
    """Return all columns of sample rows, by name, with the parameters of each."""
    parts = []
    for p, group in groupby(states, key=lambda state: state[1]):
        own = copy.copy(derived)
        own.p = p
        with np.errstate(all="ignore"):  # NaN if a and lambda are unknown
            samples = own(Block.of_rows(np.array([x for x, _ in group]), system.sample_layout))
        parts.append(_named(samples))
    found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return found | {"time": found["t"]}


def _named(samples: Samples) -> dict[str, Array]:
    """Return the columns of samples by their names in CSV files."""
    coordinates, constraints, terms = samples.coordinates, samples.constraints, samples.terms
    pairs = [
        (constraints[c], coordinates[q])
        for c, q in zip(terms.constraint, terms.coordinate, strict=True)
    ]
    found: dict[str, Array] = {}
    for quantity in SAMPLED:
        names = column_names(quantity, coordinates, constraints, pairs, samples.conserved_names)
        values = getattr(samples, quantity.name).reshape(len(samples.time), len(names))
        found |= zip(map(str, names), values.T, strict=True)
    return found | dict(samples.outputs)
