"""The initial values: fixed or guessed, one for every coordinate and velocity."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from lagcli.errors import SourceLocation
from lagcli.model.draft import Draft, Indices
from lagcli.model.expression.quantities import Quantity, evaluate, formula_of, read_quantity
from lagcli.model.expression.tokens import without_dots
from lagcli.model.keys import INITIAL, keys_of
from lagcli.model.model import Constraint, InitialValue, Written
from lagcli.model.names.families import Declaration, Member, members_of, read_key
from lagcli.model.names.members import family_of, members_clause
from lagcli.model.names.scope import uses
from lagcli.model.names.unknown import meant_derivative
from lagcli.model.sections.parameters import override_node
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.symbols import Context, Symbols
from lagcli.model.yaml.source import Mapping as MappingNode
from lagcli.model.yaml.source import Scalar, YamlNode

_SHOWN = 12  # missing entries written out
#: A guess on the command line: as the file has it.
GUESS = re.compile(r"\s*+\{\s*+(guess)\s*+:\s++([^{}]*+)\}\s*+")

Values = dict[str, InitialValue]


def read_closed(draft: Draft, constraints: Sequence[Constraint]) -> frozenset[str]:
    """Return the contacts that `initial` states to be closed: ``floor: closed``."""
    unilateral = {c.name for c in constraints if c.sign}
    node = draft.get("initial")
    found = set()
    for name, key, value in node if isinstance(node, MappingNode) else ():
        if not _is_closed(draft, name, value):
            continue
        if name in unilateral:
            found.add(name)
        elif any(c.name == name for c in constraints):
            draft.report.add(
                "not-unilateral",
                f"`{name}` cannot be closed: it is not a contact",
                key.location,
                "only a constraint with `>=` or `<=` opens and closes",
            )
    return frozenset(found)


def _is_closed(draft: Draft, name: str, node: YamlNode) -> bool:
    """Whether an entry states that a constraint is closed."""
    stated = isinstance(node, Scalar) and node.value.strip() == "closed"
    return stated and name in draft.names.constraints and canonical_name(draft, name) is None


def read_initial(
    draft: Draft, constants: Symbols, overrides: Mapping[str, object]
) -> tuple[Values, Values]:
    """Return the initial coordinates and velocities, by coordinate."""
    names = draft.names
    entries = draft.entries("initial")
    given = _overriding(draft, overrides)
    values: Values = {}
    attempted: dict[str, Member] = {}
    readers: dict[int, _InitialReader] = {}
    for name, key, node in entries or []:
        if _is_closed(draft, name, node):
            continue
        declaration = _declaration(draft, name, key, node)
        if declaration is None:
            continue
        readers[id(declaration)] = _InitialReader(draft, declaration, constants)
        for member in members_of(draft, declaration, constants):
            if not _enter(draft, attempted, member):
                break
    for canonical, member in attempted.items():
        if canonical not in given:
            readers[id(member.declaration)].read(canonical, member.indices, values)
    for canonical, option in given.items():
        node = override_node("--set-initial", option, overrides[option])
        declaration = Declaration(canonical, node, _guess_or(node))
        _InitialReader(draft, declaration, constants).read(canonical, {}, values)
    if entries is not None and not names.incomplete and "initial" not in draft.misspelled_keys:
        _report_missing(draft, {*attempted, *given})
    positions = {q: values[q] for q in names.coordinates if q in values}
    velocities = {q: values[f"{q}'"] for q in names.coordinates if f"{q}'" in values}
    return positions, velocities


def _declaration(draft: Draft, name: str, key: Scalar, node: YamlNode) -> Declaration | None:
    """Return what an entry gives a value to; an unknown name is reported."""
    if "[" not in name:
        canonical = canonical_name(draft, name)
        if canonical is None:
            _report_unknown(draft, name, key)
            return None
        base = canonical.removesuffix("'")
        return Declaration(base, key, node, primes=len(canonical) - len(base))
    declaration = read_key(draft, key, node, "initial value", primed=True)
    if declaration is None or "coordinate" in draft.names.families.get(declaration.family, ()):
        return declaration
    if not declaration.primes:  # x_dot[1]
        base = declaration.name.removesuffix("_dot")
        if base != declaration.name and f"{base}[]" in draft.names.families:
            return replace(declaration, name=base, primes=1)
    _report_unknown(draft, declaration.title, key)
    return None


def _enter(draft: Draft, attempted: dict[str, Member], member: Member) -> bool:
    """Enter what an entry gives a value to; report what has one already, or is no coordinate.

    A value for a single member takes the place of that for a range.
    """
    names, d = draft.names, member.declaration
    canonical = member.name + "'" * d.primes
    if member.name not in names.coordinates:
        if d.family not in names.broken:
            draft.report.add(
                "no-member",
                f"`initial` names `{canonical}`, but"
                f" {members_clause(d.name, _members(draft, d.name))}",
                d.key.location,
                "only coordinates have initial values: let the ranges be the same",
            )
        return False
    first = attempted.get(canonical)
    if first is None or (first.declaration.several and not d.several):
        attempted[canonical] = member
    elif first.declaration.several == d.several:
        draft.report.add(
            "duplicate-key",
            f"`{canonical}` has two initial values",
            d.key.location,
            "a value for a single member takes precedence over a range; ranges must not overlap"
            if d.span is not None
            else "`x_dot` and `x'` are the same thing; keep one of them",
            (("the first one is here", first.declaration.key.location),),
        )
        return False
    return True


def _members(draft: Draft, base: str) -> list[str]:
    return [q for q in draft.names.coordinates if q.startswith(f"{base}[")]


def _overriding(draft: Draft, overrides: Mapping[str, object]) -> dict[str, str]:
    """Return the options by what they give a value to."""
    given: dict[str, str] = {}
    for name, value in overrides.items():
        canonical = canonical_name(draft, "".join(name.split()))
        if canonical is None:
            _report_unknown_override(draft, name, value)
        elif canonical in given:
            place = override_node("--set-initial", name, value).location
            message = f"`{canonical}` is given twice, as {given[canonical]} and {name}"
            draft.report.add("duplicate-key", message, place, "keep one of them")
        else:
            given[canonical] = name
    return given


def _guess_or(node: Scalar) -> YamlNode:
    """Return a value from the command line; a guess as the mapping that it is in a file."""
    match = GUESS.fullmatch(node.value)
    if match is None:
        return node
    key, guess = (
        Scalar(node.source, (0, match.start(i)), (0, match.end(i)), match[i]) for i in (1, 2)
    )
    return MappingNode(node.source, node.start, node.end, {"guess": (key, guess)})


def canonical_name(draft: Draft, name: str) -> str | None:
    """Return the coordinate or velocity (x') that an entry names."""
    if name in draft.names.coordinates:
        return name
    if not name.isascii():  # φ̇ and φ′ are φ'
        plain, primes = without_dots(name.replace("′", "'"))
        name = plain + "'" * primes
    for ending in ("'", "_dot"):
        base = name.removesuffix(ending)
        if base != name and base in draft.names.coordinates:
            return f"{base}'"
    base, bracket, index = name.partition("_dot[")
    return f"{base}[{index}'" if bracket and f"{base}[{index}" in draft.names.coordinates else None


def _every(draft: Draft) -> list[str]:
    return [name for q in draft.names.coordinates for name in (q, f"{q}'")]


def _report_unknown(draft: Draft, name: str, key: Scalar) -> None:
    names = draft.names
    base = name.rstrip("'").removesuffix("_ddot").removesuffix("_dot")
    if names.incomplete or base in names.suspects:
        return
    what, line = names.lines.get(base, ("", 0))
    if base in names.coordinates:
        message = f"`{shorten(name)}` has no initial value: accelerations are computed"
        help_: str | None = "remove the entry"
    else:
        message = f"`initial` names `{shorten(name)}`, which is not a coordinate or a velocity"
        velocity = meant_derivative(names, name)
        help_ = f"a velocity is written with a prime: `{velocity}`" if velocity else None
        help_ = help_ or did_you_mean(nearest(name, _every(draft)))
        if base in names.constraints:
            help_ = f"`{base}` is a constraint; a contact starts closed with `{base}: closed`"
        if what:
            help_ = f"`{base}` is a {what} (line {line}); remove the entry"
    draft.report.add(
        "unknown-name",
        message,
        key.location,
        help_
        or "the coordinates are " + ", ".join(f"`{q}`" for q in list(names.coordinates)[:_SHOWN]),
    )


def _report_unknown_override(draft: Draft, name: str, value: object) -> None:
    names = draft.names
    if names.incomplete:
        return
    where = override_node("--set-initial", name, value).source.path
    every = _every(draft)
    help_ = did_you_mean(nearest(name, every))
    if name in names.parameters:
        help_ = f"`{name}` is a parameter: give --set {name}={value}"
    draft.report.add(
        "unknown-name",
        f"the model has no initial value `{shorten(name)}`",
        SourceLocation(where, 0, 0),
        help_ or f"its initial values are {', '.join(every[: 2 * _SHOWN])}",
    )


class _InitialReader:
    """Reads the value of an entry, for each member that it is given for."""

    def __init__(self, draft: Draft, declaration: Declaration, constants: Symbols):
        self.draft, self.location, self.fixed = draft, declaration.node.location, True
        self.quantity: Quantity | None = None
        node: YamlNode | None = declaration.node
        self.what = what = f"the initial value of `{declaration.title}`"
        if isinstance(node, MappingNode):
            node = self.guess(node, what)
        names = replace(
            constants, coordinates=draft.names.coordinates, definitions=draft.names.definitions
        )
        if node is not None:
            self.quantity = read_quantity(draft, node, what, names)
        if self.quantity is not None:
            context = Context(what, coordinates=False, definitions=False, time=False)
            index, tree = declaration.index, self.quantity.parsed.tree
            self.formula = formula_of(draft, self.quantity, context, names, index)
            self.varies = index is not None and uses(tree, index)
        self.same: float | None = None

    def guess(self, node: MappingNode, what: str) -> YamlNode | None:
        """Return the field ``guess``."""
        fields = self.draft.fields(node, what, keys_of(INITIAL))
        self.fixed = False
        if "guess" not in fields and not node.entries:
            self.draft.report.add(
                "missing-value", f"{what} is empty", node.location, "write a number, or {guess: 0}"
            )
        return fields.get("guess")

    def read(self, name: str, indices: Indices, values: Values) -> None:
        """Evaluate the entry for a coordinate or velocity."""
        if self.quantity is None:
            return
        value = self.same
        if value is None:
            value = evaluate(self.draft, self.quantity, self.formula, self.what, indices)
            self.same = None if self.varies else value
        if value is not None:
            quantity = self.quantity
            written = Written(quantity.parsed.tree, quantity.factor, indices)
            values[name] = InitialValue(value, self.fixed, self.location, written, quantity.unit)


def _report_missing(draft: Draft, attempted: set[str]) -> None:
    missing = [n for n in _every(draft) if n not in attempted]
    missing = [n for n in missing if family_of(n.rstrip("'")) not in draft.names.broken]
    if not missing:
        return
    entry = draft.root.entries.get("initial")
    shown = missing[:_SHOWN]
    rest = f" and {len(missing) - _SHOWN} more" if len(missing) > _SHOWN else ""
    draft.report.add(
        "missing-initial",
        "no initial value for " + ", ".join(f"`{n}`" for n in shown) + rest,
        entry[0].location if entry else draft.source.location(0, 0),
        "every coordinate and velocity needs a number, or {guess: …} where the constraints"
        " decide:\ninitial:\n" + "\n".join(f"  {n}: 0" for n in shown),
    )
