"""Entries that a machine adds to the model file: names, values and terms, with their places."""

from __future__ import annotations

from collections.abc import Iterable

from lagcli.model.diagnostics import Diagnostics
from lagcli.model.machines.references import Key, is_quantity, is_zero
from lagcli.model.names.draft import Draft
from lagcli.model.yaml.source import Derived, Mapping, Scalar, Sequence, YamlNode

Entries = dict[str, tuple[Scalar, YamlNode]]

#: Blocks whose entries a machine adds, in the order in which they are printed.
BLOCKS = ("coordinates", "parameters", "definitions", "Q", "constraints", "initial", "outputs")
ENERGIES = ("T", "V", "D")


class MachineEntries:
    """What the bodies, joints and forces of a file add to it.

    Parameters
    ----------
    draft : Draft
    """

    def __init__(self, draft: Draft):
        self.draft = draft
        self.blocks: dict[str, Entries] = {block: {} for block in BLOCKS}
        self.terms: dict[str, list[tuple[str, Scalar]]] = {energy: [] for energy in ENERGIES}

    @property
    def report(self) -> Diagnostics:
        """The diagnostics of the file."""
        return self.draft.report

    def derived(self, text: str, place: YamlNode, inlined: Iterable[Scalar] = ()) -> Derived:
        """Return a text at the place of a body or joint; errors in inlined texts keep theirs."""
        parts = [(text.find(x.value), x, 0) for x in inlined if x.value and x.value in text]
        return Derived(text, place.location, place, tuple(parts))

    def add(
        self,
        block: str,
        name: str,
        value: str | YamlNode,
        place: Scalar,
        inlined: Iterable[Scalar] = (),
    ) -> None:
        """Add an entry to a block."""
        node = self.derived(value, place, inlined) if isinstance(value, str) else value
        self.blocks[block][name] = (self.derived(name, place), node)

    def guess(self, name: str, value: str, place: Scalar) -> None:
        """Add an initial value that the solver may change."""
        key = self.derived("guess", place)
        entries = {"guess": (key, self.derived(value, place))}
        node = Mapping(place.source, place.start, place.end, entries)  # type: ignore[arg-type]
        self.add("initial", name, node, place)

    def constraint(
        self,
        name: str,
        equation: str,
        place: Scalar,
        fields: dict[str, str] | None = None,
        inlined: Iterable[Scalar] = (),
    ) -> None:
        """Add a constraint, with fields such as ``restitution``."""
        if not fields:
            self.add("constraints", name, equation, place, inlined)
            return
        every = {"expr": equation, **fields}
        nodes = {k: (self.derived(k, place), self.derived(v, place)) for k, v in every.items()}
        node = Mapping(place.source, place.start, place.end, nodes)  # type: ignore[arg-type]
        self.add("constraints", name, node, place)

    def parameter(self, key: Key, path: str, node: YamlNode) -> str:
        """Declare the number ``NAME.path``, and return its name in expressions; 0 remains 0."""
        if is_zero(node):
            return "0"
        self.blocks["parameters"][f"{key.declared}.{path}"] = (
            self.derived(f"{key.declared}.{path}", node),
            node,
        )
        return f"{key.name}.{path}"

    def value(self, key: Key, path: str, node: YamlNode) -> tuple[str, list[Scalar]]:
        """Return a value for expressions: a number as a parameter, any expression as it is."""
        if isinstance(node, Scalar) and not is_quantity(node.value) and not node.missing:
            return node.value.strip(), [node]
        return self.parameter(key, path, node), []

    def term(self, energy: str, text: str, key: Key) -> None:
        """Add a term of T, V or D, summed over a family."""
        if key.index:
            text = f"sum({text}, {key.index} = {key.span})"
        self.terms[energy].append((text, key.node))

    def root(self, replaced: Iterable[str]) -> Mapping:
        """Return the model file with the entries added, without the keys that they replace."""
        root = self.draft.root
        entries = {n: e for n, e in root.entries.items() if n not in set(replaced)}
        made: Entries = {}
        for block in BLOCKS:
            if self.blocks[block]:
                made[block] = self._merged(block, entries.pop(block, None))
        for energy in ENERGIES:
            if self.terms[energy]:
                made[energy] = self._summed(energy, entries.pop(energy, None))
        order = ["name", "title", "description", "coordinates", "parameters", "functions"]
        order += ["inputs", "definitions", "T", "V", "Q", "D", "constraints", "initial"]
        every = {**entries, **made}
        ordered = {n: every[n] for n in order if n in every} | every
        return Mapping(root.source, root.start, root.end, ordered)

    def _merged(self, block: str, given: tuple[Scalar, YamlNode] | None) -> tuple[Scalar, YamlNode]:
        added = self.blocks[block]
        first = next(iter(added.values()))[0]
        if given is None:
            node: YamlNode = Mapping(first.source, first.start, first.end, added)
            return self.derived(block, first), node
        key, node = given
        entries = dict(node.entries) if isinstance(node, Mapping) else {}
        if block == "coordinates" and isinstance(node, Sequence):
            named = [x for x in node.items if isinstance(x, Scalar)]
            entries = {x.value: (x, self.derived("", x)) for x in named}
        elif not isinstance(node, Mapping) and not (isinstance(node, Scalar) and node.missing):
            return given  # which the section reports
        for name in added.keys() & entries.keys():
            own, (theirs, value) = added[name], entries[name]
            if block == "Q" and isinstance(own[1], Scalar) and isinstance(value, Scalar):
                text = f"{own[1].value} + {value.value}"
                entries[name] = (theirs, self.derived(text, value, [value]))
            elif block != "initial":
                self.report.add(
                    "duplicate-name",
                    f"`{name}` is declared twice: by a body, joint or force, and under `{block}`",
                    theirs.location,
                    "rename one of the two, or remove the entry",
                    (("the first one is here", own[0].location),),
                )
        return key, Mapping(node.source, node.start, node.end, {**added, **entries})

    def _summed(
        self, energy: str, given: tuple[Scalar, YamlNode] | None
    ) -> tuple[Scalar, YamlNode]:
        terms = self.terms[energy]
        text = " + ".join(t for t, _ in terms).replace("+ -", "- ")
        if given is None:
            return self.derived(energy, terms[0][1]), self.derived(text, terms[0][1])
        key, node = given
        if not isinstance(node, Scalar) or node.missing:
            return given
        return key, self.derived(f"{text} + ({node.value})", node, [node])
