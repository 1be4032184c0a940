"""The initial values: fixed or guessed, one for every coordinate and every velocity."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Any, NamedTuple

from lagcli.columns import unit_quotient
from lagcli.errors import SourceLocation
from lagcli.model.expression.tensors import Tensor
from lagcli.model.expression.tokens import decimal, is_number, without_dots
from lagcli.model.expression.trees import (
    ComponentExpr,
    Name,
    NumberExpr,
    ProductExpr,
    SumExpr,
    Tree,
    VectorExpr,
    walk,
)
from lagcli.model.expression.units import NO_HERTZ, is_frequency, si_notation, to_si
from lagcli.model.keys import INITIAL, keys_of
from lagcli.model.model import Coordinate, InitialValue, Written
from lagcli.model.names.draft import (
    Draft,
    Entry,
    Formula,
    Indices,
    Quantity,
    QuantityValue,
    read_quantity,
)
from lagcli.model.names.expansion import substituted
from lagcli.model.names.families import Declaration, Member, members_of, read_key
from lagcli.model.names.members import family_of, indices_of, members_clause
from lagcli.model.names.namespace import Allowed
from lagcli.model.names.scope import uses
from lagcli.model.sections.coordinates import KINDS, components
from lagcli.model.sections.parameters import override_node, report_ambiguous_unit
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Mapping as MappingNode
from lagcli.model.yaml.source import Scalar, Sequence, YamlNode
from lagcli.prose import counted

Spins = dict[str, tuple[bool, bool, bool]]

_SHOWN = 12  # largest number of missing entries in a message
Values = dict[str, InitialValue]
#: A guess on the command line, written as in a file.
GUESS = r"\s*+\{\s*+(guess)\s*+:\s++([^{}]*+)\}\s*+"
_AXES = ("x", "y", "z")
#: 2 e' = e (0, ω): for each e.k the terms sign·e.i·ω.j.
_RATES = (
    ((-1, 1, 0), (-1, 2, 1), (-1, 3, 2)),
    ((1, 0, 0), (1, 2, 2), (-1, 3, 1)),
    ((1, 0, 1), (1, 3, 0), (-1, 1, 2)),
    ((1, 0, 2), (1, 1, 1), (-1, 2, 0)),
)


class InitialReader:
    """Reads the value of an entry, for each member that the entry covers.

    Parameters
    ----------
    draft : Draft
    declaration : Declaration
        The entry, with its value as node.
    fixed : bool
        Whether the value is fixed unless it is written as a guess.
    quantity : Quantity, optional
        The value, if it has already been read.
    """

    def __init__(
        self,
        draft: Draft,
        declaration: Declaration,
        fixed: bool = True,
        quantity: Quantity | None = None,
    ):
        self.draft, self.declaration = draft, declaration
        self.location = declaration.node.location
        self.what = what = f"the initial value of `{declaration.title}`"
        node, own = unwrapped(draft, declaration.node, what)
        self.fixed, self.quantity = fixed and own, quantity
        if node is not None and quantity is None:
            self.quantity = read_quantity(draft, node, what)
            self._refuse_hertz()
        if self.quantity is not None:
            indices, tree = declaration.indices, self.quantity.parsed.tree
            self.value = QuantityValue(draft, self.quantity, what, indices=indices)
            self.varies = any(uses(tree, index) for index in indices)
        self.same: float | None = None

    def _refuse_hertz(self) -> None:
        """Report a velocity in hertz."""
        unit = self.quantity.unit if self.quantity and self.declaration.primes else None
        if unit is not None and is_frequency(unit):
            message = f"{self.what} is in {unit}"
            self.draft.report.add("units", message, self.location, NO_HERTZ)

    def read(self, name: str, indices: Indices, values: dict[str, InitialValue]) -> None:
        """Evaluate the entry for a coordinate or velocity."""
        if self.quantity is None:
            return
        value = self.same
        if value is None:
            value = self.value.number(indices)
            self.same = None if self.varies else value
        if value is not None:
            quantity = self.quantity
            written = Written(quantity.parsed.tree, quantity.factor, indices)
            values[name] = InitialValue(value, self.fixed, self.location, written, quantity.unit)


def unwrapped(draft: Draft, node: YamlNode, what: str) -> tuple[YamlNode | None, bool]:
    """Return the value of an entry without ``{guess: …}``, and whether it is fixed."""
    if not isinstance(node, MappingNode):
        return node, True
    fields = draft.fields(node, what, keys_of(INITIAL))
    if "guess" not in fields and not node.entries:
        draft.report.add(
            "missing-value", f"{what} is empty", node.location, "write a number, or {guess: 0}"
        )
    return fields.get("guess"), False


def guessed(entry: YamlNode, value: YamlNode) -> YamlNode:
    """Return a value as ``{guess: value}`` if the entry is a guess."""
    assert isinstance(entry, MappingNode)
    key = entry.entries["guess"][0]
    return MappingNode(value.source, value.start, value.end, {"guess": (key, value)})


def guess_or(node: Scalar) -> YamlNode:
    """Return a value from the command line; a guess as the mapping used in files."""
    match = re.fullmatch(GUESS, node.value)
    if match is None:
        return node
    key, guess = (
        Scalar(node.source, (0, match.start(i)), (0, match.end(i)), match[i]) for i in (1, 2)
    )
    return MappingNode(node.source, node.start, node.end, {"guess": (key, guess)})


def _rotation_in(node: Sequence) -> str | None:
    """Return the rotation nearest to a matrix of numbers, as ``quat(…)``."""
    rows = [row.items for row in node.items if isinstance(row, Sequence)]
    if [len(row) for row in rows] != [3, 3, 3]:
        return None
    numbers = [[decimal(x.value) if isinstance(x, Scalar) else None for x in row] for row in rows]
    matrix = [[x for x in row if x is not None] for row in numbers]
    from lagcli.model.expression.rotations import quaternion_text

    return quaternion_text(matrix) if all(len(row) == 3 for row in matrix) else None


class VectorReader:
    """Reads the initial value of a vector or rotation, or its derivative.

    Parameters
    ----------
    draft : Draft
    declaration : Declaration
        The entry of ``initial``, with its value as node.
    kind : str
        One of `KINDS`. The derivative of a quaternion is given by the angular velocity in the body
        frame.
    """

    def __init__(
        self,
        draft: Draft,
        declaration: Declaration,
        kind: str,
    ):
        self.draft, self.declaration = draft, declaration
        self.what = f"the initial value of `{declaration.title}`"
        self.rotates = kind == "quaternion"
        self.turning = self.rotates and bool(declaration.primes)
        self.parts = _AXES if self.turning else KINDS[kind].parts
        self.location = declaration.node.location
        value, self.fixed = unwrapped(draft, declaration.node, self.what)
        self.cells: dict[str, InitialReader] = {}
        self.rates_by_name: dict[str, Values] = {}
        if isinstance(value, Sequence):
            self.listed(value)
        elif value is not None:
            self.written(value)

    def listed(self, node: Sequence) -> None:
        """Read a list of components, each with its unit, fixed or guessed."""
        if len(node.items) != len(self.parts):
            remedy = _rotation_in(node) if self.rotates and not self.turning else None
            self.wrong_shape(node, f"a list of {len(node.items)}", remedy)
            return
        for part, item in zip(self.parts, node.items, strict=True):
            own = self.declaration._replace(node=item, part=f".{part}")
            self.cells[part] = InitialReader(self.draft, own, self.fixed)

    def written(self, node: YamlNode) -> None:
        """Read an expression, such as ``l*[1, 0, 0]`` or ``rot_z(30 deg)``."""
        quantity = read_quantity(self.draft, node, self.what)
        if quantity is None:
            return
        tree = quantity.parsed.tree
        trees = self.parts_of(tree, quantity)
        for part, component in trees.items():
            own = quantity._replace(parsed=quantity.parsed._replace(tree=component))
            declared = self.declaration._replace(part=f".{part}", node=node)
            reader = InitialReader(self.draft, declared, self.fixed, own)
            self.cells[part] = reader

    def parts_of(self, tree: Tree, quantity: Quantity) -> dict[str, Tree]:
        """Return the components of an expression of the right shape."""
        identity = self.rotates and not self.turning
        if quantity.number == identity:  # 0 for a vector, 1 for a rotation
            numbers = [identity, *(0 for _ in self.parts[1:])]
            place = tree.start, tree.end
            return {
                part: NumberExpr(*place, Fraction(x))
                for part, x in zip(self.parts, numbers, strict=True)
            }
        if isinstance(tree, VectorExpr) and len(tree.items) == len(self.parts):
            return dict(zip(self.parts, tree.items, strict=True))
        indices = self.declaration.indices
        formula = Formula(self.draft, quantity.parsed, self.what, Allowed.NUMBERS, indices)
        sized = formula.value(dict.fromkeys(indices, 1))
        if sized is None:
            return {}
        value = sized.value
        wanted = (3, 3) if identity else (len(self.parts), 1)
        if not isinstance(value, Tensor) or value.shape != wanted:
            kind = value.kind if isinstance(value, Tensor) else "a scalar"
            self.wrong_shape(quantity.parsed.node, kind)
            return {}
        return {p: ComponentExpr(tree.start, tree.end, tree, p) for p in self.parts}

    def wrong_shape(self, node: YamlNode, given: str, remedy: str | None = None) -> None:
        """Report a value that is not a vector or rotation of the right size."""
        if self.turning:
            wanted = "the angular velocity in the frame of the body, a vector of 3"
            help_ = f"write `{self.declaration.title}: [0, 0, 2 rad/s]`"
        elif self.rotates:
            wanted = "a rotation, or the four components of a quaternion"
            shown = remedy or "rot_z(30 deg)"
            help_ = f"write `{self.declaration.title}: {shown}`, or `[1, 0, 0, 0]`"
        else:
            wanted = f"a vector of {len(self.parts)}"
            help_ = f"write `{self.declaration.title}: [0, 0, 0]`"
        message = f"{self.what} must be {wanted}, not {given}"
        self.draft.report.add("shape", message, node.location, help_)

    @property
    def fixed_spin(self) -> tuple[bool, bool, bool]:
        """Which components of an angular velocity are fixed."""
        x, y, z = (axis in self.cells and self.cells[axis].fixed for axis in _AXES)
        return x, y, z

    def read(self, canonical: str, indices: Indices, values: Values) -> None:
        """Evaluate one component, ``r.x``, ``e.0`` or ``e.0'``."""
        base, _, part = canonical.rstrip("'").rpartition(".")
        if self.turning:
            rates = self.rates_by_name.get(base)
            if rates is None:
                rates = self.rates_by_name[base] = self.rates(base, indices, values)
            if canonical in rates:
                values[canonical] = rates[canonical]
        elif part in self.cells:
            self.cells[part].read(canonical, indices, values)

    def rates(self, base: str, indices: Indices, values: Values) -> Values:
        """Return the derivatives of a quaternion from the angular velocity."""
        omega: Values = {}
        for axis, cell in self.cells.items():
            cell.read(axis, indices, omega)
        e = [values.get(f"{base}.{k}") for k in KINDS["quaternion"].parts]
        known = [x for x in e if x is not None]
        if len(omega) < len(_AXES) or len(known) < len(e):
            return {}
        w = [omega[axis] for axis in _AXES]
        rates: Values = {}
        for k, terms in enumerate(_RATES):
            value = sum(sign * known[i].value * w[j].value for sign, i, j in terms) / 2
            tree = _half_sum([(sign, known[i], w[j]) for sign, i, j in terms])
            varies = any(isinstance(x, Name) for x in walk(tree))
            written = Written(tree, 1, {}) if varies else None
            fixed = all(x.fixed for x in w)
            unit = "1/s" if varies else None
            rates[f"{base}.{k}'"] = InitialValue(value, fixed, self.location, written, unit)
        return rates


