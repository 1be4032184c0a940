"""The view: the drawing of a model."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import partial
from itertools import pairwise
from typing import Literal, NamedTuple

from symengine import Basic

from lagcli.model.diagnostics import Broken
from lagcli.model.expression.algebra import is_zero
from lagcli.model.expression.functions import derivative
from lagcli.model.expression.grammar import Span, parse, parse_spans
from lagcli.model.expression.tensors import Tensor
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import Name, SumExpr, Tree, VectorExpr, as_written
from lagcli.model.keys import DISC, VECTOR, VIEW, keys_of
from lagcli.model.model import (
    Arrow,
    Constraint,
    Disc,
    Plate,
    Segment,
    View,
    coordinate,
    velocity,
)
from lagcli.model.names.draft import Draft, Formula, Indices
from lagcli.model.names.families import Declaration, by_name, declarations, members_of
from lagcli.model.names.members import format_members, members_clause, with_indices
from lagcli.model.names.namespace import Allowed
from lagcli.model.names.scope import Scope, uses
from lagcli.model.sections.coordinates import si_unit
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.model.yaml.source import Mapping as MappingNode
from lagcli.model.yaml.source import Scalar, Sequence, YamlNode

_Kind = Literal["rod", "rope", "spring", "damper", "belt", "guide", "wall", "edge"]
_SEGMENTS: tuple[tuple[str, _Kind], ...] = (
    ("rods", "rod"),
    ("ropes", "rope"),
    ("springs", "spring"),
    ("dampers", "damper"),
    ("belts", "belt"),
    ("guides", "guide"),
    ("walls", "wall"),
    ("edges", "edge"),
)
_EXAMPLES = {
    "points": "A: [x_A, y_A]",
    "rods": "crank: O-A",
    "ropes": "cable: O-A",
    "springs": "suspension: O-A",
    "dampers": "damper: O-A",
    "belts": "belt: G-H",
    "guides": "rail: G-H",
    "walls": "floor: G-H",
    "edges": "block: C-D-E-F-C",
    "plates": "block: C-D-E-F",
    "sliders": "B",
    "masses": "A",
    "discs": "wheel: {center: C, radius: R, angle: phi}",
    "grounds": "O",
    "trails": "B",
    "labels": "A: mass m",
    "vectors": "v_A: {velocity: A}",
}
#: Description of components by unit.
_MEASURED: dict[str, Literal["velocity", "force"]] = {"m/s": "velocity", "N": "force"}
_SHORT = r"[^\W\d_](?:\d|_[^\W_]{1,2})?"  # names that are labels: O, P1, x_A


def read_view(draft: Draft) -> View | None:
    """Return the model's ``view``; None if it has none."""
    node = draft.get("view")
    if node is None or (isinstance(node, Scalar) and node.missing):
        return None
    if not isinstance(node, MappingNode):
        draft.report.add(
            "wrong-type",
            f"`view` must be a mapping of what to draw, not {node.what}",
            node.location,
            "begin with its points, as in\nview:\n  points:\n    A: [x_A, y_A]",
        )
        return None
    return _ViewReader(draft).read(node)


