"""A check as JSON values; ``docs/schemas/check.json`` describes them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from symengine import Basic

from lagcli.analysis.check.check import Check
from lagcli.equations.derivation.lagrange import ConstraintEquation
from lagcli.equations.presentation.conserved import title_of
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.render.grammar import grammar_text
from lagcli.equations.symmetry.conserved import ConservedQuantity
from lagcli.equations.symmetry.proof import Proof

_Text = Callable[[Basic], str]


def to_mapping(found: Check) -> dict[str, Any]:
    """Return what a check found, as ``lagcli check --json`` prints it.

    Formulas are text of the model grammar.

    Parameters
    ----------
    found : Check
    """
    eq, rank, start = found.equations, found.rank, found.start
    model, freedom = eq.model, rank.freedom
    arrange = Formulas(eq).arrange

    def text(expression: Basic) -> str:
        return grammar_text(arrange(expression))

    names = model.coordinate_names
    state = [*start.state.q.tolist(), *start.state.v.tolist()]
    scales = found.time_scales
    return {
        "command": "check",
        "model": model.name,
        "coordinates": list(names),
        "constraints": [_constraint(found, c, text) for c in eq.constraints],
        "rank": freedom.rank,
        "random_ranks": list(rank.random_ranks),
        "special_start": rank.special,
        "near_singular_start": bool(rank.near_singular),
        "degrees_of_freedom": freedom.degrees,
        "index": found.index,
        "redundant": [
            {"constraints": list(x.constraints), "surplus": x.surplus} for x in freedom.redundant
        ],
        "unique_combinations": [dict(c.factors) for c in rank.combinations],
        "conserved": {
            "searched": found.conserved.extent,
            "quantities": [_quantity(found, q, text) for q in found.conserved.quantities],
        },
        "start": {
            "t": start.state.t,
            "values": dict(zip([*names, *(f"{n}'" for n in names)], state, strict=True)),
            "moved": {name: list(pair) for name, pair in start.moved.items()},
        },
        "time_scales": None
        if scales is None
        else {
            "largest_frequency": scales.largest_frequency,
            "damping_ratio": scales.damping_ratio,
            "fastest_decay": scales.fastest_decay,
            "fastest_growth": scales.fastest_growth,
            "slowest": scales.slowest,
            "stiffness": scales.stiffness,
        },
        "units": found.units.to_mapping(),
    }


def _constraint(found: Check, c: ConstraintEquation, text: _Text) -> dict[str, Any]:
    names, name = found.equations.model.coordinate_names, c.constraint.name
    tested = found.velocity_constraints.get(name)
    integral = None if tested is None else tested.integral
    return {
        "name": name,
        "kind": c.constraint.kind,
        "rheonomic": c.rheonomic,
        "variation": {names[j]: text(b) for j, b in sorted(c.row.items())},
        "multiplier_unique": name in found.rank.unique,
        "integrable": None if tested is None else tested.integrable,
        "integral": None if integral is None else text(integral.expression),
        "integral_value": None if tested is None else tested.value,
    }


def _quantity(found: Check, q: ConservedQuantity, text: _Text) -> dict[str, Any]:
    eq, proof = found.equations, Proof(found.equations, q)
    names = eq.model.coordinate_names
    conditions = [
        {
            "of": "L",
            "products": _products(proof.products(), text),
            "equals": text(proof.rate(q.gauge)),
        }
    ]
    for beta, c in enumerate(eq.constraints):
        products = _products(proof.constraint_products(beta), text)
        if products:
            equals = text(proof.multiple(beta))
            conditions.append({"of": c.constraint.name, "products": products, "equals": equals})
    return {
        "name": q.name,
        "kind": q.kind,
        "title": title_of(q, names),
        "in_momenta": q.in_momenta,
        "formula": text(q.expression),
        "value": found.conserved_values[q.name],
        "unit": found.conserved_units.get(q.name),
        "for_all_parameters": q.general,
        "symmetry": {names[i]: text(x) for i, x in q.field.items()},
        "time_shift": text(q.time),
        "gauge": text(q.gauge),
        "proof": conditions,
    }


def _products(products: Iterable[tuple[Basic, Basic]], text: _Text) -> list[list[str]]:
    return [[text(x), text(y)] for x, y in products if x != 0 and y != 0]
