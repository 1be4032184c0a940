"""A check as JSON values and as one page of text."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable
from itertools import islice
from typing import Any

import numpy as np
from symengine import Basic

from lagcli.analysis.check.check import Check
from lagcli.analysis.check.combinations import IntegrableCombination
from lagcli.analysis.check.rank import Combination
from lagcli.analysis.check.units import place_of, where
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.constraints.random_states import MOST_COORDINATES
from lagcli.equations.derivation.lagrange import ConstraintEquation
from lagcli.equations.presentation.conserved import conserved_step, title_of
from lagcli.equations.presentation.extent import Extent
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.index_form import IndexForm
from lagcli.equations.presentation.overview import freedom_step, short_constraints_step
from lagcli.equations.symmetry.conserved import ConservedQuantity, Proof
from lagcli.equations.typesetting.latex import LatexFormula
from lagcli.equations.typesetting.markdown import render_markdown
from lagcli.equations.typesetting.nodes import (
    ONE,
    Line,
    Node,
    Sign,
    Step,
    Symbol,
    product_of,
    sum_of,
)
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula, grammar_text, render_text
from lagcli.equations.typesetting.writer import written_decimals
from lagcli.model.names.members import families
from lagcli.prose import counted
from lagcli.results.listing import distinct_numbers

_Text = Callable[[Basic], str]


def to_mapping(checked: Check) -> dict[str, Any]:
    """Return the result of a check, as ``lagcli check --json`` prints it.

    Formulas are text of the model grammar.
    """
    eq, rank, start = checked.equations, checked.rank, checked.start
    model, freedom = eq.model, rank.freedom
    arrange = Formulas(eq).arrange

    def text(expression: Basic) -> str:
        return grammar_text(arrange(expression))

    names = model.coordinate_names
    state = [*start.state.q.tolist(), *start.state.v.tolist()]
    scales = checked.time_scales
    return {
        "command": "check",
        "model": model.name,
        "coordinates": list(names),
        "constraints": [_constraint(checked, c, text) for c in eq.constraints],
        "rank": freedom.rank,
        "random_ranks": list(rank.random_ranks),
        "special_start": rank.special,
        "near_singular_start": bool(rank.near_singular),
        "degrees_of_freedom": freedom.degrees,
        "index": checked.index,
        "redundant": [
            {"constraints": list(x.constraints), "surplus": x.surplus} for x in freedom.redundant
        ],
        "unique_combinations": [dict(c.factors) for c in rank.combinations],
        "integrable_combinations": [
            {
                "factors": c.factors and {name: text(x) for name, x in c.factors.items()},
                "numbers": dict(c.numbers),
                "integral": None if c.integral is None else text(c.integral.expression),
                "integral_value": c.value,
            }
            for c in checked.integrability.combinations
        ],
        "nonintegrable": checked.integrability.nonintegrable,
        "conserved": {
            "searched": checked.conserved.extent,
            "quantities": [_quantity(checked, q, text) for q in checked.conserved.quantities],
        },
        "start": {
            "t": start.state.t,
            "values": dict(zip([*names, *(f"{n}'" for n in names)], state, strict=True)),
            "moved": {name: list(pair) for name, pair in start.moved.items()},
        },
        "steady_start": checked.steady,
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
        "units": checked.units.to_mapping(),
        "unused_parameters": {name: list(x) for name, x in checked.unused_parameters.items()},
        "hints": [{"message": x.message, "place": place_of(x.location)} for x in checked.hints],
    }


def _constraint(checked: Check, c: ConstraintEquation, text: _Text) -> dict[str, Any]:
    names, name = checked.equations.model.coordinate_names, c.constraint.name
    tested = checked.integrability.constraints.get(name)
    integral = None if tested is None else tested.integral
    return {
        "name": name,
        "kind": c.constraint.kind,
        "rheonomic": c.rheonomic,
        "variation": {names[j]: text(b) for j, b in sorted(c.row.items())},
        "multiplier_unique": name in checked.rank.unique,
        "integrable": None if tested is None else tested.integrable,
        "integral": None if integral is None else text(integral.expression),
        "integral_value": None if tested is None else tested.value,
    }


def _quantity(checked: Check, q: ConservedQuantity, text: _Text) -> dict[str, Any]:
    eq, proof = checked.equations, Proof(checked.equations, q)
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
        "title": title_of(q, eq.model),
        "in_momenta": q.in_momenta,
        "formula": text(q.expression),
        "value": checked.conserved_values[q.name],
        "unit": checked.conserved_units.get(q.name),
        "for_all_parameters": q.general,
        "symmetry": {names[i]: text(x) for i, x in q.field.items()},
        "time_shift": text(q.time),
        "gauge": text(q.gauge),
        "proof": conditions,
    }


def _products(products: Iterable[tuple[Basic, Basic]], text: _Text) -> list[list[str]]:
    return [[text(x), text(y)] for x, y in products if x != 0 and y != 0]


#: Ratio of the fastest decay to the slowest motion from which it is reported.
_STIFF = 10.0
#: Largest number of initial values and of names that are listed.
_LISTED = 12
#: Values below this part of the largest are what an iteration leaves of 0.
_REST = 1e-12

_INDEX = {
    0: "ordinary differential equations: there is no multiplier.",
    2: "differential-algebraic equations with velocity constraints.",
    3: "differential-algebraic equations with position constraints.",
}
_SEARCHED = {
    "linear": "The search covered symmetries ξ = A q + b of L and the constraints.",
    "translations": "The search covered only symmetries with constant ξ: the equations have too"
    " many terms for others.",
    "absent coordinates": "The search covered only cyclic coordinates: the equations have too many"
    " terms for others.",
}


def page(checked: Check, width: int = 80) -> str:
    """Return the text that ``lagcli check`` prints.

    Parameters
    ----------
    checked : Check
    width : int
        Columns, at least 40.

    Returns
    -------
    str
        Ends with a newline.
    """
    model = checked.equations.model
    formula = TextFormula(Notation(model), written_decimals(model))
    return render_text(model, _steps(checked), formula, width, numbered=False)


def markdown(checked: Check) -> str:
    """Return a check in Markdown with LaTeX, as a notebook shows it."""
    model = checked.equations.model
    formula = LatexFormula(Notation(model), written_decimals(model))
    return render_markdown(model, _steps(checked), formula, numbered=False)


def _steps(checked: Check) -> list[Step]:
    f = Formulas(checked.equations, freedom=checked.rank.freedom)
    steps = [
        short_constraints_step(f),
        *_integrability(f, checked),
        _freedom(f, checked),
        _singular(checked),
        _multipliers(checked),
        *_conserved(f, checked),
        _start(checked),
        _time_scales(checked),
        Step("Units", (), " ".join(checked.units.sentences())),
        _unused(checked),
        _hints(checked),
    ]
    model = checked.equations.model
    indexed = IndexForm(model).steps([step for step in steps if step is not None])
    return Extent(f).shortened(indexed)


def _integrability(f: Formulas, checked: Check) -> list[Step]:
    found = checked.integrability
    if not found.constraints:
        return []
    lines = []
    for name, x in found.constraints.items():
        label = Symbol(name, kind="constraint")
        others = "" if x.integrable == "alone" else " with the other constraints"
        if x.integral is not None and x.value is not None:
            sides = (f.arrange(x.integral.expression), _number(x.value))
            note = f"integrable{others}: it also restricts the positions"
            lines.append(Line(sides, name, note))
        elif x.integrable in ("alone", "together"):
            lines.append(Line((label,), note=f"integrable{others}; no integral was found"))
        elif x.integrable == "not tested":
            lines.append(Line((label,), note="not tested: too large, or branches"))
    for c in found.combinations:
        combination = _factors(f, c)
        if c.integral is not None and c.value is not None:
            sides = (f.arrange(c.integral.expression), _number(c.value))
            lines.append(Line(sides, combination, "integrable: it also restricts the positions"))
            continue
        note = "integrable; no integral was found"
        if c.factors is None:
            note = "integrable, with these factors at a state near the start"
        lines.append(Line((combination,), note=note))
    return [
        Step(
            "Velocity constraints (Frobenius)", tuple(lines), _not_integrable(checked, bool(lines))
        )
    ]


def _factors(f: Formulas, c: IntegrableCombination) -> Node:
    terms = []
    for name, x in c.numbers.items():
        symbol = Symbol(name, kind="constraint")
        exact = None if c.factors is None else c.factors[name]
        if exact is None or not exact.free_symbols:
            factor = ONE if abs(x) == 1 else _number(abs(x))
            terms.append((-1 if x < 0 else 1, product_of([factor, symbol])))
        else:
            terms.append((1, product_of([f.arrange(exact), symbol])))
    return sum_of(sorted(terms, key=lambda term: -term[0]))


def _not_integrable(checked: Check, other: bool) -> str | None:
    """Return what is said of the distribution, the motions that all constraints allow."""
    if not checked.integrability.nonintegrable:
        return None
    constraints = checked.equations.constraints
    if any(c.rheonomic or c.drift != 0 for c in constraints):
        function = "no other function" if other else "no function"
        return (
            f"Not integrable: {function} of the coordinates and time is constant on all motions"
            " that the constraints allow."
        )
    if other:
        return "Otherwise not integrable: all positions with these values remain accessible."
    if any(c.position is not None for c in constraints):
        return "Not integrable: all positions that the position constraints allow are accessible."
    return "Not integrable: the constraints leave all positions accessible."


def _freedom(f: Formulas, checked: Check) -> Step:
    step, rank = freedom_step(f), checked.rank
    said = [f"Index {checked.index}: {_INDEX[checked.index]}"]
    if rank.freedom.constraints:
        counts = sorted(Counter(rank.random_ranks).items())
        shown = ", ".join(f"{n} at {counted(count, 'state')}" for n, count in counts)
        said.append(
            f"Rank of B at random consistent states: {shown}."
            if shown
            else "The constraints determine all positions."
            if not rank.freedom.degrees
            else "No other consistent states were found near the start."
            if len(f.model.coordinates) <= MOST_COORDINATES
            else f"The rank is not computed at other states of more than {MOST_COORDINATES}"
            " coordinates."
        )
    kind = "Dependent at the start" if rank.special else "Redundant"
    sets = [f"{kind}: {x.sentence(families(x.constraints))}." for x in rank.freedom.redundant]
    return Step(step.title, step.lines, " ".join([*sets, *said]))


def _singular(checked: Check) -> Step | None:
    rank = checked.rank
    if rank.special:
        return Step("Singular start", (), rank.freedom.singular)
    if rank.near_singular:
        said = (
            "The start is next to a singular configuration, in which constraints are dependent"
            f" ({', '.join(rank.near_singular)}): accelerations and multipliers change much over a"
            " small distance. Other guesses may lead to a start away from it."
        )
        return Step("Almost singular start", (), said)
    return None


def _multipliers(checked: Check) -> Step | None:
    rank = checked.rank
    if not rank.freedom.constraints:
        return None
    title = "Multipliers"
    if not rank.not_unique:
        held = rank.freedom.held
        said = "All are unique." if held is None else f"Unique: {_names(rank.unique)}."
        return Step(title, (), said)
    said = f"Not unique: {_names(rank.not_unique)}."
    said += f" Unique: {_names(rank.unique)}." if rank.unique else ""
    if not rank.combinations:
        return Step(title, (), said)
    lines = tuple(Line((_combination(c),)) for c in rank.combinations)
    if rank.special:
        said += " Unique at the start are these combinations:"
    else:
        said += " Constraint forces are unique, and at the start these combinations:"
    return Step(title, lines, lead=said)


def _combination(c: Combination) -> Node:
    terms = []
    for name, x in c.factors.items():
        factor = ONE if abs(x) == 1 else _number(abs(x))
        terms.append((-1 if x < 0 else 1, product_of([factor, Symbol(name, kind="multiplier")])))
    return sum_of(terms)


def _conserved(f: Formulas, checked: Check) -> list[Step]:
    steps = [
        conserved_step(f, q, checked.conserved_values[q.name], checked.conserved_units.get(q.name))
        for q in checked.conserved.quantities
    ]
    said = _SEARCHED[checked.conserved.extent]
    if not steps:
        return [Step("Conserved quantities", (), f"None were found. {said}")]
    return steps


def _start(checked: Check) -> Step:
    start = checked.start
    t = Line((Sign("t", "t"), _number(start.state.t)))
    if not start.moved:
        return Step("Consistent start", (t,), "The initial values satisfy the constraints.")
    lines = [t]
    adjusted = _visible(start)
    for name, (before, after) in islice(adjusted.items(), _LISTED):
        base = name.rstrip("'")
        given, used = distinct_numbers(before, after, 8)
        note = f"adjusted from {given.replace('-', '−')}"
        symbol = Symbol(base, len(name) - len(base))
        lines.append(Line((symbol, _signed(after, used)), note=note))
    more = len(adjusted) - _LISTED
    said = (
        f"{counted(more, 'more value')} adjusted to satisfy the constraints." if more > 0 else None
    )
    return Step("Consistent start", tuple(lines), said)


def _visible(start: ConsistentState) -> dict[str, tuple[float, float]]:
    """Return the adjusted values with the rest of an iteration instead of 0 as 0."""
    state = np.concatenate([start.state.q, start.state.v])
    least = _REST * np.abs(state).max(initial=0.0)
    shown = {
        name: tuple(0.0 if abs(x) <= least else x for x in pair)
        for name, pair in start.moved.items()
    }
    return {name: (before, after) for name, (before, after) in shown.items() if before != after}


def _time_scales(checked: Check) -> Step | None:
    x = checked.time_scales
    if checked.rank.special or checked.rank.near_singular:
        where = "at" if checked.rank.special else "next to"
        why = f"Not computed {where} a singular configuration: they change over a small distance."
        return Step("Time scales", (), why)
    if checked.steady is False:
        why = (
            "Not computed: the start is not an equilibrium or a motion at constant velocities."
            " `lagcli modes --equilibrium` describes small motions about an equilibrium near it."
        )
        return Step("Time scales", (), why)
    if x is None:
        return None
    said = []
    if x.largest_frequency:
        period = 2 * math.pi / x.largest_frequency
        said.append(
            f"Largest frequency {x.largest_frequency:.6g} rad/s (period {period:.4g} s), damping"
            f" ratio {x.damping_ratio:.4g}."
        )
    else:
        said.append("No oscillation.")
    if x.fastest_decay:
        said.append(f"Fastest decay {x.fastest_decay:.6g} 1/s.")
    if x.fastest_growth:
        said.append(f"Fastest growth {x.fastest_growth:.6g} 1/s.")
    if x.stiffness > _STIFF:
        said.append(f"The fastest decay is {x.stiffness:.3g} times as fast as the slowest motion.")
    said.append("These values describe small motions about the initial state.")
    return Step("Time scales", (), " ".join(said))


def _unused(checked: Check) -> Step | None:
    unused = checked.unused_parameters
    if not unused:
        return None
    shown = [
        f"`{name}`" + (f" (did you mean `{similar[0]}`?)" if similar else "")
        for name, similar in islice(unused.items(), _LISTED)
    ]
    more = f" and {len(unused) - _LISTED} more" if len(unused) > _LISTED else ""
    return Step("Unused parameters", (), f"Nothing uses {', '.join(shown)}{more}.")


def _hints(checked: Check) -> Step | None:
    if not checked.hints:
        return None
    said = [f"{x.message} ({where(x.location)})." for x in checked.hints[:_LISTED]]
    return Step("Hints", (), " ".join(said))


def _names(names: Iterable[str]) -> str:
    shown = families(names)
    more = len(shown) - _LISTED
    return ", ".join(shown[:_LISTED]) + (f" and {more} more" if more > 0 else "")


def _number(value: float, digits: int = 6) -> Node:
    return _signed(value, f"{abs(value):.{digits}g}")


def _signed(value: float, text: str) -> Node:
    """Return a number with its sign."""
    text = text.removeprefix("-")
    sign, latex = ("−", "-") if value < 0 else ("", "")
    return Sign(sign + text, latex + text)