class _ViewReader:
    def __init__(self, draft: Draft):
        self.draft = draft
        self.constraints = {c.name: c for c in draft.constraints}
        self.points = Points(draft)
        self.plain: list[str] = []  # points that are not members of families
        self.fields: dict[str, YamlNode] = {}

    def read(self, node: MappingNode) -> View | None:
        """Read the whole block."""
        draft = self.draft
        self.fields = draft.fields(node, "`view`", keys_of(VIEW))
        if "points" not in self.fields:
            draft.report.add(
                "missing-key",
                "the view has no `points`",
                draft.root.entries["view"][0].location,
                "name the points that are drawn, as in\nview:\n  points:\n    A: [x_A, y_A]",
            )
            return None
        self.read_points()
        if not self.points.dimension:
            return None
        shapes = [s for key, kind in _SEGMENTS for s in self.segments(key, kind)]
        discs = tuple(self.discs())
        grounds, trails = tuple(self.marked("grounds")), tuple(self.marked("trails"))
        labels, vectors = self.labels(), tuple(self.vectors())
        points = self.points
        return View(
            points.dimension,
            points.places,
            segments=tuple(shapes),
            discs=discs,
            grounds=grounds,
            trails=trails,
            labels=labels,
            vectors=vectors,
            plates=tuple(self.plates()),
            sliders=tuple(self.marked("sliders")),
            masses=tuple(self.marked("masses")) if "masses" in self.fields else None,
        )

    def entries(self, key: str, what: str) -> list[Declaration]:
        """Return the declarations of a mapping under a key of the view."""
        node = self.fields.get(key)
        if node is None or (isinstance(node, Scalar) and node.missing):
            return []
        if isinstance(node, MappingNode):
            return declarations(self.draft, list(node), what)
        self.draft.report.add(
            "wrong-type",
            f"`{key}` must be a mapping of names, not {node.what}",
            node.location,
            f"write each on a line of its own, with a name, as in\n{key}:\n  {_EXAMPLES[key]}",
        )
        return []

    # points

    def read_points(self) -> None:
        """Read the points; the first valid one determines the number of dimensions."""
        declared = self.entries("points", "point")
        members = [m for d in declared for m in members_of(self.draft, d)]
        unique = by_name(self.draft, members)
        self.points.declared = dict.fromkeys(unique)
        self.plain = [d.name for d in declared if not d.spans]
        for d in declared:
            what = f"the point `{d.title}`"
            parsed = self.draft.parse(d.node, what, "expression such as `[x, y]`")
            if parsed is None:
                continue
            self.draft.trees[f"view.points.{d.title}"] = parsed.tree
            formula = Formula(self.draft, parsed, what, indices=d.indices)
            for member in (m for m in unique.values() if m.declaration is d):
                place = self.tuple_of(formula, member.indices, (2, 3))
                if place is None:
                    break
                self.points.places[member.name] = place
                self.points.dimension = self.points.dimension or len(place)

    def tuple_of(
        self, formula: Formula, indices: Mapping[str, int], lengths: tuple[int, ...]
    ) -> tuple[Basic, ...] | None:
        """Return the entries of a vector with the dimension of the view."""
        sized = formula.value(indices)
        if sized is None:
            return None
        if self.points.dimension:
            lengths = (self.points.dimension,)
        value = sized.value
        if isinstance(value, Tensor) and value.is_vector and len(value.entries) in lengths:
            return value.entries
        kind = value.kind if isinstance(value, Tensor) else "a scalar"
        wanted = " or ".join(map(str, lengths))
        tree = formula.parsed.tree
        formula.good = False
        error = ExpressionError(
            "shape",
            f"{formula.scope.where} must be a vector of {wanted}, not {kind}",
            tree.start,
            tree.end,
            "all points of a view have two coordinates, or all have three: `[x, y]`, `[x, y, z]`",
        )
        self.draft.report.add_expression_error(error, formula.parsed.node)
        return None

    # lines and marks

    def segments(self, key: str, kind: _Kind) -> Iterator[Segment]:
        """Yield the lines under a key of the view."""
        for points, name in self.lines(key, kind):
            for start, end in pairwise(points):
                yield Segment(kind, f"{start}-{end}" if name is None else name, start, end)

    def plates(self) -> Iterator[Plate]:
        """Yield the filled outlines."""
        for points, name in self.lines("plates", "plate"):
            corners = points[:-1] if points[0] == points[-1] else points
            yield Plate("-".join(points) if name is None else name, corners)

    def lines(self, key: str, what: str) -> Iterator[tuple[tuple[str, ...], str | None]]:
        """Yield the points of lines under a key, a list or a mapping, and their names."""
        example = "O-A-B" if what == "plate" else "O-A"
        node = self.fields.get(key)
        if isinstance(node, Sequence) or (isinstance(node, Scalar) and not node.missing):
            for item in node.items if isinstance(node, Sequence) else [node]:
                path = read_path(self.draft, item, f"a {what} of the view", None, example)
                if path is not None:
                    for points, _, _ in each(self.draft, path, None, self.points.at):
                        yield points, None
            return
        for d in self.entries(key, what):
            path = read_path(self.draft, d.node, f"the {what} `{d.title}`", None, example)
            if path is not None:
                for points, name, _ in each(self.draft, path, d, self.points.at):
                    yield points, name

    def marked(self, key: str) -> Iterator[str]:
        """Yield the points in a list under a key of the view."""
        node = self.fields.get(key)
        if node is None or (isinstance(node, Scalar) and node.missing):
            return
        for item in node.items if isinstance(node, Sequence) else [node]:
            what = f"`{key}`"
            path = read_path(self.draft, item, what, 1, _EXAMPLES[key])
            if path is None:
                continue
            for points, _, _ in each(self.draft, path, None, self.points.at):
                yield points[0]

    def labels(self) -> dict[str, str | None]:
        """Return the labels: a mapping, a list, or by default the points with short names."""
        node = self.fields.get("labels")
        if node is None:
            short = [name for name in self.plain if re.fullmatch(_SHORT, name)]
            return dict.fromkeys(name for name in short if name in self.points.places)
        if isinstance(node, Sequence):
            return dict.fromkeys(self.marked("labels"))
        labels: dict[str, str | None] = {}
        for d in self.entries("labels", "label"):
            text = self.draft.text(d.node, f"the label of `{d.title}`")
            path = read_path(self.draft, d.key, "a label", 1, "A") if not d.spans else None
            if path is not None:
                for points, _, _ in each(self.draft, path, None, self.points.at):
                    labels[points[0]] = text
            elif d.spans:
                members = [m.name for m in members_of(self.draft, d)]
                missing = [name for name in members if name not in self.points.declared]
                if missing:
                    self.draft.report.add(
                        "no-member",
                        f"the view has no point `{missing[0]}` to be labelled",
                        d.key.location,
                        "use the same ranges",
                    )
                labels.update({name: text for name in members if name in self.points.places})
        return labels

    # discs

    def discs(self) -> Iterator[Disc]:
        """Yield the discs."""
        for d in self.entries("discs", "disc"):
            what = f"the disc `{d.title}`"
            fields = self.mapping(d, what, keys_of(DISC))
            if fields is None or not self.required(d, what, fields, tuple(DISC["required"])):
                continue
            path = read_path(self.draft, fields["center"], f"the center of {what}", 1, "C")
            radius = self.formula(d, fields, "radius", what)
            angle = self.formula(d, fields, "angle", what)
            normal = self.formula(d, fields, "normal", what)
            if "normal" in fields and self.points.dimension == 2:
                self.draft.report.add(
                    "contradiction",
                    f"{what} has a normal, but the view has two dimensions",
                    fields["normal"].location,
                    "remove it, or give all points three coordinates",
                )
                continue
            if path is None or radius is None:
                continue
            for points, name, indices in each(self.draft, path, d, self.points.at):
                size = radius.scalar(indices)
                if size is None:
                    break
                yield Disc(
                    name,
                    points[0],
                    size,
                    angle.scalar(indices) if angle else None,
                    self.tuple_of(normal, indices, (3,)) if normal else None,
                )

    # vectors

    def vectors(self) -> Iterator[Arrow]:
        """Yield the vectors."""
        kinds = ("velocity", "force", "components")
        for d in self.entries("vectors", "vector"):
            what = f"the vector `{d.title}`"
            fields = self.mapping(d, what, keys_of(VECTOR))
            if fields is None:
                continue
            given = [kind for kind in kinds if kind in fields]
            if len(given) != 1:
                self.draft.report.add(
                    "contradiction" if given else "missing-value",
                    f"{what} has " + (" and ".join(f"`{k}`" for k in given) or "no value"),
                    d.key.location,
                    "give one of `velocity: POINT`, `force: CONSTRAINT`,"
                    f" `components: {self.zero}`",
                )
                continue
            kind = given[0]
            if kind != "velocity" and not self.required(d, what, fields, ("at",)):
                continue
            unit = self.draft.text(fields.get("unit"), f"`unit` of {what}")
            if unit is not None and not si_unit(self.draft, unit, fields["unit"]):
                continue
            read: Callable[..., Iterator[Arrow]] = {
                "velocity": self.velocity,
                "force": self.force,
                "components": self.free_vector,
            }[kind]
            yield from read(d, what, fields, unit)

    @property
    def zero(self) -> str:
        """An example of components."""
        return "[0, 0]" if self.points.dimension == 2 else "[0, 0, 0]"

    def velocity(
        self, d: Declaration, what: str, fields: dict[str, YamlNode], unit: str | None
    ) -> Iterator[Arrow]:
        """Yield the velocities of points."""
        path = read_path(self.draft, fields["velocity"], f"the velocity of {what}", 1, "A")
        place = path
        if "at" in fields:
            place = read_path(self.draft, fields["at"], f"`at` of {what}", 1, "A")
        if path is None or place is None:
            return
        moving = each(self.draft, path, d, self.points.at)
        standing = each(self.draft, place, d, self.points.at)
        for (points, name, _), (at, _, _) in zip(moving, standing, strict=False):
            rates = tuple(map(self.draft.names.derivative, self.points.places[points[0]]))
            yield Arrow(name, "velocity", at, rates, unit=unit)

    def free_vector(
        self, d: Declaration, what: str, fields: dict[str, YamlNode], unit: str | None
    ) -> Iterator[Arrow]:
        """Yield vectors given by their components."""
        path = read_path(self.draft, fields["at"], f"`at` of {what}", 1, "A")
        formula = self.formula(d, fields, "components", what, multipliers=True)
        if path is None or formula is None:
            return
        for at, name, indices in each(self.draft, path, d, self.points.at):
            components = self.tuple_of(formula, indices, (2, 3))
            if components is None:
                break
            yield Arrow(name, _MEASURED.get(unit or "", "vector"), at, components, unit=unit)

    def force(
        self, d: Declaration, what: str, fields: dict[str, YamlNode], unit: str | None
    ) -> Iterator[Arrow]:
        """Yield the forces of constraints."""
        draft = self.draft
        path = read_path(draft, fields["at"], f"`at` of {what}", 0, "A")
        named = read_path(draft, fields["force"], f"`force` of {what}", 1, "guide")
        if path is None or named is None:
            return
        places = each(draft, path, d, self.points.at)
        forces = each(draft, named, d, partial(constraint_named, draft))
        for (at, name, _), ((constraint,), _, _) in zip(places, forces, strict=False):
            parts = components_of(constraint, self.constraints)
            constraints = [self.constraints[part] for part in parts if part in self.constraints]
            if not constraints:
                break
            if not all(
                check_force(draft, c, at, self.points.places, path.node) for c in constraints
            ):
                break
            yield Arrow(name, "force", at, (), constraint, unit, parts)

    # fields

    def mapping(
        self, d: Declaration, what: str, known: tuple[str, ...]
    ) -> dict[str, YamlNode] | None:
        """Return the fields of an entry."""
        key = "vectors" if "vector" in what.split("`")[0] else "discs"
        node = self.draft.mapping(d.node, what, f"write `{_EXAMPLES[key]}`")
        return None if node is None else self.draft.fields(node, what, known)

    def required(
        self, d: Declaration, what: str, fields: dict[str, YamlNode], names: tuple[str, ...]
    ) -> bool:
        """Report missing fields; return whether there is none."""
        missing = [name for name in names if name not in fields]
        if missing:
            self.draft.report.add(
                "missing-value",
                f"{what} has no " + " and no ".join(f"`{name}`" for name in missing),
                d.key.location,
                f"as in `{_EXAMPLES['discs']}`"
                if "radius" in names
                else "name the point where it is drawn: `at: A`",
            )
        return not missing

    def formula(
        self,
        d: Declaration,
        fields: dict[str, YamlNode],
        key: str,
        what: str,
        multipliers: bool = False,
    ) -> Formula | None:
        """Return the expression of a field; None if it is missing or has an error."""
        if key not in fields:
            return None
        where = f"`{key}` of {what}"
        parsed = self.draft.parse(fields[key], where)
        if parsed is None:
            return None
        self.draft.trees[f"view.{d.title}.{key}"] = parsed.tree
        allowed = Allowed.ACCELERATIONS if multipliers else Allowed.MOTION
        return Formula(self.draft, parsed, where, allowed, d.indices)


