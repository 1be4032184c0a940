"""Benchmark cases (``cases/*.yaml``) → text of lagcli models, and the values they should give.

The format of a case is described in ``cases/README.md``. Nothing here uses lagcli: closed forms
are evaluated by a few separate lines, so that an error in lagcli's grammar cannot hide itself.
"""

from __future__ import annotations

import ast
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

#: The fast one, of libyaml, where PyYAML was built with it.
LOADER = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
FOLDER = Path(__file__).parent / "cases"

#: What a row of ``reference`` may state, beside its kind, time, source and digits.
QUANTITIES = ("q", "qd", "qdd", "lam", "constraint_force", "observables", "energy")

#: The keys of a case; an unknown one would be ignored silently, so the reader rejects it.
KEYS = frozenset(
    {
        *("name", "title", "category", "source", "coordinates", "parameters", "definitions"),
        *("T", "V", "Q", "constraints", "initial", "t_end", "convention", "reference"),
        *("verification", "notes", "observables", "analytic", "analytic_definitions"),
        *("redundant", "singular_configurations"),
    }
)

#: Where a quantity has no stated accuracy: what it is computed from.
_DIGITS_OF = {
    "qdd": ("q", "qd", "lam"),
    "constraint_force": ("q", "lam"),
    "energy": ("q", "qd"),
    "observables": ("q", "qd"),
}

_FUNCTIONS = {
    **{"sin": math.sin, "cos": math.cos, "tan": math.tan, "sqrt": math.sqrt, "abs": abs},
    **{"asin": math.asin, "acos": math.acos, "atan": math.atan, "exp": math.exp},
    **{"sinh": math.sinh, "cosh": math.cosh, "tanh": math.tanh, "log": math.log},
}
_OPERATIONS = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}


def evaluate(text: str, names: Mapping[str, float]) -> float:
    """Evaluate an expression of numbers, names and the functions of the case format."""

    def value(node: ast.expr) -> float:
        match node:
            case ast.Constant(value=int() | float()):
                return float(node.value)
            case ast.Name():
                return names[node.id]
            case ast.BinOp():
                return _OPERATIONS[type(node.op)](value(node.left), value(node.right))
            case ast.UnaryOp(op=ast.USub()):
                return -value(node.operand)
            case ast.Call(func=ast.Name(id=function), args=[argument]):
                return _FUNCTIONS[function](value(argument))
        raise ValueError(f"not an expression of the case format: {text}")

    return value(ast.parse(text.strip(), mode="eval").body)


@dataclass(frozen=True)
class Reference:
    """One row of ``reference``: values by quantity and component, and their digits.

    ``digits`` are those by which a published value agrees with the computed solution, component by
    component, or those to which a computed value can be trusted.
    """

    kind: str
    time: float
    values: Mapping[str, Mapping[str, float]]
    digits: Mapping[str, Mapping[str, float]]


