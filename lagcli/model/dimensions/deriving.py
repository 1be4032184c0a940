"""Derivation of the dimensions of a model's quantities, and their check."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction

import symengine as se
from symengine import Basic

from lagcli.columns import SCALARS, read_column_name, read_dotted_name
from lagcli.functions import FUNCTIONS, DimensionRule
from lagcli.model.dimensions.evaluation import Disagreement, is_constant
from lagcli.model.dimensions.model_units import (
    ModelUnits,
    UnitFinding,
    conjugate,
    find,
    multiplier_dimension,
    text_of,
)
from lagcli.model.dimensions.named import NamedDimensions
from lagcli.model.expression.dimension import (
    ANGLE,
    ENERGY,
    NUMBER,
    ONE,
    POWER,
    SECOND,
    UNKNOWN,
    ZERO,
    Dimension,
    Scalar,
    TensorDimension,
    Value,
    power,
    product,
    rate_of,
    same,
    whole,
)
from lagcli.model.expression.trees import (
    Comparison,
    IndexedSumExpr,
    SumExpr,
    Tree,
    VectorExpr,
    walk,
)
from lagcli.model.expression.units import read_unit
from lagcli.model.model import RATE, TIME, Constraint, Model, ModelEvent, read_input
from lagcli.model.names.members import family_of
from lagcli.settings.settings import SettingsOverrides

#: Torque on a body, in its frame.
_TORQUE = TensorDimension(((conjugate(ANGLE),),) * 3)


def derive_units(model: Model, assumed: Mapping[str, Scalar] | None = None) -> ModelUnits:
    """Derive and check the dimensions of a model's quantities.

    T, V and L are energies, D is a power, forces are conjugate to the coordinates they act on,
    terms of a sum and sides of a constraint have the same dimension, arguments of functions are
    numbers, and initial values have the dimensions of their coordinates.

    Parameters
    ----------
    model : Model
    assumed : mapping of str to Dimension or UNKNOWN, optional
        Dimensions of coordinates and parameters, or of families ``x[]``, instead of those given by
        the model.

    Returns
    -------
    ModelUnits
    """
    known = NamedDimensions(model, assumed or {})
    if not known.stated:
        return ModelUnits(missing=tuple(known.missing))
    statements = _Statements(model, known)
    settled = known.numbers.settled

    def all_settled(values: Mapping[str, Value]) -> dict[str, Value]:
        return {name: settled(value) for name, value in values.items()}

    def finding(f: UnitFinding) -> UnitFinding:
        dimension, expected = settled(f.disagreement.dimension), settled(f.disagreement.expected)
        assert not isinstance(dimension, TensorDimension)
        assert not isinstance(expected, TensorDimension)
        return f._replace(
            disagreement=f.disagreement._replace(dimension=dimension, expected=expected)
        )

    return ModelUnits(
        stated=True,
        throughout=known.throughout,
        missing=tuple(known.missing),
        names=all_settled(known.names),
        constraints=all_settled(statements.constraints),
        multipliers=all_settled(known.multipliers),
        outputs=all_settled(statements.outputs),
        written=known.written,
        findings=tuple(map(finding, known.findings)),
        numbers=tuple(known.numbers.taken()),
    )


def expression_unit(model: Model, tree: Tree) -> str | None:
    """Return the SI unit of an expression in a model's names; None if it is unknown.

    Parameters
    ----------
    model : Model
    tree : Tree
        May use λ, constraint forces, outputs, and the columns of every result with one number per
        sample, such as ``energy_total``.
    """
    if not model.units.stated:
        return None
    known = NamedDimensions(model, {})
    known.multipliers.update(model.units.multipliers)
    known.names.update(model.units.names)
    known.names.update(model.units.outputs)
    known.names.update({q.name: read_unit(q.unit).dimension for q in SCALARS if "{" not in q.unit})
    return text_of(known.numbers.settled(known.evaluated(tree, "")))


class _Statements:
    """Checks the entries of one model, and derives the dimensions of λ and of the outputs."""

    def __init__(self, model: Model, known: NamedDimensions):
        self.model, self.known = model, known
        self.constraints: dict[str, Value] = {}
        self.outputs: dict[str, Value] = {}
        self.seen: set[tuple[int, str]] = set()
        self.energies()
        self.forces()
        self.constrained()
        if model.switches:
            check_switching(model, known, self.terms)
        self.initial()
        self.settings()
        self.reported()

    def energies(self) -> None:
        for key, expected in (("T", ENERGY), ("V", ENERGY), ("L", ENERGY), ("D", POWER)):
            if key in self.model.trees:
                self.terms(self.model.trees[key], expected, key, None, f"`{key}`")

    def forces(self) -> None:
        for key, tree in self.model.trees.items():
            block, _, name = key.partition(".")
            if block == "Q":
                place = find(self.known.names, name)
                if isinstance(place, TensorDimension) and len(place.rows[0]) == len(_TORQUE.rows):
                    on: Value = _TORQUE  # on a body, given its rotation
                elif isinstance(place, TensorDimension):
                    on = place.map(conjugate)
                else:
                    on = conjugate(place)
                self.terms(tree, on, block, name, f"the force on `{name}`")

    def terms(self, tree: Tree, expected: Value, block: str, name: str | None, role: str) -> None:
        """Check that every term of an expression has a dimension."""
        good: Tree | None = None
        bad: list[tuple[Tree, Value]] = []
        for term in self._terms(tree):
            value = self.known.evaluated(term, block, name)
            if not self.known.fits(value, expected):
                bad.append((term, value))
            elif good is None and isinstance(value, Dimension) and not value.numbers:
                good = term
        for term, value in bad:
            for part, dimension, wanted in _entries(term, value, expected):
                if not self.known.fits(dimension, wanted):
                    wrong = Disagreement("required", part, dimension, wanted, good, role)
                    self.known.findings.append(UnitFinding(wrong, block, name))

    def _terms(self, tree: Tree) -> Iterator[Tree]:
        if isinstance(tree, SumExpr):
            for _, term in tree.terms:
                yield from self._terms(term)
        elif isinstance(tree, IndexedSumExpr) and not self.known.varied:
            yield from self._terms(tree.term)
        else:
            yield tree

    def constrained(self) -> None:
        known: dict[int, Value] = {}
        residuals: list[tuple[str, Value]] = []
        multipliers: list[tuple[str, Value]] = []
        for c in self.model.constraints:
            residual = known.get(id(c.left))
            if residual is None or c.left is None or self.known.varied:
                residual = known[id(c.left)] = self._residual(c)
            residuals.append((c.name, residual))
            assert not isinstance(residual, TensorDimension)
            force = multiplier_dimension(residual, c.kind == "holonomic")
            multipliers.append((c.name, force))
        self.constraints.update(self._table(residuals))
        self.known.multipliers.update(self._table(multipliers))

    def _residual(self, c: Constraint) -> Value:
        if c.projected:
            return UNKNOWN
        if c.left is None:
            force = find(self.known.names, c.name.removesuffix(RATE))
            return UNKNOWN if isinstance(force, TensorDimension) else conjugate(force)
        if c.from_sign:  # errors in it are reported for Q
            known = len(self.known.findings)
            dimension = self.known.evaluated(c.left, "constraints", c.name, c.indices)
            del self.known.findings[known:]
            return dimension if isinstance(dimension, Dimension) else UNKNOWN
        left = self.known.evaluated(c.left, "constraints", c.name, c.indices)
        if c.right is not None:
            right = self.known.evaluated(c.right, "constraints", c.name, c.indices)
            both = self.known.evaluator.join(left, right)
            if both is None:
                assert not isinstance(left, TensorDimension)
                assert not isinstance(right, TensorDimension)
                wrong = Disagreement("sides", c.left, left, right, c.right)
                self.known.findings.append(UnitFinding(wrong, "constraints", c.name))
            left = UNKNOWN if both is None else both
        if left is NUMBER and self.known.throughout:
            return ONE
        return left if isinstance(left, Dimension) else UNKNOWN

    def _table(self, entries: list[tuple[str, Value]]) -> dict[str, Value]:
        """Return dimensions by name, with one entry for members of a family that agree."""
        table: dict[str, Value] = {}
        families: dict[str, list[tuple[str, Value]]] = {}
        for name, value in entries:
            families.setdefault(family_of(name), []).append((name, value))
        for family, members in families.items():
            together = self.known.joined(value for _, value in members)
            if together is None:
                table.update(members)
            else:
                table[family] = together
        return table

    def initial(self) -> None:
        for name, given in self.model.initial.items():
            written = given.written
            if written is None or (given.unit is None and is_constant(written.tree)):
                continue  # a number alone is in SI
            if not self._differs(name, written.tree):
                continue
            expected = self._of_motion(name)
            value: Value
            if given.unit:
                value = read_unit(given.unit).dimension
            else:
                where = ("initial", name, written.indices, given.location)
                value = self.known.evaluated(written.tree, *where)
            if value is not NUMBER and not self.known.fits(value, expected):
                assert not isinstance(value, TensorDimension)
                assert not isinstance(expected, TensorDimension)
                role = f"the initial value of `{name}`"
                wrong = Disagreement("required", written.tree, value, expected, role=role)
                certain = given.unit is not None
                found = UnitFinding(wrong, "initial", name, given.location, certain)
                self.known.findings.append(found)

    def _differs(self, name: str, tree: Tree) -> bool:
        """Whether a value may differ in dimension from those before: of other members."""
        key = id(tree), family_of(name)
        known = key in self.seen
        self.seen.add(key)
        return not known or bool(self.known.varied)

    def _of_motion(self, name: str) -> Value:
        """Return the dimension of a coordinate or velocity.

        Of a coordinate without a unit, that of its initial value, if this has one.
        """
        coordinate = name.rstrip("'")
        dimension = find(self.known.names, coordinate)
        start = self.model.initial.get(coordinate)
        if dimension is UNKNOWN and name != coordinate and start is not None and start.unit:
            dimension = read_unit(start.unit).dimension
        return rate_of(dimension, len(name) - len(coordinate))

    def settings(self) -> None:
        for key, tree in self.model.trees.items():
            block, _, name = key.partition(".")
            if block == "simulation" and not is_constant(tree):
                setting = name.partition(".")[0]
                unit = SettingsOverrides.DECLARED[setting].unit
                expected = read_unit(unit).dimension if unit else ONE
                self.terms(tree, expected, block, name, f"`{setting}`")
        for name, (key, tree) in self.model.tolerances.items():
            if not is_constant(tree) and self._differs(name, tree):
                role, entry = f"the tolerance of `{name}`", f"atol.{key}"
                self.terms(tree, self._of_motion(name), "simulation", entry, role)

    def reported(self) -> None:
        """Derive the dimensions of the outputs, and check the given units."""
        stated: dict[str, str] = {}
        for name, unit in self.model.output_units.items():
            self.known.written[f"outputs.{name}"] = unit
            stated.setdefault(family_of(name), unit)
        outputs: list[tuple[str, Value]] = []
        for key, tree in self.model.trees.items():
            block, _, name = key.partition(".")
            if block != "outputs":
                continue
            value = self.known.evaluated(tree, block, name)
            if family_of(name) in stated and value is not NUMBER:
                expected = read_unit(stated[family_of(name)]).dimension
                if not self.known.fits(value, expected):
                    role = f"the output `{name}`"
                    assert not isinstance(value, TensorDimension)
                    wrong = Disagreement("required", tree, value, expected, role=role)
                    self.known.findings.append(UnitFinding(wrong, block, name))
            outputs.append((name, ONE if value is NUMBER and self.known.throughout else value))
        self.outputs.update(self._table(outputs))


def _entries(tree: Tree, value: Value, expected: Value) -> Iterator[tuple[Tree, Scalar, Scalar]]:
    """Yield the parts of an expression with their dimensions: of a vector, its entries."""
    if not (isinstance(value, TensorDimension) and isinstance(expected, TensorDimension)):
        assert not isinstance(value, TensorDimension)
        assert not isinstance(expected, TensorDimension)
        yield tree, value, expected
        return
    items = tree.items if isinstance(tree, VectorExpr) else [tree] * len(value.flat)
    yield from zip(items, value.flat, expected.flat, strict=False)


#: Function that checks the dimensions of the terms of an expression: tree, dimension, block, entry,
#: role.
Terms = Callable[[Tree, Value, str, str, str], None]

_FIELD = r"(?P<entry>.+?)\.(?P<field>restitution|friction|limit)(?:\.(?:static|kinetic))?"
_CLOCK = r"(?P<entry>.+?)\.(?P<field>every|offset)"
_ACTION = r"(?P<entry>.+?)\.(?P<field>set|impulse)\.(?P<target>.+)"


def _fields(model: Model) -> Iterator[tuple[str, str, str, Tree]]:
    """Yield entry, field, key and tree of the fields of constraints."""
    for key, tree in model.trees.items():
        block, _, name = key.partition(".")
        if block == "constraints" and (match := re.fullmatch(_FIELD, name)):
            yield match["entry"], match["field"], name, tree


def check_switching(model: Model, known: NamedDimensions, terms: Terms) -> None:
    """Check the fields of constraints, and conditions and actions of events.

    Parameters
    ----------
    model : Model
    known : NamedDimensions
        Dimensions including the multipliers; disagreements are added to it.
    terms : callable
        See `Terms`.
    """
    for entry, field, name, tree in _fields(model):
        expected: Value = find(known.multipliers, entry) if field == "limit" else ONE
        if not is_constant(tree):  # a number alone is in SI
            terms(tree, expected, "constraints", name, f"`{field}` of `{entry}`")
    _conditions(model, known)
    for key, tree in model.trees.items():
        block, _, name = key.partition(".")
        if is_constant(tree):
            continue
        if block == "events" and (match := re.fullmatch(_ACTION, name)):
            target = match["target"]
            expected = _of_target(known, target, match["field"])
            role = "the new value of" if match["field"] == "set" else "the impulse on"
            terms(tree, expected, "events", name, f"{role} `{target}`")
        elif block == "events" and (match := re.fullmatch(_CLOCK, name)):
            terms(tree, SECOND, "events", name, f"`{match['field']}` of `{match['entry']}`")


def _of_target(known: NamedDimensions, target: str, field: str) -> Value:
    """Return the dimension of a quantity set by an event, or of an impulse."""
    base = target.rstrip("'")
    value = find(known.names, base)
    if isinstance(value, TensorDimension):
        return UNKNOWN
    if field == "set":
        return rate_of(value, len(target) - len(base))
    return product(conjugate(value), SECOND)


def _conditions(model: Model, known: NamedDimensions) -> None:
    """Check that the sides of comparisons agree."""
    seen: set[int] = set()
    for event in model.events:
        if not event.sides or id(event.sides[0]) in seen:
            continue
        seen.add(id(event.sides[0]))
        compared = list(_compared(event.sides))
        for sides, reason in compared:
            _alike(known, sides, reason, event)


def _compared(sides: tuple[Tree, ...]) -> Iterator[tuple[tuple[Tree, ...], str]]:
    """Yield the sides of the comparisons in a condition."""
    if len(sides) > 1:
        yield sides, "sides"
        return
    for part in walk(sides[0]):
        if isinstance(part, Comparison):
            yield part.operands, "comparison"


def _alike(known: NamedDimensions, sides: tuple[Tree, ...], reason: str, event: ModelEvent) -> None:
    name = f"{event.name}.when"
    values = known.beside(sides, "events", name, event.indices)
    first: tuple[Tree, Dimension] | None = None
    for side, value in zip(sides, values, strict=True):
        if not isinstance(value, Dimension):
            continue
        if first is None:
            first = side, value
        elif known.evaluator.join(first[1], value) is None:
            wrong = Disagreement(reason, side, value, first[1], first[0])
            known.findings.append(UnitFinding(wrong, "events", name))


_ANGLES = tuple(
    getattr(se, function.symbol)
    for function in FUNCTIONS.values()
    if function.symbol and function.dimension in (DimensionRule.ANGLE, DimensionRule.DIRECTION)
)


def symbolic_unit(model: Model, expression: Basic) -> str | None:
    """Return the SI unit of an expression; None if it is unknown.

    Parameters
    ----------
    model : Model
        A model with consistent units: only one term of a sum is evaluated.
    expression : Basic
        Expression in t, q, q', q'', parameters, λ and constraint forces.
    """
    if not model.units.stated:
        return None
    dimension = _dimension(model, expression, {})
    return text_of(ONE if dimension is NUMBER and model.units.throughout else dimension)


def _dimension(model: Model, expression: Basic, seen: dict[Basic, Scalar]) -> Scalar:
    dimension = seen.get(expression)
    if dimension is None:
        dimension = seen[expression] = _evaluated(model, expression, seen)
    return dimension


def _evaluated(model: Model, expression: Basic, seen: dict[Basic, Scalar]) -> Scalar:
    if isinstance(expression, se.Symbol):
        return _symbol(model, expression.name)
    if (read := read_input(expression)) is not None:
        return _symbol(model, read[0] + "'" * read[1])
    if not expression.free_symbols:
        if expression == 0:
            return ZERO
        # a number may have taken a unit
        return NUMBER if not model.units.numbers or _is_small(expression) else UNKNOWN
    parts = expression.args
    if isinstance(expression, se.Mul):
        total: Scalar = NUMBER
        for part in parts:
            total = product(total, _dimension(model, part, seen))
        return total
    if isinstance(expression, se.Pow):
        base, exponent = _dimension(model, parts[0], seen), parts[1]
        if not isinstance(base, Dimension):
            return base
        if isinstance(exponent, se.Rational):
            return power(base, whole(Fraction(*map(int, exponent.get_num_den()))))
        return ONE if same(base, ONE) else UNKNOWN
    if isinstance(expression, (se.Add, se.Piecewise, se.Abs, se.Max, se.Min)):
        values = parts[0::2] if isinstance(expression, se.Piecewise) else parts
        terms = [_dimension(model, part, seen) for part in values]
        known = [x for x in terms if isinstance(x, Dimension)]
        return next((x for x in known if x.rad), known[0] if known else terms[0])
    return ANGLE if isinstance(expression, _ANGLES) else ONE


def _is_small(number: Basic) -> bool:
    return isinstance(number, se.Rational) and max(map(abs, map(int, number.get_num_den()))) <= 12


def _symbol(model: Model, name: str) -> Scalar:
    units, column = model.units, read_dotted_name(name)
    if column is not None and column.coordinate:
        column = read_column_name(name, model.coordinate_names, model.constraint_names)
    if name == TIME.name:
        return SECOND
    if column is None:
        base = name.rstrip("'")
        value = rate_of(find(units.names, base), len(name) - len(base))
    elif column.quantity == "multipliers":
        value = find(units.multipliers, column.constraint)
    else:
        value = find(units.names, column.coordinate)
        value = UNKNOWN if isinstance(value, TensorDimension) else conjugate(value)
    return UNKNOWN if isinstance(value, TensorDimension) else value
