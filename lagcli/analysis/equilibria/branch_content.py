"""Bifurcation diagrams as JSON values, as text and as files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lagcli.analysis.equilibria.description import held_text, shown_verdict
from lagcli.analysis.equilibria.diagram import BifurcationDiagram, Branch, SpecialPoint
from lagcli.analysis.local.contact_text import contact_lines, describe_contacts
from lagcli.analysis.text import entry, listed, without_rounding
from lagcli.arrays import Array

_RANGES = 6  # largest number of ranges of a verdict that are listed


def describe_diagram(diagram: BifurcationDiagram) -> dict[str, Any]:
    """Return what ``equilibrium --along --json`` prints: see docs/schemas/equilibrium.json."""
    return {
        "command": "equilibrium",
        "model": diagram.model,
        "steady": dict(diagram.steady),
        "parameter": diagram.parameter,
        "limits": list(diagram.limits),
        "branches": [_branch(branch, diagram) for branch in diagram.branches],
        "special_points": [_special(point, diagram) for point in diagram.special],
        "contacts": describe_contacts(diagram.contacts),
    }


def _branch(branch: Branch, diagram: BifurcationDiagram) -> dict[str, Any]:
    return {
        "origin": branch.origin,
        "parameter": branch.parameter.tolist(),
        "q": _columns(diagram.coordinates, branch.q),
        "v": _columns(diagram.coordinates, branch.v),
        "multipliers": _columns(diagram.constraints, branch.multipliers),
        "stable": branch.stable.tolist(),
        "stability": list(branch.stability),
        "growth": branch.growth.tolist(),
        "line": branch.line,
    }


def _columns(names: Sequence[str], values: Array) -> dict[str, list[float]]:
    return {name: column.tolist() for name, column in zip(names, values.T, strict=True)}


def _special(point: SpecialPoint, diagram: BifurcationDiagram) -> dict[str, Any]:
    return {
        "kind": point.kind,
        "branch": point.branch,
        "parameter": point.parameter,
        "q": dict(zip(diagram.coordinates, point.q.tolist(), strict=True)),
        "v": dict(zip(diagram.coordinates, point.v.tolist(), strict=True)),
        "multipliers": dict(zip(diagram.constraints, point.multipliers.tolist(), strict=True)),
        "frequency": point.frequency,
        "crossing": point.crossing,
        "contact": point.contact,
        "stability": None if point.stability is None else list(point.stability),
    }


def diagram_arrays(diagram: BifurcationDiagram) -> dict[str, Array]:
    """Return the arrays of all branches, concatenated, with the number of the branch."""
    branches = diagram.branches
    number = np.concatenate([np.full(len(b.parameter), i) for i, b in enumerate(branches)])
    names = ("parameter", "q", "v", "multipliers", "stable", "growth")
    found = {"branch": number.astype(float)}
    for name in names:
        found[name] = np.concatenate([np.asarray(getattr(b, name), float) for b in branches])
    return found


def format_diagram(content: Mapping[str, Any]) -> str:
    """Return the text that ``lagcli equilibrium --along`` prints."""
    name, branches = content["parameter"], content["branches"]
    low, high = content["limits"]
    count = f"{len(branches)} branch{'es' * (len(branches) != 1)}"
    held = f", {held_text(content['steady'])}" if content["steady"] else ""
    lines = [f"{content['model']}: {count} of equilibria, {name} from {low:g} to {high:g}{held}"]
    lines += contact_lines(content.get("contacts", ()), 2)
    for number, branch in enumerate(branches):
        origin = "" if branch["origin"] is None else f" off branch {branch['origin']}"
        at = branch["parameter"]
        lines.append(
            f"  branch {number}{origin}: {len(at)} points, {name} = {at[0]:.6g} to {at[-1]:.6g}"
        )
        if branch["line"]:
            level = max(at) - min(at) <= 1e-9 * max(map(abs, at))
            part = "all of it" if level else "its end"
            lines += entry("line", f"{part} is a line of equilibria at {name} = {at[-1]:.12g}", 4)
            lines += entry("q", listed(_range_of(branch["q"])), 4)
        changes = [
            x["parameter"]
            for x in content["special_points"]
            if x["branch"] == number and x["stability"] is not None
        ]
        lines += entry("verdict", _verdicts(branch, changes), 4)
        ends = _range_of(branch["multipliers"])
        if ends:
            lines += entry("λ", listed(ends), 4)
    for point in content["special_points"]:
        rate = f", {point['frequency']:.6g} rad/s" if point["frequency"] is not None else ""
        note = point.get("crossing") or point.get("contact")
        crossing = f" ({note})" if note else ""
        lines.append(
            f"  {point['kind']}{crossing} on branch {point['branch']}:"
            f" {name} = {point['parameter']:.12g}{rate}"
        )
        if point["stability"] is not None:
            before, after = map(shown_verdict, point["stability"])
            lines += entry("verdict", f"{before}, then {after}", 4)
        values = without_rounding(point["q"])
        lines += entry("q", listed([f"{k} = {x:.6g}" for k, x in values.items()]), 4)
        if point["multipliers"]:
            values = without_rounding(point["multipliers"])
            lines += entry("λ", listed([f"{k} {x:.6g}" for k, x in values.items()]), 4)
    return "\n".join(lines)


def _verdicts(branch: Mapping[str, Any], changes: Sequence[float]) -> str:
    """Return the verdicts along a branch, with the ranges of the parameter.

    Parameters
    ----------
    branch : mapping
    changes : sequence of float
        The parameter at the special points at which the verdict changes.
    """
    at, verdicts = branch["parameter"], branch["stability"]
    starts = [i for i, x in enumerate(verdicts) if i == 0 or x != verdicts[i - 1]]
    if len(starts) == 1:
        return shown_verdict(verdicts[0])
    if len(starts) > _RANGES:
        counts = Counter(map(shown_verdict, verdicts))
        return ", ".join(f"{name} at {count} points" for name, count in counts.items())
    inner = changes if len(changes) == len(starts) - 1 else [at[i] for i in starts[1:]]
    ends = [at[0], *inner, at[-1]]
    return "; ".join(
        f"{shown_verdict(verdicts[i])} {ends[k]:.6g} to {ends[k + 1]:.6g}"
        for k, i in enumerate(starts)
    )


def _range_of(columns: Mapping[str, Sequence[float]]) -> list[str]:
    return [f"{name} {min(x) + 0.0:.6g} to {max(x) + 0.0:.6g}" for name, x in columns.items()]
