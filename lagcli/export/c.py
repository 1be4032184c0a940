"""C: one file in C11 with the equations, their solution, and a program that simulates."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence

from lagcli.engine.tape.operations import Op
from lagcli.export.assets import asset, filled
from lagcli.export.content import Content, wrapped
from lagcli.export.expressions import Syntax, helpers
from lagcli.export.names import Identifiers, words
from lagcli.export.sections import CodeSection, CodeWriter

_RESERVED = words(
    "auto break case char const continue default do double else enum extern float for goto if"
    " inline int long register restrict return short signed sizeof static struct switch typedef"
    " union unsigned void volatile while main M f B gamma position velocity out lambda j0 j1 jn y0"
    " y1 yn NULL INFINITY NAN errno stdin stdout stderr signgam index time NQ NC NH NP NO ROWS"
    " POSITIONS NONLINEAR rows position_rows position_of unit terms raise_scales bounded clipped"
    " piece table solve share rate"
    " solve_constrained slopes S J NX share shares multiply solve_shares slopes_along"
    " share_jacobian eliminated"
    " abs exp log log10 log2 pow sin cos tan asin acos atan atan2 sinh cosh tanh"
    " asinh acosh atanh sqrt cbrt hypot erf erfc floor ceil fabs fmax fmin fmod round trunc rint"
    " free malloc calloc exit printf puts getc putc rand div abort system remove rename"
    " linux unix i386 L_ctermid L_cuserid L_tmpnam L_tmpnam_s P_tmpdir alloca environ"
    " math_errhandling memcpy memset onexit_t pclose popen ru_first ru_last sa_handler"
    " sa_sigaction sigmask sv_onstack sys_errlist sys_nerr w_coredump w_retcode w_stopsig w_stopval"
    " w_termsig wpopen expm1 log1p"
)

# the headers have hundreds, other ones on each system: EOF, M_PI, HUGE
_MACRO = re.compile(r"[A-Z][0-9A-Z_]{2,}")


def _function(op: Op) -> str:
    return "fabs" if op is Op.ABS else op.name.lower()


def number(value: float) -> str:
    """Return a number in C, exactly."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))


_SYNTAX = Syntax(
    "{0} ? {1} : {2}",
    _function,
    {Op.AND: "({0} && {1})", Op.OR: "({0} || {1})", Op.NOT: "!({0})"},
    number,
)


def write_c(content: Content) -> str:
    """Return the equations of a model as a program in C."""
    named = (*content.system.coordinates, *content.system.parameters)
    reserved = {*_RESERVED, *(x for x in named if _MACRO.fullmatch(x))}
    writer = CodeWriter(content, _SYNTAX, "{0}[{1}]", reserved, differentiates=True, projects=True)
    counts, name = content.system.counts, Identifiers(_RESERVED).of(content.model.name)
    own = asset("model.c").replace("model_", f"{name}_").replace("MODEL_", f"{name.upper()}_")
    state, settings = content.start.state, content.settings
    system = content.system
    names = [*system.coordinates, *(f"{x}'" for x in system.coordinates)]
    names += [f"lambda.{x}" for x in system.constraints]
    redundant = bool(content.redundant)
    sizes = {
        "NQ": counts.nq,
        "NC": counts.nc,
        "NH": counts.nh,
        "NP": len(system.parameters),
        "NO": len(content.columns),
        "NX": 1 + 2 * counts.nq + len(system.parameters),
        "ROWS": len(content.rows),
        "POSITIONS": len(content.position_rows),
        "NONLINEAR": len(system.nonlinear),
    }
    head = [
        *content.described(),
        "",
        f"    cc -std=c11 -O2 {name}.c -lm && ./a.out > run.csv",
        "",
        *wrapped(f"Compile with -D{name.upper()}_WITHOUT_MAIN for the functions alone."),
    ]
    text = filled(
        own,
        sizes="enum { " + ", ".join(f"{k} = {n}" for k, n in sizes.items()) + " };",
        parameters=_numbers([*state.p, 0.0]),
        start=number(state.t),
        state=_numbers([*state.q, *state.v]),
        rows=_rows(content),
        helpers="\n".join(_helpers(writer)),
        equations="\n".join(_equations(writer)),
        constraints="\n".join(_constraints(writer, writer.sections.constraints)),
        terms="\n".join(_terms(writer)),
        outputs="\n".join(_outputs(writer)),
        slopes="\n".join(_slopes(writer)),
        columns=_strings(content.columns),
        share=asset("share.c") if redundant else "",
        eliminated=_eliminated(writer),
        solved=_SOLVED if writer.solved else "",
        solution=_SHARED if redundant else _REGULAR,
        jacobian=_SHARED_JACOBIAN if redundant else _REGULAR_JACOBIAN,
        names=_strings(names),
        atol=_numbers(content.tolerances),
        rtol=number(settings.rtol),
        end=number(settings.t_end),
        samples=str(max(2, settings.sample_count)),
    )
    lines = [" * " + line.replace("*/", "* /").replace("/*", "/ *") for line in head]
    return "\n".join(["/*", *(line.rstrip() for line in lines), " */", text])