_FOR = r"\s+for\s+"


class Points:
    """The points of a view, and definitions that can be used as points.

    Attributes
    ----------
    places : dict of str to expressions
        The points that have a value; a definition is added when it is first used.
    declared : dict with str keys
        Names of all points, including those with errors, in the order of the file.
    dimension : int
        2 or 3; 0 while unknown.
    """

    def __init__(self, draft: Draft):
        self.draft = draft
        self.places: dict[str, tuple[Basic, ...]] = {}
        self.declared: dict[str, None] = {}
        self.dimension = 0

    def at(self, tree: Name, scope: Scope) -> str:
        """Return the name of the point that a tree denotes.

        Raises
        ------
        ExpressionError
            There is no such point.
        Broken
            The declaration of the point has an error.
        """
        text = member_name(tree, scope)
        if text in self.places:
            return text
        if text in self.declared:
            raise Broken
        definition = self.draft.definitions.get(text)
        value = definition.value if definition is not None else None
        if isinstance(value, Tensor) and value.is_vector and len(value.entries) == self.dimension:
            self.places[text] = value.entries
            return text
        names = self.draft.names
        if names.incomplete or text in names.broken or text in names.suspects:
            raise Broken
        raise ExpressionError(
            "unknown-name",
            f"{scope.where} uses `{text}`{scope.at()}, which is not a point of the view",
            tree.start,
            tree.end,
            self._help(tree, text),
            f"point {tree.text}",
        )

    def _help(self, tree: Name, text: str) -> str:
        base = text.partition("[")[0]
        members = [name for name in self.declared if name.startswith(f"{base}[")]
        if members and tree.indices:
            return members_clause(base, members)
        if members:
            return f"name a member, as in `{members[0]}`"
        close = nearest(text, list(self.declared))
        shown = ", ".join(f"`{name}`" for name in list(self.declared)[:12])
        return did_you_mean(close) or f"its points are {shown}"