def _half_sum(terms: list[tuple[int, InitialValue, InitialValue]]) -> Tree:
    """Return half the sum of products of initial values, unevaluated."""
    half = NumberExpr(0, 0, Fraction(1, 2))
    products = [
        (sign, ProductExpr(0, 0, ((1, half), (1, _tree(a)), (1, _tree(b))))) for sign, a, b in terms
    ]
    return SumExpr(0, 0, tuple(products))


def _tree(value: InitialValue) -> Tree:
    written = value.written
    if written is None:
        return NumberExpr(0, 0, Fraction(value.value))
    numbers: Mapping[str, Tree] = {
        name: NumberExpr(0, 0, Fraction(k)) for name, k in written.indices.items()
    }
    tree = substituted(written.tree, numbers, (0, 0))
    if written.factor == 1:
        return tree
    return ProductExpr(0, 0, ((1, tree), (1, NumberExpr(0, 0, Fraction(written.factor)))))


Reader = InitialReader | VectorReader


def read_closed(draft: Draft) -> frozenset[str]:
    """Return the contacts that `initial` states to be closed: ``floor: closed``."""
    signs = {c.name: c.sign for c in draft.constraints}
    node = draft.get("initial")
    closed = set()
    for name, key, value in node if isinstance(node, MappingNode) else ():
        if not _states_closed(draft, name, value):
            continue
        if signs.get(name):
            closed.add(name)
        elif name in signs:
            draft.report.add(
                "not-unilateral",
                f"`{name}` cannot be closed: it is not a contact",
                key.location,
                "only a constraint with `>=` or `<=` opens and closes",
            )
        elif name not in draft.names.constraints:
            _report_no_contact(draft, name, key, [c for c in signs if signs[c]])
    return frozenset(closed)