_SOLVED = """\
    if (eliminated(t, q, v, p, a, lambda))
        return 0;
"""
_REGULAR = "    return solve_constrained(M, f, B, NC, rows, 1, gamma, a, lambda);"
_SHARED = """\
    double c[ROWS], mu[ROWS];
    for (int i = 0; i < ROWS; ++i)
        c[i] = gamma[rows[i]];
    return solve_constrained(M, f, B, ROWS, rows, 1, c, a, mu) || share(B, mu, lambda);"""
_REGULAR_JACOBIAN = """\
    double *S = malloc(sizeof(double) * (NQ + NC) * NX);
    if (!S)
        return 1;
    slopes(t, q, v, a, lambda, p, S);
    const int singular = solve_constrained(M, S, B, NC, rows, NX, S + NQ * NX, J, J + NQ * NX);
    free(S);
    return singular;"""
_SHARED_JACOBIAN = "    return share_jacobian(t, q, v, p, M, B, a, lambda, J);"


def _rows(content: Content) -> str:
    """Return the independent constraints; their holonomic ones; and where phi has these."""
    arrays = {
        "rows[ROWS + 1]": content.rows,
        "position_rows[POSITIONS + 1]": content.position_rows,
        "position_of[POSITIONS + 1]": content.position_places,
    }
    return "\n".join(
        [
            "/* Constraints that are independent; those of them that are holonomic; their places in"
            " phi. */",
            *(f"static const int {name} = {{{_integers(x)}}};" for name, x in arrays.items()),
            "/* Of each coordinate, the first that is known to have its unit. */",
            f"static const int unit[NQ + 1] = {{{_integers(content.units)}}};",
            "",
        ]
    )


def _integers(values: Iterable[int]) -> str:
    return ", ".join(map(str, [*values, 0]))


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(number(x) for x in values)


def _strings(names: Iterable[str]) -> str:
    return ", ".join(json.dumps(name, ensure_ascii=False) for name in names)


def _helpers(writer: CodeWriter) -> list[str]:
    """Return the functions of the language of models that C lacks."""
    lines: list[str] = []
    for helper in helpers(writer.sections.used, writer.syntax):
        lines += [
            f"/* {helper.comment} */",
            f"static double {helper.name}({', '.join(f'double {x}' for x in helper.parameters)})",
            "{",
            f"    return {helper.value};",
            "}",
            "",
        ]
    if writer.sections.pieces:
        lines += [asset("table.c")]
    for i in sorted(writer.sections.pieces):
        f, own = writer.content.functions[i], f"table_{i}"
        rows = ",\n".join(
            f"    {{{_numbers([origin, *row])}}}"
            for origin, row in zip(f.origins, f.coefficients, strict=True)
        )
        lines += [
            f"/* {f.name}: knots; and the pieces: origin, coefficients. */",
            f"static const double {own}_knots[{len(f.knots)}] = {{{_numbers(f.knots)}}};",
            f"static const double {own}_pieces[{len(f.knots)}][{f.size}] = {{\n{rows}}};",
            f"static const struct table {own} = {{{len(f.knots)}, {f.size}, {own}_knots,"
            f" &{own}_pieces[0][0], {_numbers([f.first, f.last, f.period])}}};",
            "",
        ]
    return lines


def _unpacked(section: CodeSection, arguments: Sequence[str]) -> list[str]:
    """Return the local variables of a function, and the arguments that it does not use."""
    lines = [
        f"    const double {x.name} = {_array(x.array)}[{x.place}];" for x in section.variables
    ]
    for name, i in section.pieces:
        lines += [f"    double {name}[{_size(i)}];", f"    piece(&table_{i}, t, {name});"]
    return [
        *(f"    (void){x};" for x in arguments if x not in {_array(y) for y in section.arrays}),
        *lines,
    ]


