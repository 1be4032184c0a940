"""Bodies in a plane: coordinates of the center of mass, points, kinetic and potential energy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from lagcli.model.keys import BODY, keys_of
from lagcli.model.machines.references import Key, Reference, is_zero, items_of, read_key
from lagcli.model.machines.written import MachineEntries
from lagcli.model.names.families import COLUMN_PREFIXES
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Derived, Mapping, Scalar, YamlNode

GROUND = "ground"
_AXES = ("x", "y")
#: Names that a point cannot have: those of the body's own quantities.
_RESERVED = ("x", "y", "z", "phi", "r", "e", "mass", "omega", "inertia", "length", "points", "com")
#: What neither a body nor a joint can be called.
NOT_NAMES = (*COLUMN_PREFIXES, "gravity", "time")


@dataclass(eq=False)
class Body:
    """A body, or a family of bodies.

    Parameters
    ----------
    key : Key
    points : dict of str to tuple of str
        Coordinates of its points in its frame, from its center of mass.
    turns : bool
        Whether it has an angle or a rotation; a point mass has none.
    dimension : int
    """

    key: Key
    points: dict[str, tuple[str, ...]] = field(default_factory=dict)
    turns: bool = True
    dimension: int = 2

    @property
    def fixed(self) -> bool:
        """Whether it is the ground."""
        return self.key.base == GROUND

    def center(self, name: str) -> str:
        """Return the vector to the center of mass of a member; of the ground, to its origin."""
        if self.fixed:
            return "[0, 0]" if self.dimension == 2 else "[0, 0, 0]"
        return f"[{name}.x, {name}.y]" if self.dimension == 2 else f"{name}.r"

    def velocity(self, name: str) -> str:
        """Return the velocity of the center of mass of a member."""
        return f"[{name}.x', {name}.y']" if self.dimension == 2 else f"{name}.r'"


class Bodies:
    """The bodies of a file.

    Parameters
    ----------
    written : MachineEntries
    free_index : str
        Name of the index of families that name none.
    """

    dimension = 2
    axes: tuple[str, ...] = _AXES
    reason = "; machines in space have `dimension: 3`"

    def __init__(self, written: MachineEntries, free_index: str):
        self.written, self.report = written, written.report
        self.free_index = free_index
        self.by_base: dict[str, list[Body]] = {}

    def __iter__(self) -> Iterator[Body]:
        """Yield the bodies, without the ground."""
        return (b for bodies in self.by_base.values() for b in bodies if not b.fixed)

    def read(self, node: Mapping, gravity: tuple[str, ...]) -> None:
        """Read the entries of `bodies`, and write what they add to the model."""
        for name, key_node, value in node:
            key = read_key(key_node, self.free_index)
            family = key is not None and bool(key.span)
            if (
                key is None
                or key.base in NOT_NAMES
                or (key.base == GROUND and family)
                or "'" in name
            ):
                self.report.add(
                    "bad-name",
                    f"`{shorten(name)}` cannot be the name of a body",
                    key_node.location,
                    "a name is a letter followed by letters, digits and _; a family of bodies is"
                    " `link[1..N]`",
                )
                continue
            if key.base == GROUND:
                self._ground(key, value)
            else:
                self._body(key, value, gravity)
        if GROUND not in self.by_base:
            place = next(iter(node.entries.values()))[0] if node.entries else None
            ground = Derived(GROUND, (place or node).location, place or node)
            self.by_base[GROUND] = [Body(Key(GROUND, "", "", ground), dimension=self.dimension)]

    def _ground(self, key: Key, value: YamlNode) -> None:
        body = Body(key, dimension=self.dimension)
        self.by_base[GROUND] = [body]
        if isinstance(value, Scalar) and value.missing:
            return
        fields = self._fields(key, value, ("points",))
        self._points(body, fields.get("points"), ("0",) * self.dimension)

    def _mass(self, key: Key, value: YamlNode) -> tuple[Body, dict[str, YamlNode], str] | None:
        """Return a body, its keys, and its mass; report that it has none."""
        fields = self._fields(key, value, keys_of(BODY))
        body = Body(key, dimension=self.dimension)
        self.by_base.setdefault(key.base, []).append(body)
        if "mass" not in fields:
            self.report.add(
                "missing-value",
                f"the body `{key.node.value}` has no `mass`",
                key.node.location,
                f"write `{key.node.value}: {{mass: 2 kg, length: 0.3 m}}`",
            )
            return None
        return body, fields, self._required(body, "mass", fields["mass"])

    def _body(self, key: Key, value: YamlNode, gravity: tuple[str, ...]) -> None:
        written, name = self.written, key.name
        read = self._mass(key, value)
        if read is None:
            return
        body, fields, mass = read
        length = None
        if "length" in fields:
            length = self._required(body, "length", fields["length"])
        inertia = None
        if "shape" in fields:
            self.report.add(
                "wrong-value",
                f"the body `{key.node.value}` has a `shape`, but the machine is planar",
                fields["shape"].location,
                "give its `inertia` about the center of mass, or write `dimension: 3`",
            )
        if "inertia" in fields:
            if items_of(fields["inertia"]) is not None:
                self.report.add(
                    "wrong-type",
                    f"the inertia of `{key.node.value}` is a list, which a body in a plane has not",
                    fields["inertia"].location,
                    "give the moment of inertia about the center of mass, as in 0.02 kg*m^2;"
                    " machines in space have `dimension: 3`",
                )
                return
            inertia = written.parameter(key, "inertia", fields["inertia"])
        elif length is not None:
            rod = written.derived(f"{mass}*{length}^2/12", key.node)
            inertia = written.parameter(key, "inertia", rod)
        body.turns = inertia not in (None, "0")
        self._coordinates(body)
        center: tuple[str, ...] = ("0", "0")
        if "com" in fields:
            center = self._vector(body, "com", fields["com"]) or center
        if length is not None:
            half = f"{length}/2"
            body.points["a"] = (minus(f"-{half}", center[0]), minus("0", center[1]))
            body.points["b"] = (minus(half, center[0]), minus("0", center[1]))
        self._points(body, fields.get("points"), center)
        for point, place in body.points.items():
            written.add("definitions", f"{key.declared}.{point}", self._at(body, place), key.node)
        speed = f"{mass}/2*({name}.x'^2 + {name}.y'^2)"
        if body.turns:
            speed += f" + {inertia}/2*{name}.phi'^2"
        written.term("T", speed, key)
        for axis, g in zip(_AXES, gravity, strict=True):
            if g != "0":
                written.term("V", f"-{mass}*{g}*{name}.{axis}", key)

    def _coordinates(self, body: Body) -> None:
        key = body.key
        for axis, unit in (("x", "m"), ("y", "m"), *([("phi", "rad")] if body.turns else [])):
            self.written.add("coordinates", f"{key.declared}.{axis}", unit, key.node)

    def _fields(self, key: Key, value: YamlNode, known: tuple[str, ...]) -> dict[str, YamlNode]:
        what = f"the body `{key.node.value}`"
        draft = self.written.draft
        example = "{points: {O: [0, 0]}}" if key.base == GROUND else "{mass: 2 kg, length: 0.3 m}"
        node = draft.mapping(value, what, f"write `{key.node.value}: {example}`")
        return draft.fields(node, what, known) if node is not None else {}

    def _required(self, body: Body, path: str, node: YamlNode) -> str:
        """Return a number that cannot be 0."""
        if is_zero(node):
            self.report.add(
                "wrong-value",
                f"the {path} of `{body.key.node.value}` is 0",
                node.location,
                "remove the body, and connect its neighbors directly; a rod without mass is a"
                " joint of the kind `rod`"
                if path == "mass"
                else "give a length above 0, or remove it and name `points`",
            )
        return self.written.parameter(body.key, path, node)

    def _vector(self, body: Body, path: str, node: YamlNode) -> tuple[str, ...] | None:
        items = items_of(node)
        if items is None or len(items) != self.dimension:
            given = node.what if items is None else f"a list of {len(items)}"
            example = "[0.1 m, 0]" if self.dimension == 2 else "[0.1 m, 0, 0]"
            self.report.add(
                "shape",
                f"`{path}` of `{body.key.node.value}` must be a vector of {self.dimension}, not"
                f" {given}",
                node.location,
                f"write `{example}`, its place in the frame of the body{self.reason}",
            )
            return None
        return tuple(
            self.written.parameter(body.key, f"{path}.{axis}", item)
            for axis, item in zip(self.axes, items, strict=True)
        )

    def _points(self, body: Body, node: YamlNode | None, center: tuple[str, ...]) -> None:
        if node is None:
            return
        what = f"`points` of `{body.key.node.value}`"
        mapping = self.written.draft.mapping(node, what, "write `points: {P: [0.1 m, 0]}`")
        for name, key, value in mapping or ():
            if name in _RESERVED or not name.isidentifier():
                self.report.add(
                    "reserved-name",
                    f"`{shorten(name)}` cannot be the name of a point of"
                    f" `{body.key.node.value}`"
                    + (": it is a quantity of the body" if name in _RESERVED else ""),
                    key.location,
                    "choose another name, such as `A` or `pin`",
                )
                continue
            place = self._vector(body, f"points.{name}", value)
            if place is None:
                body.points[name] = ("0",) * self.dimension
                continue
            local = tuple(minus(p, c) for p, c in zip(place, center, strict=True))
            body.points[name] = local
            if body.fixed:
                self.written.add("definitions", f"{GROUND}.{name}", f"[{', '.join(local)}]", key)
            elif not body.turns and set(place) != {"0"}:
                self.report.add(
                    "missing-value",
                    f"the body `{body.key.node.value}` has the point `{name}` beside its center"
                    " of mass, but no inertia",
                    key.location,
                    f"write `{body.key.node.value}: {{mass: …, inertia:"
                    f" {'0.02 kg*m^2' if self.dimension == 2 else '[0.02, 0.03, 0.04]'}}}`, or the"
                    " `length` of a rod",
                )

    def _at(self, body: Body, place: tuple[str, ...]) -> str:
        """Return the vector to a point of a body."""
        name, (x, y) = body.key.name, place
        if (x, y) == ("0", "0"):
            return f"[{name}.x, {name}.y]"
        cos, sin = f"cos({name}.phi)", f"sin({name}.phi)"
        first = _sum(f"{name}.x", (1, x, cos), (-1, y, sin))
        second = _sum(f"{name}.y", (1, x, sin), (1, y, cos))
        return f"[{first}, {second}]"

    def find(self, reference: Reference, what: str) -> Body | None:
        """Return the body that a reference names; report an unknown body or point."""
        bodies = self.by_base.get(reference.base)
        node = reference.node
        if bodies is None:
            self.report.add(
                "unknown-name",
                f"{what} names the body `{reference.base}`, which is not declared",
                node.location,
                did_you_mean(nearest(reference.base, list(self.by_base)))
                or "the bodies are " + ", ".join(f"`{b}`" for b in self.by_base),
            )
            return None
        family = any(body.key.span for body in bodies)
        if family != bool(reference.index):
            self.report.add(
                "unknown-name",
                f"{what} names `{reference.name}`, but `{reference.base}` is"
                + (" a family of bodies" if family else " a single body"),
                node.location,
                f"write `{reference.base}[1]`" if family else f"write `{reference.base}`",
            )
            return None
        inside = reference.index[1:-1]
        body = next((b for b in bodies if b.key.span == inside), None)
        body = body or next((b for b in bodies if b.key.index), bodies[0])
        if reference.point and all(reference.point not in b.points for b in bodies):
            listed = ", ".join(f"`{p}`" for p in body.points)
            self.report.add(
                "unknown-name",
                f"{what} names the point `{reference.point}`, which `{reference.base}` has not",
                node.location,
                did_you_mean(nearest(reference.point, list(body.points)))
                or (f"its points are {listed}" if listed else "declare it under its `points`"),
            )
            return None
        return body


def minus(x: str, y: str) -> str:
    """Return a difference; 0 remains 0."""
    if y == "0":
        return x
    return f"({'' if x == '0' else x + ' '}- {y})"


def _sum(first: str, *terms: tuple[int, str, str]) -> str:
    text = first
    for sign, value, factor in terms:
        if value == "0":
            continue
        positive = sign > 0
        if value.startswith("-"):
            positive, value = not positive, value[1:]
        text += f" {'+' if positive else '-'} {value}*{factor}"
    return text
