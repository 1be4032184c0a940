"""MATLAB and Octave: a function that returns the functions of a model."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from lagcli.engine.tape.operations import Op
from lagcli.export.assets import asset, filled
from lagcli.export.content import Content
from lagcli.export.expressions import Syntax, helpers
from lagcli.export.names import Identifiers, words
from lagcli.export.sections import CodeSection, CodeWriter
from lagcli.functions import Domain

_RESERVED = words(
    "break case catch classdef continue else elseif end for function global if otherwise parfor"
    " persistent return spmd switch try while do until unwind_protect endif endfor endfunction"
    " ans eps e i j I J Inf inf NaN nan NA pi realmin realmax true false nargin nargout M f B"
    " gamma position velocity out model S equations residuals outputs dynamics slopes derivatives"
    " solve simulate piece ifelse clipped abs sqrt exp log sin cos tan asin acos atan atan2 sinh"
    " cosh tanh asinh acosh atanh floor ceil power erf erfc zeros expm1 log1p"
    " real_sqrt real_log real_power real_asin real_acos real_acosh real_atanh real_log1p"
)


def number(value: float) -> str:
    """Return a number in MATLAB, exactly."""
    if math.isfinite(value):
        return repr(float(value))
    return "NaN" if math.isnan(value) else "Inf" if value > 0 else "-Inf"


def _is_partial(op: Op) -> bool:
    """Return whether MATLAB gives complex numbers where an operation has no real value."""
    return op is Op.POW or (op.function is not None and op.function.domain != Domain())


def _built_in(op: Op) -> str:
    return "power" if op is Op.POW else op.name.lower()


def _function(op: Op) -> str:
    return f"real_{_built_in(op)}" if _is_partial(op) else _built_in(op)


_SYNTAX = Syntax(
    "ifelse({0}, {1}, {2})",
    _function,
    {Op.AND: "({0} && {1})", Op.OR: "({0} || {1})", Op.NOT: "~({0})"},
    number,
    {Op.NE: "{0} ~= {1}"},
    infix_choice=False,
)
_CHOICE = """
function out = ifelse(condition, yes, no)
  % one of two values
  if condition
    out = yes;
  else
    out = no;
  end
