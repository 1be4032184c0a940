"""Derivation of the dimensions of a model's quantities, and the check of its statements."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction

from lagcli.errors import SourceLocation
from lagcli.model.dimensions.dimension import (
    ENERGY,
    NUMBER,
    ONE,
    POWER,
    SECOND,
    UNKNOWN,
    ZERO,
    Dimension,
    Scalar,
    same,
)
from lagcli.model.dimensions.evaluation import (
    DimensionEvaluator,
    Disagreement,
    Entries,
    Value,
    rate_of,
)
from lagcli.model.dimensions.model_units import (
    ModelUnits,
    UnitFinding,
    conjugate,
    find,
    multiplier_dimension,
)
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import (
    IndexedSumExpr,
    Name,
    NumberExpr,
    SumExpr,
    Tree,
    VectorExpr,
    walk,
)
from lagcli.model.expression.units import read_unit, si_notation
from lagcli.model.model import NO_INDICES, Constraint, Definition, Model, Parameter, Written
from lagcli.model.names.dependencies import topological_order
from lagcli.model.names.indices import Indices
from lagcli.model.names.members import family_of, with_indices

_PASSES = 4  # over definitions that refer to other members of their family
_DENOMINATOR = 12  # of exponents that are values of parameters


def derive_units(model: Model, assumed: Mapping[str, Scalar] | None = None) -> ModelUnits:
    """Derive the dimensions of a model's quantities and check its statements.

    T, V and L are energies, D is a power, forces are conjugate to what they act on, sums add like
    to like, arguments of functions are numbers, both sides of a constraint agree, and initial
    values fit their coordinates.

    Parameters
    ----------
    model : Model
    assumed : mapping of str to Dimension or UNKNOWN, optional
        Dimensions of coordinates and parameters in place of those that the model states.

    Returns
    -------
    ModelUnits
    """
    return _Derivation(model, assumed or {}).units()


class _Derivation:
    """Derives the dimensions of one model; the `Lookup` of its expressions."""

    def __init__(self, model: Model, assumed: Mapping[str, Scalar]):
        self.model, self.assumed = model, assumed
        self.names: dict[str, Value] = {}
        self.constraints: dict[str, Value] = {}
        self.multipliers: dict[str, Value] = {}
        self.outputs: dict[str, Value] = {}
        self.written: dict[str, str] = {}
        self.missing: list[str] = []
        self.findings: list[UnitFinding] = []
        self.seen: dict[tuple[str, int], Value] = {}
        self.indices: dict[str, int] = {}
        self.members: dict[str, dict[str, Value]] = {}
        self.index = Indices(self.indices, self._whole)
        self.varied: set[str] = set()
        self.changed = False  # whether the dimension of a name has changed
        self.evaluator = DimensionEvaluator(self, strict=True)

    def units(self) -> ModelUnits:
        model = self.model
        stated = any(c.unit for c in model.coordinates) or any(
            p.unit for p in model.parameters.values()
        )
        self.coordinates()
        computed = self.stated_parameters()
        if not stated:
            return ModelUnits(missing=tuple(self.missing))
        self.evaluator.strict = not self.missing
        self.computed_parameters(computed)
        self.definitions()
        self.energies()
        self.forces()
        self.constrained()
        self.initial()
        self.reported()
        return ModelUnits(
            stated=True,
            missing=tuple(self.missing),
            names=self.names,
            constraints=self.constraints,
            multipliers=self.multipliers,
            outputs=self.outputs,
            written=self.written,
            findings=tuple(self.findings),
        )

    # what names stand for

    def value(self, name: Name) -> Value:
        """Return the dimension of a name with its primes."""
        key = name.text, name.primes
        known = self.seen.get(key)
        if known is None:
            known = self._value(name)
            if known is not ZERO and not (name.indices and self.varied):
                self.seen[key] = known
        return known

    def _value(self, name: Name) -> Value:
        text, primes = self.model.names.resolve(name)
        if text in self.varied:
            try:
                text = with_indices(text, [self.index.at(tree) for tree in name.indices])
            except ExpressionError:  # an index without a value
                return UNKNOWN
        value = self.names.get(text)
        if value is not None:
            return rate_of(value, primes)
        if "." in text:
            head, *rest = text.split(".")
            if head == "lambda":
                return find(self.multipliers, rest[0])
            force = find(self.names, rest[-1])
            return UNKNOWN if isinstance(force, Entries) else conjugate(force)
        if self.model.names.declared(text):
            return ZERO  # a definition by itself, not evaluated yet
        return SECOND if text == "t" else NUMBER  # pi, or an index

    def number(self, name: Name) -> Fraction | None:
        """Return the value of a parameter in an exponent, if it is a rational number."""
        parameter = self.model.parameters.get(name.text)
        if parameter is None:
            return None
        exact = Fraction(parameter.value).limit_denominator(_DENOMINATOR)
        return exact if float(exact) == parameter.value else None

    def each(self, tree: IndexedSumExpr) -> Iterator[None]:
        """Iterate over the terms of a sum, if members of a family have different dimensions."""
        if not self.varied:
            yield
            return
        try:
            span = self.index.range(tree.range)
        except ExpressionError:
            yield
            return
        for self.indices[tree.index] in span:
            yield
        self.indices.pop(tree.index, None)

    def _whole(self, name: Name) -> int:
        text = with_indices(name.text, [self.index.at(tree) for tree in name.indices])
        parameter = self.model.parameters.get(text)
        if parameter is None:
            raise ExpressionError("no-member", "no parameter", name.start, name.end)
        return int(parameter.value)

    def enter(self, entries: Iterable[tuple[str, Value]]) -> None:
        """Enter the dimensions of names; members of a family together where they agree."""
        touched = set()
        for name, value in entries:
            family = family_of(name)
            if family == name:
                self.change(name, value)
            else:
                self.members.setdefault(family, {})[name] = value
                touched.add(family)
        for family in touched:
            together = self.joined(self.members[family].values())
            if together is not None and family not in self.varied:
                self.change(family, together)
            else:
                self.varied.add(family)
                self.names.pop(family, None)
                self.names.update(self.members[family])
                self.seen.clear()

    def change(self, name: str, value: Value) -> None:
        if self.names.get(name) != value:
            self.names[name] = value
            self.seen.clear()
            self.changed = True

    def joined(self, values: Iterable[Value]) -> Value | None:
        """Return the common dimension of values; None if they differ."""
        total: Value = ZERO
        for value in values:
            joined = self.evaluator.join(total, value)
            if joined is None:
                return None
            total = joined
        return total

    def evaluated(
        self,
        tree: Tree,
        block: str,
        name: str | None = None,
        indices: Mapping[str, int] = NO_INDICES,
        location: SourceLocation | None = None,
    ) -> Value:
        """Return the dimension of an expression; enter what disagrees in it."""
        self.indices.clear()
        self.indices.update(indices)
        value = self.evaluator.value(tree)
        if self.evaluator.found:
            found = self.evaluator.found
            self.findings += [UnitFinding(d, block, name, location) for d in found]
            self.evaluator.found = []
        return value

    def fits(self, value: Value, expected: Value) -> bool:
        """Whether a value may have a dimension, as far as both are known."""
        if isinstance(value, Entries) or isinstance(expected, Entries):
            both = isinstance(value, Entries) and isinstance(expected, Entries)
            return not both or all(map(self.fits, value.flat, expected.flat))  # type: ignore[union-attr]
        if not isinstance(expected, Dimension):
            return True
        if value is NUMBER:
            return same(expected, ONE) or not self.evaluator.strict
        return not isinstance(value, Dimension) or same(value, expected)

    # coordinates, parameters and definitions

    def coordinates(self) -> None:
        found: list[tuple[str, Value]] = []
        for c in self.model.coordinates:
            value: Scalar = read_unit(c.unit).dimension if c.unit else UNKNOWN
            if c.unit:
                self.written[c.name] = c.unit
            else:
                self.missing.append(c.name)
            found.append((c.name, self.assumed.get(c.name, value)))
        self.enter(found)

    def stated_parameters(self) -> list[Parameter]:
        """Enter the parameters that are numbers or have a unit; return the others."""
        found: list[tuple[str, Value]] = []
        others = []
        for name, p in self.model.parameters.items():
            value: Scalar | None = None
            if p.unit:
                value = read_unit(p.unit).dimension
                self.written[name] = si_notation(p.unit)
            elif p.structural and p.value.is_integer():
                value = ONE  # how many there are of something
            elif p.written is None or not any(isinstance(x, Name) for x in walk(p.written.tree)):
                value = UNKNOWN
                self.missing.append(name)
            if value is None:
                others.append(p)
            else:
                found.append((name, self.assumed.get(name, value)))
        self.enter(found)
        return others

    def computed_parameters(self, others: list[Parameter]) -> None:
        """Enter the parameters that are expressions of others; check those with a unit."""
        needs: dict[str, list[str]] = {}
        members: dict[str, list[Parameter]] = {}
        for p in others:
            assert p.written is not None
            family = family_of(p.name)
            members.setdefault(family, []).append(p)
            used = [x.text for x in walk(p.written.tree) if isinstance(x, Name)]
            needs.setdefault(family, []).extend(used)
        for family in topological_order(needs)[0]:
            self.enter([(p.name, self._computed(p)) for p in members[family]])
        for p in self.model.parameters.values():
            if p.unit and p.written and not isinstance(p.written.tree, NumberExpr):
                self._check_stated(p, p.unit, p.written)

    def _computed(self, p: Parameter) -> Value:
        assert p.written is not None
        value = self._evaluated_parameter(p, p.written)
        return ONE if value is NUMBER and not self.missing else value

    def _evaluated_parameter(self, p: Parameter, written: Written) -> Value:
        return self.evaluated(written.tree, "parameters", p.name, written.indices, p.location)

    def _check_stated(self, p: Parameter, unit: str, written: Written) -> None:
        """Check an expression with a unit: a number in that unit, or a value in SI."""
        value, stated = self._evaluated_parameter(p, written), read_unit(unit)
        if isinstance(value, Dimension) and not same(value, ONE):
            if not same(value, stated.dimension):
                self.require(p, value, stated.dimension)
            elif stated.factor != 1:
                found = Disagreement("scaled", written.tree, value, stated.dimension)
                self.findings.append(UnitFinding(found, "parameters", p.name, p.location))

    def definitions(self) -> None:
        """Enter the definitions: each after those that it uses, until families agree."""
        needs: dict[str, list[str]] = {}
        families: dict[str, list[Definition]] = {}
        seen: set[int] = set()
        for d in self.model.definitions.values():
            family = family_of(d.name)
            families.setdefault(family, []).append(d)
            if id(d.tree) not in seen:
                seen.add(id(d.tree))
                names = (x for x in walk(d.tree) if isinstance(x, Name))
                used = [self.model.names.resolve(x)[0] for x in names]
                needs.setdefault(family, []).extend(used)
        order, cycles = topological_order(needs)
        before = len(self.findings)
        for _ in range(_PASSES if cycles else 1):
            del self.findings[before:]
            self.changed = False
            for family in order:
                self.enter(self._defined(families[family]))
            if not self.changed:
                break

    def _defined(self, members: list[Definition]) -> Iterator[tuple[str, Value]]:
        known: dict[int, Value] = {}
        for d in members:
            value = known.get(id(d.tree))
            if value is None or self.varied:
                value = self.evaluated(d.tree, "definitions", d.name, d.indices)
                known[id(d.tree)] = value
            yield d.name, value

    # statements

    def require(self, p: Parameter, found: Dimension, expected: Dimension) -> None:
        assert p.written is not None
        role = f"the unit of `{p.name}`"
        wrong = Disagreement("required", p.written.tree, found, expected, role=role)
        self.findings.append(UnitFinding(wrong, "parameters", p.name, p.location))

    def energies(self) -> None:
        for key, expected in (("T", ENERGY), ("V", ENERGY), ("L", ENERGY), ("D", POWER)):
            if key in self.model.trees:
                self.terms(self.model.trees[key], expected, key, None, f"`{key}`")

    def forces(self) -> None:
        for key, tree in self.model.trees.items():
            block, _, name = key.partition(".")
            if block == "Q":
                place = find(self.names, name)
                on = place.map(conjugate) if isinstance(place, Entries) else conjugate(place)
                self.terms(tree, on, block, name, f"the force on `{name}`")

    def terms(self, tree: Tree, expected: Value, block: str, name: str | None, role: str) -> None:
        """Check that every term of an expression has a dimension."""
        good: Tree | None = None
        bad: list[tuple[Tree, Value]] = []
        for term in self._terms(tree):
            value = self.evaluated(term, block, name)
            if not self.fits(value, expected):
                bad.append((term, value))
            elif good is None and isinstance(value, Dimension):
                good = term
        for term, value in bad:
            for part, found, wanted in _entries(term, value, expected):
                if not self.fits(found, wanted):
                    wrong = Disagreement("required", part, found, wanted, good, role)
                    self.findings.append(UnitFinding(wrong, block, name))

    def _terms(self, tree: Tree) -> Iterator[Tree]:
        if isinstance(tree, SumExpr):
            for _, term in tree.terms:
                yield from self._terms(term)
        elif isinstance(tree, IndexedSumExpr) and not self.varied:
            yield from self._terms(tree.term)
        else:
            yield tree

    def constrained(self) -> None:
        known: dict[int, Value] = {}
        residuals: list[tuple[str, Value]] = []
        multipliers: list[tuple[str, Value]] = []
        for c in self.model.constraints:
            residual = known.get(id(c.left))
            if residual is None or self.varied:
                residual = known[id(c.left)] = self._residual(c)
            residuals.append((c.name, residual))
            assert not isinstance(residual, Entries)
            force = multiplier_dimension(residual, c.kind == "holonomic")
            multipliers.append((c.name, force))
        self.constraints.update(self._table(residuals))
        self.multipliers.update(self._table(multipliers))

    def _residual(self, c: Constraint) -> Value:
        left = self.evaluated(c.left, "constraints", c.name, c.indices)
        if c.right is not None:
            right = self.evaluated(c.right, "constraints", c.name, c.indices)
            both = self.evaluator.join(left, right)
            if both is None:
                assert not isinstance(left, Entries)
                assert not isinstance(right, Entries)
                wrong = Disagreement("sides", c.left, left, right, c.right)
                self.findings.append(UnitFinding(wrong, "constraints", c.name))
            left = UNKNOWN if both is None else both
        if left is NUMBER and not self.missing:
            return ONE
        return left if isinstance(left, Dimension) else UNKNOWN

    def _table(self, entries: list[tuple[str, Value]]) -> dict[str, Value]:
        """Return dimensions by name, of members of a family together where they agree."""
        found: dict[str, Value] = {}
        families: dict[str, list[tuple[str, Value]]] = {}
        for name, value in entries:
            families.setdefault(family_of(name), []).append((name, value))
        for family, members in families.items():
            together = self.joined(value for _, value in members)
            if together is None:
                found.update(members)
            else:
                found[family] = together
        return found

    def initial(self) -> None:
        seen: set[tuple[int, str]] = set()
        for name, given in self.model.initial.items():
            coordinate = name.rstrip("'")
            rate = len(name) - len(coordinate)
            written = given.written
            if written is None:
                continue
            key = id(written.tree), family_of(coordinate)
            if key in seen and not self.varied:
                continue
            seen.add(key)
            expected = rate_of(find(self.names, coordinate), rate)
            value: Value = (
                read_unit(given.unit).dimension
                if given.unit
                else self.evaluated(written.tree, "initial", name, written.indices, given.location)
            )
            # a number alone is in SI
            if value is not NUMBER and not self.fits(value, expected):
                assert not isinstance(value, Entries)
                assert not isinstance(expected, Entries)
                role = f"the initial value of `{name}`"
                wrong = Disagreement("required", written.tree, value, expected, role=role)
                self.findings.append(UnitFinding(wrong, "initial", name, given.location))

    def reported(self) -> None:
        """Derive the dimensions of the outputs, and check the units that the model states."""
        stated: dict[str, str] = {}
        for name, unit in self.model.output_units.items():
            self.written[f"outputs.{name}"] = unit
            stated.setdefault(family_of(name), unit)
        found: list[tuple[str, Value]] = []
        for key, tree in self.model.trees.items():
            block, _, name = key.partition(".")
            if block != "outputs":
                continue
            value = self.evaluated(tree, block, name)
            if family_of(name) in stated and value is not NUMBER:
                expected = read_unit(stated[family_of(name)]).dimension
                if not self.fits(value, expected):
                    role = f"the output `{name}`"
                    assert not isinstance(value, Entries)
                    wrong = Disagreement("required", tree, value, expected, role=role)
                    self.findings.append(UnitFinding(wrong, block, name))
            found.append((name, ONE if value is NUMBER and not self.missing else value))
        self.outputs.update(self._table(found))


def _entries(tree: Tree, value: Value, expected: Value) -> Iterator[tuple[Tree, Scalar, Scalar]]:
    """Yield the parts of an expression with their dimensions: of a vector, its entries."""
    if not (isinstance(value, Entries) and isinstance(expected, Entries)):
        assert not isinstance(value, Entries)
        assert not isinstance(expected, Entries)
        yield tree, value, expected
        return
    items = tree.items if isinstance(tree, VectorExpr) else [tree] * len(value.flat)
    yield from zip(items, value.flat, expected.flat, strict=True)