def _states_closed(draft: Draft, name: str, node: YamlNode) -> bool:
    """Whether an entry declares as closed something that is not a coordinate or a velocity."""
    stated = isinstance(node, Scalar) and node.value.strip() == "closed"
    named = name in draft.names.constraints or "[" not in name
    return stated and named and canonical_name(draft, name, vectors=True) is None


def read_initial(
    draft: Draft, overrides: Mapping[str, object]
) -> tuple[Values, Values, Spins, dict[str, object]]:
    """Return the initial coordinates and velocities, by coordinate, and which ω are fixed.

    The last result is the overrides. Numbers from Python are in SI, and have the SI unit there if
    the file's value has another unit.
    """
    names = draft.names
    entries = draft.entries("initial")
    given = _overriding(draft, overrides)
    own = _entered(draft, entries or [])
    jobs = dict(own)
    overrides = dict(overrides)
    for canonical, option in given.items():
        node = override_node("--set-initial", option, overrides[option])
        unit = _units(own.get(canonical), canonical).get("")
        if unit is not None and not isinstance(overrides[option], str) and is_number(node.value):
            overrides[option] = f"{node.value} {si_notation(unit)}"
            node = override_node("--set-initial", option, overrides[option])
        declaration = _named(draft, canonical, node, guess_or(node))
        for member, reader in _values(draft, declaration):
            name = member.name + "'" * member.declaration.primes
            if not member.declaration.part or name not in given:
                if isinstance(reader, InitialReader):  # numbers in vectors are in SI
                    _check_unit(draft, name, reader, own.get(name), option)
                jobs[name] = (reader, member.indices)
    values = _read(jobs)
    if entries is not None and not names.incomplete and "initial" not in draft.misspelled_keys:
        _report_missing(draft, jobs.keys())
    positions = {q: values[q] for q in names.coordinates if q in values}
    velocities = {q: values[f"{q}'"] for q in names.coordinates if f"{q}'" in values}
    return positions, velocities, _spins(jobs), overrides


