"""Equilibria as JSON values and as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lagcli.analysis.equilibria.equilibrium import Equilibria, Equilibrium
from lagcli.analysis.local.contact_text import contact_lines, describe_contacts
from lagcli.analysis.text import entry, listed, without_rounding

_EIGENVALUES = 6  # items per line
_ROUNDING = 1e-12  # real parts below this part of the imaginary ones are not shown


def describe_equilibria(found: Equilibria) -> dict[str, Any]:
    """Return what ``lagcli equilibrium --json`` prints: see docs/schemas/equilibrium.json."""
    return {
        "command": "equilibrium",
        "model": found.model,
        "steady": dict(found.steady),
        "starts": found.starts,
        "equilibria": [_described(x, found) for x in found.equilibria],
        "ignored": dict(found.ignored),
    }


def _described(one: Equilibrium, found: Equilibria) -> dict[str, Any]:
    point, stability = one.operating_point.point, one.stability
    names, constraints = found.coordinates, one.constraints
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
    found, starts = content["equilibria"], content["starts"]
    steady = bool(content["steady"])
    one, many = ("steady motion", "steady motions") if steady else ("equilibrium", "equilibria")
    count = f"{len(found)} {one if len(found) == 1 else many}"
    where = f" found from {starts} starts; there may be more" if starts > 1 else ""
    held = held_text(content["steady"])
    lines = [f"{content['model']}: {count}{f' with {held}' if held else ''}{where}"]
    for number, x in enumerate(found, 1):
        lines.append(f"{number:>3}  {_verdict(x)}, V = {x['potential'] + 0.0:.6g} J")
        rates = {f"{name}'": value for name, value in x["v"].items() if value}
        if x["speeds"]:
            speeds = without_rounding(x["speeds"])
            lines += entry("speeds", listed([f"{k} = {v:.9g}" for k, v in speeds.items()]), 5)
        values = without_rounding(x["q"])
        values |= {k: v for k, v in without_rounding(rates).items() if v}
        lines += entry("q", listed([f"{k} = {v:.6g}" for k, v in values.items()]), 5)
        if x["multipliers"]:
            values = without_rounding(x["multipliers"])
            lines += entry("λ", listed([f"{k} {v:.6g}" for k, v in values.items()]), 5)
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
    return "\n".join(lines)


def held_text(steady: Mapping[str, float | None]) -> str:
    """Return what is held, as text; of unknown speeds, the names."""
    return ", ".join(
        f"{name} unknown" if value is None else f"{name} = {value:.6g}"
        for name, value in steady.items()
    )


def _verdict(x: Mapping[str, Any]) -> str:
    """Say how stable an equilibrium is, and by what that is limited."""
    text, contacts = _of_linear_terms(x), x.get("contacts", ())
    unclear = [c["name"] for c in contacts if c["state"] in ("touches", "at its limit")]
    if unclear:
        return f"stability not determined: {', '.join(unclear)} may change with any deviation"
    acting = any(c["state"] in ("closed", "sticks", "slips") for c in contacts)
    return f"{text}, as long as no contact changes" if acting else text


def _of_linear_terms(x: Mapping[str, Any]) -> str:
    verdict, stiffness = x["stability"], x["stiffness"]
    if not x["eigenvalues"]:
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
