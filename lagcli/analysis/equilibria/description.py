"""Equilibria and bifurcation diagrams as JSON values, as text and as arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lagcli.analysis.equilibria.diagram import BifurcationDiagram, Branch, SpecialPoint
from lagcli.analysis.equilibria.equilibrium import Equilibria, Equilibrium
from lagcli.analysis.local.clocked import clocked_notes
from lagcli.analysis.local.contacts import contact_lines, describe_contacts
from lagcli.analysis.output.tables import (
    ModelName,
    Phrase,
    PlotPlace,
    Remark,
    ResultColumn,
    ResultSection,
    ResultTable,
    SectionBlock,
    StateQuantity,
    UnitText,
    more,
    note_remarks,
    state_quantities,
    unit_of,
)
from lagcli.analysis.output.text import entry, listed, state_lines, width, without_rounding
from lagcli.arrays import Array
from lagcli.prose import counted, wrapped

_EIGENVALUES = 6  # items per line
_EQUILIBRIA = 24  # largest number of equilibria in a table
_ROUNDING = 1e-12  # real parts below this part of the imaginary ones are not shown


def describe_equilibria(result: Equilibria) -> dict[str, Any]:
    """Return the JSON values of ``lagcli equilibrium --json``: docs/schemas/equilibrium.json."""
    return {
        "command": "equilibrium",
        "model": result.model.name,
        "steady": dict(result.steady),
        "starts": result.starts,
        "equilibria": [_described(x, result) for x in result.equilibria],
        "ignored": dict(result.ignored),
        "notes": list(clocked_notes(result.model)),
    }


def _described(one: Equilibrium, result: Equilibria) -> dict[str, Any]:
    point, stability = one.operating_point.point, one.stability
    names, constraints = result.coordinates, one.constraints
    stiffness = stability.stiffness
    return {
        "stability": stability.verdict,
        "time": point.t,
        "q": _by_name(names, point.q),
        "v": _by_name(names, point.v),
        "speeds": dict(one.speeds),
        "multipliers": _by_name(constraints, point.multipliers),
        "constraint_forces": {
            name: {q: float(x) for q, x in zip(names, row, strict=True) if x}
            for name, row in zip(constraints, one.constraint_forces, strict=True)
        },
        "potential": one.potential,
        "eigenvalues": [[s.real, s.imag] for s in stability.eigenvalues.tolist()],
        "stiffness": None if stiffness is None else stiffness.tolist(),
        "dimension": one.dimension,
        "neutral_coordinates": [names[i] for i in one.neutral_coordinates],
        "contacts": describe_contacts(one.operating_point.contacts),
    }


def _by_name(names: Sequence[str], values: np.ndarray) -> dict[str, float]:
    return {name: value + 0.0 for name, value in zip(names, values.tolist(), strict=True)}


def format_equilibria(content: Mapping[str, Any]) -> str:
    """Return the text that ``lagcli equilibrium`` prints."""
    equilibria, starts = content["equilibria"], content["starts"]
    steady = bool(content["steady"])
    one, many = ("steady motion", "steady motions") if steady else ("equilibrium", "equilibria")
    count = counted(len(equilibria), one, many)
    where = f" found from {starts} starts; there may be more" if starts > 1 else ""
    held = held_text(content["steady"])
    lines = [f"{content['model']}: {count}{f' with {held}' if held else ''}{where}"]
    for number, x in enumerate(equilibria, 1):
        lines += wrapped(_verdict(x), width(), f"{number:>3}  ", " " * 5)
        lines += entry("V", f"{x['potential'] + 0.0:.6g} J", 5)
        if x["speeds"]:
            speeds = without_rounding(x["speeds"])
            lines += entry("speeds", listed([f"{k} = {v:.9g}" for k, v in speeds.items()]), 5)
        lines += state_lines(x, 5)
        if x["multipliers"]:
            rows = x["constraint_forces"].items()
            forces = {f"{c} on {q}": v for c, row in rows for q, v in row.items()}
            shown = [f"{k} {v:.6g}" for k, v in without_rounding(forces).items() if v]
            lines += entry("λ b", listed(shown) or "none", 5)
        lines += contact_lines(x.get("contacts", ()), 5)
        lines += entry("s, 1/s", _eigenvalues(x["eigenvalues"]), 5)
        if x["dimension"]:
            free = ", ".join(x["neutral_coordinates"])
            lines += entry(
                "set", f"one of a set of dimension {x['dimension']} that differ in {free}", 5
            )
    if content["ignored"]:
        given = listed([f"{name} = {x:.6g}" for name, x in content["ignored"].items()], 6)
        first, value = next(iter(content["ignored"].items()))
        remedy = "" if steady else f'; --steady "{first}={value:.6g}" finds a motion with it'
        what = "the steady motion does not have" if steady else "equilibria are at rest, without"
        lines += entry("note", f"{what} initial velocities of the file: {given}{remedy}", 2)
    for note in content["notes"]:
        lines += entry("note", note, 2)
    return "\n".join(lines)


def held_text(steady: Mapping[str, float | None]) -> str:
    """Return the prescribed velocities and quantities as text; of unknown ones, the names."""
    return ", ".join(
        f"{name} unknown" if value is None else f"{name} = {value:.6g}"
        for name, value in steady.items()
    )


def _verdict(x: Mapping[str, Any]) -> str:
    """Return the stability of an equilibrium in words, with its restrictions."""
    text, contacts = _of_linear_terms(x), x.get("contacts", ())
    unclear = [c["name"] for c in contacts if c["state"] in ("touches", "at its limit")]
    if unclear:
        return f"stability not determined: {', '.join(unclear)} may change with any deviation"
    acting = any(c["state"] in ("closed", "sticks", "slips") for c in contacts)
    return f"{text}, as long as no contact changes" if acting else text


def _of_linear_terms(x: Mapping[str, Any]) -> str:
    verdict, stiffness = x["stability"], x["stiffness"]
    if not x["eigenvalues"]:
        if verdict == "undecided":
            return "stability not determined: a singular configuration, where the rank of B changes"
        return "determined by the constraints"
    if verdict == "unstable":
        growing = [complex(*s) for s in x["eigenvalues"] if s[0] > 0]
        largest = max(growing, key=lambda s: s.real, default=0j)
        how = "oscillation grows" if largest.imag else "deviation grows"
        return f"unstable ({how} as e^({largest.real:.4g} t))"
    if verdict == "undecided":
        return f"stability {shown_verdict(verdict)}"
    if verdict == "stable" and stiffness is not None and not any(x["v"].values()):
        return "stable (a minimum of the potential energy)"
    if verdict == "linearly stable":
        return "linearly stable (no deviation grows; higher-order terms may decide)"
    return shown_verdict(verdict)


def shown_verdict(verdict: str) -> str:
    """Return a verdict as text says it."""
    return "not determined by the linear terms" if verdict == "undecided" else verdict


def _eigenvalues(values: Sequence[Sequence[float]]) -> str:
    texts = []
    for real, imaginary in values:
        if imaginary:
            damped = abs(real) > _ROUNDING * imaginary
            texts.append(f"{real:.6g} ± {imaginary:.6g}i" if damped else f"± {imaginary:.6g}i")
        else:
            texts.append(f"{real + 0.0:.6g}")
    return listed(texts, _EIGENVALUES) or "none"


_RANGES = 6  # largest number of ranges of a verdict that are listed


def describe_diagram(diagram: BifurcationDiagram) -> dict[str, Any]:
    """Return the JSON values of ``equilibrium --along --json``: docs/schemas/equilibrium.json."""
    return {
        "command": "equilibrium",
        "model": diagram.model.name,
        "steady": dict(diagram.steady),
        "parameter": diagram.parameter,
        "limits": list(diagram.limits),
        "branches": [_branch(branch, diagram) for branch in diagram.branches],
        "special_points": [_special(point, diagram) for point in diagram.special],
        "contacts": describe_contacts(diagram.contacts),
        "notes": list(clocked_notes(diagram.model)),
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
    arrays = {"branch": number.astype(float)}
    for name in names:
        arrays[name] = np.concatenate([np.asarray(getattr(b, name), float) for b in branches])
    return arrays


def format_diagram(content: Mapping[str, Any]) -> str:
    """Return the text that ``lagcli equilibrium --along`` prints."""
    name, branches = content["parameter"], content["branches"]
    low, high = content["limits"]
    count = counted(len(branches), "branch", "branches")
    held = f", {held_text(content['steady'])}" if content["steady"] else ""
    lines = [f"{content['model']}: {count} of equilibria, {name} from {low:g} to {high:g}{held}"]
    lines += contact_lines(content.get("contacts", ()), 2)
    for number, branch in enumerate(branches):
        origin = "" if branch["origin"] is None else f" off branch {branch['origin']}"
        at = branch["parameter"]
        lines.append(
            f"  branch {number}{origin}: {counted(len(at), 'point')},"
            f" {name} = {at[0]:.6g} to {at[-1]:.6g}"
        )
        if branch["line"]:
            level = max(at) - min(at) <= 1e-9 * max(map(abs, at))
            part = "all of it" if level else "its end"
            lines += entry("line", f"{part} is a line of equilibria at {name} = {at[-1]:.12g}", 4)
            lines += entry("q", listed(_range_of(branch["q"])), 4)
        elif _stops(branch, content):
            lines += entry("end", "no further point was found; the branch may go on", 4)
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
        lines.append(
            f"  {_kind(point)} on branch {point['branch']}:"
            f" {name} = {point['parameter']:.12g}{rate}"
        )
        if point["stability"] is not None:
            before, after = map(shown_verdict, point["stability"])
            lines += entry("verdict", f"{before}, then {after}", 4)
        lines += state_lines(point, 4, rates=False)
    for note in content["notes"]:
        lines += entry("note", note, 2)
    return "\n".join(lines)


def _stops(branch: Mapping[str, Any], content: Mapping[str, Any]) -> bool:
    """Whether a branch ends within the range, and neither at a contact nor where it began."""
    at, (low, high) = branch["parameter"], content["limits"]
    q = np.array(list(branch["q"].values())).T
    least, most = sorted((low, high))
    margin = 1e-6 * (most - least)
    contacts = [x["parameter"] for x in content["special_points"] if x["contact"] is not None]
    steps = np.abs(np.diff(q, axis=0)).max(axis=0, initial=0.0)
    closed = len(at) > 2 and (np.abs(q[-1] - q[0]) <= steps).all()
    return least + margin < at[-1] < most - margin and at[-1] not in contacts and not closed


def _kind(point: Mapping[str, Any]) -> str:
    """Return the kind of a special point, with the type of a branch point or the contact."""
    note = point.get("crossing") or point.get("contact")
    return str(point["kind"]) + (f" ({note})" if note else "")


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
        return ", ".join(f"{name} at {counted(count, 'point')}" for name, count in counts.items())
    inner = changes if len(changes) == len(starts) - 1 else [at[i] for i in starts[1:]]
    ends = [at[0], *inner, at[-1]]
    return "; ".join(
        f"{shown_verdict(verdicts[i])} {ends[k]:.6g} to {ends[k + 1]:.6g}"
        for k, i in enumerate(starts)
    )


def _range_of(columns: Mapping[str, Sequence[float]]) -> list[str]:
    return [f"{name} {min(x) + 0.0:.6g} to {max(x) + 0.0:.6g}" for name, x in columns.items()]


# tables


def equilibria_sections(
    content: Mapping[str, Any], units: Mapping[str, str]
) -> list[ResultSection]:
    """Return the section of equilibria; ``units`` by coordinate, and of λ by column."""
    equilibria = content["equilibria"]
    if not equilibria:
        nothing = [Remark("None were found."), *note_remarks(content["notes"])]
        return [ResultSection("equilibria", "Equilibria", nothing)]
    shown = equilibria[:_EQUILIBRIA]
    rows = [
        StateQuantity("Stability", UnitText(), [x["stability"] for x in shown]),
        *state_quantities(shown, units),
    ]
    if any(x["potential"] is not None for x in shown):
        energies = [x["potential"] for x in shown]
        rows.append(StateQuantity("Potential energy", UnitText("J"), energies))
    columns = [
        ResultColumn("Quantity", [x.name for x in rows]),
        ResultColumn("Unit", [x.unit for x in rows]),
        *(
            ResultColumn(f"No. {i + 1}", [x.values[i] for x in rows], digits=8)
            for i in range(len(shown))
        ),
    ]
    starts = content["starts"]
    caption = Phrase(f"{len(equilibria)} from {starts} starts" if starts > 1 else "Found")
    blocks: list[SectionBlock] = [
        ResultTable(caption, columns),
        *more(len(equilibria), len(shown)),
        *note_remarks(content["notes"]),
    ]
    return [ResultSection("equilibria", "Equilibria", blocks)]


def diagram_sections(content: Mapping[str, Any], units: Mapping[str, str]) -> list[ResultSection]:
    """Return the sections of a bifurcation diagram; ``units`` as of `equilibria_sections`."""
    name, branches, points = content["parameter"], content["branches"], content["special_points"]
    origins, unit = [x["origin"] for x in branches], unit_of(name, units)
    table = (
        ResultColumn("Branch", [str(i) for i in range(len(branches))]),
        ResultColumn("Leaves", ["" if x is None else f"branch {x}" for x in origins]),
        ResultColumn("Points", [len(x["parameter"]) for x in branches]),
        ResultColumn("From", [min(x["parameter"]) for x in branches], unit),
        ResultColumn("to", [max(x["parameter"]) for x in branches], unit),
        ResultColumn(
            "Stable", [f"{sum(x['stable'])} of {len(x['stable'])} points" for x in branches]
        ),
    )
    plot = PlotPlace(f"Branches of equilibria over {name}")
    listed: list[SectionBlock] = [
        plot,
        ResultTable(Phrase("Branches"), table),
        *note_remarks(content["notes"]),
    ]
    sections = [ResultSection("branches", "Equilibria over", listed, (name,))]
    if points:
        frequencies = [x["frequency"] for x in points]
        columns = [
            ResultColumn("Point", [_kind(x) for x in points]),
            ResultColumn("Branch", [str(x["branch"]) for x in points]),
            ResultColumn(ModelName(name), [x["parameter"] for x in points], unit or "1", 12),
            ResultColumn("Frequency", ["" if x is None else x for x in frequencies], "rad/s", 8),
            *(
                ResultColumn(
                    ModelName(prefix + key),
                    [x[part][key] for x in points],
                    unit_of(prefix + key, units),
                )
                for part, prefix in (("q", ""), ("multipliers", "lambda."))
                for key in points[0][part]
            ),
        ]
        caption = Phrase("Folds, branch points, Hopf points, changes of contacts")
        sections.append(ResultSection("special", "Bifurcations", [ResultTable(caption, columns)]))
    return sections