def given_values(draft: Draft) -> Values:
    """Return the values that `initial` gives, by coordinate and velocity."""
    return _read(dict(_entered(draft, draft.entries("initial") or [])))


def _check_unit(
    draft: Draft,
    name: str,
    reader: Reader,
    own: tuple[Reader, Indices] | None,
    option: str | None = None,
) -> None:
    """Report a number without a unit in place of one with a unit other than SI.

    Parameters
    ----------
    draft : Draft
    name : str
        Coordinate or velocity.
    reader : Reader
        Of the value that replaces the file's.
    own : (Reader, indices) or None
        Of the file's.
    option : str, optional
        Name of the quantity in ``--set-initial``, which gives the value.
    """
    units = _units(own, name)
    for part, quantity in _quantities(reader, name).items():
        unit = units.get(part)
        if quantity.unit is None and quantity.number and unit is not None:
            node = quantity.parsed.node
            written = f"`{node.value.strip()} {unit}`"
            if option is not None:
                value = f"{node.value.strip()} {unit}"
                value = value if reader.fixed else f"{{guess: {value}}}"
                written = f'--set-initial "{option}={value}"'
            report_ambiguous_unit(draft, name, unit, node, written)


def _units(job: tuple[Reader, Indices] | None, name: str) -> dict[str, str]:
    """Return the units other than SI in which a coordinate or velocity is given, by part."""
    quantities = {} if job is None else _quantities(job[0], name)
    units = {part: x.unit for part, x in quantities.items()}
    return {part: unit for part, unit in units.items() if unit and to_si(unit) != 1}


