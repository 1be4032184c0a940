"""The functions of exported code: a tape with the names of its inputs in a language."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape
from lagcli.export.content import Content
from lagcli.export.expressions import (
    HELPERS,
    AppliedOperation,
    Assignments,
    Expression,
    Syntax,
    Variable,
    assignments,
)
from lagcli.export.names import Identifiers


class LocalVariable(NamedTuple):
    """A local variable and the entry of an array that it names."""

    name: str
    array: str
    place: int


class CodeSection(NamedTuple):
    """A function of a state.

    Parameters
    ----------
    variables : tuple of LocalVariable
        The inputs that the function reads, apart from t; not those of tables.
    pieces : tuple of (str, int)
        The tables that it reads: the array of a piece, and the number of the table.
    assigned : Assignments
    """

    variables: tuple[LocalVariable, ...]
    pieces: tuple[tuple[str, int], ...]
    assigned: Assignments

    @property
    def arrays(self) -> frozenset[str]:
        """The arrays that the function reads, and ``t``."""
        timed = {"t"} if "t" in self.assigned.read or self.pieces else set[str]()
        return frozenset({variable.array for variable in self.variables} | timed)

    def renamed(self, names: Mapping[str, str]) -> CodeSection:
        """Return the function with other names of its intermediate variables."""

        def other(e: Expression) -> Expression:
            if isinstance(e, AppliedOperation):
                return AppliedOperation(e.op, tuple(map(other, e.operands)))
            return Variable(names.get(e.name, e.name)) if isinstance(e, Variable) else e

        own = self.assigned
        steps = tuple((names[name], other(x)) for name, x in own.steps)
        assigned = own._replace(steps=steps, outputs=tuple(map(other, own.outputs)))
        return self._replace(assigned=assigned)


class Solved(NamedTuple):
    """The unrolled elimination as text.

    Parameters
    ----------
    section : CodeSection
    a, multipliers : lists of nq and of nc str
    accurate : list of str
        Conditions, of which all hold where they are accurate.
    jacobian : list of (row, column, str)
        The nonzero entries of B, if constraints are redundant.
    """

    section: CodeSection
    a: list[str]
    multipliers: list[str]
    accurate: list[str]
    jacobian: list[tuple[int, int, str]]


class Sections(NamedTuple):
    """The functions of code.

    Parameters
    ----------
    dynamics, constraints, report : CodeSection
        M, f, B, γ; φ, ψ; energies, powers and outputs.
    slopes : CodeSection, optional
        The entries of `lagcli.export.content.SlopeTape`.
    terms : CodeSection, optional
        Sums of the magnitudes of the terms of φ and of ψ.
    solved : CodeSection, optional
        The outputs of `lagcli.export.elimination.EliminatedTape`.
    """

    dynamics: CodeSection
    constraints: CodeSection
    report: CodeSection
    slopes: CodeSection | None = None
    terms: CodeSection | None = None
    solved: CodeSection | None = None

    @property
    def written(self) -> tuple[CodeSection, ...]:
        """All that there are."""
        return tuple(section for section in self if section is not None)

    @property
    def used(self) -> frozenset[Op]:
        """The operations that code needs."""
        return frozenset(op for section in self.written for op in section.assigned.used)

    @property
    def pieces(self) -> frozenset[int]:
        """The tables that code needs."""
        return frozenset(number for section in self.written for _, number in section.pieces)


def _own(content: Content) -> set[str]:
    """Return names that code has for tables and for functions that languages lack."""
    forms = ("table_{}", "TABLE_{}", "table_{}_knots", "table_{}_pieces")
    return {*HELPERS, *(x.format(i) for x in forms for i in range(len(content.functions)))}


class CodeWriter:
    """Writes the functions of a model in a language.

    Parameters
    ----------
    content : Content
    syntax : Syntax
    entry : str
        Format of an entry of an array: ``{0}[{1}]``.
    reserved : iterable of str
        Words that are no names of variables.
    first : int
        Index of the first entry of an array.
    differentiates : bool
        Whether the code has derivatives of the equations: its language has none of its own.
    projects : bool
        Whether the code brings states onto the constraints.
    """

    def __init__(
        self,
        content: Content,
        syntax: Syntax,
        entry: str,
        reserved: Iterable[str],
        first: int = 0,
        differentiates: bool = False,
        projects: bool = False,
    ):
        self.content, self.syntax, self.entry, self.first = content, syntax, entry, first
        system = content.system
        names = Identifiers({"t", "q", "v", "p", "a", "multipliers", *reserved, *_own(content)})
        self.q = [names.of(name) for name in system.coordinates]
        self.p = [names.of(name) for name in system.parameters]
        self.v = [names.of(f"{name}'") for name in system.coordinates]
        self.a = [names.of(f"{name}''") for name in system.coordinates]
        self.multipliers = [names.of(f"lambda_{name}") for name in system.constraints]
        self.tables = [names.of(f"{f.name}_piece") for f in content.functions]
        self.names = names
        state = [*self._of("q", self.q), *self._of("v", self.v)]
        forces = [*self._of("a", self.a), *self._of("multipliers", self.multipliers)]
        self.sections = Sections(
            self._section(content.dynamics, state),
            self._section(content.constraints, state),
            self._section(content.report, [*state, *forces]),
            self._section(content.slopes.tape, [*state, *forces]) if differentiates else None,
            self._section(content.terms, state) if projects else None,
            None if content.solved is None else self._section(content.solved.tape, state),
        )

    def _of(self, array: str, names: Sequence[str]) -> list[LocalVariable]:
        return [LocalVariable(name, array, i) for i, name in enumerate(names)]

    def _section(self, tape: Tape, inputs: Sequence[LocalVariable]) -> CodeSection:
        functions = self.content.functions
        pieces = [
            (self.place(name, k), name, number)
            for number, (name, f) in enumerate(zip(self.tables, functions, strict=True))
            for k in range(f.size)
        ]
        variables = [*inputs, *self._of("p", self.p)]
        names = ["t", *(x.name for x in variables), *(place for place, _, _ in pieces)]
        assert len(names) == tape.inputs
        assigned = assignments(tape, names)
        return CodeSection(
            tuple(x for x in variables if x.name in assigned.read),
            tuple(dict.fromkeys((name, i) for place, name, i in pieces if place in assigned.read)),
            assigned,
        )

    @property
    def solved(self) -> Solved | None:
        """The unrolled elimination; None if there is none."""
        section = self.sections.solved
        if section is None:
            return None
        assert self.content.solved is not None
        system, outputs = self.content.system, section.assigned.outputs
        nq, unknowns, first = system.counts.nq, system.counts.unknowns, self.content.solved.first
        entries = outputs[unknowns:first]
        return Solved(
            section,
            self.vector(outputs[:nq]),
            self.vector(outputs[nq:unknowns]),
            [self.syntax.condition(x) for x in outputs[first:]],
            self.matrix(system.jacobian_pattern, entries) if entries else [],
        )

    def place(self, array: str, index: int) -> str:
        """Return an entry of an array."""
        return self.entry.format(array, index + self.first)

    def matrix(
        self, pattern: Sequence[tuple[int, int]], outputs: Sequence[Expression]
    ) -> list[tuple[int, int, str]]:
        """Return the nonzero entries of a matrix: row, column, text."""
        pairs = zip(pattern, outputs, strict=True)
        return [(i + self.first, j + self.first, self.syntax.text(x)) for (i, j), x in pairs]

    def slopes(self) -> tuple[CodeSection, list[tuple[int, int, str]]]:
        """Return the section of the derivatives of the equations, and their entries."""
        section = self.sections.slopes
        assert section is not None
        return section, self.matrix(self.content.slopes.pattern, section.assigned.outputs)

    def vector(self, outputs: Sequence[Expression]) -> list[str]:
        """Return the entries of a vector as text."""
        return [self.syntax.text(x) for x in outputs]