def member_name(tree: Name, scope: Scope) -> str:
    """Return a name with its indices as numbers."""
    for index in tree.indices:
        scope.check_index(index)
    return with_indices(tree.text, [scope.indices.at(index) for index in tree.indices])


class Path(NamedTuple):
    """A sequence of points as written, and the index over which it repeats."""

    what: str
    node: Scalar
    names: tuple[Name, ...]
    declaration: Declaration

    @property
    def title(self) -> str:
        """The names as written."""
        return "-".join(map(as_written, self.names))


def read_path(
    draft: Draft, node: YamlNode, what: str, count: int | None, example: str
) -> Path | None:
    """Parse names joined by hyphens, optionally followed by ``for i = 1..N``; report errors.

    Parameters
    ----------
    draft : Draft
    node : Node
    what : str
        Description for messages.
    count : int or None
        1 for a single point; None for two or more; 0 for any number.
    example : str
    """
    if isinstance(node, Sequence):
        node = draft.vector_text(node)  # [O, A]
    if not isinstance(node, Scalar) or node.missing:
        draft.report.add(
            "wrong-type",
            f"{what} names {'a point' if count == 1 else 'points'}, not {node.what}",
            node.location,
            f"write `{example}`",
        )
        return None
    with draft.report.expression(node):
        text = node.value
        clause = re.search(_FOR, text)
        tree = parse(text[: clause.start()] if clause else text)
        names = tuple(_names(tree, what, count, example))
        spans: list[Span] = []
        if clause:
            spans = parse_spans(text, clause.end(), len(text))
            if spans[0][0] is None:
                raise ExpressionError(
                    "syntax",
                    "the index has no name",
                    clause.end(),
                    len(text),
                    "write `for i = 1..N`",
                )
        return Path(what, node, names, Declaration(what, node, node, tuple(spans)))
    return None


