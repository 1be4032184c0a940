"""Python: modules for NumPy and SciPy, for JAX, and for CasADi."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from lagcli.engine.tape.inputs import RESOLUTION, PiecewiseFunction
from lagcli.engine.tape.operations import Op
from lagcli.export.assets import asset, filled
from lagcli.export.content import Content
from lagcli.export.expressions import Syntax, helpers
from lagcli.export.names import words
from lagcli.export.sections import CodeSection, CodeWriter

_RESERVED = words(
    "False None True and as assert async await break class continue def del elif else except"
    " finally for from global if import in is lambda nonlocal not or pass raise return try while"
    " yield with np jnp jax ca scipy erfc M f B gamma piece clipped abs float max min S"
    " eliminated solution bordered accurate mu"
)


#: Operations of an elimination above which NumPy, whose interpreter takes 0.07 µs for each, solves
#: densely, which takes 60 to 70 µs.
_MOST_INTERPRETED = 900


def number(value: float) -> str:
    """Return a number in Python, exactly."""
    return repr(float(value)) if math.isfinite(value) else f'float("{value}")'


def _syntax(
    library: str, choice: str, logic: Mapping[Op, str], named: Mapping[str, str], infix: bool
) -> Syntax:
    def function(op: Op) -> str:
        own = op.name.lower()
        name = named.get(own, own)
        return name if "." in name or name == "erfc" else f"{library}.{name}"

    return Syntax(choice, function, logic, number, infix_choice=infix)


_ARC = {
    **{f"a{x}": f"arc{x}" for x in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
    "atan2": "arctan2",
    "pow": "power",
}
_WORDS = {Op.AND: "({0} and {1})", Op.OR: "({0} or {1})", Op.NOT: "(not {0})"}
_ARRAYS = {
    Op.AND: "(({0}) & ({1}))",
    Op.OR: "(({0}) | ({1}))",
    Op.NOT: "jnp.logical_not({0})",
}
_CALLS = {
    Op.AND: "ca.logic_and({0}, {1})",
    Op.OR: "ca.logic_or({0}, {1})",
    Op.NOT: "ca.logic_not({0})",
}
_NUMPY_ERF = {"erf": "scipy.special.erf", "erfc": "scipy.special.erfc"}
_JAX_ERF = {"erf": "jax.scipy.special.erf", "erfc": "jax.scipy.special.erfc"}


_REGULAR_JACOBIAN = """\
    S = slopes(t, q, v, a, multipliers, p)
    of_a, of_multipliers = solve(M, S[:n], B, ROWS, S[n:])"""


_NUMPY_SOLVED = """\
    with np.errstate(all="ignore"):
        a, mu, accurate = eliminated(t, *map(np.asarray, (q, v, p)))
    if not accurate:
        M, f, B, gamma = equations(t, q, v, p)
        a, mu = solve(M, f, B, ROWS, gamma[ROWS])"""


class Dialect(NamedTuple):
    """What differs between the modules.

    Parameters
    ----------
    library : str
        In the names of the files with the parts that are the same for all models.
    syntax : Syntax
    zeros, vector : str
        Formats of a matrix of zeros and of a vector.
    regular, redundant : str
        The last lines of the solution for a and λ, with independent and with redundant constraints.
    plain, solved : str
        The lines that solve the equations: densely alone, or by the elimination.
    all_of : str
        Format of whether all of some conditions hold, one a line.
    matrix : str
        Format of a matrix, if its entries cannot be assigned: shape, rows, columns, values.
    regular_rows, redundant_rows : str
        The equations of a DAE that determine λ.
    """

    library: str
    syntax: Syntax
    zeros: str
    vector: str
    regular: str
    redundant: str
    plain: str
    solved: str
    all_of: str
    matrix: str = ""
    regular_rows: str = ""
    redundant_rows: str = ""


NUMPY = Dialect(
    "numpy",
    _syntax("np", "{1} if {0} else {2}", _WORDS, {**_ARC, **_NUMPY_ERF}, True),
    "np.zeros(({0}, {1}))",
    "np.array([{0}])",
    "    return a, mu",
    """\
    # B = C B_r; of all lambda with B^T lambda = B_r^T mu, the one of least norm
    B = equations(t, q, v, p)[2]
    B_r = B[ROWS]
    C = np.linalg.solve(B_r @ B_r.T, B_r @ B.T).T
    return a, C @ np.linalg.solve(C.T @ C, mu)""",
    """\
    M, f, B, gamma = equations(t, q, v, p)
    a, mu = solve(M, f, B, ROWS, gamma[ROWS])""",
    _NUMPY_SOLVED,
    "all([{0}])",
)
JAX = Dialect(
    "jax",
    _syntax("jnp", "jnp.where({0}, {1}, {2})", _ARRAYS, {**_ARC, **_JAX_ERF}, False),
    "jnp.zeros(({0}, {1}))",
    "jnp.array([{0}])",
    "    return a, mu",
    """\
    B = equations(t, q, v, p)[2]
    B_r = B[ROWS]
    # B = C B_r; of all lambda with B^T lambda = B_r^T mu, the one of least norm
    C = jnp.linalg.solve(B_r @ B_r.T, B_r @ B.T).T
    return a, C @ jnp.linalg.solve(C.T @ C, mu)""",
    asset("dense_jax.py"),
    asset("solution_jax.py"),
    "jnp.all(jnp.array([{0}]))",
    "jnp.zeros(({0}, {1})).at[jnp.array({2}), jnp.array({3})].set(jnp.array([{4}]))",
)
CASADI = Dialect(
    "casadi",
    _syntax("ca", "ca.if_else({0}, {1}, {2})", _CALLS, {"pow": "power", "abs": "fabs"}, False),
    "ca.SX({0}, {1})",
    "ca.vertcat({0})",
    "    return a, mu",
    """\
    B_r = B[ROWS, :]
    # B = C B_r; of all lambda with B^T lambda = B_r^T mu, the one of least norm
    C = ca.solve(B_r @ B_r.T, B_r @ B.T).T
    return a, C @ ca.solve(C.T @ C, mu)""",
    asset("dense_casadi.py").rstrip(),
    asset("dynamics_casadi.py").rstrip(),
    "ca.logic_all(ca.vertcat({0}))",
    regular_rows="    rows = B @ a - gamma",
    redundant_rows="""\
    # B = C B_r; lambda is the one of least norm: lambda = C lambda_r
    B_r = B[ROWS, :]
    rest = [i for i in range(NC) if i not in ROWS]
    C = ca.solve(B_r @ B_r.T, B_r @ B.T).T
    least = multipliers[rest] - C[rest, :] @ multipliers[ROWS]
    rows = ca.vertcat(B_r @ a - gamma[ROWS], least)""",
)


def write_numpy(content: Content) -> str:
    """Return the equations of a model as a module for NumPy and SciPy."""
    return _Module(content, NUMPY).text()


def write_jax(content: Content) -> str:
    """Return the equations of a model as a module for JAX."""
    return _Module(content, JAX).text()


def write_casadi(content: Content) -> str:
    """Return the equations of a model as a module for CasADi."""
    return _Module(content, CASADI).text()


class _Module:
    """A module for one library."""

    def __init__(self, content: Content, dialect: Dialect):
        self.content, self.dialect = content, dialect
        reserved = {*_RESERVED, *(f"TABLE_{i}" for i in range(len(content.functions)))}
        own = dialect is NUMPY  # the other libraries differentiate by themselves
        self.writer = CodeWriter(
            content, dialect.syntax, "{0}[{1}]", reserved, differentiates=own, projects=own
        )
        self.solved = self.writer.solved
        if own and content.solved is not None:
            added = len(content.solved.tape.code) - len(content.dynamics.code)
            if added > _MOST_INTERPRETED:
                self.solved = None

    def text(self) -> str:
        content, dialect, system = self.content, self.dialect, self.content.system
        state, settings = content.start.state, content.settings
        rows = [content.rows, content.position_rows, content.position_places]
        redundant = bool(content.redundant)
        code = filled(
            asset(f"model_{dialect.library}.py"),
            parameters=_table(dict(zip(system.parameters, state.p, strict=True))),
            start=number(state.t),
            position=_list(state.q),
            velocity=_list(state.v),
            rows=", ".join(str([*x]) for x in rows),
            independent=str([*content.rows]),
            coordinates=_names(system.coordinates),
            constraint_names=_names(system.constraints),
            columns=_names(content.columns),
            helpers="\n".join(self.helpers()),
            equations="\n".join(self.equations()),
            constraints="\n".join(self.constraints(self.writer.sections.constraints)),
            terms="\n".join(self.terms() if dialect is NUMPY else ()),
            nonlinear=str(bool(system.nonlinear)),
            units=str([*content.units]),
            outputs="\n".join(self.outputs()),
            eliminated="\n".join(self.eliminated()),
            solved=dialect.solved if self.solved else dialect.plain,
            solution=dialect.redundant if redundant else dialect.regular,
            slopes="\n".join(self.slopes() if dialect is NUMPY else ()),
            jacobian=asset("jacobian_numpy.py").rstrip() if redundant else _REGULAR_JACOBIAN,
            border=dialect.redundant_rows if redundant else dialect.regular_rows,
            rtol=number(settings.rtol),
            atol=_list(content.tolerances),
            end=number(settings.t_end),
            samples=str(max(2, settings.sample_count)),
        )
        head = "\n".join(line.rstrip() for line in content.described())
        head = head.replace("\\", "\\\\").replace('"', '\\"')
        return f'"""{head}\n"""\n\n{code}'

    def helpers(self) -> list[str]:
        """Return the functions that the library lacks, and the tables."""
        used, lines = self.writer.sections.used, list[str]()
        names = {op.name for op in used}
        if self.dialect is NUMPY and names & {"ERF", "ERFC"}:
            lines += ["", "import scipy.special"]
        if self.dialect is CASADI and "ERFC" in names:
            lines += ["", "", "def erfc(x):", "    return 1 - ca.erf(x)"]
        for helper in helpers(used, self.dialect.syntax):
            lines += [
                "",
                "",
                f"def {helper.name}({', '.join(helper.parameters)}):",
                f'    """Return {helper.comment}"""',
                f"    return {helper.value}",
            ]
        pieces = sorted(self.writer.sections.pieces)
        for i in pieces:
            lines += ["", *_table_of(self.content.functions[i], i)]
        if pieces:
            text = filled(asset(f"table_{self.dialect.library}.py"), slack=repr(RESOLUTION))
            lines += ["", "", text.rstrip()]
        return [*lines, ""]

    def body(self, section: CodeSection) -> list[str]:
        """Return the local variables of a function."""
        lines = [f"    {x.name} = {x.array}[{x.place}]" for x in section.variables]
        lines += [f"    {name} = piece(t, TABLE_{i})" for name, i in section.pieces]
        steps = section.assigned.steps
        return lines + [f"    {name} = {self.dialect.syntax.text(x)}" for name, x in steps]

    def vector(self, entries: Sequence[str]) -> str:
        """Return a vector, its entries one a line."""
        rows = "".join(f"\n        {x}," for x in entries)
        return self.dialect.vector.format(f"{rows}\n    " if entries else "")

    def matrix(self, name: str, rows: int, entries: Sequence[tuple[int, int, str]]) -> list[str]:
        """Return the assignment of a matrix with nq columns."""
        columns, dialect = len(self.content.system.coordinates), self.dialect
        if not dialect.matrix or not entries:
            lines = [f"    {name} = {dialect.zeros.format(rows, columns)}"]
            return lines + [f"    {name}[{i}, {j}] = {x}" for i, j, x in entries]
        own, across, values = zip(*entries, strict=True)
        listed = "".join(f"\n        {x}," for x in values) + "\n    "
        return [f"    {name} = {dialect.matrix.format(rows, columns, [*own], [*across], listed)}"]

    def equations(self) -> list[str]:
        """Return the lines of M, f, B and γ."""
        writer, system = self.writer, self.content.system
        section = writer.sections.dynamics
        parts = system.dynamics_layout.split(section.assigned.outputs)
        counts = system.counts
        mass = writer.matrix(system.mass_pattern, parts["mass_matrix"])
        rows = writer.matrix(system.jacobian_pattern, parts["jacobian"])
        return [
            *self.body(section),
            *self.matrix("M", counts.nq, mass),
            f"    f = {self.vector(writer.vector(parts['forcing']))}",
            *self.matrix("B", counts.nc, rows),
            f"    gamma = {self.vector(writer.vector(parts['rhs']))}",
        ]

    def eliminated(self) -> list[str]:
        """Return the function with the unrolled elimination."""
        solved = self.solved
        if solved is None:
            return []
        rows = self.content.rows
        lines = [
            asset("eliminated.py").rstrip(),
            *self.body(solved.section),
            f"    a = {self.vector(solved.a)}",
            f"    mu = {self.vector([solved.multipliers[i] for i in rows])}",
            f"    accurate = {self.all_of(solved.accurate)}",
        ]
        return [*lines, "    return a, mu, accurate", ""]

    def all_of(self, conditions: Sequence[str]) -> str:
        """Return whether all conditions hold."""
        listed = "".join(f"\n        {x}," for x in conditions)
        return self.dialect.all_of.format(f"{listed}\n    ") if conditions else "True"

    def terms(self) -> list[str]:
        """Return the lines of the sums of the magnitudes of the terms of φ and ψ."""
        section = self.writer.sections.terms
        assert section is not None
        return self.constraints(section)

    def constraints(self, section: CodeSection) -> list[str]:
        """Return the lines of φ and ψ, or of other values of the constraints."""
        nh = self.content.system.counts.nh
        values = self.writer.vector(section.assigned.outputs)
        both = f"{self.vector(values[:nh])}, {self.vector(values[nh:])}"
        return [*self.body(section), f"    return {both}"]

    def slopes(self) -> list[str]:
        """Return the lines of the derivatives of the equations."""
        section, entries = self.writer.slopes()
        counts = self.content.system.counts
        columns = 1 + 2 * counts.nq + len(self.content.system.parameters)
        lines = [f"    S = {self.dialect.zeros.format(counts.unknowns, columns)}"]
        return [*self.body(section), *lines, *(f"    S[{i}, {j}] = {x}" for i, j, x in entries)]

    def outputs(self) -> list[str]:
        """Return the lines of energies, powers and outputs."""
        section = self.writer.sections.report
        values = self.writer.vector(section.assigned.outputs)
        return [*self.body(section), f"    return {self.vector(values)}"]


def _list(values: Iterable[float]) -> str:
    return f"[{', '.join(map(number, values))}]"


def _table(values: Mapping[str, float]) -> str:
    rows = "".join(
        f"\n    {json.dumps(name, ensure_ascii=False)}: {number(x)}," for name, x in values.items()
    )
    return f"{{{rows}\n}}" if values else "{}"


def _table_of(f: PiecewiseFunction, i: int) -> list[str]:
    """Return a table: knots; pieces by origin and coefficients; where it is defined; its period."""
    rows = zip(f.origins, f.coefficients, strict=True)
    pieces = "".join(f"\n        {_list([origin, *row])}," for origin, row in rows)
    ends = ", ".join(map(number, (f.first, f.last, f.period)))
    return [
        f"#: {f.name}: knots; of each piece its origin and coefficients; first, last, period.",
        f"TABLE_{i} = (",
        f"    {_list(f.knots)},",
        f"    [{pieces}\n    ],",
        f"    {ends},",
        ")",
    ]


def _names(names: Iterable[str]) -> str:
    return json.dumps([*names], ensure_ascii=False)
