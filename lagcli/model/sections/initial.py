"""The initial values: fixed or guessed, one for every coordinate and velocity."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING

from lagcli.errors import SourceLocation
from lagcli.model.draft import Draft, Indices
from lagcli.model.expression.grammar import Span
from lagcli.model.expression.tokens import without_dots
from lagcli.model.expression.trees import NumberExpr
from lagcli.model.initial_values import InitialReader, guess_or, guessed
from lagcli.model.model import Constraint, InitialValue
from lagcli.model.names.families import Declaration, Member, members_of, read_key
from lagcli.model.names.members import family_of, indices_of, members_clause
from lagcli.model.sections.parameters import override_node
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.symbols import Symbols
from lagcli.model.vectors.kinds import KINDS, components
from lagcli.model.yaml.source import Mapping as MappingNode
from lagcli.model.yaml.source import Scalar, Sequence, YamlNode

if TYPE_CHECKING:
    from lagcli.model.vectors.initial import VectorReader

    Reader = InitialReader | VectorReader

Spins = dict[str, tuple[bool, bool, bool]]

_SHOWN = 12  # largest number of missing entries in a message
Values = dict[str, InitialValue]


def read_closed(draft: Draft, constraints: Iterable[Constraint]) -> frozenset[str]:
    """Return the contacts that `initial` states to be closed: ``floor: closed``."""
    signs = {c.name: c.sign for c in constraints}
    node = draft.get("initial")
    found = set()
    for name, key, value in node if isinstance(node, MappingNode) else ():
        if not _states_closed(draft, name, value):
            continue
        if signs.get(name):
            found.add(name)
        elif name in signs:
            draft.report.add(
                "not-unilateral",
                f"`{name}` cannot be closed: it is not a contact",
                key.location,
                "only a constraint with `>=` or `<=` opens and closes",
            )
        elif name not in draft.names.constraints:
            _report_no_contact(draft, name, key, [c for c in signs if signs[c]])
    return frozenset(found)


def _states_closed(draft: Draft, name: str, node: YamlNode) -> bool:
    """Whether an entry declares as closed something that is not a coordinate or a velocity."""
    stated = isinstance(node, Scalar) and node.value.strip() == "closed"
    named = name in draft.names.constraints or "[" not in name
    return stated and named and canonical_name(draft, name, vectors=True) is None


def read_initial(
    draft: Draft, constants: Symbols, overrides: Mapping[str, object]
) -> tuple[Values, Values, Spins]:
    """Return the initial coordinates and velocities, by coordinate, and which ω are fixed."""
    names = draft.names
    entries = draft.entries("initial")
    given = _overriding(draft, overrides)
    attempted: dict[str, Member] = {}
    readers: dict[int, Reader] = {}
    for name, key, node in entries or []:
        if _states_closed(draft, name, node):
            continue
        declaration = _declaration(draft, name, key, node)
        for member, reader in _values(draft, declaration, constants) if declaration else ():
            readers[id(member.declaration)] = reader
            if not _enter(draft, attempted, member):
                break
    jobs = {
        canonical: (readers[id(member.declaration)], member.indices)
        for canonical, member in attempted.items()
    }
    for canonical, option in given.items():
        node = override_node("--set-initial", option, overrides[option])
        declaration = _named(draft, canonical, node, guess_or(node))
        for member, reader in _values(draft, declaration, constants):
            name = member.name + "'" * member.declaration.primes
            if not member.declaration.part or name not in given:
                jobs[name] = (reader, member.indices)
    values: Values = {}
    for canonical in sorted(jobs, key=lambda name: name.endswith("'")):
        reader, indices = jobs[canonical]
        reader.read(canonical, indices, values)
    if entries is not None and not names.incomplete and "initial" not in draft.misspelled_keys:
        _report_missing(draft, jobs.keys())
    positions = {q: values[q] for q in names.coordinates if q in values}
    velocities = {q: values[f"{q}'"] for q in names.coordinates if f"{q}'" in values}
    return positions, velocities, _spins(jobs)


def _spins(jobs: Mapping[str, tuple[Reader, Indices]]) -> Spins:
    """Return by quaternion which components of its angular velocity are fixed."""
    found: Spins = {}
    readers = {name: reader for name, (reader, _) in jobs.items()}
    for name, reader in readers.items():
        base, _, part = name.removesuffix("'").rpartition(".")
        turning = getattr(reader, "turning", False)
        parts = [f"{base}.{k}'" for k in KINDS["quaternion"].parts]
        if turning and part == "0" and all(readers.get(x) is reader for x in parts):
            found[base] = reader.fixed_spin  # type: ignore[union-attr]
    return found


def _values(
    draft: Draft, declaration: Declaration, constants: Symbols
) -> Iterator[tuple[Member, Reader]]:
    """Yield the targets of an entry, and the readers of their values."""
    members = members_of(draft, declaration, constants)
    kind = draft.names.kinds.get(declaration.family)
    value, fixed = declaration.node, True
    if isinstance(value, MappingNode) and "guess" in value.entries:
        value, fixed = value.entries["guess"][1], False
    rotation = kind == "quaternion" and not declaration.primes
    split = isinstance(value, Sequence) and (
        kind is None or rotation or any(isinstance(item, Sequence) for item in value.items)
    )
    if not (split and declaration.several):
        yield from _readers(draft, declaration, members, kind, constants)
        return
    assert isinstance(value, Sequence)
    if len(value.items) != len(members):
        draft.report.add(
            "wrong-length",
            f"`{declaration.title}` has {len(members)} members, but its list has"
            f" {len(value.items)} values",
            value.location,
            "give one value for each member, or one for all of them",
        )
        members = members[: len(value.items)]
    for member, item in zip(members, value.items, strict=False):
        own = declaration._replace(node=item if fixed else guessed(declaration.node, item))
        yield from _readers(draft, own, [member._replace(declaration=own)], kind, constants)


def _readers(
    draft: Draft,
    declaration: Declaration,
    members: Iterable[Member],
    kind: str | None,
    constants: Symbols,
) -> Iterator[tuple[Member, Reader]]:
    """Yield members, each component of a vector separately, with the reader of their value."""
    if kind is None:
        reader: Reader = InitialReader(draft, declaration, constants)
        yield from ((member, reader) for member in members)
        return
    from lagcli.model.vectors.initial import VectorReader

    reader = VectorReader(draft, declaration, kind, constants)
    parts = [part._replace(kind=kind) for part in components(declaration, kind)]
    for member in members:
        for d in parts:
            yield Member(member.name + d.part, d, member.indices), reader


def _declaration(draft: Draft, name: str, key: Scalar, node: YamlNode) -> Declaration | None:
    """Return the target of an entry; report an unknown name."""
    if "[" not in name:
        canonical = canonical_name(draft, name, vectors=True)
        if canonical is None:
            _report_unknown(draft, name, key)
            return None
        return _named(draft, canonical, key, node)
    declaration = read_key(draft, key, node, "initial value", primed=True)
    if declaration is None or _is_coordinate(draft, declaration):
        return declaration
    if not declaration.primes:  # x_dot[1]
        base = declaration.name.removesuffix("_dot")
        own = declaration._replace(name=base, primes=1)
        if base != declaration.name and _is_coordinate(draft, own):
            return own
    _report_unknown(draft, declaration.title, key)
    return None


def _named(draft: Draft, canonical: str, key: Scalar, node: YamlNode) -> Declaration:
    """Return the declaration of a single name, such as ``r``, ``r.x'`` or ``x[1]``."""
    base = canonical.removesuffix("'")
    spans: tuple[Span, ...] = ()
    if "[" in base and family_of(base) in draft.names.kinds:
        spans = tuple((None, NumberExpr(0, 0, Fraction(k))) for k in indices_of(base))
        base = base.partition("[")[0]
    return Declaration(base, key, node, spans, primes=len(canonical.rstrip("'")) < len(canonical))