end"""
_REGULAR_JACOBIAN = """\
  S = slopes(t, q, v, a, multipliers, p);
  [of_a, of_multipliers] = solve(M, S(1:n, :), B, S(n+1:end, :));"""
_LEAST_NORM = """\
  % B = C B_r; of all lambda with B' lambda = B_r' mu, the one of least norm
  C = ((B(rows, :) * B(rows, :)') \\ (B(rows, :) * B'))';
  multipliers = C * ((C' * C) \\ multipliers);
"""


def write_matlab(content: Content) -> str:
    """Return the equations of a model as a function of MATLAB, which Octave runs."""
    writer = CodeWriter(content, _SYNTAX, "{0}({1})", _RESERVED, first=1, differentiates=True)
    system, state, settings = content.system, content.start.state, content.settings
    name = Identifiers(_RESERVED).of(content.model.name)
    head = [
        *content.described("{0}({1})", 1),
        "",
        f"Simulate, from the file {name}.m, with",
        "",
        f"    m = {name}();",
        "    [q, v, a, multipliers, out] = m.simulate(m.times, m.q, m.v, m.p);",
    ]
    texts = {
        "name": name,
        "head": "\n% ".join(head).replace("\n%  \n", "\n%\n"),
        "coordinates": _strings(system.coordinates),
        "constraint_names": _strings(system.constraints),
        "parameter_names": _strings(system.parameters),
        "columns": _strings(content.columns),
        "parameters": _column(state.p),
        "position": _column(state.q),
        "velocity": _column(state.v),
        "start": number(state.t),
        "end": number(settings.t_end),
        "samples": str(max(2, settings.sample_count)),
        "rtol": number(settings.rtol),
        "atol": _column(content.tolerances),
        "equations_body": "\n".join(_equations(writer)),
        "constraints_body": "\n".join(_constraints(writer)),
        "outputs_body": "\n".join(_outputs(writer)),
        "holonomic": _places(system.holonomic),
        "rows": _places(content.rows),
        "slopes_body": "\n".join(_slopes(writer)),
        "jacobian": asset("jacobian_matlab.m").rstrip() if content.redundant else _REGULAR_JACOBIAN,
        "solution": _LEAST_NORM if content.redundant else "",
        "count": str(len(system.constraints)),
        "outputs_count": str(len(content.columns)),
        "helpers": "\n".join(_helpers(writer)),
    }
    text = filled(asset("model_matlab.m"), **texts)
    if "ifelse(" in text:
        text += _CHOICE
    return "\n".join(line.rstrip() for line in text.splitlines()).rstrip() + "\n"


def _strings(names: Iterable[str]) -> str:
    return ", ".join("'" + name.replace("'", "''") + "'" for name in names)


def _column(values: Iterable[float]) -> str:
    return "; ".join(map(number, values))


def _places(indices: Sequence[int]) -> str:
    return f"[{', '.join(str(i + 1) for i in indices)}]"


def _body(writer: CodeWriter, section: CodeSection) -> list[str]:
    lines = [f"  {x.name} = {writer.place(x.array, x.place)};" for x in section.variables]
    lines += [f"  {name} = table_{i}(t);" for name, i in section.pieces]
    return lines + [f"  {name} = {writer.syntax.text(x)};" for name, x in section.assigned.steps]


def _entries(name: str, values: Sequence[str]) -> list[str]:
    lines = [f"  {name} = zeros({len(values)}, 1);"]
    return lines + [f"  {name}({i}) = {x};" for i, x in enumerate(values, 1)]


def _equations(writer: CodeWriter) -> list[str]:
    section, system = writer.sections.dynamics, writer.content.system
    parts, counts = system.dynamics_layout.split(section.assigned.outputs), system.counts
    mass = writer.matrix(system.mass_pattern, parts["mass_matrix"])
    rows = writer.matrix(system.jacobian_pattern, parts["jacobian"])
    return [
        *_body(writer, section),
        f"  M = zeros({counts.nq}, {counts.nq});",
        *(f"  M({i}, {j}) = {x};" for i, j, x in mass),
        *_entries("f", writer.vector(parts["forcing"])),
        f"  B = zeros({counts.nc}, {counts.nq});",
        *(f"  B({i}, {j}) = {x};" for i, j, x in rows),
        *_entries("gamma", writer.vector(parts["rhs"])),
    ]


def _constraints(writer: CodeWriter) -> list[str]:
    section, nh = writer.sections.constraints, writer.content.system.counts.nh
    values = writer.vector(section.assigned.outputs)
    residuals = [*_entries("position", values[:nh]), *_entries("velocity", values[nh:])]
    return [*_body(writer, section), *residuals]


def _outputs(writer: CodeWriter) -> list[str]:
    section = writer.sections.report
    values = writer.vector(section.assigned.outputs)
    return [*_body(writer, section), *_entries("out", values)]


def _slopes(writer: CodeWriter) -> list[str]:
    section, entries = writer.slopes()
    system = writer.content.system
    columns = 1 + 2 * system.counts.nq + len(system.parameters)
    lines = [*_body(writer, section), f"  S = zeros({system.counts.unknowns}, {columns});"]
    return lines + [f"  S({i}, {j}) = {x};" for i, j, x in entries]


def _helpers(writer: CodeWriter) -> list[str]:
    """Return the functions that MATLAB lacks, and the tables."""
    lines = []
    for op in filter(_is_partial, sorted(writer.sections.used)):
        arguments = ", ".join("xy"[: op.arity])
        lines += [
            "",
            f"function out = {_function(op)}({arguments})",
            f"  % {_built_in(op)}, NaN where it has no real value",
            f"  out = {_built_in(op)}({arguments});",
            "  if ~isreal(out)",
            "    out = NaN;",
            "  end",
            "end",
        ]
    for helper in helpers(writer.sections.used, writer.syntax):
        lines += [
            "",
            f"function out = {helper.name}({', '.join(helper.parameters)})",
            f"  % {helper.comment}",
            f"  out = {helper.value};",
            "end",
        ]
    pieces = sorted(writer.sections.pieces)
    for i in pieces:
        f = writer.content.functions[i]
        rows = zip(f.origins, f.coefficients, strict=True)
        listed = "".join(f"\n    {', '.join(map(number, [x, *row]))};" for x, row in rows)
        ends = ", ".join(map(number, (f.first, f.last, f.period)))
        lines += [
            "",
            f"function out = table_{i}(t)",
            f"  % {f.name}: knots; of each piece its origin and coefficients; first, last, period",
            f"  knots = [{_column(f.knots)}];",
            f"  pieces = [{listed}\n  ];",
            f"  out = piece(t, knots, pieces, {ends});",
            "end",
        ]
    if pieces:
        lines.append(asset("table_matlab.m"))
    return lines
