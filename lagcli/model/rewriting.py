"""Replacement of values in the text of a model file; everything else is preserved."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping

from lagcli.errors import Diagnostic, ModelError, SourceLocation
from lagcli.model.expression.tokens import is_number
from lagcli.model.expression.units import to_si
from lagcli.model.loader import load_text
from lagcli.model.model import InitialValue, Model, Parameter
from lagcli.model.names.draft import unit_of
from lagcli.model.names.members import family_of
from lagcli.model.sections.initial import GUESS
from lagcli.model.yaml.composing import compose
from lagcli.model.yaml.source import Derived, Position, Scalar, Sequence, Source, YamlNode
from lagcli.model.yaml.source import Mapping as MappingNode

#: Text that needs no quotes in YAML.
_PLAIN = re.compile(r"[-+]?[\w.(][\w.+*/^()' °µ-]*")
#: Relative tolerance for the rounding of unit conversions.
_ROUNDING = 4e-16


def rewrite(
    text: str,
    path: str,
    set: Mapping[str, str],
    set_initial: Mapping[str, str],
    t_end: float | None = None,
) -> str:
    """Return the text of a model file with new values.

    A value replaces that of the file. If an entry declares several members of a family, the value
    of one member is written as a separate entry after it. Comments and layout are preserved.

    Parameters
    ----------
    text, path : str
        The model file and its name.
    set, set_initial : mapping of str to str
        As for `load`.
    t_end : float, optional
        End time of the simulation, s.

    Returns
    -------
    str
        Text that loads with the same values as ``load(path, set, set_initial)``.

    Raises
    ------
    ModelError
        The file or a value is invalid, or a value cannot be replaced because it is an alias.
    """
    text = text.removeprefix("\ufeff")
    requested = load_text(text, path, set, set_initial)
    before = load_text(text, path)
    source = Source(text, path)
    writer = _Rewriter(source, compose(source)[0])
    for block, overrides, old, new in (
        ("parameters", set, before.parameters, requested.parameters),
        ("initial", set_initial, before.initial, requested.initial),
    ):
        locations = _locations(old, new)
        shared = Counter(locations.values())
        for name, value in _canonical_names(before, overrides).items():
            if name not in new:
                writer.write_vector(block, name, value)
                continue
            location = locations.get(name) or _relative(locations, name)
            alone = name in locations and shared[location] == 1
            if not alone and "[" not in name and "." not in name:
                raise _not_written([name])
            writer.write(block, name, value, new[name].value, location, in_place=alone)
    if t_end is not None:
        writer.write_entry("simulation", "t_end", repr(t_end).removesuffix(".0"))
    result = writer.text()
    _check(result, requested, t_end)
    return result


def with_releases(text: str, path: str, releases: Mapping[str, float]) -> str:
    """Return the text of a model file with an event for each constraint that is released.

    Parameters
    ----------
    text, path : str
        The model file and its name.
    releases : mapping of str to float
        Times by the names of constraints, s.

    Raises
    ------
    ModelError
        The file is not a mapping in YAML. The names of constraints are checked when the result is
        loaded.
    """
    for constraint, time in releases.items():
        source = Source(text, path)
        root = compose(source)[0]
        events = root.entries["events"][1] if "events" in root.entries else None
        taken = events.entries if isinstance(events, MappingNode) else {}
        name = "cut_" + re.sub(r"\W+", "_", constraint).strip("_")
        while name in taken:
            name += "_"
        writer = _Rewriter(source, root)
        event = f"{{when: t >= {time!r}, release: {_quoted(constraint)}}}"
        writer.write_entry("events", name, event)
        text = writer.text()
    return text


_Values = Mapping[str, Parameter] | Mapping[str, InitialValue]


def _locations(before: _Values, requested: _Values) -> dict[str, SourceLocation]:
    """Return the locations of values in the file, also for other numbers of family members.

    A value set by an option has line 0.
    """
    both: dict[str, Parameter | InitialValue] = {**requested, **before}
    return {n: x.location for n, x in both.items() if x.location is not None and x.location.line}


def _canonical_names(model: Model, overrides: Mapping[str, str]) -> dict[str, str]:
    """Return values by the names that the model uses: ``x_dot`` becomes ``x'``."""
    names = {}
    for name, value in overrides.items():
        plain = model.names.unaliased("".join(name.split()))
        if plain not in model.parameters and (match := re.fullmatch(r"(.+)_dot(\[.*\])?", plain)):
            plain = f"{match[1]}{match[2] or ''}'"
        names[plain] = value
    return names


def _relative(locations: Mapping[str, SourceLocation], name: str) -> SourceLocation:
    """Return the location of another member of the family, for one beyond the file's own N."""
    same = (p for n, p in locations.items() if _family(n) == _family(name))
    location = next(same, None)
    if location is None:
        raise _not_written([name])
    return location


def _family(name: str) -> tuple[str, bool]:
    return family_of(name.rstrip("'")), name.endswith("'")


