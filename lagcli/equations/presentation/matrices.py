"""A large system as M q̈ = f + Bᵀλ, B q̈ = γ: entries by name, common subexpressions abbreviated."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache, cached_property
from typing import NamedTuple, TypeVar

import symengine as se
from symengine import Basic
from symengine.lib.symengine_wrapper import Boolean

from lagcli.equations.presentation.formulas import Formulas, Signs
from lagcli.equations.typesetting.nodes import Entry, Line, Node, Sign, Step, Symbol, symbols_in
from lagcli.model.names.members import family_of

_LETTERS = ("z", "s", "u", "h", "zeta", "xi", "eta")


class Abbreviations(NamedTuple):
    """Expressions with named common subexpressions.

    Parameters
    ----------
    named : mapping of str to expression
        Value of each abbreviation, in symbols of the model and earlier abbreviations.
    expressions : tuple of expressions
        The expressions with abbreviations substituted.
    """

    named: Mapping[str, Basic]
    expressions: tuple[Basic, ...]


def abbreviate(
    expressions: Sequence[Basic], taken: Collection[str], known: Mapping[Basic, str] | None = None
) -> Abbreviations:
    """Name common subexpressions.

    Parameters
    ----------
    expressions : sequence of expressions
    taken : collection of str
        Names that are in use.
    known : mapping of expression to str, optional
        Definitions of the model by value; they keep their names.

    Returns
    -------
    Abbreviations
    """
    known = known or {}
    parts, shortened = se.cse(list(expressions))
    uses = _uses([x for _, x in parts], shortened)
    whole: dict[Basic, Basic] = {}  # expanded, for comparison with definitions
    replaced: dict[Basic, Basic] = {}
    named: dict[str, Basic] = {}
    letter = _free_letter(taken)
    count = 0
    for symbol, part in parts:
        if known:
            whole[symbol] = _replaced(part, whole)
        value = _replaced(part, replaced)
        definition = known.get(whole.get(symbol, symbol))
        if definition is not None and definition not in named:
            named[definition] = value
            replaced[symbol] = se.Symbol(definition)
        elif (
            isinstance(value, Boolean)
            or uses[symbol] < 2
            or _short(value)
            or (uses[symbol] < 4 and _pair(value))
        ):
            replaced[symbol] = value
        else:
            count += 1
            name = f"{letter}_{count}"
            named[name] = value
            replaced[symbol] = se.Symbol(name)
    return _needed(named, tuple(_replaced(x, replaced) for x in shortened))


def _replaced(expression: Basic, values: Mapping[Basic, Basic]) -> Basic:
    """Substitute values for the symbols that occur; SymEngine copies the whole mapping."""
    known = (s for s in expression.free_symbols if s in values)
    return expression.xreplace({_place(s, values[s]): values[s] for s in known})


def _place(symbol: Basic, value: Basic) -> Basic:
    """Return what stands for a value: its symbol, or of a condition ``symbol == true``."""
    return se.Eq(symbol, se.true) if isinstance(value, Boolean) else symbol


def _needed(named: Mapping[str, Basic], expressions: tuple[Basic, ...]) -> Abbreviations:
    """Drop unused abbreviations."""
    used = {s.name for x in expressions for s in x.free_symbols}
    needed: dict[str, Basic] = {}
    for name, value in reversed(list(named.items())):
        if name in used:
            needed[name] = value
            used.update(s.name for s in value.free_symbols)
    return Abbreviations(dict(reversed(list(needed.items()))), expressions)


def without_single_uses(
    short: Abbreviations, arrange: Callable[[Basic], Node], kept: Collection[str] = ()
) -> Abbreviations:
    """Write out the abbreviations that the arranged formulas use only once.

    Arranging collects terms: z q̇₁ q̇₂ + z q̇₂ q̇₁ uses z twice, 2 z q̇₁ q̇₂ once. So a formula is
    arranged where an abbreviation occurs in it alone; one in two formulas is used twice.

    Parameters
    ----------
    short : Abbreviations
        From `abbreviate`.
    arrange : callable
        Returns the printed form of an expression.
    kept : collection of str
        Definitions of the model, which keep their names.

    Returns
    -------
    Abbreviations
        Numbered from the first one on.
    """
    named, expressions = dict(short.named), short.expressions
    numbered = [x for x in named if x not in kept]
    while True:
        # equal entries are printed together
        formulas = [*named.values(), *dict.fromkeys(expressions)]
        places: dict[str, list[Basic]] = {}
        for formula in formulas:
            for symbol in formula.free_symbols:
                places.setdefault(symbol.name, []).append(formula)
        alone = {places[x][0] for x in numbered if x in named and len(places.get(x, ())) == 1}
        uses = Counter(symbols_in(map(arrange, alone)))
        single = [x for x in numbered if x in named and len(places.get(x, ())) < 2 and uses[x] < 2]
        if not single:
            break
        values: dict[Basic, Basic] = {}
        for name in single:
            values[se.Symbol(name)] = _replaced(named.pop(name), values)
        named = {name: _replaced(x, values) for name, x in named.items()}
        expressions = tuple(_replaced(x, values) for x in expressions)
    if len(named) == len(short.named):
        return short
    remaining = [x for x in numbered if x in named]
    names = dict(zip(remaining, numbered, strict=False))
    symbols = {se.Symbol(old): se.Symbol(new) for old, new in names.items() if old != new}
    return Abbreviations(
        {names.get(name, name): _replaced(x, symbols) for name, x in named.items()},
        tuple(_replaced(x, symbols) for x in expressions),
    )


def _uses(parts: Sequence[Basic], expressions: Sequence[Basic]) -> Counter[Basic]:
    uses: Counter[Basic] = Counter()
    stack = [*parts, *expressions]
    while stack:
        e = stack.pop()
        if isinstance(e, se.Symbol):
            uses[e] += 1
        else:
            stack.extend(e.args)
    return uses


def _short(value: Basic) -> bool:
    """Whether an expression is as short as a name: x, sin x, x², 2 x, −x."""
    if isinstance(value, se.Symbol | se.Number):
        return True
    if isinstance(value, se.Pow):
        base, exponent = value.args
        return isinstance(exponent, se.Integer) and int(exponent) > 0 and _short(base)
    if isinstance(value, se.Mul):
        return sum(not isinstance(x, se.Number) for x in value.args) == 1 and all(
            map(_short, value.args)
        )
    if isinstance(value, se.Add | se.Piecewise):
        return False
    return len(value.args) == 1 and isinstance(value.args[0], se.Symbol)


def _pair(value: Basic) -> bool:
    """Whether an expression is a product of two short ones."""
    return isinstance(value, se.Mul) and len(value.args) == 2 and all(map(_short, value.args))


def _free_letter(taken: Collection[str]) -> str:
    """Return a letter for abbreviations that no name of the model starts with."""
    used = {family_of(name).rstrip("[]").partition("_")[0].rstrip("0123456789") for name in taken}
    return next((x for x in _LETTERS if x not in used), "abbreviation")


T = TypeVar("T")
#: Matrices and vectors that can be printed: M, f, B, γ, b_0 and φ or ψ of the constraints, Q, and
#: T, V, L.
PARTS = ("M", "f", "B", "gamma", "drift", "expression", "Q", "energy")
Place = tuple[str, int, int]  # the matrix, row and column


class Matrices:
    """The entries of M, f, B and γ, with abbreviations.

    Parameters
    ----------
    formulas : Formulas
        Formulas of the system.
    parts : collection of str
        One or several of `PARTS`.
    """

    def __init__(self, formulas: Formulas, parts: Collection[str] = ("M", "f", "B", "gamma")):
        self.formulas, self.parts = formulas, parts
        self.equations, self.model = formulas.equations, formulas.model
        self.signs = Signs(formulas.model)

    @cached_property
    def entries(self) -> Mapping[Place, Basic]:
        """The nonzero entries; for M, those on and above the diagonal. Vectors have one column."""
        e, constraints = self.equations, self.equations.constraints
        entries: dict[Place, Basic] = {}
        for i, row in enumerate(e.mass_matrix):
            entries |= {("M", i, j): m for j, m in sorted(row.items()) if j >= i}
        for i, c in enumerate(constraints):
            entries |= {("B", i, j): b for j, b in sorted(c.row.items())}
        columns = {
            "f": e.forcing,
            "gamma": [c.rhs for c in constraints],
            "drift": [c.drift for c in constraints],
            "expression": [c.constraint.expression for c in constraints],
            "Q": e.applied_forces,
            "energy": (e.kinetic, e.potential, e.lagrangian),
        }
        for part, column in columns.items():
            entries |= {(part, i, 0): x for i, x in enumerate(column)}
        return {place: x for place, x in entries.items() if x != 0 and place[0] in self.parts}

    @cached_property
    def short(self) -> Abbreviations:
        """The entries, in the order of `entries`, with abbreviations."""
        names = (*self.model.coordinate_names, *self.model.parameters, *self.model.definitions)
        known = {
            d.value: name
            for name, d in self.model.definitions.items()
            if isinstance(d.value, Basic) and not isinstance(d.value, se.Symbol | se.Number)
        }
        short = abbreviate(list(self.entries.values()), names, known)
        self.formulas.in_order(short.named)
        if len(short.named) > _COUNTED:
            return short
        return without_single_uses(short, self.formulas.arrange, self.model.definitions)

    @cached_property
    def size(self) -> float:
        """Approximate number of lines of text of the whole system."""
        return sum(map(self._packed, self.short.named.values())) + sum(
            map(self._alone, self.short.expressions)
        )

    @cached_property
    def _operation(self) -> float:
        """Number of characters of an operation: its sign and a name."""
        names = self.model.coordinate_names
        return 4.0 + 0.9 * sum(map(len, names)) / len(names)

    @cached_property
    def _letters(self) -> Callable[[Basic], float]:
        """Return the number of characters of a formula; estimated for long formulas."""
        parts = (*self.short.named.values(), *self.short.expressions)
        if sum(map(se.count_ops, parts)) > _ESTIMATED:
            return lambda value: self._operation * float(se.count_ops(value))
        from lagcli.equations.typesetting.notation import Notation
        from lagcli.equations.typesetting.text import TextFormula

        text = TextFormula(Notation(self.model)).text
        return cache(lambda value: float(len(text(self.formulas.arrange(value)))))

    def _packed(self, value: Basic) -> float:
        """Return the approximate fraction of a line that a short formula takes."""
        return (self._letters(value) + _NAME) / _LINE

    def _alone(self, value: Basic) -> float:
        """Return the approximate number of lines of a formula that is printed on its own."""
        return float(math.ceil((self._letters(value) + 2 * _NAME) / _LINE))

    def abbreviations(self, share: float = 1.0) -> list[Line]:
        """Return the abbreviations in order of dependence, or the first of them."""
        shown = first_part(list(self.short.named.items()), lambda x: self._packed(x[1]), share)
        return [Line((Symbol(name), self.formulas.arrange(value))) for name, value in shown]

    def formulas_of(self) -> dict[Place, Node]:
        """Return all entries, arranged."""
        pairs = zip(self.entries, self.short.expressions, strict=True)
        return {place: self.formulas.arrange(value) for place, value in pairs}

    def lines(self, matrix: str, share: float = 1.0) -> list[Line]:
        """Return the entries of M, f, B or gamma, equal ones together, or the first of them."""
        same: dict[Basic, list[Place]] = {}
        for place, value in zip(self.entries, self.short.expressions, strict=True):
            if place[0] == matrix:
                same.setdefault(value, []).append(place)
        shown = first_part(list(same.items()), lambda x: self._alone(x[0]), share)
        return [
            Line((*self.names(places), self.formulas.arrange(value))) for value, places in shown
        ]

    def names(self, places: list[Place]) -> list[Node]:
        """Return the names of equal entries; of many, the first ones and the last."""
        if len(places) <= _ALIKE + 2:
            return list(map(self.entry, places))
        dots = Sign(f"⋯ ({len(places)} entries)", rf"\cdots_{{\text{{{len(places)} entries}}}}")
        return [*map(self.entry, places[:_ALIKE]), dots, self.entry(places[-1])]

    def entry(self, place: Place) -> Node:
        """Return the name of an entry."""
        matrix, i, j = place
        q, constraints = self.formulas.coordinates, self.equations.constraints
        if matrix == "M":
            return Entry(self.signs.mass_matrix, (q[i], q[j]))
        if matrix == "f":
            return Entry(self.signs.forcing, (q[i],))
        row = Symbol(constraints[i].constraint.name, kind="constraint")
        if matrix == "B":
            return Entry(self.signs.constraint_matrix, (row, q[j]))
        return Entry(self.signs.rhs, (row,))

    def steps(self, room: float | None = None) -> list[Step]:
        """Return the system as printed steps.

        Parameters
        ----------
        room : float, optional
            Number of lines; longer lists are cut.
        """
        share = 1.0 if room is None else min(1.0, room / max(self.size, 1.0))
        signs = self.signs
        remark = (
            "Entries are named by the coordinates and constraints that they belong to."
            f" {signs.mass_matrix.text} is symmetric, its upper triangle is listed; entries that"
            " are not listed are zero."
        )
        if "gamma" not in self.parts and self.equations.constraints:
            remark += f" {_without(signs)}"
        steps = [Step("Equations of motion, in matrices", self._laws(), remark)]
        if self.short.named:
            lines, count = self.abbreviations(share), len(self.short.named)
            said = cut_short(len(lines), count)
            steps.append(Step("Abbreviations", tuple(lines), said, packed=True))
        titles = {
            "M": f"Mass matrix {signs.mass_matrix.text}",
            "f": f"Forces {signs.forcing.text}",
            "B": f"Constraint matrix {signs.constraint_matrix.text}",
            "gamma": f"Right side {signs.rhs.text}",
        }
        for matrix, title in titles.items():
            values = [
                value
                for place, value in zip(self.entries, self.short.expressions, strict=True)
                if place[0] == matrix
            ]
            if values:
                lines = self.lines(matrix, share)
                steps.append(Step(title, tuple(lines), cut_short(len(lines), len(set(values)))))
        return steps

    def _laws(self) -> tuple[Line, ...]:
        """Return M q̈ = f + Bᵀ λ and B q̈ = γ."""
        m, f, b = self.signs.mass_matrix, self.signs.forcing, self.signs.constraint_matrix
        left = Sign(f"{m.text} q̈", rf"{m.latex} \, \ddot{{q}}")
        if not self.equations.constraints:
            return (Line((left, f)),)
        right = Sign(f"{f.text} + {b.text}ᵀ λ", rf"{f.latex} + {b.latex}^{{\mathrm{{T}}}} \lambda")
        held = Sign(f"{b.text} q̈", rf"{b.latex} \, \ddot{{q}}")
        return Line((left, right)), Line((held, self.signs.rhs))


def _without(signs: Signs) -> str:
    """Return the remark that γ = −(∂ψ/∂q) q̇ − ∂ψ/∂t is not listed."""
    psi = signs.velocity_residual
    return (
        f"{signs.rhs.text} = −(∂{psi}/∂q) q̇ − ∂{psi}/∂t is omitted for its length; --format json"
        " gives it."
    )


#: Number of equal entries listed before the ellipsis.
_ALIKE = 4
#: Number of characters of a name with its equality sign, and of a line.
_NAME, _LINE = 8.0, 92.0
#: Number of abbreviations above which their uses are not counted, because that arranges them twice,
#: which takes 0.7 of 3.0 s with 413.
_COUNTED = 500
#: Number of operations above which lengths are estimated, because arranging takes seconds.
_ESTIMATED = 8000


def first_part(items: list[T], cost: Callable[[T], float], share: float) -> list[T]:
    """Return the first items whose cost is within a share of the total; at least one."""
    if share >= 1.0:
        return items
    costs = list(map(cost, items))
    allowed, spent, shown = share * sum(costs), 0.0, 0
    while shown < len(items) and spent + costs[shown] <= allowed:
        spent += costs[shown]
        shown += 1
    return items[: max(1, shown)]


def cut_short(shown: int, count: int) -> str | None:
    """Return the remark that a list is incomplete."""
    return (
        None if shown == count else f"The first {shown} of {count}; --full writes everything out."
    )