class Case:
    """One case.

    Parameters
    ----------
    name : str
        Name of its file, without the suffix.

    Attributes
    ----------
    coordinates, constraints : tuple of str
        In the order of q and λ.
    parameters : dict of str to float
    references : tuple of Reference
    t_end : float
    redundant, singular : bool
        Whether λ is not unique; whether the motion passes singular configurations.
    """

    def __init__(self, name: str):
        text = (FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
        # every scalar stays text: numbers go into the model digit by digit as they stand
        self.data: dict[str, Any] = yaml.load(text, Loader=LOADER)
        if unknown := set(self.data) - KEYS:
            raise ValueError(f"{name}: the reader does not know {sorted(unknown)}")
        self.name = name
        self.coordinates = tuple(self.data["coordinates"])
        kinds = ("holonomic", "nonholonomic")
        rows = [c for kind in kinds for c in self.data["constraints"].get(kind, [])]
        self._constraints = {c["name"]: c["expr"] for c in rows}
        self.constraints = tuple(self._constraints)
        self.parameters = {"pi": math.pi}
        for key, value in self.data["parameters"].items():
            self.parameters[key] = evaluate(value, self.parameters)
        self.references = tuple(_reference(row) for row in self.data["reference"])
        self.t_end = evaluate(self.data["t_end"], self.parameters)
        self.redundant = self.data.get("redundant") == "true"
        self.singular = self.data.get("singular_configurations") == "true"
        self.has_closed_form = "analytic" in self.data

    def model_text(self, free: tuple[str, ...] = (), start: Reference | None = None) -> str:
        """Return the case as a lagcli model.

        Parameters
        ----------
        free : tuple of str
            Initial entries (``x``, ``x'``) that become guesses, for cases whose published initial
            state satisfies the constraints only approximately.
        start : Reference, optional
            Row at t = 0 whose q and qd replace the initial state of the case.
        """
        lines = [f"name: {self.name}", f"description: {json.dumps(self.data['title'])}"]
        lines.append(f"coordinates: [{', '.join(self.coordinates)}]")
        lines += _block("parameters", self.data["parameters"])
        lines += _block("definitions", self.data.get("definitions", {}))
        lines += [f"{key}: {json.dumps(self.data[key])}" for key in ("T", "V")]
        lines += _block("Q", self.data.get("Q", {}))
        lines += _block("constraints", self._constraints)
        lines += _block("initial", self._initial(start), free)
        lines += _block("outputs", self.data.get("observables", {}))
        return "\n".join(lines) + "\n"

    def _initial(self, start: Reference | None) -> dict[str, str]:
        given = self.data["initial"]
        entries = {}
        for quantity, prime in (("q", ""), ("qd", "'")):
            for name in self.coordinates:
                value = given[quantity].get(name, "0")
                if start is not None:
                    value = repr(start.values[quantity][name])
                entries[name + prime] = value
        return entries

    def closed_form(self, time: float) -> dict[str, dict[str, float]]:
        """Evaluate ``analytic`` at a time: values by quantity (q, qd, lam) and component."""
        names = {**self.parameters, "t": time}
        for name, text in self.data.get("analytic_definitions", {}).items():
            names[name] = evaluate(text, names)
        return {
            quantity: {name: evaluate(text, names) for name, text in components.items()}
            for quantity, components in self.data["analytic"].items()
        }

    def double_digits(self, time: float, quantity: str) -> float:
        """Return the digits, of the largest component, that a run in doubles is known to reach.

        Between the times for which the case states them, the smaller of the two counts. Beyond the
        last one they shrink by 2 log10(t/t_last): a drift of the energy that grows like t makes an
        error of phase that grows like t².
        """
        known = {}
        for key, row in self.data["verification"]["double_agreement_digits"].items():
            stated = [float(row[source]) for source in _DIGITS_OF.get(quantity, (quantity,))]
            meant = [d for d in stated if d > 0]  # a value that is 0 has no relative digits
            if meant:
                known[float(key.removeprefix("t="))] = min(meant)
        # the keys print six digits of the time
        for t, digits in known.items():
            if math.isclose(t, time, rel_tol=1e-5):
                return digits
        last = max(known)
        if time > last:
            return known[last] - 2 * math.log10(time / last)
        before = [t for t in known if t < time][-1:]
        after = [t for t in known if t > time][:1]
        return min(known[t] for t in before + after)


def _reference(row: Mapping[str, Any]) -> Reference:
    values = {q: _numbers(row[q]) for q in QUANTITIES if q in row}
    if "verified_digits" in row:
        digits = {q: _numbers(d) for q, d in row["verified_digits"].items()}
    else:
        stated = _numbers(row["digits"])
        digits = {
            q: dict.fromkeys(components, min(stated[s] for s in _DIGITS_OF.get(q, (q,))))
            for q, components in values.items()
        }
    return Reference(row["kind"], float(row["t"]), values, digits)


def _numbers(node: str | Mapping[str, str]) -> dict[str, float]:
    """Return numbers by component; a lone number is its own component, without a name."""
    if isinstance(node, str):
        return {"": float(node)}
    return {name: float(value) for name, value in node.items()}


def _block(key: str, entries: Mapping[str, str], guesses: tuple[str, ...] = ()) -> list[str]:
    """Return a mapping of the model file; empty without entries."""
    lines = [f"{key}:"] if entries else []
    for name, text in entries.items():
        value = json.dumps(text)
        lines.append(f"  {name}: {{guess: {value}}}" if name in guesses else f"  {name}: {value}")
    return lines


def case_names() -> list[str]:
    """Return the names of all cases of the folder."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))
