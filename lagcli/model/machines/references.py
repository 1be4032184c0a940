"""References to bodies, points and joints, and calls such as ``revolute(crank.b, rod.a)``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from lagcli.model.expression.units import WITH_UNIT
from lagcli.model.yaml.source import Derived, Scalar, YamlNode
from lagcli.model.yaml.source import Mapping as MappingNode
from lagcli.model.yaml.source import Sequence as SequenceNode

_NAME = r"[^\W\d]\w*"
_REFERENCE = re.compile(rf"\s*({_NAME})\s*(\[[^\]]*\])?\s*(?:\.\s*({_NAME}))?\s*")
_CALL = re.compile(rf"\s*({_NAME})\s*\((.*)\)\s*", re.DOTALL)
_KEYWORD = re.compile(rf"\s*({_NAME})\s*=(?!=)\s*")
_KEY = re.compile(rf"\s*({_NAME})\s*(?:\[\s*(?:({_NAME})\s*=)?([^\]]*)\])?\s*")


@dataclass(frozen=True)
class Reference:
    """A body or a joint, and a point of a body: ``link[i-1].b``.

    Parameters
    ----------
    base, index : str
        Name, and the index with its brackets.
    point : str
        Empty for the center of mass.
    node : Scalar
    """

    base: str
    index: str
    point: str
    node: Scalar

    @property
    def name(self) -> str:
        """The body or joint, with its index."""
        return self.base + self.index


@dataclass(frozen=True)
class Key:
    """The name that an entry declares: ``crank``, ``link[1..N]``, ``J[i = 2..N]``.

    Parameters
    ----------
    base : str
    index : str
        Name of the index of a family; empty for a single name or member.
    span : str
        The range of a family, or the index of one member; empty for a single name.
    node : Scalar
    """

    base: str
    index: str
    span: str
    node: Scalar

    @property
    def name(self) -> str:
        """The name in expressions: ``crank``, ``link[i]``."""
        inside = self.index or self.span
        return f"{self.base}[{inside}]" if inside else self.base

    @property
    def declared(self) -> str:
        """The name in keys: ``crank``, ``link[i = 1..N]``."""
        if not self.index:
            return self.name
        return f"{self.base}[{self.index} = {self.span}]"


class JointCall(NamedTuple):
    """A joint or force as it is written: its kind, what it connects, and its keys."""

    kind: str
    kind_node: Scalar
    arguments: tuple[Scalar, ...]
    keys: Mapping[str, tuple[Scalar, YamlNode]]


def read_key(node: Scalar, free_index: str) -> Key | None:
    """Return the name that a key declares; None if it is none."""
    match = _KEY.fullmatch(node.value)
    if match is None:
        return None
    base, index, span = match[1], match[2] or "", (match[3] or "").strip()
    if ".." in span and not index:
        index = free_index
    return Key(base, index, span, node)


def read_reference(node: Scalar) -> Reference | None:
    """Return the body or joint that a text names; None if it names none."""
    match = _REFERENCE.fullmatch(node.value)
    if match is None:
        return None
    index = re.sub(r"\s+", "", match[2] or "")
    return Reference(match[1], index, match[3] or "", node)


def excerpt(node: Scalar, start: int, end: int) -> Scalar:
    """Return a part of a scalar, without blanks around it, as a scalar at its place."""
    text = node.value[start:end]
    start += len(text) - len(text.lstrip())
    text = text.strip()
    return Derived(text, node.span(start, start + max(1, len(text))), node, ((0, node, start),))


def pieces(node: Scalar, start: int, end: int) -> list[Scalar]:
    """Return the parts of ``node.value[start:end]`` between commas outside of brackets."""
    parts, depth, first = [], 0, start
    for at in range(start, end):
        char = node.value[at]
        depth += (char in "([{") - (char in ")]}")
        if char == "," and depth == 0:
            parts.append(excerpt(node, first, at))
            first = at + 1
    if node.value[first:end].strip() or parts:
        parts.append(excerpt(node, first, end))
    return parts


def items_of(node: YamlNode) -> list[YamlNode] | None:
    """Return the entries of a list, ``[a, b]``, in YAML or in the text of a call."""
    if isinstance(node, SequenceNode):
        return node.items
    if isinstance(node, Scalar) and re.fullmatch(r"\s*\[.*\]\s*", node.value, re.DOTALL):
        start, end = node.value.index("[") + 1, node.value.rindex("]")
        return list(pieces(node, start, end))
    return None


def read_call(node: YamlNode, kinds: Mapping[str, object]) -> JointCall | str:
    """Return a call, from the text ``kind(A, B, key=value)`` or ``{kind: [A, B], key: value}``.

    A message says what is wrong with any other node.
    """
    if isinstance(node, MappingNode):
        named = [name for name in node.entries if name in kinds]
        if len(named) != 1:
            return "names no kind" if not named else f"has the kinds {' and '.join(named)}"
        kind_node, value = node.entries[named[0]]
        given = items_of(value)
        if given is None and isinstance(value, Scalar):
            given = [value]
        arguments = tuple(x for x in given or [] if isinstance(x, Scalar))
        if len(arguments) != len(given or [""]):
            return "needs a list of names"
        keys = {name: (key, x) for name, key, x in node if name != named[0]}
        return JointCall(named[0], kind_node, arguments, keys)
    if not isinstance(node, Scalar):
        return f"is {node.what}"
    match = _CALL.fullmatch(node.value)
    if match is None:
        return "is no call"
    positional: list[Scalar] = []
    keywords: dict[str, tuple[Scalar, YamlNode]] = {}
    for part in pieces(node, match.start(2), match.end(2)):
        keyword = _KEYWORD.match(part.value)
        if keyword is None:
            positional.append(part)
        elif keyword[1] in keywords:
            return f"gives `{keyword[1]}` twice"
        else:
            name = excerpt(part, *keyword.span(1))
            keywords[keyword[1]] = (name, excerpt(part, keyword.end(), len(part.value)))
    return JointCall(match[1], excerpt(node, *match.span(1)), tuple(positional), keywords)


def is_quantity(text: str) -> bool:
    """Whether a text is a number, or a number with a unit."""
    return WITH_UNIT.fullmatch(text.strip()) is not None or _number(text) is not None


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def is_zero(node: YamlNode) -> bool:
    """Whether a node is the number 0."""
    return isinstance(node, Scalar) and _number(node.value) == 0