def _is_coordinate(draft: Draft, d: Declaration) -> bool:
    names = draft.names
    return d.family in names.kinds or "coordinate" in names.families.get(d.family, ())


def _enter(draft: Draft, attempted: dict[str, Member], member: Member) -> bool:
    """Record the target of an entry; report one that already has a value, or is no coordinate.

    A value for a single member overrides that of a range.
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
                "only coordinates have initial values: use the same ranges",
            )
        return False
    first = attempted.get(canonical)
    if first is None or _width(d) < _width(first.declaration):
        attempted[canonical] = member
    elif _width(d) == _width(first.declaration):
        draft.report.add(
            "duplicate-key",
            f"`{canonical}` has two initial values",
            d.key.location,
            "a value for a single member takes precedence over a range; ranges must not overlap"
            if d.spans or d.part
            else "`x_dot` and `x'` are the same thing; keep one of them",
            (("the first one is here", first.declaration.key.location),),
        )
        return False
    return True


def _width(d: Declaration) -> int:
    """Return the number of values that an entry gives: of a component, a vector, or a range."""
    return int(d.several) + 2 * bool(d.kind)


def _members(draft: Draft, base: str) -> list[str]:
    return [q for q in draft.names.coordinates if q.startswith(f"{base}[")]


def _overriding(draft: Draft, overrides: Mapping[str, object]) -> dict[str, str]:
    """Return the options by the names of their targets."""
    given: dict[str, str] = {}
    for name, value in overrides.items():
        canonical = canonical_name(draft, "".join(name.split()), vectors=True)
        if canonical is None:
            _report_unknown_override(draft, name, value)
        elif canonical in given:
            place = override_node("--set-initial", name, value).location
            message = f"`{canonical}` is given twice, as {given[canonical]} and {name}"
            draft.report.add("duplicate-key", message, place, "keep one of them")
        else:
            given[canonical] = name
    return given


def canonical_name(draft: Draft, name: str, vectors: bool = False) -> str | None:
    """Return the coordinate or velocity (x') that an entry names, or the vector of these."""
    names = draft.names

    def known(text: str) -> bool:
        return text in names.coordinates or (
            vectors and family_of(text) in names.kinds and text in names.definitions
        )

    if known(name):
        return name
    if not name.isascii():  # φ̇ and φ′ are φ'
        plain, primes = without_dots(name.replace("′", "'"))
        name = plain + "'" * primes
    for ending in ("'", "_dot"):
        base = name.removesuffix(ending)
        if base != name and known(base):
            return f"{base}'"
    base, bracket, index = name.partition("_dot[")
    return f"{base}[{index}'" if bracket and known(f"{base}[{index}") else None


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
        from lagcli.model.names.unknown import meant_derivative

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


def _report_no_contact(draft: Draft, name: str, key: Scalar, contacts: list[str]) -> None:
    """Report a name that is declared as closed but is not a constraint."""
    names = draft.names
    if names.incomplete or name in names.suspects:
        return
    listed = ", ".join(f"`{c}`" for c in contacts[:_SHOWN])
    draft.report.add(
        "unknown-name",
        f"`initial` says that `{shorten(name)}` is closed, which is not a contact",
        key.location,
        did_you_mean(nearest(name, contacts))
        or (f"the contacts are: {listed}" if contacts else "the model has no contacts: remove it"),
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


def _report_missing(draft: Draft, attempted: Collection[str]) -> None:
    missing = [n for n in _every(draft) if n not in attempted]
    missing = [n for n in missing if family_of(n.rstrip("'")) not in draft.names.broken]
    if not missing:
        return
    entry = draft.root.entries.get("initial")
    missing = list(dict.fromkeys(_whole(draft, n, missing) for n in missing))
    shown = missing[:_SHOWN]
    rest = f" and {len(missing) - _SHOWN} more" if len(missing) > _SHOWN else ""
    draft.report.add(
        "missing-initial",
        "no initial value for " + ", ".join(f"`{n}`" for n in shown) + rest,
        entry[0].location if entry else draft.source.location(0, 0),
        "every coordinate and velocity needs a number, or {guess: …} where the constraints"
        " determine it:\ninitial:\n" + "\n".join(f"  {n}: {_example(draft, n)}" for n in shown),
    )


def _whole(draft: Draft, name: str, missing: Collection[str]) -> str:
    """Return the vector of a component if all of its components are missing."""
    base, dot, part = name.rstrip("'").rpartition(".")
    kind = draft.names.kinds.get(family_of(base)) if dot else None
    primes = name[len(name.rstrip("'")) :]
    parts = KINDS[kind].parts if kind else ()
    every = [f"{base}.{p}{primes}" for p in parts]
    return base + primes if part in parts and set(every) <= set(missing) else name


def _example(draft: Draft, name: str) -> str:
    """Return an example of a value for a coordinate or a vector."""
    kind = draft.names.kinds.get(family_of(name.rstrip("'")))
    if kind is None:
        return "0"
    return "1" if kind == "quaternion" and not name.endswith("'") else "[0, 0, 0]"
