"""The definitions: named expressions, built in the order in which they need each other."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from lagcli.model.declarations import valid_name
from lagcli.model.dependencies import in_order
from lagcli.model.draft import Draft, Entry, Parsed
from lagcli.model.expressions import Sized
from lagcli.model.model import Definition
from lagcli.model.scope import Context
from lagcli.model.source import Node
from lagcli.model.trees import Name, walk


def read_definitions(draft: Draft, entries: list[Entry]) -> dict[str, Definition]:
    """Build the definitions, and enter them into the draft's names."""
    keys: dict[str, Node] = {}
    texts: dict[str, tuple[Parsed, str | None]] = {}
    for name, key, given in entries:
        if not valid_name(draft, name, key, "definition"):
            continue
        keys[name] = key
        what = f"the definition `{name}`"
        node, fields = draft.expression_node(key, given, what)
        description = draft.text(fields.get("description"), f"`description` of {what}")
        parsed = draft.parse(node, what) if node is not None else None
        if parsed is None:
            draft.names.broken.add(name)
        else:
            texts[name] = (parsed, description)
    built: dict[str, Sized] = {}
    draft.names.definitions = {name: partial(built.__getitem__, name) for name in keys}
    order, circles = in_order(
        {name: _definitions_in(draft, parsed) for name, (parsed, _) in texts.items()}
    )
    for circle in circles:
        report_circle(draft, "definition", circle, keys)
    for name in order:
        if name in draft.names.broken:
            continue
        sized = draft.build(texts[name][0], Context(f"the definition `{name}`"))
        if sized is None:
            draft.names.broken.add(name)
        else:
            built[name] = sized
    draft.trees.update((name, parsed.tree) for name, (parsed, _) in texts.items())
    return {
        name: Definition(name, built[name].value, texts[name][0].tree, texts[name][1])
        for name in keys
        if name in built
    }


def _definitions_in(draft: Draft, parsed: Parsed) -> list[str]:
    names = (draft.names.resolve(p)[0] for p in walk(parsed.tree) if isinstance(p, Name))
    return [name for name in names if name in draft.names.definitions]


def report_circle(draft: Draft, what: str, circle: list[str], keys: Mapping[str, Node]) -> None:
    """Report names that are defined by each other."""
    places = [keys[name].location for name in circle]
    first = min(range(len(circle)), key=lambda i: places[i].line)
    circle = circle[first:] + circle[:first]
    arrows = " → ".join(f"`{name}`" for name in [*circle, circle[0]])
    draft.report.add(
        "circular",
        f"the {what} `{circle[0]}` is defined by itself: {arrows}",
        keys[circle[0]].location,
        "give one of them without the others" if len(circle) > 1 else "give it without itself",
        tuple((f"`{name}` is defined here", keys[name].location) for name in circle[1:4]),
    )
    draft.names.broken.update(circle)