def _array(name: str) -> str:
    return "lambda" if name == "multipliers" else name


def _size(i: int) -> str:
    return f"sizeof table_{i}_pieces[0] / sizeof(double)"


def _body(writer: CodeWriter, section: CodeSection, arguments: Sequence[str]) -> list[str]:
    steps = (
        f"    const double {name} = {writer.syntax.text(x)};" for name, x in section.assigned.steps
    )
    return [*_unpacked(section, arguments), *steps]


def _equations(writer: CodeWriter) -> list[str]:
    section, system = writer.sections.dynamics, writer.content.system
    parts = system.dynamics_layout.split(section.assigned.outputs)
    lines = _body(writer, section, ("t", "q", "v", "p"))
    lines += ["    memset(M, 0, sizeof(double) * NQ * NQ);"]
    mass = writer.matrix(system.mass_pattern, parts["mass_matrix"])
    lines += [f"    M[{i} * NQ + {j}] = {x};" for i, j, x in mass]
    lines += [f"    f[{i}] = {x};" for i, x in enumerate(writer.vector(parts["forcing"]))]
    rows = writer.matrix(system.jacobian_pattern, parts["jacobian"])
    if not system.constraints:
        return [*lines, "    (void)B;", "    (void)gamma;"]
    lines += ["    memset(B, 0, sizeof(double) * NC * NQ);"]
    lines += [f"    B[{i} * NQ + {j}] = {x};" for i, j, x in rows]
    return lines + [f"    gamma[{i}] = {x};" for i, x in enumerate(writer.vector(parts["rhs"]))]


def _eliminated(writer: CodeWriter) -> str:
    """Return the function with the unrolled elimination."""
    solved = writer.solved
    if solved is None:
        return ""
    lines = _body(writer, solved.section, ("t", "q", "v", "p"))
    lines += [f"    a[{i}] = {x};" for i, x in enumerate(solved.a)]
    accurate = " &&\n        ".join(solved.accurate) or "1"
    if writer.content.redundant:
        lines += ["    double B[NC * NQ] = {0.0}, mu[ROWS];"]
        lines += [f"    B[{i} * NQ + {j}] = {x};" for i, j, x in solved.jacobian]
        lines += [
            f"    mu[{k}] = {solved.multipliers[i]};" for k, i in enumerate(writer.content.rows)
        ]
        lines += [
            f"    if (!({accurate}))",
            "        return 0;",
            "    return !share(B, mu, lambda);",
        ]
    else:
        lines += [f"    lambda[{i}] = {x};" for i, x in enumerate(solved.multipliers)]
        lines += [] if solved.multipliers else ["    (void)lambda;"]
        lines += [f"    return {accurate};"]
    return filled(asset("eliminated.c"), body="\n".join(lines))


def _terms(writer: CodeWriter) -> list[str]:
    section = writer.sections.terms
    assert section is not None
    return _constraints(writer, section)


def _constraints(writer: CodeWriter, section: CodeSection) -> list[str]:
    counts = writer.content.system.counts
    values = writer.vector(section.assigned.outputs)
    lines = _body(writer, section, ("t", "q", "v", "p"))
    lines += [
        f"    (void){name};"
        for name, n in (("position", counts.nh), ("velocity", counts.nc))
        if not n
    ]
    lines += [f"    position[{i}] = {x};" for i, x in enumerate(values[: counts.nh])]
    return lines + [f"    velocity[{i}] = {x};" for i, x in enumerate(values[counts.nh :])]


def _outputs(writer: CodeWriter) -> list[str]:
    section = writer.sections.report
    lines = _body(writer, section, ("t", "q", "v", "a", "lambda", "p"))
    values = zip(writer.content.columns, writer.vector(section.assigned.outputs), strict=True)
    return lines + [f"    out[{i}] = {x}; /* {name} */" for i, (name, x) in enumerate(values)]


def _slopes(writer: CodeWriter) -> list[str]:
    section, entries = writer.slopes()
    lines = _body(writer, section, ("t", "q", "v", "a", "lambda", "p"))
    lines += ["    memset(S, 0, sizeof(double) * (NQ + NC) * NX);"]
    return lines + [f"    S[{i} * NX + {j}] = {x};" for i, j, x in entries]
