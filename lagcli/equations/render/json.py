"""The equations as JSON, for programs.

Schema ``lagcli-derivation-2``. Every formula is ``{"text": …, "latex": …}``: text of the model
grammar, which `lagcli.model.expression.grammar` reads back, and LaTeX.

==================  ==========================================================================
``schema``          ``"lagcli-derivation-2"``
``name``            name of the model; also ``title`` and ``description``
``form``            ``"written-out"``, or for a large model without ``--full`` ``"matrices"``, whose
                    formulas contain abbreviations
``abbreviations``   objects ``name, text, latex`` in topological order, including definitions of
                    the model
``numeric``         whether the parameters are replaced by their values
``coordinates``     objects ``name, unit, description, latex``, in the model's order
``parameters``      name → value in SI
``constraints``     objects: ``name, kind, rheonomic, integrable`` (of a nonholonomic one),
                    ``expression`` φ or ψ; ``written`` as an equation in LaTeX;
                    ``variation``: coordinate → b_i (8.79); ``row``: the b_i by index, and
                    ``drift`` b_0 of the velocity form Σ b_i v_i + b_0 = 0; ``gamma``: the right
                    side of Σ b_i a_i = γ; ``relation`` (``=``, ``>=``, ``<=``), ``active``, and
                    null or formulas: ``restitution``; ``limit``: ``static, kinetic`` and
                    ``normal``, the constraint whose |λ| they are proportional to
``events``          objects ``name, when``, ``condition``: a formula that rises through zero as it
                    becomes true, or null; ``either``: whether falling counts too; ``change``: null
                    or constraint and change; ``set``, ``impulse``: name → formula; ``release``,
                    ``engage``: constraints; ``stop``, ``times``, ``record`` (null for all)
``rank``            rank of B at the consistent initial state; null if unknown
``degrees_of_freedom``  k − rank; k − r if the rank is unknown
``redundant``       sets of dependent ``constraints`` at that state, and their ``surplus``: the
                    number of redundant ones
``kinetic``, ``potential``, ``lagrangian``
``mass_matrix``     nonzero entries ``[i, j, formula]``
``forcing``         f of M a = f + Bᵀλ
``applied_forces``  Q
``equations``       objects ``coordinate, lhs, rhs``: (8.85), assembled; null in matrix form
``sign_convention`` a sentence that defines the sign of λ
``kinds``           the kinds of equations that were requested
``partition``       null for the first kind alone; else ``independent`` and ``dependent``
                    coordinates, the ``constraints`` that determine them, those that follow from
                    others (``surplus``), and ``determinants``: their product is the determinant of
                    the dependent columns of B
``second``          with ``--kind second``: ``dependent``: objects ``coordinate, constraints``, and
                    null or formulas: ``value``, ``angle, sine, cosine``; ``velocities`` by
                    coordinate; ``lagrangian``, null if it is long; ``abbreviations``;
                    ``mass_matrix`` and ``forcing`` of M a = f, by positions in ``independent``
``maggi``           with ``--kind maggi``: ``null_space``: nonzero entries ``[i, k, formula]`` of
                    J; ``drift`` J_0 of v = J v_independent + J_0; ``abbreviations``;
                    ``mass_matrix`` JᵀM J and ``forcing``
``solved``          with ``--solve``: by kind null, if it is long, or objects ``unknown``
                    (``phi''``, ``lambda.guide``), ``numerator``, ``denominator``
``steps``           with ``--steps``: objects ``title, lead, remark, lines``; a line has ``latex``,
                    ``label`` and ``note``
==================  ==========================================================================
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from symengine import Basic

from lagcli.equations.derivation.integrability import integrable
from lagcli.equations.derivation.lagrange import ConstraintEquation
from lagcli.equations.presentation.assembly import Contents, shown_steps
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.kinds import LONGEST
from lagcli.equations.presentation.matrices import PARTS, Matrices, abbreviate
from lagcli.equations.presentation.overview import in_matrices
from lagcli.equations.presentation.switching import as_inequality
from lagcli.equations.reduction.elimination import (
    SolvedUnknown,
    solve_accelerations,
    solve_first_kind,
)
from lagcli.equations.reduction.second_kind import Maggi, SecondKind, second_kind
from lagcli.equations.reduction.small_systems import operations
from lagcli.equations.typesetting.latex import LatexFormula
from lagcli.equations.typesetting.nodes import ZERO, Line, Node, Symbol
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import grammar_text
from lagcli.equations.typesetting.writer import written_decimals
from lagcli.model.expression.units import si_notation
from lagcli.model.model import EventClock, ModelEvent, MultiplierLimit

SCHEMA = "lagcli-derivation-2"
SIGN_CONVENTION = (
    "d/dt dL/dq' - dL/dq = Q + sum of lambda*b over the constraints, with b = dphi/dq of a"
    " holonomic constraint phi = 0 and b = dpsi/dq' of a nonholonomic one psi = 0; of an equation"
    " lhs = rhs, phi or psi is lhs - rhs"
)


def render_json(f: Formulas, contents: Contents) -> str:
    """Return the equations as JSON in the schema of this module.

    Parameters
    ----------
    f : Formulas
        Formulas of the system.
    contents : Contents
        Requested content; its steps are added as a list.
    """
    full = contents.full
    plain = Formulas(f.equations, bool(f.values), named=False, freedom=f.freedom)
    matrices = Matrices(plain, PARTS) if in_matrices(f, full) else None
    writer = _JsonWriter(plain, matrices)
    content = writer.content()
    content |= writer.kinds(contents)
    if contents.steps and matrices is None:
        content["steps"] = [
            {
                "title": step.title,
                "lead": step.lead,
                "remark": step.remark,
                "lines": [writer.line(line) for line in step.lines],
            }
            for step in shown_steps(f, contents)
        ]
    return json.dumps(content, ensure_ascii=False, indent=2) + "\n"


class _JsonWriter:
    def __init__(self, f: Formulas, matrices: Matrices | None):
        self.f, self.matrices = f, matrices
        self.entries = matrices.formulas_of() if matrices is not None else {}
        names = Notation(f.model)
        self.latex = LatexFormula(names, written_decimals(f.model), bool(f.values)).latex
        self.names = names

    def formula(self, expression: Basic, part: str, i: int, j: int = 0) -> dict[str, str]:
        """Return an entry, with abbreviations if there are any."""
        if self.matrices is None:
            return self.node(self.f.arrange(expression))
        key = (part, min(i, j), max(i, j)) if part == "M" else (part, i, j)
        return self.node(self.entries.get(key, ZERO))

    def node(self, node: Node) -> dict[str, str]:
        return {"text": grammar_text(node), "latex": self.latex(node)}

    def line(self, line: Line) -> dict[str, str | None]:
        label = line.label
        return {
            "latex": " = ".join(map(self.latex, line.sides)),
            "label": self.latex(label) if isinstance(label, Node) else label,
            "note": line.remark,
        }

    def content(self) -> dict[str, Any]:
        e, model = self.f.equations, self.f.model
        return {
            "schema": SCHEMA,
            "name": model.name,
            "title": model.title,
            "description": model.description,
            "numeric": bool(self.f.values),
            "coordinates": [
                {
                    "name": c.name,
                    "unit": c.unit,
                    "description": c.description,
                    "latex": self.names.latex(c.name),
                }
                for c in model.coordinates
            ],
            "parameters": model.declared_values,
            "inputs": [
                {
                    "name": x.name,
                    "unit": si_notation(x.data.unit) if x.data.unit else None,
                    "description": x.description,
                    "interpolation": x.interpolation,
                    "extend": x.extend,
                    "file": x.data.file or None,
                    "sha256": x.data.sha256 or None,
                }
                for x in model.inputs.values()
            ],
            "form": "written-out" if self.matrices is None else "matrices",
            "abbreviations": self.abbreviations(),
            "constraints": [self.constraint(i, c) for i, c in enumerate(e.constraints)],
            "events": [self.event(event) for event in model.events],
            **{
                key: value
                for key, value in self.f.freedom.to_mapping().items()
                if key in ("rank", "degrees_of_freedom", "redundant")
            },
            "kinetic": self.formula(e.kinetic, "energy", 0),
            "potential": self.formula(e.potential, "energy", 1),
            "lagrangian": self.formula(e.lagrangian, "energy", 2),
            "mass_matrix": [
                [i, j, self.formula(m, "M", i, j)]
                for i, row in enumerate(e.mass_matrix)
                for j, m in sorted(row.items())
            ],
            "forcing": [self.formula(x, "f", i) for i, x in enumerate(e.forcing)],
            "applied_forces": [self.formula(x, "Q", i) for i, x in enumerate(e.applied_forces)],
            "equations": None
            if self.matrices is not None
            else [self.equation(i) for i in range(len(e.q))],
            "sign_convention": SIGN_CONVENTION,
        }

    def kinds(self, contents: Contents) -> dict[str, Any]:
        p = contents.partition
        content: dict[str, Any] = {"kinds": list(contents.kinds), "partition": None}
        if p is None:
            return content
        names, constraints = self.f.model.coordinate_names, self.f.model.constraint_names
        content["partition"] = {
            "independent": [names[i] for i in p.independent],
            "dependent": [names[i] for i in p.dependent],
            "constraints": [constraints[i] for i in p.constraints],
            "surplus": [constraints[i] for i in p.surplus],
            "determinants": list(map(self.arranged, p.determinants)),
        }
        solved: dict[str, list[SolvedUnknown]] = {}
        for kind in contents.kinds:
            if kind == "second":
                second = second_kind(p, contents.full)
                content["second"] = self.second(second)
                solved[kind] = solve_accelerations(second) if contents.solve else []
            elif kind == "maggi":
                content["maggi"] = self.maggi(Maggi(p))
                solved[kind] = solve_accelerations(Maggi(p)) if contents.solve else []
            else:
                solved[kind] = solve_first_kind(p) if contents.solve else []
        if contents.solve:
            content["solved"] = {kind: self.solved(x) for kind, x in solved.items()}
        return content

    def arranged(self, expression: Basic) -> dict[str, str]:
        return self.node(self.f.arrange(expression))

    def solved(self, unknowns: list[SolvedUnknown]) -> list[dict[str, Any]] | None:
        return [
            {
                "unknown": x.unknown.name,
                "numerator": self.arranged(x.numerator),
                "denominator": self.arranged(x.denominator),
            }
            for x in unknowns
        ] or None

    def second(self, second: SecondKind) -> dict[str, Any]:
        names = self.f.model.coordinate_names
        dependent = []
        for solved in second.blocks:
            constraints = [self.f.model.constraint_names[i] for i in solved.block.rows]
            values = {x.unknown.name: x for x in solved.solutions}
            ordered = [*values, *(names[i] for i in solved.block.columns if names[i] not in values)]
            for name in ordered:
                x = values.get(name)
                parts = {} if x is None else {"value": x.value, "angle": x.angle}
                parts |= {} if x is None else {"sine": x.sine, "cosine": x.cosine}
                dependent.append(
                    {"coordinate": name, "constraints": constraints}
                    | dict.fromkeys(("value", "angle", "sine", "cosine"))
                    | {k: self.arranged(v) for k, v in parts.items() if v is not None}
                )
        return {
            "dependent": dependent,
            "velocities": {names[i]: self.arranged(x) for i, x in second.rates.items()},
            "lagrangian": None if second.is_long else self.arranged(second.lagrangian),
            **self.motion(second.mass_matrix, second.forcing),
        }

    def maggi(self, maggi: Maggi) -> dict[str, Any]:
        p = maggi.partition
        return {
            "null_space": [
                [i, k, self.arranged(x)]
                for i, row in enumerate(p.null_space)
                for k, x in sorted(row.items())
            ],
            "drift": list(map(self.arranged, p.drift)),
            **self.motion(maggi.mass_matrix, maggi.forcing),
        }

    def motion(
        self, mass_matrix: tuple[tuple[Basic, ...], ...], forcing: tuple[Basic, ...]
    ) -> dict[str, Any]:
        """Return M and f, with abbreviations if they are long."""
        size = len(forcing)
        entries = [*(x for row in mass_matrix for x in row), *forcing]
        model = self.f.model
        named: Mapping[str, Basic] = {}
        if operations(entries) > LONGEST:
            taken = (*model.coordinate_names, *model.parameters, *model.definitions)
            named, shortened = abbreviate(entries, taken)
            entries = list(shortened)
        formulas = list(map(self.arranged, entries))
        return {
            "abbreviations": [{"name": n, **self.arranged(x)} for n, x in named.items()],
            "mass_matrix": [formulas[i * size : (i + 1) * size] for i in range(size)],
            "forcing": formulas[size * size :],
        }

    def equation(self, i: int) -> dict[str, Any]:
        left, right = self.f.equation_line(i).sides
        name = self.f.model.coordinates[i].name
        return {"coordinate": name, "lhs": self.node(left), "rhs": self.node(right)}

    def abbreviations(self) -> list[dict[str, str]]:
        if self.matrices is None:
            return []
        return [
            {"name": side.name, **self.node(value)}
            for side, value in (line.sides for line in self.matrices.abbreviations())
            if isinstance(side, Symbol)
        ]

    def constraint(self, i: int, c: ConstraintEquation) -> dict[str, Any]:
        names = self.f.model.coordinate_names
        row = {j: self.formula(b, "B", i, j) for j, b in sorted(c.row.items())}
        return {
            "name": c.constraint.name,
            "kind": c.constraint.kind,
            "rheonomic": c.rheonomic,
            "integrable": integrable(c, self.f.equations)
            if c.constraint.kind == "nonholonomic"
            else None,
            "expression": self.formula(c.constraint.expression, "expression", i),
            "written": " = ".join(
                map(self.latex, as_inequality(self.f.constraint_line(c), c).sides)
            ),
            "variation": {names[j]: b for j, b in row.items()},
            "row": [[j, b] for j, b in row.items()],
            "drift": self.formula(c.drift, "drift", i),
            "gamma": self.formula(c.rhs, "gamma", i),
            "relation": c.constraint.relation,
            "active": c.constraint.active,
            "restitution": self.optional(c.constraint.restitution),
            "limit": self.limit(c.constraint.limit),
        }

    def optional(self, expression: Basic | None) -> dict[str, str] | None:
        return None if expression is None else self.arranged(expression)

    def limit(self, limit: MultiplierLimit | None) -> dict[str, Any] | None:
        if limit is None:
            return None
        both = {"static": limit.static, "kinetic": limit.kinetic}
        return {**{k: self.arranged(x) for k, x in both.items()}, "normal": limit.normal}

    def clock(self, clock: EventClock | None) -> dict[str, Any] | None:
        if clock is None:
            return None
        return {"period": self.arranged(clock.period), "offset": self.arranged(clock.offset)}

    def event(self, event: ModelEvent) -> dict[str, Any]:
        action = event.action
        return {
            "name": event.name,
            "when": event.when,
            "condition": self.optional(event.condition),
            "either": event.either,
            "clock": self.clock(event.clock),
            "change": event.change and list(event.change),
            "set": {name: self.arranged(x) for name, x in action.set.items()},
            "impulse": {name: self.arranged(x) for name, x in action.impulse.items()},
            "release": list(action.release),
            "engage": list(action.engage),
            "stop": action.stop,
            "times": event.times,
            "record": None if action.record is None else list(action.record),
        }