class _Rewriter:
    """Collects and applies replacements in a text."""

    def __init__(self, source: Source, root: MappingNode):
        self.source, self.root = source, root
        self.changes: list[tuple[int, int, str]] = []
        self.added: dict[str, list[str]] = {}
        self.lines = _line_starts(source)

    def text(self) -> str:
        """Return the text with all changes applied."""
        text = self.source.text
        for start, end, new in sorted(self.changes, key=lambda c: c[:2])[::-1]:
            text = text[:start] + new + text[end:]
        for block, entries in self.added.items():
            newline = "" if text.endswith("\n") else "\n"
            text += f"{newline}{block}: {{{', '.join(entries)}}}\n"
        return text

    def offset(self, position: Position) -> int:
        return (
            self.lines[position[0]] + position[1]
            if position[0] < len(self.lines)
            else len(self.source.text)
        )

    def write(
        self,
        block: str,
        name: str,
        value_text: str,
        value: float,
        location: SourceLocation,
        in_place: bool,
    ) -> None:
        """Replace a value, or insert an entry after one that declares several members."""
        mapping = self.root.entries[block][1] if block in self.root.entries else None
        found = [
            (key, entry, node, within)
            for _, key, entry in (mapping if isinstance(mapping, MappingNode) else ())
            for node, within in _values(entry)
            if node.location == location
        ]
        if not found:
            self.write_in_machine(block, name, value_text, location, in_place)
            return
        assert isinstance(mapping, MappingNode)
        key, entry, node, within = found[0]
        value_text = _with_unit(value_text, node)
        if not in_place or within:
            self.insert(mapping, key, entry, f"{name}: {_quoted(value_text)}")
            return
        if isinstance(entry, MappingNode) and isinstance(node, Scalar) and "unit" in entry.entries:
            # the unit is a separate field
            unit = entry.entries["unit"][1]
            value_text = _without(value_text, unit, value)
        self.replace(node, _quoted(value_text))

    def write_in_machine(
        self, block: str, name: str, value_text: str, location: SourceLocation, in_place: bool
    ) -> None:
        """Replace a value in a body, joint or force; add one that follows from others."""
        if block == "initial":  # of a body that its joints place
            self.write_entry(block, name, _quoted(value_text))
            return
        for key, holder, node in _nodes_of_machine(self.root):
            place = node.location
            if place == location and node is key:  # as of the inertia of a rod
                field = name.rpartition(".")[2]
                if not isinstance(holder, MappingNode) or not holder.entries:
                    raise _not_written([name])
                last_key, last = list(holder.entries.values())[-1]
                self.insert(holder, last_key, last, f"{field}: {_quoted(value_text)}")
                return
            if not in_place or node is key:
                continue
            if place == location:
                self.replace(node, _quoted(_with_unit(value_text, node)))
                return
            if isinstance(node, Scalar) and _within(location, place):  # an argument of a call
                start = self.offset((location.line - 1, location.column - 1))
                end = start + location.length
                part = Derived(self.source.text[start:end], location, node)
                self.changes.append((start, end, _with_unit(value_text, part)))
                return
        raise _not_written([name])

    def write_vector(self, block: str, name: str, value_text: str) -> None:
        """Replace the value of a vector or rotation that has its own entry."""
        mapping = self.root.entries[block][1]
        if not isinstance(mapping, MappingNode) or name not in mapping.entries:
            raise _not_written([name])
        self.replace(mapping.entries[name][1], _quoted(value_text))

    def write_entry(self, block: str, name: str, value_text: str) -> None:
        """Write an entry of a block; add the block if it is missing."""
        node = self.root.entries[block][1] if block in self.root.entries else None
        if isinstance(node, MappingNode) and name in node.entries:
            self.replace(node.entries[name][1], value_text)
        elif isinstance(node, MappingNode) and node.entries:
            key, last = list(node.entries.values())[-1]
            self.insert(node, key, last, f"{name}: {value_text}")
        elif node is None:
            self.added.setdefault(block, []).append(f"{name}: {value_text}")
        else:
            self.replace(node, f"{{{name}: {value_text}}}")

    def replace(self, node: YamlNode, new: str) -> None:
        start = self.offset(node.start)
        before = self.source.text[start - 1 : start]
        space = "" if before.isspace() or before in ("[", "{") else " "
        self.changes.append((start, self.end(node), space + new))

    def insert(self, mapping: MappingNode, key: Scalar, entry: YamlNode, new: str) -> None:
        """Insert an entry after another one."""
        end = self.end(entry)
        if self.source.text[self.offset(mapping.start)] == "{":
            self.changes.append((end, end, f", {new}"))
            return
        stop = re.compile("$", re.MULTILINE).search(self.source.text, end)
        assert stop is not None
        self.changes.append((stop.start(), stop.start(), f"\n{' ' * key.start[1]}{new}"))

    def end(self, node: YamlNode) -> int:
        """Return the end offset of a node's text, before blanks and comments."""
        flow = self.source.text[self.offset(node.start) :][:1] in ("{", "[")
        if isinstance(node, MappingNode) and not flow:
            return self.end(list(node.entries.values())[-1][1])
        if isinstance(node, Sequence) and not flow:
            return self.end(node.items[-1])
        start, end = self.offset(node.start), self.offset(node.end)
        return start + len(self.source.text[start:end].rstrip())