def _quantities(reader: Reader, name: str) -> dict[str, Quantity]:
    """Return what is read for a coordinate or velocity: all axes of an angular velocity."""
    if isinstance(reader, InitialReader):
        cells = {"": reader}
    elif reader.turning:
        cells = reader.cells
    else:
        part = name.rstrip("'").rpartition(".")[2]
        cells = {"": reader.cells[part]} if part in reader.cells else {}
    return {part: cell.quantity for part, cell in cells.items() if cell.quantity}


Jobs = dict[str, tuple[Reader, Indices]]


def _entered(draft: Draft, entries: Iterable[Entry]) -> Jobs:
    """Return the readers of the values of entries, by coordinate and velocity."""
    attempted: dict[str, Member] = {}
    readers: dict[int, Reader] = {}
    for name, key, node in entries:
        if _states_closed(draft, name, node):
            continue
        declaration = _declaration(draft, name, key, node)
        for member, reader in _values(draft, declaration) if declaration else ():
            readers[id(member.declaration)] = reader
            if not _enter(draft, attempted, member):
                break
    return {
        canonical: (readers[id(member.declaration)], member.indices)
        for canonical, member in attempted.items()
    }


def _read(jobs: Jobs) -> Values:
    """Evaluate values; velocities last, because rates of quaternions need their orientations."""
    values: Values = {}
    for canonical in sorted(jobs, key=lambda name: name.endswith("'")):
        reader, indices = jobs[canonical]
        reader.read(canonical, indices, values)
    return values


class ChangedValues(NamedTuple):
    """Initial values of a model with other entries in place of its own.

    Parameters
    ----------
    texts : dict of str to str
        The other entries in the syntax of ``--set-initial``.
    fields : dict
        The fields of the model, with all values.
    """

    texts: dict[str, str]
    fields: dict[str, Any]


def changed_values(draft: Draft, entries: Iterable[Entry], what: str) -> ChangedValues:
    """Read entries of initial values in place of those of the file.

    Parameters
    ----------
    draft : Draft
    entries : iterable of Entry
    what : str
        What has them, for messages.
    """
    entries = list(entries)
    for name, key, node in entries:
        if _states_closed(draft, name, node):
            draft.report.add(
                "bad-setting",
                f"{what} has values; `{name}: closed` is none",
                key.location,
                "write it under `initial` of the model",
            )
    own = _entered(draft, entries)
    of_file = _entered(draft, draft.entries("initial") or [])
    jobs = {**of_file, **own}
    values = _read(jobs)
    texts: dict[str, str] = {}
    for canonical, (reader, _) in own.items():
        if canonical in values:
            _check_unit(draft, canonical, reader, of_file.get(canonical))
            of_same = _units(of_file.get(canonical), canonical)
            texts.update(_as_option(draft, canonical, reader, values, what, of_same))
    fields = {
        "initial_positions": {q: values[q] for q in draft.names.coordinates if q in values},
        "initial_velocities": {
            q: values[f"{q}'"] for q in draft.names.coordinates if f"{q}'" in values
        },
        "spins": _spins(jobs),
    }
    return ChangedValues(texts, fields)


