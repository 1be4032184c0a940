"""Assignment of curves to the panels of a plot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from lagcli.columns import ColumnName
from lagcli.errors import UsageError
from lagcli.model.names.members import split_names
from lagcli.pictures.plots.curves import Catalogue, Curve
from lagcli.pictures.scale_groups import scale_groups


class Panel(NamedTuple):
    """Curves as functions of time, or pairs of curves.

    Parameters
    ----------
    curves : tuple of Curve
        Curves of the vertical axis.
    over : tuple of Curve
        Curves of the horizontal axis; empty for the time.
    joined : bool
        Whether the user joined the curves.
    """

    curves: tuple[Curve, ...]
    over: tuple[Curve, ...] = ()
    joined: bool = False

    @property
    def log(self) -> bool:
        """Whether the panel's axis is logarithmic."""
        return not self.over and all(c.log for c in self.curves)

    @property
    def alike(self) -> bool:
        """Whether both axes are lengths and need equal scales."""
        pairs = list(zip(self.curves, self.over, strict=False))
        lengths = all(a.unit == b.unit == "m" for a, b in pairs)
        unknown = all(a.unit == b.unit == "" and a.field == b.field == "q" for a, b in pairs)
        return bool(pairs) and (lengths or unknown)


def asked(catalogue: Catalogue, names: Iterable[str]) -> list[Panel]:
    """Return the panels of the names on a command line.

    Names of one kind and unit share a panel; so do those joined by commas, of any kind. ``a:b`` is
    b over a.

    Raises
    ------
    UsageError
        A name is unknown.
    """
    together: dict[object, list[Curve]] = {}
    phases: list[Panel] = []
    for place, text in enumerate(names):
        parts = [part for part in split_names(text) if part]
        pairs = [part for part in parts if ":" in part]
        if not parts:
            raise UsageError(f"{text!r} names nothing to plot")
        if pairs and len(pairs) < len(parts):
            raise UsageError(
                f"{text!r} mixes quantities drawn over time with others; give them separately"
            )
        if pairs:
            phases.append(_phase(catalogue, pairs))
            together[place] = []
            continue
        found = [curve for part in parts for curve in catalogue.find(part)]
        if len(parts) > 1:
            together[place] = found
            continue
        for curve in found:
            together.setdefault((curve.group, curve.unit, curve.log), []).append(curve)
    panels = []
    for key, curves in together.items():
        if curves:
            panels.append(Panel(tuple(dict.fromkeys(curves)), joined=isinstance(key, int)))
        elif isinstance(key, int):
            panels.append(phases.pop(0))
    return panels


def _phase(catalogue: Catalogue, pairs: Sequence[str]) -> Panel:
    over, up = [], []
    for pair in pairs:
        ends = pair.split(":")
        if len(ends) != 2 or not all(end.strip() for end in ends):
            raise UsageError(f"{pair!r} is not a pair of curves; write x:y, which draws y over x")
        first, second = (catalogue.find(end) for end in ends)
        if len(first) != len(second):
            raise UsageError(f"{pair!r} pairs {len(first)} curves with {len(second)}")
        over += first
        up += second
    return Panel(tuple(up), tuple(over))


def usual(catalogue: Catalogue) -> list[Panel]:
    """Return the default panels: coordinates, multipliers and energies."""
    run = catalogue.run
    names = [
        *run.coordinates,
        *(str(ColumnName("multipliers", c)) for c in run.constraints),
        *("energy_kinetic", "energy_potential", "energy_total"),
    ]
    return asked(catalogue, names)


def split_by_scale(panels: Iterable[Panel], largest: Mapping[str, float]) -> list[Panel]:
    """Return panels without curves that are too small to be visible next to the others.

    Panels with curves joined by the user are unchanged.

    Parameters
    ----------
    panels : iterable of Panel
    largest : mapping of str to float
        The largest magnitude of each curve, by its name.
    """
    found: list[Panel] = []
    for panel in panels:
        if panel.over or panel.log or panel.joined:
            found.append(panel)
            continue
        groups = scale_groups([largest[c.name] for c in panel.curves])
        found += [Panel(tuple(panel.curves[i] for i in group)) for group in groups]
    return found