def _names(tree: Tree, what: str, count: int | None, example: str) -> Iterator[Name]:
    terms: tuple[tuple[int, Tree], ...] = ((1, tree),)
    if isinstance(tree, SumExpr):
        terms = tree.terms
    elif isinstance(tree, VectorExpr):
        terms = tuple((-1 if place else 1, item) for place, item in enumerate(tree.items))
    for place, (sign, term) in enumerate(terms):
        if not isinstance(term, Name) or term.primes or (sign > 0) != (place == 0):
            raise ExpressionError(
                "not-a-point",
                f"{what} is drawn at {'a single named point' if count == 1 else 'named points'}",
                term.start,
                term.end,
                f"write `{example}`; declare expressions under `points`",
            )
        yield term
    if (count is None and len(terms) < 2) or (count and len(terms) != count):
        raise ExpressionError(
            "not-a-point",
            f"{what} runs between two points"
            if count is None
            else f"{what} is drawn at a single point",
            tree.start,
            tree.end,
            f"write `{example}`",
        )


def each(
    draft: Draft,
    path: Path,
    declaration: Declaration | None,
    resolve: Callable[[Name, Scope], str],
) -> Iterator[tuple[tuple[str, ...], str, Indices]]:
    """Yield the points of a path for each value of its index.

    Parameters
    ----------
    draft, path : Draft, Path
    declaration : Declaration or None
        The entry whose value is the path and whose key has its index. If not given, the index
        follows the path.
    resolve : callable
        Returns the value of a name; raises the errors of `Points.at`.

    Yields
    ------
    points : tuple of str
    name : str
        Name of the member of the entry; without an entry, the points with hyphens.
    indices : mapping of str to int
    """
    over = path.declaration if declaration is None else declaration
    scope = Scope(draft.names, path.what, indices=over.indices)
    if declaration is not None and path.declaration.spans:
        draft.report.add(
            "bad-range",
            f"{path.what} has a name, to which the index belongs",
            path.node.location,
            f"write `{declaration.name}[i = 1..N]: P[i-1]-P[i]`",
        )
        return
    if over.several and not any(uses(name, i) for i in over.indices for name in path.names):
        draft.report.add(
            "unused-index",
            f"{path.what} is the same for every index",
            path.node.location,
            "use the index, or give it once",
        )
        return
    for member in members_of(draft, over):
        scope.values.update(member.indices)
        with draft.report.expression(path.node):
            points = tuple(resolve(name, scope) for name in path.names)
            yield points, "-".join(points) if declaration is None else member.name, member.indices
            continue
        return  # one error is reported for all members