def _line_starts(source: Source) -> list[int]:
    """Return the offset of each line of the text."""
    starts, at = [], 0
    for line in source.lines:
        starts.append(at)
        at += len(line)
        at += 2 if source.text[at : at + 2] == "\r\n" else 1
    return starts


def _values(entry: YamlNode) -> Iterator[tuple[YamlNode, bool]]:
    """Yield the nodes that may hold a value of an entry, and whether they are part of a guess."""
    if isinstance(entry, MappingNode):
        yield from ((entry.entries[f][1], False) for f in ("value",) if f in entry.entries)
    yield entry, False
    stack = [(entry, False)]
    while stack:
        node, within = stack.pop()
        if isinstance(node, MappingNode) and "guess" in node.entries:
            stack.append((node.entries["guess"][1], True))
        elif isinstance(node, Sequence):
            stack += [(item, within) for item in node.items]
        if node is not entry:
            yield node, within


def _nodes_of_machine(root: MappingNode) -> Iterator[tuple[Scalar, YamlNode, YamlNode]]:
    """Yield the nodes of bodies, joints, forces and gravity, each with the key and value around.

    The key is first among them.
    """
    for block in ("gravity", "bodies", "joints", "forces"):
        if block not in root.entries:
            continue
        block_key, block_node = root.entries[block]
        entries = (
            block_node.entries.values()
            if isinstance(block_node, MappingNode)
            else [(block_key, block_node)]
        )
        for key, value in entries:
            yield key, value, key
            stack = [value]
            while stack:
                node = stack.pop()
                yield key, value, node
                if isinstance(node, MappingNode):
                    stack += [x for _, x in node.entries.values()]
                elif isinstance(node, Sequence):
                    stack += node.items


def _within(location: SourceLocation, place: SourceLocation) -> bool:
    """Whether a span is part of another on one line."""
    first, last = place.column, place.column + place.length
    return (
        location.line == place.line
        and first <= location.column
        and location.column + location.length <= last
    )


def _quoted(text: str) -> str:
    """Return a value quoted for YAML if necessary."""
    if match := re.fullmatch(GUESS, text):
        return f"{{guess: {_quoted(match[2])}}}"
    if _PLAIN.fullmatch(text):
        return text
    return "'" + text.replace("'", "''") + "'"


def _with_unit(value_text: str, node: YamlNode) -> str:
    """Return a bare number with the unit of the file's value, if that is an SI unit."""
    if isinstance(node, MappingNode) and "guess" in node.entries:
        node = node.entries["guess"][1]
    unit = unit_of(node)
    match = re.fullmatch(GUESS, value_text)
    if match is not None:
        return f"{{guess: {_with_unit(match[2].strip(), node)}}}"
    if unit is None or to_si(unit) != 1 or not is_number(value_text):
        return value_text
    return f"{value_text} {unit}"


def _without(value_text: str, unit: YamlNode, value: float) -> str:
    """Return a value without its unit, which is a separate field of the entry."""
    assert isinstance(unit, Scalar)
    bare = value_text.strip().removesuffix(unit.value.strip()).strip()
    return bare if is_number(bare) else repr(value / float(to_si(unit.value)))


def _check(text: str, requested: Model, t_end: float | None) -> None:
    """Raise ModelError unless the text has the requested values."""
    try:
        loaded = load_text(text, requested.path)
    except ModelError:
        raise _not_written([*requested.set, *requested.set_initial]) from None
    wrong = [n for n, p in requested.parameters.items() if not _same(loaded.parameters.get(n), p)]
    for name, x in requested.initial.items():
        other = loaded.initial.get(name)
        if other is None or other.fixed != x.fixed or not _same(other, x):
            wrong.append(name)
    if t_end is not None and loaded.settings.t_end != t_end:
        wrong.append("t_end")
    if wrong:
        raise _not_written(wrong)


def _same(one: Parameter | InitialValue | None, other: Parameter | InitialValue) -> bool:
    value = math.nan if one is None else one.value
    return math.isclose(value, other.value, rel_tol=_ROUNDING, abs_tol=0.0)


def _not_written(names: list[str]) -> ModelError:
    listed = ", ".join(f"`{n}`" for n in names[:5])
    return ModelError(
        [
            Diagnostic(
                "not-written",
                f"cannot write the values of {listed} into the file",
                None,
                "an alias or a text shared by several values is used there; edit the file by hand",
            )
        ]
    )
