"""The log of a run: what happened at contacts and events, and the modes that follow from it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices

#: Modes of switched rows, as `lagcli.engine.switching.switching.RowMode` numbers them.
MODES = ("open", "holds", "forward", "backward")
#: What an entry may be.
KINDS = (
    *("closes", "opens", "slips", "sticks", "impact", "rest"),
    *("releases", "engages", "event"),
)


class Rest(NamedTuple):
    """The end of a sequence of impacts that has a limit in time.

    Parameters
    ----------
    name : str
        Of the constraint.
    time : float
        s.
    impacts : int
        How many of it there were since it last opened, or since the start.
    """

    name: str
    time: float
    impacts: int

    def __str__(self) -> str:
        impacts = f"{self.impacts} impact{'s' * (self.impacts != 1)}"
        return f"`{self.name}` came to rest at t = {self.time:.11g} s after {impacts}"


@dataclass(frozen=True, kw_only=True, eq=False)
class EventLog:
    """What happened at contacts and events during a run, in order.

    ne entries, one for each row and instant; nq coordinates, nc constraints, ns switched rows.

    Parameters
    ----------
    rows : tuple of ns str
        The constraints that switch.
    start : (ns,) array of int
        Their modes at the start, places in `MODES`.
    time : (ne,) array
        s.
    names : tuple of ne str
        The constraint; of kind "event", the event.
    kinds : tuple of ne str
        Among `KINDS`. "rest" ends a sequence of impacts that has a limit in time.
    q, before, after : (ne, nq) arrays
        The coordinates, and the velocities before and after the instant.
    impulse : (ne, nc) array
        Of all constraints at the instant, J s per unit of the constraint; 0 without an impact.
    loss : (ne,) array
        Energy that the entry's own impulse takes, −Λ (γ⁻ + γ⁺)/2 with its friction, J.
    supplied : (ne,) array
        Energy that moving constraints supply by their impulses, J.
    work : (ne,) array
        Work of the event's actions, J.
    modes : (ne, ns) array of int
        Modes of the switched rows after the entry.
    """

    rows: tuple[str, ...]
    start: Indices
    time: Array
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    q: Array
    before: Array
    after: Array
    impulse: Array
    loss: Array
    supplied: Array
    work: Array
    modes: Indices

    def __len__(self) -> int:
        return len(self.time)

    def check(self) -> None:
        """Raise ValueError unless times are in order, and kinds and modes are known."""
        if not np.isfinite(self.time).all() or (np.diff(self.time) < 0.0).any():
            raise ValueError("the times of events are not finite, or decrease")
        unknown = set(self.kinds) - set(KINDS)
        if unknown:
            raise ValueError(f"there is an event of the kind {min(unknown)!r}")
        for modes in (self.start, self.modes):
            if modes.size and not 0 <= modes.min() <= modes.max() < len(MODES):
                raise ValueError("there is a mode that is none")
        if len(set(self.rows)) < len(self.rows):
            raise ValueError("a row switches twice")

    def modes_at(self, time: Array) -> Indices:
        """Return the modes at given times, after what happens there.

        Parameters
        ----------
        time : (nt,) array
            s.

        Returns
        -------
        (nt, ns) array of int
            Places in `MODES`.
        """
        return np.vstack([self.start, self.modes])[np.searchsorted(self.time, time, side="right")]

    def counts(self) -> dict[str, dict[str, int]]:
        """Return how often what happened, by name and kind, in the order of the first time."""
        found: dict[str, dict[str, int]] = {}
        for (name, kind), count in Counter(zip(self.names, self.kinds, strict=True)).items():
            found.setdefault(name, {})[kind] = count
        return found

    def rests(self) -> list[Rest]:
        """Return the sequences of impacts that came to rest."""
        found, impacts = [], Counter[str]()
        for time, name, kind in zip(self.time.tolist(), self.names, self.kinds, strict=True):
            if kind == "impact":
                impacts[name] += 1
            elif kind == "rest":
                found.append(Rest(name, time, impacts[name]))
            if kind in ("rest", "opens"):
                impacts[name] = 0
        return found

    def total_impulse(self) -> Array:
        """Return the sum of the impulses of each constraint, (nc,).

        The entries of one impact all have its impulses, which count once.
        """
        again = np.zeros(len(self), dtype=bool)
        same = (self.impulse[1:] == self.impulse[:-1]).all(axis=1)
        again[1:] = same & (self.time[1:] == self.time[:-1])
        return np.asarray(self.impulse[~again].sum(axis=0))

    def to_mapping(self) -> dict[str, Any]:
        """Return what happened in short, as JSON values.

        ``entries``, their number; ``counts`` by name and kind; ``rests`` (name, time, impacts);
        ``loss``, ``supplied`` and ``work``, the sums.
        """
        return {
            "entries": len(self),
            "counts": self.counts(),
            "rests": [rest._asdict() for rest in self.rests()],
            "loss": float(self.loss.sum()),
            "supplied": float(self.supplied.sum()),
            "work": float(self.work.sum()),
        }

    def instants(self, name: str, kind: str) -> Array:
        """Return the times of entries of a name and kind, s."""
        chosen = [
            i for i, of in enumerate(zip(self.names, self.kinds, strict=True)) if of == (name, kind)
        ]
        return np.asarray(self.time[chosen])


def event_sentences(found: Mapping[str, Any]) -> list[str]:
    """Return what happened in a run for people, from `EventLog.to_mapping`.

    Counts by constraint and event, notes on sequences of impacts that came to rest, and the energy.
    """
    if not found["entries"]:
        return ["nothing happened at contacts and events"]
    counts = (
        f"{name}: " + ", ".join(f"{kind} {count}" for kind, count in kinds.items())
        for name, kinds in found["counts"].items()
    )
    sentences = ["; ".join(counts)]
    sentences += [f"note: {Rest(**rest)}" for rest in found["rests"]]
    energy = [
        f"{what} {found[name]:.6g} J"
        for name, what in (
            ("loss", "impacts took"),
            ("supplied", "moving constraints supplied"),
            ("work", "events did work of"),
        )
        if found[name]
    ]
    return sentences + [", ".join(energy)] * bool(energy)