_COMPONENTS = {"x", "y", "z", *map(str, range(1, 10))}


def constraint_named(draft: Draft, tree: Name, scope: Scope) -> str:
    """Return the constraint that a tree names.

    Raises
    ------
    ExpressionError
        There is no such constraint.
    Broken
        A declaration with an error may be the constraint.
    """
    known = list(draft.names.constraints)
    text = member_name(tree, scope)
    if any(part in draft.names.constraints for part in components_of(text, known)):
        return text
    base = text.partition("[")[0]
    if base in draft.names.suspects or draft.names.may_be_constraint(text):
        raise Broken
    members = [name for name in known if name.startswith(f"{base}[")]
    help_ = f"the members are {format_members(base, members)}" if members else None
    raise ExpressionError(
        "unknown-name",
        f"{scope.where} names `{text}`{scope.at()}, which is not a constraint",
        tree.start,
        tree.end,
        help_ or did_you_mean(nearest(text, known) or known[:3]) or "the model has no constraints",
    )


def components_of(constraint: str, known: Collection[str]) -> tuple[str, ...]:
    """Return a constraint, or the components of a vector constraint: ``pin.x`` of ``pin``."""
    if constraint in known:
        return (constraint,)
    parts = (name.removeprefix(f"{constraint}.") for name in known if name != constraint)
    return tuple(f"{constraint}.{part}" for part in parts if part in _COMPONENTS)


def check_force(
    draft: Draft,
    constraint: Constraint,
    at: tuple[str, ...],
    points: Mapping[str, tuple[Basic, ...]],
    node: YamlNode,
) -> bool:
    """Report a constraint that acts on coordinates on which none of the points depends.

    λ b is the force of the constraint on the coordinates, and Jᵀ F that of forces F at points,
    where J contains the derivatives of the points with respect to the coordinates: if J has no
    column for a coordinate, b must not have one.
    """
    coordinates = draft.names.coordinates
    symbols = {s for name in at for x in points[name] for s in x.free_symbols}
    where = " and ".join(f"`{name}`" for name in at)
    moving = sorted(s.name for s in symbols if s.name.rstrip("'") in coordinates)
    rates = [name for name in moving if name.endswith("'")]
    if rates:
        draft.report.add(
            "velocity-in-position",
            f"a force acts at a position, but {where} depends on the velocity `{rates[0]}`",
            node.location,
            "name a point that is a position",
        )
        return False
    symbol = coordinate if constraint.kind == "holonomic" else velocity
    free = constraint.expression.free_symbols
    others = [
        name
        for name in coordinates
        if name not in moving
        and symbol(name) in free
        and not is_zero(derivative(constraint.expression, symbol(name)))
    ]
    if not others:
        return True
    draft.report.add(
        "force-elsewhere",
        f"the constraint `{constraint.name}` also acts on `{others[0]}`, on which {where} does not"
        " depend: its force does not act only there",
        node.location,
        "name all points that it acts on, as in `at: [A, B]`; or, instead of `force`, give the"
        f" vector itself: `components: [lambda.{constraint.name}, 0]`",
        subject=f"{constraint.name.partition('[')[0]} {node.location.line}",
    )
    return False