def _as_option(
    draft: Draft,
    canonical: str,
    reader: Reader,
    values: Values,
    what: str,
    units: Mapping[str, str],
) -> dict[str, str]:
    """Return the value of an entry as an option has it: as written, if it is one text.

    ``units`` are those of the file's own value, if they are not SI: see `_units`.
    """
    declaration = reader.declaration
    node, fixed = declaration.node, True
    if isinstance(node, MappingNode):
        node, fixed = node.entries["guess"][1], False
    name = canonical
    if isinstance(reader, VectorReader) and (reader.turning or isinstance(node, Scalar)):
        base, _, _ = canonical.rstrip("'").rpartition(".")
        name = base + "'" * declaration.primes
    if isinstance(node, Scalar) and not declaration.indices:
        text = node.value.strip()
    elif isinstance(reader, VectorReader) and reader.turning:
        spin: Values = {}
        for axis, cell in reader.cells.items():
            cell.read(axis, {}, spin)
        if len({x.fixed for x in spin.values()}) > 1:
            draft.report.add(
                "bad-setting",
                f"{what}: some components of `{declaration.title}` are fixed, and some are guesses",
                declaration.node.location,
                "fix the angular velocity, or write all of it as a guess",
            )
        text = f"[{', '.join(_written(x) for x in spin.values())}]"
        fixed = fixed and all(x.fixed for x in spin.values())
    else:
        value = values[canonical]
        text, fixed = _written(value), value.fixed
        if unit := units.get(""):
            text += f" {si_notation(unit)}"
    return {name: text if fixed else f"{{guess: {text}}}"}


def _written(value: InitialValue) -> str:
    """Return a value in SI as text with all its digits."""
    return repr(value.value).removesuffix(".0")


def _spins(jobs: Mapping[str, tuple[Reader, Indices]]) -> Spins:
    """Return by quaternion which components of its angular velocity are fixed."""
    spins: Spins = {}
    readers = {name: reader for name, (reader, _) in jobs.items()}
    for name, reader in readers.items():
        base, _, part = name.removesuffix("'").rpartition(".")
        turning = getattr(reader, "turning", False)
        parts = [f"{base}.{k}'" for k in KINDS["quaternion"].parts]
        if turning and part == "0" and all(readers.get(x) is reader for x in parts):
            spins[base] = reader.fixed_spin  # type: ignore[union-attr]
    return spins


def _values(draft: Draft, declaration: Declaration) -> Iterator[tuple[Member, Reader]]:
    """Yield the targets of an entry, and the readers of their values."""
    members = members_of(draft, declaration)
    kind = draft.names.kinds.get(declaration.family)
    value, fixed = declaration.node, True
    if isinstance(value, MappingNode) and "guess" in value.entries:
        value, fixed = value.entries["guess"][1], False
    rotation = kind == "quaternion" and not declaration.primes
    split = isinstance(value, Sequence) and (
        kind is None or rotation or any(isinstance(item, Sequence) for item in value.items)
    )
    if not (split and declaration.several):
        yield from _readers(draft, declaration, members, kind)
        return
    assert isinstance(value, Sequence)
    if len(value.items) != len(members):
        draft.report.add(
            "wrong-length",
            f"`{declaration.title}` has {counted(len(members), 'member')}, but its list has"
            f" {counted(len(value.items), 'value')}",
            value.location,
            "give one value for each member, or one for all of them",
        )
        members = members[: len(value.items)]
    for member, item in zip(members, value.items, strict=False):
        own = declaration._replace(node=item if fixed else guessed(declaration.node, item))
        yield from _readers(draft, own, [member._replace(declaration=own)], kind)


