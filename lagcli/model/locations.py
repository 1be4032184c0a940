"""Source locations of the expressions of a model."""

from __future__ import annotations

import re
from collections.abc import Iterable

from lagcli.errors import SourceLocation
from lagcli.model.expression.trees import Tree
from lagcli.model.model import Model
from lagcli.model.spelling import shorten
from lagcli.model.yaml.composing import compose
from lagcli.model.yaml.source import Mapping, Scalar, Sequence, Source, YamlNode

#: A field of an entry: ``floor.slip``, ``floor.friction.static``, ``kick.set.x'``.
_FIELD = re.compile(
    r"(.+?)\.((?:restitution|friction|slip|limit|when|every|offset|set|impulse)(?:\..+)?)"
)


class ExpressionLocations:
    """Source locations of a model's entries, computed from its text.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        self._root, _ = compose(Source(model.text, model.path))

    def entry(self, block: str, name: str | None = None) -> YamlNode | None:
        """Return the YAML node of the expression of a key, or of an entry in a block.

        Parameters
        ----------
        block : str
            ``T``, ``definitions``, …
        name : str, optional
            Name of the entry, or of a field of it, as in ``floor.slip``, ``times.2``. A member of
            a family belongs to the family's entry unless it has its own.
        """
        item = self._root.entries.get(block)
        node = item[1] if item else None
        if block == "simulation" and name is not None:
            return self.inside(block, *name.split(".", 1))
        if name is not None and isinstance(node, Mapping):
            family = name.partition("[")[0]
            field = _FIELD.fullmatch(name)
            entry = field[1] if field else name
            keys = [k for k in (entry, entry.rpartition(".")[0]) if k in node.entries]
            keys += [k for k in node.entries if k.startswith(f"{family}[") and "[" in name]
            node = node.entries[keys[0]][1] if keys else None
            for key in field[2].split(".") if field else ():
                inside = node.entries.get(key) if isinstance(node, Mapping) else None
                node = inside[1] if inside else node
        if isinstance(node, Mapping) and "expr" in node.entries:
            node = node.entries["expr"][1]
        return node

    def inside(self, *keys: str) -> YamlNode:
        """Return the node at a path of keys and of places in lists, or the last one that exists."""
        node: YamlNode = self._root
        for key in keys:
            if isinstance(node, Sequence) and key.isdigit():
                node = node.items[int(key)]
                continue
            if not isinstance(node, Mapping) or key not in node.entries:
                break
            node = node.entries[key][1]
        return node

    def at(self, block: str, place: SourceLocation) -> YamlNode | None:
        """Return the node of a value in a block; None if there is none."""
        entry = self._root.entries.get(block)
        stack = [entry[1]] if entry else []
        while stack:
            node = stack.pop()
            if node.location == place:
                return node
            if isinstance(node, Mapping):
                stack.extend(value for _, _, value in node)
            elif isinstance(node, Sequence):
                stack.extend(node.items)
        return None

    def location(self, node: YamlNode | None, tree: Tree | None = None) -> SourceLocation | None:
        """Return the location of an entry, or of a subexpression."""
        if node is None:
            return None
        if tree is None or not (scalar := _text_of(node)):
            return node.location
        return scalar.span(tree.start, tree.end)

    def text(self, node: YamlNode | None, tree: Tree) -> str | None:
        """Return the source text of a subexpression, shortened."""
        scalar = _text_of(node)
        if scalar is None:
            return None
        return shorten(" ".join(scalar.value[tree.start : tree.end].split()))


def _text_of(node: YamlNode | None) -> Scalar | None:
    """Return the scalar of an expression; a YAML list becomes the text of a vector."""
    if isinstance(node, Sequence):
        text = node.source.between(node.start, node.end)
        return Scalar(node.source, node.start, node.end, text)
    return node if isinstance(node, Scalar) else None


def declarations_in(model: Model, message: str) -> list[str]:
    """Return a sentence on each name in backticks that the model declares, with file and line.

    Names omitted because the message itself states their line.

    Parameters
    ----------
    model : Model
    message : str
        The engine's message, which contains no locations.
    """
    quoted = dict.fromkeys(re.findall(r"`([^`]+)`", message))
    places = _places(model)
    return [
        f"`{name}` is declared in {place.with_line}"
        for name in quoted
        if (place := places.get(name)) is not None and f"`{name}` is on line" not in message
    ]


def lines_of(model: Model, names: Iterable[str]) -> list[int]:
    """Return the lines of the model where constraints are declared, increasing."""
    places = _places(model)
    return sorted({places[name].line for name in names if name in places})


def _places(model: Model) -> dict[str, SourceLocation]:
    places = [(c.name, c.location) for c in model.coordinates]
    places += [(c.name, c.location) for c in model.constraints]
    places += [(e.name, e.location) for e in model.events]
    return {name: place for name, place in places if place is not None}
