"""Modelica: one model with the equations of index 1."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence

from lagcli.engine.tape.inputs import RESOLUTION
from lagcli.engine.tape.operations import Op
from lagcli.errors import UsageError
from lagcli.export.assets import asset, filled
from lagcli.export.content import Content, wrapped
from lagcli.export.expressions import Syntax, helpers
from lagcli.export.names import Identifiers, words
from lagcli.export.sections import CodeSection, CodeWriter

_RESERVED = words(
    "algorithm and annotation assert block break class connect connector constant constrainedby der"
    " discrete each else elseif elsewhen encapsulated end enumeration equation expandable extends"
    " external false final flow for function if import impure in initial inner input loop model"
    " not operator or outer output package parameter partial protected public pure record"
    " redeclare replaceable return stream then true type when while within time t Real Integer"
    " Boolean String abs sign sqrt div mod rem ceil floor integer semiLinear homotopy delay"
    " cardinality inStream actualStream spatialDistribution getInstanceName initial terminal"
    " smooth sample pre edge change reinit noEvent sin cos tan asin acos atan atan2 sinh cosh tanh"
    " asinh acosh atanh exp log log10 min max sum product size fill zeros ones identity transpose"
    " cross skew symmetric scalar vector matrix cat piece clipped stabilization expm1 log1p"
)
_LARGE = 1e300  # Modelica has no infinity


def number(value: float) -> str:
    """Return a number in Modelica, exactly if it is finite."""
    if math.isnan(value):
        raise UsageError("Modelica has no number for an undefined constant of the model")
    return repr(max(-_LARGE, min(float(value), _LARGE)))


def _function(op: Op) -> str:
    if op.name in ("ERF", "ERFC"):
        raise UsageError(
            f"Modelica has no function `{op.name.lower()}`, which the model uses; --to c, python,"
            " casadi, jax and matlab have it"
        )
    return op.name.lower()


_SYNTAX = Syntax(
    "if {0} then {1} else {2}",
    _function,
    {Op.AND: "({0} and {1})", Op.OR: "({0} or {1})", Op.NOT: "not ({0})"},
    number,
    {Op.EQ: "not ({0} < {1} or {0} > {1})", Op.NE: "({0} < {1} or {0} > {1})"},
    power="{0}^{1}",
)
#: Functions that Modelica lacks, of x.
_LACKING = {
    "ASINH": "if x < 0 then -log(sqrt(x*x + 1) - x) else log(x + sqrt(x*x + 1))",
    "ACOSH": "log(x + sqrt(x - 1)*sqrt(x + 1))",
    "ATANH": "0.5*log((1 + x)/(1 - x))",
    "EXPM1": "(exp(x) + 1)*tanh(x/2)",
    "LOG1P": "log(1 + x)",
}


def write_modelica(content: Content) -> str:
    """Return the equations of a model in Modelica."""
    return _ModelicaText(content).text()


class _ModelicaText:
    """The parts of one model."""

    def __init__(self, content: Content):
        self.content = content
        self.writer = CodeWriter(content, _SYNTAX, "{0}[{1}]", _RESERVED, first=1)
        self.names = self.writer.names
        self.declared: list[str] = []
        self.equations: list[str] = []
        self.mass: dict[tuple[int, int], str] = {}
        self.rows: list[dict[int, str]] = [{} for _ in content.system.constraints]

    def text(self) -> str:
        content, model = self.content, self.content.model
        name = Identifiers(_RESERVED).of(model.name)
        visible = self.visible()
        self.dynamics()
        self.motion()
        self.outputs()
        functions = self.functions()
        about = [*content.described(""), "", *wrapped(_ABOUT)]
        lines = [
            f"model {name} {_quoted(model.title)}",
            *(f"  // {line}".rstrip() for line in about),
            *visible,
            "protected",
            *(f"  {line}" for line in self.declared),
            *(f"  {line}" for line in functions),
            "equation",
            *(f"  {line}" for line in self.equations),
            f"  annotation (experiment(StartTime={number(content.settings.t_start)},"
            f" StopTime={number(content.settings.t_end)},"
            f" Tolerance={number(content.settings.rtol)}));",
            f"end {name};",
        ]
        return "\n".join(lines) + "\n"

    def visible(self) -> list[str]:
        """Return the declarations of parameters, coordinates, multipliers and outputs."""
        writer, content, units = self.writer, self.content, self.content.model.units
        state, model = content.start.state, content.model
        lines = ['  parameter Real stabilization(unit="1/s") = 10 "rate at which drift decays";']
        for own, p, value in zip(writer.p, model.parameters.values(), state.p, strict=True):
            lines.append(_declared("parameter Real", own, units.of(p.name), p.description, value))
        for names, values, order in ((writer.q, state.q, 0), (writer.v, state.v, 1)):
            for own, c, value in zip(names, model.coordinates, values, strict=True):
                unit = _rate(units.of(c.name), order)
                text = c.description if not order else f"rate of {c.name}"
                lines.append(_declared("Real", own, unit, text, start=float(value)))
        for own, c in zip(writer.a, model.coordinates, strict=True):
            unit = _rate(units.of(c.name), 2)
            lines.append(_declared("Real", own, unit, f"acceleration of {c.name}"))
        for own, constraint in zip(writer.multipliers, model.constraints, strict=True):
            unit, text = units.of_multiplier(constraint.name), constraint.description
            lines.append(_declared("Real", own, unit, text or f"multiplier of {constraint.name}"))
        self.columns = [self.names.of(name) for name in content.columns]
        own_units = [None] * (len(content.columns) - len(content.system.outputs))
        given = [*own_units, *map(units.of_output, content.system.outputs)]
        for own, unit in zip(self.columns, given, strict=True):
            lines.append(_declared("Real", own, unit, None))
        return lines

    def body(self, section: CodeSection, prefix: str) -> CodeSection:
        """Add the intermediate variables of a function; return it with their own names."""
        renamed = {name: self.names.of(f"{prefix}{name}") for name, _ in section.assigned.steps}
        section = section.renamed(renamed)
        for name, x in section.assigned.steps:
            self.declared.append(f"Real {name};")
            self.equations.append(f"{name} = {self.writer.syntax.text(x)};")
        return section

    def variable(self, name: str, value: str) -> str:
        """Return a variable with a value; a name or a number is its own."""
        if value.replace("_", "").replace(".", "").isalnum():
            return value
        own = self.names.of(name)
        self.declared.append(f"Real {own};")
        self.equations.append(f"{own} = {value};")
        return own

    def dynamics(self) -> None:
        """Add M, f, B and γ."""
        writer, system = self.writer, self.content.system
        if any(
            "t" in section.assigned.read or section.pieces for section in writer.sections.written
        ):
            self.declared.append("Real t;")
            self.equations.append("t = time;")
        for name, i in dict.fromkeys(x for s in writer.sections.written for x in s.pieces):
            size = self.content.functions[i].size
            self.declared.append(f"Real {name}[{size}];")
            self.equations.append(f"{name} = table_{i}(t);")
        section = self.body(writer.sections.dynamics, "dynamics_")
        parts = system.dynamics_layout.split(section.assigned.outputs)
        for i, j, x in writer.matrix(system.mass_pattern, parts["mass_matrix"]):
            known = self.mass.get((j - 1, i - 1)) if j < i else None
            self.mass[i - 1, j - 1] = known or self.variable(f"M_{i}_{j}", x)
        for i, j, x in writer.matrix(system.jacobian_pattern, parts["jacobian"]):
            self.rows[i - 1][j - 1] = self.variable(f"B_{i}_{j}", x)
        self.forcing = [writer.syntax.term(x) for x in parts["forcing"]]
        self.rhs = [writer.syntax.term(x) for x in parts["rhs"]]

    def motion(self) -> None:
        """Add the equations of motion."""
        writer, content, system = self.writer, self.content, self.content.system
        section = self.body(writer.sections.constraints, "residual_")
        values = writer.vector(section.assigned.outputs)
        nh = system.counts.nh
        position = {
            i: self.variable(f"residual_{system.constraints[i]}", x)
            for i, x in zip(system.holonomic, values[:nh], strict=True)
        }
        velocity = [
            self.variable(f"residual_rate_{name}", x)
            for name, x in zip(system.constraints, values[nh:], strict=True)
        ]
        for q, v, a in zip(writer.q, writer.v, writer.a, strict=True):
            self.equations += [f"der({q}) = {v};", f"der({v}) = {a};"]
        for i, own in enumerate(self.forcing):
            left = [f"{m}*{writer.a[j]}" for (k, j), m in self.mass.items() if k == i]
            terms = zip(self.rows, writer.multipliers, strict=True)
            right = [f"{row[i]}*{force}" for row, force in terms if i in row]
            self.equations.append(f"{_sum(left)} = {' + '.join([own, *right])};")
        for k in content.rows:
            left = [f"{b}*{writer.a[j]}" for j, b in self.rows[k].items()]
            decay = f" - 2*stabilization*{velocity[k]}"
            if k in position:
                decay += f" - stabilization^2*{position[k]}"
            self.equations.append(f"{_sum(left)} = {self.rhs[k]}{decay};")
        self.least_norm()

    def least_norm(self) -> None:
        """Add the equations of λ of redundant constraints: λ = C λ_r, where B = C B_r."""
        kept = self.content.rows
        for d in (i for i in range(len(self.rows)) if i not in kept):
            shares = [self.names.of(f"share_{d + 1}_{r + 1}") for r in kept]
            self.declared += [f"Real {name};" for name in shares]
            for r in kept:
                terms = [
                    f"({product})*{share}"
                    for s, share in zip(kept, shares, strict=True)
                    if (product := self.product(r, s))
                ]
                self.equations.append(f"{_sum(terms)} = {self.product(r, d) or '0'};")
            terms = [
                f"{x}*{force}"
                for x, force in zip(shares, (self.writer.multipliers[r] for r in kept), strict=True)
            ]
            self.equations.append(f"{self.writer.multipliers[d]} = {_sum(terms)};")

    def product(self, i: int, k: int) -> str:
        """Return the product of two rows of B."""
        first, second = self.rows[i], self.rows[k]
        return " + ".join(f"{x}*{second[j]}" for j, x in first.items() if j in second)

    def outputs(self) -> None:
        """Add energies, powers and outputs."""
        section = self.body(self.writer.sections.report, "output_")
        values = self.writer.vector(section.assigned.outputs)
        self.equations += [f"{x} = {y};" for x, y in zip(self.columns, values, strict=True)]

    def functions(self) -> list[str]:
        """Return the functions that Modelica lacks, and the tables."""
        used, lines = self.writer.sections.used, list[str]()
        for op in sorted(used):
            if op.name in _LACKING:
                lines += _function_of(op.name.lower(), ["x"], _LACKING[op.name], op.name.lower())
        for helper in helpers(used, self.writer.syntax):
            lines += _function_of(helper.name, helper.parameters, helper.value, helper.comment)
        for i in sorted(self.writer.sections.pieces):
            f = self.content.functions[i]
            rows = zip(f.origins, f.coefficients, strict=True)
            text = filled(
                asset("table.mo"),
                name=f"table_{i}",
                title=f.name.replace('"', "'"),
                count=str(len(f.knots)),
                size=str(f.size),
                knots=", ".join(map(number, f.knots)),
                pieces=", ".join(f"{{{', '.join(map(number, [x, *row]))}}}" for x, row in rows),
                slack=repr(RESOLUTION),
                size_of_time="max(abs(x), abs(x - knots[1]))" if f.period else "abs(x)",
                first=number(f.first),
                last=number(f.last),
                shift=f"floor((x + slack - knots[1])/{number(f.period)})*{number(f.period)}"
                if f.period
                else "0",
            )
            lines += text.splitlines()
        return lines


_ABOUT = (
    "The equations have index 1. Residuals of the constraints decay with the rate stabilization."
)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _sum(terms: Sequence[str]) -> str:
    return " + ".join(terms) if terms else "0"


def _rate(unit: str | None, order: int) -> str | None:
    """Return the unit of a derivative with respect to time."""
    if unit is None or not order:
        return unit
    below = "s" if order == 1 else f"s{order}"
    if "/" in unit:
        top, _, bottom = unit.partition("/")
        return f"{top}/({bottom}.{below})"
    return f"{unit}/{below}"


def _unit(unit: str) -> str:
    """Return a unit in Modelica's notation: ``kg.m2/s2``; of several divisors one product."""
    head, *tail = unit.replace("^", "").replace("*", ".").split("/")
    below = ".".join(x.strip("()") for x in tail)
    return head if not tail else f"{head}/({below})" if "." in below else f"{head}/{below}"


def _declared(
    kind: str,
    name: str,
    unit: str | None,
    text: str | None,
    value: float | None = None,
    start: float | None = None,
) -> str:
    """Return a declaration."""
    given = [] if unit is None else [f"unit={_quoted(_unit(unit))}"]
    if start is not None:
        given += [f"start={number(start)}", "fixed=true"]
    attributes = f"({', '.join(given)})" if given else ""
    assigned = "" if value is None else f" = {number(value)}"
    return f"  {kind} {name}{attributes}{assigned}{f' {_quoted(text)}' if text else ''};"


def _function_of(name: str, inputs: Iterable[str], value: str, comment: str) -> list[str]:
    """Return a function of one expression."""
    return [
        f"function {name} {_quoted(comment)}",
        *(f"  input Real {x};" for x in inputs),
        "  output Real y;",
        "algorithm",
        f"  y := {value};",
        f"end {name};",
    ]