def _readers(
    draft: Draft,
    declaration: Declaration,
    members: Iterable[Member],
    kind: str | None,
) -> Iterator[tuple[Member, Reader]]:
    """Yield members, each component of a vector separately, with the reader of their value."""
    if kind is None:
        reader: Reader = InitialReader(draft, declaration)
        yield from ((member, reader) for member in members)
        return
    reader = VectorReader(draft, declaration, kind)
    parts = [part._replace(kind=kind) for part in components(declaration, kind)]
    for member in members:
        for d in parts:
            part = d.part.rpartition(".")[2]
            yield Member(f"{member.name}.{part}", d, member.indices), reader


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
    primed = len(canonical.rstrip("'")) < len(canonical)
    if "[" not in base or family_of(base) not in draft.names.kinds:
        return Declaration(base, key, node, primes=primed)
    spans = tuple((None, NumberExpr(0, 0, Fraction(k))) for k in indices_of(base))
    stem, part = base.partition("[")[0], base.rpartition("]")[2]
    return Declaration(stem, key, node, spans, primed, part)


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

    name = names.unaliased(name)
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


def stated_unit(name: str, value: InitialValue, coordinates: Iterable[Coordinate]) -> str | None:
    """Return the unit of an initial value, or else that of its coordinate; None without both."""
    if value.unit is not None:
        return value.unit
    base = name.removesuffix("'")
    unit = next((c.unit for c in coordinates if c.name == base), None)
    return unit if unit is None or base == name else unit_quotient(unit, "s")


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
    base = name.removesuffix("'").removesuffix("_dot")
    if base in names.definitions:
        help_ = f"`{base}` is a definition: give the coordinates that it depends on" + (
            f";\nif it is that of a joint, `{base}` in `initial` of the file makes it a coordinate"
            if names.placing is not None
            else ""
        )
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
    entries = _entries(draft, missing)
    names = [name for name, _ in entries]
    shown = entries[:_SHOWN]
    rest = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    draft.report.add(
        "missing-initial",
        "no initial value for " + ", ".join(f"`{n}`" for n in names[:_SHOWN]) + rest,
        entry[0].location if entry else draft.source.location(0, 0),
        "every coordinate and velocity needs a number, or {guess: …} where the constraints"
        " determine it:\ninitial:\n" + "\n".join(f"  {example}" for _, example in shown),
    )


_MEMBER = r"(.+)\[(\d+)\](['.\w]*)"


def _entries(draft: Draft, missing: list[str]) -> list[tuple[str, str]]:
    """Return missing names and entries that give them a value, one for consecutive members.

    x[1]', …, x[20]' are ``x[1..20]'``, given by ``x[i = 1..N]': 0`` if they are declared with N.
    """
    runs: list[tuple[str, str, int, int]] = []  # before and after the index, first and last
    places: dict[tuple[str, str], int] = {}
    for name in missing:
        match = re.fullmatch(_MEMBER, name)
        before, after = (match[1], match[3]) if match else (name, "")
        index = int(match[2]) if match else -1
        place = places.get((before, after), -1)
        if match and place >= 0 and runs[place][3] == index - 1:
            runs[place] = (before, after, runs[place][2], index)
        else:
            places[before, after] = len(runs)
            runs.append((before, after, index, index))
    letter = next(x for x in ("i", "j", "k", "n", "index") if x not in draft.names.lines)
    entries: list[tuple[str, str]] = []
    for before, after, first, last in runs:
        if last - first < 2:
            single = [f"{before}[{k}]{after}" for k in range(first, last + 1)]
            names = single if first >= 0 else [before]
            entries += [(x, f"{x}: {_example(draft, x)}") for x in names]
            continue
        span = rf"(?<!\w){re.escape(before)}\[\s*{first}\s*\.\.\s*([A-Za-z]\w*)\s*\]"
        declared = re.search(span, draft.source.text)
        members = sum(family_of(x) == f"{before}[]" for x in draft.names.coordinates)
        end = declared[1] if declared and members == last - first + 1 else str(last)
        value = _example(draft, f"{before}[{first}]{after}")
        key = f"{before}[{letter} = {first}..{end}]{after}"
        entries.append((f"{before}[{first}..{last}]{after}", f"{key}: {value}"))
    return entries


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
