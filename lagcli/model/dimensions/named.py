"""Dimensions of the names of a model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction

from lagcli.errors import SourceLocation
from lagcli.model.dimensions.evaluation import (
    DimensionEvaluator,
    Disagreement,
    EntryPlace,
    is_constant,
    is_measured,
)
from lagcli.model.dimensions.model_units import (
    UnitFinding,
    conjugate,
    find,
)
from lagcli.model.expression.dimension import (
    NUMBER,
    ONE,
    SECOND,
    UNKNOWN,
    ZERO,
    Dimension,
    Scalar,
    TensorDimension,
    Value,
    rate_of,
    same,
)
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import (
    IndexedSumExpr,
    Name,
    NumberExpr,
    Tree,
    walk,
)
from lagcli.model.expression.units import read_unit, si_notation
from lagcli.model.model import NO_INDICES, Definition, Model, Parameter, Written
from lagcli.model.names.dependencies import topological_order
from lagcli.model.names.members import IndexEvaluator, family_of, with_indices

_PASSES = 4  # number of passes over definitions that refer to other members of their family
_DENOMINATOR = 12  # largest denominator of exponents given by parameters


class NamedDimensions:
    """Dimensions of a model's names, and of expressions in them.

    Parameters
    ----------
    model : Model
    assumed : mapping of str to Dimension or UNKNOWN
        Dimensions of coordinates and parameters, or of families ``x[]``, instead of those given by
        the model.

    Attributes
    ----------
    names : dict of str to dimension
        Dimensions of coordinates, parameters and definitions, by name; one entry for a family
        ``x[]`` whose members agree.
    multipliers : dict of str to dimension
        Dimensions of λ, by constraint; set by the caller.
    written : dict of str to str
        Units given by the model, in SI.
    missing : list of str
        Coordinates and parameters without a unit.
    stated, throughout : bool
        Whether the model gives any unit, and whether it gives all.
    varied : set of str
        Families whose members have different dimensions.
    findings : list of UnitFinding
    """

    def __init__(self, model: Model, assumed: Mapping[str, Scalar]):
        self.model, self.assumed = model, assumed
        self.names: dict[str, Value] = {}
        self.multipliers: dict[str, Value] = {}
        self.written: dict[str, str] = {}
        self.missing: list[str] = []
        self.varied: set[str] = set()
        self.findings: list[UnitFinding] = []
        self._members: dict[str, dict[str, Value]] = {}
        self._seen: dict[tuple[str, int], Value] = {}
        self._changed = False  # whether the dimension of a name has changed
        self._early = False  # whether a definition was used before it had a dimension
        self._indices: dict[str, int] = {}
        self._index = IndexEvaluator(self._indices, self._whole)
        self.evaluator = DimensionEvaluator(self, strict=True)
        self.numbers = self.evaluator.numbers
        self._coordinates()
        self._inputs()
        computed = self._stated_parameters()
        given = any(p.unit for p in model.parameters.values())
        self.stated = given or any(c.unit for c in model.coordinates)
        self.throughout = self.evaluator.strict = given and not self.missing
        if self.stated:
            self._computed_parameters(computed)
            self._definitions()

    # lookup of names

    def value(self, name: Name) -> Value:
        """Return the dimension of a name with its primes."""
        key = name.text, name.primes
        known = self._seen.get(key)
        if known is None:
            known = self._value(name)
            if known is not ZERO and not (name.indices and self.varied):
                self._seen[key] = known
        return known

    def _value(self, name: Name) -> Value:
        text, primes = self.model.names.resolve(name)
        if text in self.varied:
            try:
                text = with_indices(text, [self._index.at(tree) for tree in name.indices])
            except ExpressionError:  # an index without a value
                return UNKNOWN
        value = self.names.get(text)
        if value is not None:
            return rate_of(value, primes)
        if "." in text:
            head, *rest = text.split(".")
            if head == "lambda":
                return find(self.multipliers, ".".join(rest))
            force = find(self.names, rest[-1])
            return UNKNOWN if isinstance(force, TensorDimension) else conjugate(force)
        if self.model.names.declared(text):
            self._early = True
            return ZERO  # a definition that has not been evaluated yet
        return SECOND if text == "t" else NUMBER  # pi, or an index

    def number(self, name: Name) -> Fraction | None:
        """Return the value of a parameter in an exponent, if it is a rational number."""
        if name.text in self._indices:
            return Fraction(self._indices[name.text])
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
            span = self._index.range(tree.range)
        except ExpressionError:
            yield
            return
        member = self.numbers.member
        for self._indices[tree.index] in span:
            self.numbers.member = (*member, self._indices[tree.index])
            yield
        self.numbers.member = member
        self._indices.pop(tree.index, None)

    def _whole(self, name: Name) -> int:
        text = with_indices(name.text, [self._index.at(tree) for tree in name.indices])
        parameter = self.model.parameters.get(text)
        if parameter is None:
            raise ExpressionError("no-member", "no parameter", name.start, name.end)
        return int(parameter.value)

    def enter(self, entries: Iterable[tuple[str, Value]]) -> None:
        """Set the dimensions of names, with one entry for members of a family that agree."""
        touched = set()
        for name, value in entries:
            family = family_of(name)
            if family != name:
                self._members.setdefault(family, {})[name] = value
                touched.add(family)
            if family == name or family in self.varied:
                self._change(name, value)
        for family in touched - self.varied:
            together = self.joined(self._members[family].values())
            if together is not None:
                self._change(family, together)
                continue
            self.varied.add(family)
            self.names.pop(family, None)
            self._seen.clear()
            for name, value in self._members[family].items():
                self._change(name, value)

    def _change(self, name: str, value: Value) -> None:
        before = self.names.get(name)
        if before != value:
            self.names[name] = value
            self._changed = True
            if before is not None:
                self._seen.clear()

    def joined(self, values: Iterable[Value]) -> Value | None:
        """Return the common dimension of values; None if they differ."""
        total: Value = ZERO
        for value in values:
            joined = None if _open(total, value) else self.evaluator.join(total, value)
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
        """Return the dimension of an expression; record disagreements in it."""
        return self.beside((tree,), block, name, indices, location)[0]

    def beside(
        self,
        trees: Sequence[Tree],
        block: str,
        name: str | None = None,
        indices: Mapping[str, int] = NO_INDICES,
        location: SourceLocation | None = None,
    ) -> list[Value]:
        """Return the dimensions of the sides of a comparison; record disagreements in each."""
        self._indices.clear()
        self._indices.update(indices)
        self.numbers.place = EntryPlace(block, name, location)
        self.numbers.member = tuple(indices.items()) if self.varied else ()
        values = self.evaluator.beside(trees)
        if self.evaluator.disagreements:
            disagreements = self.evaluator.disagreements
            self.findings += [UnitFinding(d, block, name, location) for d in disagreements]
            self.evaluator.disagreements = []
        return values

    def fits(self, value: Value, expected: Value) -> bool:
        """Whether a value can have a dimension, as far as both are known."""
        if isinstance(value, TensorDimension) or isinstance(expected, TensorDimension):
            both = isinstance(value, TensorDimension) and isinstance(expected, TensorDimension)
            return not both or all(map(self.fits, value.flat, expected.flat))  # type: ignore[union-attr]
        if not isinstance(expected, Dimension):
            return True
        if value is NUMBER:
            return not self.evaluator.strict or self.numbers.agree(expected, ONE)
        return not isinstance(value, Dimension) or self.numbers.agree(value, expected)

    # coordinates, parameters and definitions

    def _coordinates(self) -> None:
        entries: list[tuple[str, Value]] = []
        for c in self.model.coordinates:
            value: Scalar = read_unit(c.unit).dimension if c.unit else UNKNOWN
            if c.unit:
                self.written[c.name] = c.unit
            else:
                self.missing.append(c.name)
            entries.append((c.name, self.assumed.get(family_of(c.name), value)))
        self.enter(entries)

    def _inputs(self) -> None:
        entries: list[tuple[str, Value]] = []
        for name, x in self.model.inputs.items():
            value: Scalar = read_unit(x.data.unit).dimension if x.data.unit else UNKNOWN
            if x.data.unit:
                self.written[name] = si_notation(x.data.unit)
            else:
                self.missing.append(name)
            entries.append((name, self.assumed.get(name, value)))
        self.enter(entries)

    def _stated_parameters(self) -> list[Parameter]:
        """Set the parameters that are numbers or have a unit; return the others."""
        entries: list[tuple[str, Value]] = []
        others = []
        for name, p in self.model.parameters.items():
            value: Scalar | None = None
            if p.unit:
                value = read_unit(p.unit).dimension
                self.written[name] = si_notation(p.unit)
            elif p.structural and p.value.is_integer():
                value = ONE  # a count
            elif p.written is None or not any(isinstance(x, Name) for x in walk(p.written.tree)):
                value = UNKNOWN
                self.missing.append(name)
            if value is None:
                others.append(p)
            else:
                entries.append((name, self.assumed.get(family_of(name), value)))
        self.enter(entries)
        return others

    def _computed_parameters(self, others: list[Parameter]) -> None:
        """Set the parameters that are expressions of others; check those with a unit."""
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
        return ONE if value is NUMBER and self.throughout else value

    def _evaluated_parameter(self, p: Parameter, written: Written) -> Value:
        return self.evaluated(written.tree, "parameters", p.name, written.indices, p.location)

    def _check_stated(self, p: Parameter, unit: str, written: Written) -> None:
        """Check an expression with a unit: a number in that unit, or a value in SI."""
        if is_constant(written.tree):
            return
        numbers = (x for x in walk(written.tree) if isinstance(x, NumberExpr))
        if not self.throughout and any(map(is_measured, numbers)):
            return  # a number may be in SI units
        value, stated = self._evaluated_parameter(p, written), read_unit(unit)
        pure = self.numbers.settled(value)
        if isinstance(value, Dimension) and isinstance(pure, Dimension) and not same(pure, ONE):
            if value.numbers and stated.factor != 1 and self.numbers.agree(value, ONE):
                return  # a number in the stated unit
            if not self.numbers.agree(value, stated.dimension):
                self._require(p, value, stated.dimension)
            elif stated.factor != 1:
                scaled = Disagreement("scaled", written.tree, value, stated.dimension)
                self.findings.append(UnitFinding(scaled, "parameters", p.name, p.location))

    def _definitions(self) -> None:
        """Set the definitions in the order of their dependencies, until families agree."""
        families: dict[str, list[Definition]] = {}
        for d in self.model.definitions.values():
            families.setdefault(family_of(d.name), []).append(d)
        before = len(self.findings)
        for members in families.values():
            self.enter(self._defined(members))
        if not self._early:
            return  # the file's order suffices
        needs: dict[str, list[str]] = {}
        for family, members in families.items():
            trees = {id(d.tree): d.tree for d in members}.values()
            names = (x for tree in trees for x in walk(tree) if isinstance(x, Name))
            needs[family] = [self.model.names.resolve(x)[0] for x in names]
        order, cycles = topological_order(needs)
        self._seen.clear()
        for _ in range(_PASSES if cycles else 1):
            del self.findings[before:]
            self._changed = False
            for family in order:
                self.enter(self._defined(families[family]))
            if not self._changed:
                return
        if cycles:  # members that depend on later ones
            del self.findings[before:]
            below = {name for cycle in cycles for name in cycle} & self.varied
            self.enter([(d.name, UNKNOWN) for family in below for d in families[family]])

    def _defined(self, members: list[Definition]) -> Iterator[tuple[str, Value]]:
        known: dict[int, Value] = {}
        for d in members:
            value = known.get(id(d.tree))
            if value is None or self.varied:
                value = self.evaluated(d.tree, "definitions", d.name, d.indices)
                known[id(d.tree)] = value
            yield d.name, value

    def _require(self, p: Parameter, dimension: Dimension, expected: Dimension) -> None:
        assert p.written is not None
        role = f"the unit of `{p.name}`"
        wrong = Disagreement("required", p.written.tree, dimension, expected, role=role)
        self.findings.append(UnitFinding(wrong, "parameters", p.name, p.location))


def _open(a: Value, b: Value) -> bool:
    """Whether values may differ because of their numbers: members of a family need not agree.

    A member that is a number takes the unit of the others.
    """
    if not isinstance(a, Dimension) or not isinstance(b, Dimension) or a == b:
        return False
    return any(x.numbers and x != Dimension(numbers=x.numbers) for x in (a, b))
