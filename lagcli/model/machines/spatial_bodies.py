"""Bodies in space: a point and a quaternion, inertia, points, kinetic and potential energy."""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.model.machines.bodies import Bodies, Body, minus
from lagcli.model.machines.references import JointCall, Key, items_of, read_call
from lagcli.model.machines.written import MachineEntries
from lagcli.model.yaml.source import YamlNode

_AXES = ("x", "y", "z")
#: Moments of inertia, each over the mass, of homogeneous bodies; cylinders are along z, rods along
#: x.
_SHAPES = {
    "box": (("a", "b", "c"), ("({b}^2 + {c}^2)/12", "({a}^2 + {c}^2)/12", "({a}^2 + {b}^2)/12")),
    "cylinder": (("r", "h"), ("(3*{r}^2 + {h}^2)/12", "(3*{r}^2 + {h}^2)/12", "{r}^2/2")),
    "sphere": (("r",), ("2*{r}^2/5", "2*{r}^2/5", "2*{r}^2/5")),
    "rod": (("l",), ("", "{l}^2/12", "{l}^2/12")),
}
_INERTIA = (
    "give the moments of inertia about the center of mass, `[0.02, 0.03, 0.04]`, a symmetric"
    " matrix of 3 × 3, or a `shape` such as `box(0.1 m, 0.2 m, 0.3 m)`"
)


class SpatialBodies(Bodies):
    """The bodies of a file in space.

    Parameters
    ----------
    written : MachineEntries
    free_index : str
        Name of the index of families that name none.
    reason : str
        Why the machine is in space, for messages.
    """

    dimension = 3
    axes = _AXES

    def __init__(self, written: MachineEntries, free_index: str, reason: str):
        super().__init__(written, free_index)
        self.reason = reason

    def _body(self, key: Key, value: YamlNode, gravity: tuple[str, ...]) -> None:
        written, name = self.written, key.name
        read = self._mass(key, value)
        if read is None:
            return
        body, fields, mass = read
        length = self._required(body, "length", fields["length"]) if "length" in fields else None
        inertia = self._inertia(body, fields, mass, length)
        body.turns = bool(inertia)
        written.add("coordinates", f"{key.declared}.r", "point", key.node)
        if body.turns:
            written.add("coordinates", f"{key.declared}.e", "quaternion", key.node)
        center: tuple[str, ...] = ("0",) * 3
        if "com" in fields:
            center = self._vector(body, "com", fields["com"]) or center
        if length is not None:
            sides = (minus("0", c) for c in center[1:])
            y, z = sides
            body.points["a"] = (minus(f"-{length}/2", center[0]), y, z)
            body.points["b"] = (minus(f"{length}/2", center[0]), y, z)
        self._points(body, fields.get("points"), center)
        for point, place in body.points.items():
            written.add("definitions", f"{key.declared}.{point}", self._at(body, place), key.node)
        if inertia:
            written.term("T", f"body({mass}, {inertia}, {name}.r, {name}.e)", key)
        else:
            written.term("T", f"{mass}/2*dot({name}.r', {name}.r')", key)
        for axis, g in zip(_AXES, gravity, strict=True):
            if g != "0":
                written.term("V", f"-{mass}*{g}*{name}.r.{axis}", key)

    def _at(self, body: Body, place: tuple[str, ...]) -> str:
        name = body.key.name
        if set(place) == {"0"}:
            return f"{name}.r"
        return f"{name}.r + {name}.e*[{', '.join(place)}]"

    # inertia

    def _inertia(
        self, body: Body, fields: dict[str, YamlNode], mass: str, length: str | None
    ) -> str:
        """Return the matrix of inertia in the frame of the body; empty for a point mass."""
        if "inertia" in fields:
            if "shape" in fields:
                self._fault(
                    body,
                    "contradiction",
                    "has an `inertia` and a `shape`, which gives one",
                    fields["shape"],
                    "remove one of the two",
                )
            return self._given(body, fields["inertia"])
        if "shape" in fields:
            return self._shaped(body, fields["shape"], mass)
        if length is None:
            return ""
        rod = self.written.derived(f"{mass}*{length}^2/12", body.key.node)
        across = self.written.parameter(body.key, "inertia.y", rod)
        along = self.written.parameter(body.key, "inertia.z", rod)
        return f"diag(0, {across}, {along})"

    def _given(self, body: Body, node: YamlNode) -> str:
        items = items_of(node)
        rows = [items_of(item) for item in items or []]
        numbers = self.written.parameter
        if items is not None and len(items) == 3 and rows == [None] * 3:
            every = (
                numbers(body.key, f"inertia.{a}", x) for a, x in zip(_AXES, items, strict=True)
            )
            return f"diag({', '.join(every)})"
        if len(rows) == 3 and all(row is not None and len(row) == 3 for row in rows):
            lines = []
            for a, row in zip(_AXES, rows, strict=True):
                assert row is not None
                entries = [
                    numbers(body.key, f"inertia.{a}{b}", x) for b, x in zip(_AXES, row, strict=True)
                ]
                lines.append(f"[{', '.join(entries)}]")
            return f"[{', '.join(lines)}]"
        given = node.what if items is None else f"a list of {len(items)}"
        self._fault(body, "shape", f"has an `inertia` that is {given}", node, _INERTIA)
        return ""

    def _shaped(self, body: Body, node: YamlNode, mass: str) -> str:
        call = read_call(node, _SHAPES)
        if not isinstance(call, JointCall) or call.kind not in _SHAPES or call.keys:
            self._fault(
                body,
                "unknown-kind",
                f"has the shape {node.what}",
                node,
                "the shapes are `box(a, b, c)`, `cylinder(r, h)`, `sphere(r)` and `rod(l)`",
            )
            return ""
        sizes, moments = _SHAPES[call.kind]
        if len(call.arguments) != len(sizes):
            self._fault(
                body,
                "wrong-arguments",
                f"has a {call.kind} with {len(call.arguments)} sizes",
                node,
                f"write `{call.kind}({', '.join(sizes)})`",
            )
            return ""
        values = {
            size: self._required(body, f"shape.{size}", x)
            for size, x in zip(sizes, call.arguments, strict=True)
        }
        every: Sequence[str] = [
            self.written.parameter(
                body.key,
                f"inertia.{axis}",
                self.written.derived(f"{mass}*{text.format(**values)}", body.key.node),
            )
            if text
            else "0"
            for axis, text in zip(_AXES, moments, strict=True)
        ]
        return f"diag({', '.join(every)})"

    def _fault(self, body: Body, kind: str, message: str, node: YamlNode, help_: str) -> None:
        self.report.add(kind, f"the body `{body.key.node.value}` {message}", node.location, help_)
