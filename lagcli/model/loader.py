"""Model file → Model, with all its errors in one pass."""

from __future__ import annotations

import dataclasses
import hashlib
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Generic, TypeVar

import symengine as se
from symengine import Basic

from lagcli.errors import Diagnostic, FileError, ModelError, SourceLocation
from lagcli.model import model as symbols
from lagcli.model import source as yaml_source
from lagcli.model.expressions import Sized, build, number
from lagcli.model.grammar import KEYWORDS, ExpressionError, Tree, parse, parse_equation
from lagcli.model.model import (
    Constraint,
    Coordinate,
    Definition,
    InitialValue,
    Model,
    Parameter,
    SettingError,
    Settings,
)
from lagcli.model.scope import DOTS, Context, ModelScope, Names
from lagcli.model.source import MAX_BYTES, Node, Scalar, Sequence, Source, nearest, shorten
from lagcli.model.source import Mapping as MappingNode
from lagcli.model.tensors import Tensor
from lagcli.model.units import UnknownUnit, to_si

KEYS = (
    *("name", "description", "coordinates", "parameters", "definitions", "T", "V", "L", "Q", "D"),
    *("constraints", "initial", "outputs", "simulation"),
)
MAX_CHAIN = 60  # definitions that need each other; a chain evaluates recursively

LATER_KEYS = ("inputs", "events", "view")

_NAME = re.compile(r"[^\W\d_][^\W²³]*$")
_WITH_UNIT = re.compile(
    r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?![eE][+-]?\d)((?:[^\W\d_]|°|1\s*/).*)$", re.DOTALL
)


def load(
    path: str | Path,
    set: Mapping[str, object] | None = None,
    set_initial: Mapping[str, object] | None = None,
) -> Model:
    """Read and check a model file.

    Parameters
    ----------
    path : path, or "-" for standard input
    set : mapping of parameter names to values, optional
        Values that replace the file's: numbers, or text as it may stand in the file
        (``"30 deg"``, ``"2*m"``).
    set_initial : mapping of coordinate or velocity names to values, optional
        Initial values that replace the file's, and are fixed.

    Returns
    -------
    Model

    Raises
    ------
    FileError
        The file cannot be read.
    ModelError
        It is not a model; carries all diagnostics.
    """
    name = "<stdin>" if str(path) == "-" else str(path)
    try:
        if str(path) == "-":
            data = sys.stdin.buffer.read(MAX_BYTES + 1)
        else:
            with Path(path).open("rb") as file:
                data = file.read(MAX_BYTES + 1)
    except IsADirectoryError:
        raise FileError(f"{name} is a folder; name the model file in it") from None
    except FileNotFoundError:
        raise FileError(_missing(Path(path))) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"cannot read {name}: {reason}") from None
    return load_text(_decode(data, name), name, set, set_initial)


def load_text(
    text: str,
    path: str = "<text>",
    set: Mapping[str, object] | None = None,
    set_initial: Mapping[str, object] | None = None,
) -> Model:
    """Check the text of a model file; as `load`, without the file."""
    return _Loader(text, path, set or {}, set_initial or {}).model()


def _missing(path: Path) -> str:
    try:
        beside = [p.name for p in path.parent.iterdir() if p.suffix in (".yaml", ".yml")]
    except OSError:
        return f"there is no folder {path.parent}"
    close = nearest(path.name, beside)
    return f"there is no file {path}" + (f"; did you mean {path.parent / close[0]}?" if close else "")


def _decode(data: bytes, name: str) -> str:
    def refuse(message: str, help_: str) -> ModelError:
        return ModelError([Diagnostic("not-text", message, SourceLocation(name, 1, 1), help_)])

    if len(data) > MAX_BYTES:
        raise refuse(f"the file is larger than {MAX_BYTES // 10**6} MB", "a model is a short text")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise refuse(
            f"the file is not UTF-8 text: byte 0x{data[error.start]:02X} in line {line}",
            "save it as UTF-8; is it a model file at all?",
        ) from None
    for offset, char in enumerate(text):
        if ord(char) < 32 and char not in "\n\r\t":
            line = text.count("\n", 0, offset) + 1
            raise refuse(
                f"the file holds the control character 0x{ord(char):02X} in line {line}",
                "a model file is plain text; is it a model file at all?",
            )
    return text


class _Loader:
    def __init__(
        self,
        text: str,
        path: str,
        overrides: Mapping[str, object],
        initial_overrides: Mapping[str, object],
    ):
        self.source = Source(text, path)
        self.overrides = overrides
        self.initial_overrides = initial_overrides
        self.root, self.diagnostics = yaml_source.parse(self.source)
        self.names = Names()
        self.broken: set[str] = set()  # names whose own error is reported: not again where used
        self.trees: dict[str, Tree] = {}
        self.parameter_numbers: Mapping[str, Callable[[], Basic]] = {}

    # diagnostics

    def report(
        self,
        kind: str,
        message: str,
        location: SourceLocation | None,
        help_: str | None = None,
        notes: tuple[tuple[str, SourceLocation], ...] = (),
    ) -> None:
        self.diagnostics.append(Diagnostic(kind, message, location, help_, notes))

    @contextmanager
    def reporting(self, node: Node) -> Iterator[None]:
        """Turn an error in an expression into a diagnostic at its place in the file."""
        try:
            yield
        except _Broken:
            pass
        except ExpressionError as error:
            place = node.span(error.start, error.end) if isinstance(node, Scalar) else node.location
            self.report(error.kind, error.message, place, error.help)

    # the file as a whole

    def model(self) -> Model:
        root = self.root
        for name, key, _ in root:
            self._check_key(name, key)
        coordinates = self._coordinates()
        parameter_nodes = self._entries("parameters")
        definition_nodes = self._entries("definitions")
        constraint_nodes = self._entries("constraints")
        self._declare(coordinates, parameter_nodes, definition_nodes)
        self.names.constraints = tuple(
            name for name, key, _ in constraint_nodes if self._valid_name(name, key, "constraint")
        )
        parameters = self._parameters(parameter_nodes)
        definitions = self._definitions(definition_nodes)
        kinetic, potential = self._energies()
        dissipation = self._optional_scalar("D", Context("`D`"))
        forces = self._forces(definitions)
        constraints = self._constraints(constraint_nodes)
        positions, velocities = self._initial()
        outputs, output_units = self._outputs()
        settings = self._settings()
        name = self._text("name") or Path(self.source.path).stem
        description = self._text("description")
        if self.diagnostics:
            far = SourceLocation("", 0, 0)
            self.diagnostics.sort(key=lambda d: ((d.location or far).line, (d.location or far).column))
            raise ModelError(self.diagnostics)
        assert potential is not None
        return Model(
            name=name,
            description=description,
            path=self.source.path,
            text=self.source.text,
            sha256=hashlib.sha256(self.source.text.encode()).hexdigest(),
            coordinates=coordinates,
            parameters=parameters,
            definitions=definitions,
            kinetic=kinetic,
            potential=potential,
            applied_forces=forces,
            dissipation=dissipation,
            constraints=constraints,
            initial_positions=positions,
            initial_velocities=velocities,
            outputs=outputs,
            output_units=output_units,
            settings=settings,
            trees=self.trees,
        )

    def _check_key(self, name: str, key: Scalar) -> None:
        if name in KEYS:
            return
        if name in LATER_KEYS:
            self.report(
                "not-yet",
                f"the key `{name}` is not part of this version",
                key.location,
                "remove it; see docs/model-file.md for the keys of this version",
            )
            return
        close = nearest(name, list(KEYS))
        self.report(
            "unknown-key",
            f"there is no key `{shorten(name)}` in a model file",
            key.location,
            f"did you mean `{close[0]}`?" if close else "the keys are " + ", ".join(KEYS),
        )

    def _get(self, key: str) -> Node | None:
        return self.root.entries[key][1] if key in self.root.entries else None

    def _text(self, key: str) -> str | None:
        node = self._get(key)
        if node is None:
            return None
        if not isinstance(node, Scalar):
            self.report("wrong-type", f"`{key}` must be text, not {node.what}", node.location)
            return None
        return node.value

    def _entries(self, key: str) -> list[tuple[str, Scalar, Node]]:
        """Return the entries of a mapping under a key of the model; empty where it is missing."""
        node = self._get(key)
        if node is None or (isinstance(node, Scalar) and not node.value.strip()):
            return []
        if not isinstance(node, MappingNode):
            self.report(
                "wrong-type",
                f"`{key}` must be a mapping of names, not {node.what}",
                node.location,
                f"write each entry on a line of its own, as in\n{key}:\n  name: value",
            )
            return []
        return list(node)

    def _fields(
        self, node: MappingNode, what: str, known: tuple[str, ...], later: tuple[str, ...] = ()
    ) -> dict[str, Node]:
        """Return the fields of an entry that is a mapping; unknown ones are reported."""
        fields = {}
        for name, key, value in node:
            if name in known:
                fields[name] = value
            elif name in later:
                self.report(
                    "not-yet", f"`{name}` of {what} is not part of this version", key.location
                )
            else:
                close = nearest(name, list(known))
                self.report(
                    "unknown-key",
                    f"{what} has no field `{shorten(name)}`",
                    key.location,
                    f"did you mean `{close[0]}`?" if close else "the fields are " + ", ".join(known),
                )
        return fields

    def _field_text(self, fields: Mapping[str, Node], name: str) -> str | None:
        node = fields.get(name)
        if node is None:
            return None
        if isinstance(node, Scalar):
            return node.value
        self.report("wrong-type", f"`{name}` must be text, not {node.what}", node.location)
        return None

    # names

    def _valid_name(self, name: str, key: Scalar, what: str) -> bool:
        if "[" in name:
            self.report(
                "not-yet",
                f"families such as `{shorten(name)}` are not part of this version",
                key.location,
                "write the members out",
            )
        elif not _NAME.match(name) or any(c.isdigit() and not c.isascii() for c in name):
            self.report(
                "bad-name",
                f"`{shorten(name)}` cannot be the name of a {what}",
                key.location,
                "a name is a letter followed by letters, digits and _",
            )
        elif name in KEYWORDS or (name in ("t", "pi") and what not in ("constraint", "output")):
            meaning = {"t": "the time", "pi": "the number π"}.get(name, "a word of the grammar")
            self.report(
                "reserved-name",
                f"`{name}` cannot be the name of a {what}: it is {meaning}",
                key.location,
                "choose another name",
            )
        else:
            return True
        return False

    def _coordinates(self) -> tuple[Coordinate, ...]:
        node = self._get("coordinates")
        if node is None:
            place = self.source.location(0, 0)
            self.report(
                "missing-key",
                "the model declares no `coordinates`",
                place,
                "add a line such as `coordinates: [x, y]`",
            )
            return ()
        found: list[Coordinate] = []
        if isinstance(node, Sequence):
            for item in node.items:
                if not isinstance(item, Scalar):
                    self.report(
                        "wrong-type", f"a coordinate is a name, not {item.what}", item.location
                    )
                elif self._valid_name(item.value, item, "coordinate"):
                    if any(c.name == item.value for c in found):
                        self.report(
                            "duplicate-name",
                            f"the coordinate `{item.value}` stands twice in the list",
                            item.location,
                        )
                    else:
                        found.append(Coordinate(item.value, location=item.location))
        elif isinstance(node, MappingNode):
            for name, key, value in node:
                if self._valid_name(name, key, "coordinate"):
                    found.append(self._coordinate(name, key, value))
        else:
            self.report(
                "wrong-type",
                f"`coordinates` must be a list of names, not {node.what}",
                node.location,
                f"write `coordinates: [{shorten(node.value)}]`"
                if isinstance(node, Scalar) and _NAME.match(node.value)
                else "write `coordinates: [x, y]`",
            )
            return ()
        if not found and not self.diagnostics:
            self.report("missing-key", "the model has no coordinates", node.location)
        return tuple(found)

    def _coordinate(self, name: str, key: Scalar, value: Node) -> Coordinate:
        if isinstance(value, Scalar):
            unit = value.value.strip() or None
            return Coordinate(name, self._si_unit(unit, value), location=key.location)
        if not isinstance(value, MappingNode):
            self.report(
                "wrong-type",
                f"the coordinate `{name}` must be followed by a unit or a mapping",
                value.location,
            )
            return Coordinate(name, location=key.location)
        fields = self._fields(value, f"the coordinate `{name}`", ("unit", "description", "latex"))
        unit = self._field_text(fields, "unit")
        return Coordinate(
            name,
            self._si_unit(unit, fields["unit"]) if unit else None,
            self._field_text(fields, "description"),
            self._field_text(fields, "latex"),
            key.location,
        )

    def _si_unit(self, unit: str | None, node: Node) -> str | None:
        """Check a unit in which results are stated: it must be coherent SI."""
        if unit is None:
            return None
        try:
            factor = to_si(unit)
        except UnknownUnit:
            self.report("unknown-unit", f"`{shorten(unit)}` is not a unit", node.location)
            return None
        if factor != 1:
            self.report(
                "not-si",
                f"coordinates and outputs are in SI, but `{unit}` is not",
                node.location,
                "write rad, m, s, …; the values of parameters and initial states may have any unit",
            )
        return unit

    def _declare(
        self,
        coordinates: tuple[Coordinate, ...],
        parameters: list[tuple[str, Scalar, Node]],
        definitions: list[tuple[str, Scalar, Node]],
    ) -> None:
        """Enter all names, and report those declared twice."""
        places: dict[str, tuple[str, SourceLocation]] = {}
        for c in coordinates:
            assert c.location is not None
            places[c.name] = ("coordinate", c.location)
            for suffix, order in DOTS:
                places[c.name + suffix] = (f"derivative {c.name}{order * chr(39)}", c.location)
        for what, entries in (("parameter", parameters), ("definition", definitions)):
            for name, key, _ in entries:
                if name in places:
                    other, place = places[name]
                    self.report(
                        "duplicate-name",
                        f"`{shorten(name)}` is declared twice: as {other} and as {what}",
                        key.location,
                        "rename one of the two",
                        ((f"the {other} is declared here", place),),
                    )
                    self.broken.add(name)
                places[name] = (what, key.location)
        self.names.coordinates = tuple(c.name for c in coordinates)
        self.names.lines = {
            name: (what, place.line)
            for name, (what, place) in places.items()
            if not what.startswith("derivative")
        }

    # parameters

    def _parameters(self, entries: list[tuple[str, Scalar, Node]]) -> dict[str, Parameter]:
        nodes = {
            name: value for name, key, value in entries if self._valid_name(name, key, "parameter")
        }
        for name, text in self.overrides.items():
            if name not in nodes:
                self._unknown_override(name, text, list(nodes))
            else:
                override = Source(_override_text(text), f"--set {name}={text}", numbered=False)
                nodes[name] = _scalar_of(override)
        lazy: _Lazy[Parameter] = _Lazy(self, "parameter")
        context = Context("", coordinates=False, definitions=False, time=False)

        def evaluator(name: str, node: Node) -> Callable[[], Parameter]:
            where = dataclasses.replace(context, where=f"the parameter `{name}`")
            return lambda: self._parameter(name, node, where)

        for name, node in nodes.items():
            lazy.add(name, evaluator(name, node), node)
        # where a number is wanted, a parameter stands for its value; elsewhere for its symbol
        self.parameter_numbers = {
            name: (lambda name=name: se.RealDouble(lazy.get(name).value)) for name in nodes
        }
        values = lazy.all()
        self.names.parameters = {name: (lambda name=name: se.Symbol(name)) for name in nodes}
        return values

    def _unknown_override(self, name: str, text: object, known: list[str]) -> None:
        base = name.rstrip("'").removesuffix("_ddot").removesuffix("_dot")
        if base in self.names.coordinates:
            message, help_ = f"`{name}` is not a parameter", f"give --set-initial \"{name}={text}\""
        else:
            close = nearest(name, known)
            message = f"the model has no parameter `{shorten(name)}`"
            help_ = (
                "did you mean " + " or ".join(f"`{c}`" for c in close) + "?"
                if close
                else "its parameters are " + (", ".join(known) or "none")
            )
        self.report("unknown-name", message, SourceLocation(f"--set {name}={text}", 0, 0), help_)

    def _parameter(self, name: str, node: Node, context: Context) -> Parameter:
        unit = description = None
        if isinstance(node, MappingNode):
            fields = self._fields(
                node, f"the parameter `{name}`", ("value", "unit", "description")
            )
            unit = self._field_text(fields, "unit")
            description = self._field_text(fields, "description")
            if "value" not in fields:
                self.report(
                    "missing-value", f"the parameter `{name}` has no `value`", node.location
                )
                raise _Broken
            if unit is not None:
                try:
                    to_si(unit)
                except UnknownUnit:
                    self.report(
                        "unknown-unit",
                        f"`{shorten(unit)}` is not a unit",
                        fields["unit"].location,
                        _UNIT_HELP,
                    )
                    raise _Broken from None
            node = fields["value"]
        with self.reporting(node):
            value, own_unit = self._quantity(node, f"the parameter `{name}`", context, unit)
            return Parameter(name, value, own_unit or unit, description, node.value)
        raise _Broken

    def _quantity(
        self, node: Node, what: str, context: Context, unit: str | None = None
    ) -> tuple[float, str | None]:
        """Return the SI value of a number with a unit, or of an expression, and its own unit."""
        if not isinstance(node, Scalar):
            self.report(
                "wrong-type", f"{what} must be a number or an expression, not {node.what}",
                node.location,
            )
            raise _Broken
        if not node.value.strip() or node.value.strip() in ("~", "null"):
            self.report("missing-value", f"{what} has no value", node.location, "give a number")
            raise _Broken
        own_unit, text, start = None, node.value, 0
        if match := _WITH_UNIT.match(node.value):
            own_unit, text, start = match[2].strip(), match[1], match.start(1)
            try:
                factor = to_si(own_unit)
            except UnknownUnit:
                self.report(
                    "unknown-unit",
                    f"{what}: `{shorten(own_unit)}` is not a unit",
                    node.span(match.start(2), match.start(2) + len(own_unit)),
                    f"{_UNIT_HELP}; a product is written with `*`",
                )
                raise _Broken from None
        else:
            factor = to_si(unit) if unit else 1
        try:
            names = dataclasses.replace(self.names, parameters=self.parameter_numbers)
            value = build(parse(text), ModelScope(names, context)).value
        except ExpressionError as error:
            help_ = error.help
            if error.message.startswith("an operator is missing"):
                help_ = f"{help_}; an expression with a unit is {{value: 2*pi, unit: rad/s}}"
            raise ExpressionError(
                error.kind, error.message, error.start + start, error.end + start, help_
            ) from None
        if isinstance(value, Tensor):
            raise ExpressionError("shape", f"{what} must be a scalar", 0, len(node.value))
        try:
            if factor == 1:
                return number(value), own_unit
            if isinstance(value, (se.Integer, se.Rational)) and not isinstance(factor, float):
                # exact until the last step: 7 mm is 0.007 m
                exact = value * se.Rational(factor.numerator, factor.denominator)
                return number(exact), own_unit
            return number(value * float(factor)), own_unit
        except ValueError:
            raise ExpressionError(
                "not-a-number", f"{what} has no real, finite value", 0, len(node.value)
            ) from None

    # expressions of the model

    def _scalar_tree(self, node: Node, what: str) -> tuple[Scalar, Tree] | None:
        if not isinstance(node, Scalar):
            help_ = None
            if isinstance(node, Sequence):
                help_ = "quote an expression that begins with [: \"[x, y]\""
            self.report(
                "wrong-type", f"{what} must be an expression, not {node.what}", node.location, help_
            )
            return None
        if not node.value.strip():
            self.report("missing-value", f"{what} is empty", node.location, "give an expression")
            return None
        with self.reporting(node):
            return node, parse(node.value)
        return None

    def _scalar(self, scalar: Scalar, tree: Tree, context: Context) -> Basic | None:
        """Build a scalar expression; report what is wrong with it."""
        with self.reporting(scalar):
            value = build(tree, ModelScope(self.names, context)).value
            if isinstance(value, Tensor):
                raise ExpressionError(
                    "shape",
                    f"{context.where} must be a scalar, not {value.kind}",
                    tree.start,
                    tree.end,
                )
            return value
        return None

    def _optional_scalar(self, key: str, context: Context) -> Basic | None:
        node = self._get(key)
        if node is None:
            return None
        parsed = self._scalar_tree(node, f"`{key}`")
        if parsed is None:
            return None
        self.trees[key] = parsed[1]
        return self._scalar(*parsed, context)

    def _definitions(self, entries: list[tuple[str, Scalar, Node]]) -> dict[str, Definition]:
        lazy: _Lazy[Sized] = _Lazy(self, "definition")
        trees: dict[str, Tree] = {}
        descriptions: dict[str, str | None] = {}

        def evaluator(name: str, scalar: Scalar, tree: Tree) -> Callable[[], Sized]:
            context = Context(f"the definition `{name}`")

            def evaluate() -> Sized:
                with self.reporting(scalar):
                    return build(tree, ModelScope(self.names, context))
                raise _Broken

            return evaluate

        for name, key, node in entries:
            if not self._valid_name(name, key, "definition"):
                continue
            if isinstance(node, MappingNode):
                fields = self._fields(node, f"the definition `{name}`", ("expr", "description"))
                descriptions[name] = self._field_text(fields, "description")
                if "expr" not in fields:
                    self.report(
                        "missing-value", f"the definition `{name}` has no `expr`", node.location
                    )
                    self.broken.add(name)
                    lazy.add(name, _raise_broken, node)
                    continue
                node = fields["expr"]
            if isinstance(node, Sequence):
                node = self._flow_text(node)
            parsed = self._scalar_tree(node, f"the definition `{name}`")
            if parsed is None:
                lazy.add(name, _raise_broken, node)
                continue
            trees[name] = parsed[1]
            lazy.add(name, evaluator(name, *parsed), node)
        self.names.definitions = {name: (lambda name=name: lazy.get(name)) for name in lazy.makers}
        values = lazy.all()
        self.trees.update(trees)
        return {
            name: Definition(name, sized.value, trees[name], descriptions.get(name))
            for name, sized in values.items()
        }

    def _flow_text(self, node: Sequence) -> Node:
        """Return a YAML list [a, b] as the text of a vector: both mean the same."""
        lines = self.source.lines
        if node.end_line != node.line or lines[node.line][node.column] != "[":
            return node
        text = lines[node.line][node.column : node.end_column]
        return Scalar(
            node.source, node.line, node.column, node.end_line, node.end_column, text, None
        )

    def _energies(self) -> tuple[Basic | None, Basic | None]:
        """Return T (None for a model written with L) and V (−L for such a model)."""
        given = [k for k in ("T", "V", "L") if k in self.root.entries]
        if "L" in given:
            if len(given) > 1:
                key = self.root.entries["L"][0]
                self.report(
                    "contradiction",
                    f"`L` stands in place of `T` and `V`, but `{given[0]}` is given too",
                    key.location,
                    "keep either `L`, or `T` and `V`",
                )
            lagrangian = self._optional_scalar("L", Context("`L`"))
            return None, None if lagrangian is None else -lagrangian
        if "T" not in given:
            self.report(
                "missing-key",
                "the model has no kinetic energy `T`",
                self.source.location(0, 0),
                "add `T` (and `V`), or `L`",
            )
        kinetic = self._optional_scalar("T", Context("`T`"))
        potential = self._optional_scalar("V", Context("`V`"))
        if "V" not in given:
            potential = se.Integer(0)
        if potential is not None and "V" in given:
            self._check_linear_in_velocities(potential)
        return kinetic, potential

    def _check_linear_in_velocities(self, potential: Basic) -> None:
        free = potential.free_symbols
        rates = [symbols.velocity(q) for q in self.names.coordinates]
        for v in (v for v in rates if v in free):
            slope = se.expand(potential.diff(v))
            for w in rates:
                if w in slope.free_symbols:
                    self.report(
                        "nonlinear-potential",
                        f"`V` is not linear in the velocity `{w.name}`",
                        self.root.entries["V"][1].location,
                        "put what is quadratic in velocities into `T`, or write `L`",
                    )
                    return

    def _forces(self, definitions: Mapping[str, Definition]) -> dict[str, Basic]:
        """Return Q_i by coordinate: Σ F·∂r/∂q_i over the entries of `Q`."""
        terms: dict[str, list[Basic]] = {}
        for name, key, node in self._entries("Q"):
            what = f"the force on `{shorten(name)}`"
            if name not in self.names.coordinates and name not in self.names.definitions:
                close = nearest(name, [*self.names.coordinates, *self.names.definitions])
                self.report(
                    "unknown-name",
                    f"`Q` names `{shorten(name)}`, which is neither a coordinate nor a definition",
                    key.location,
                    "did you mean " + " or ".join(f"`{c}`" for c in close) + "?"
                    if close
                    else "a force acts on a coordinate, or along a definition such as x_B",
                )
                continue
            if isinstance(node, Sequence):
                node = self._flow_text(node)
            parsed = self._scalar_tree(node, what)
            if parsed is None:
                continue
            self.trees[f"Q.{name}"] = parsed[1]
            with self.reporting(parsed[0]):
                force = build(parsed[1], ModelScope(self.names, Context(what))).value
                if name in self.names.coordinates:
                    if isinstance(force, Tensor):
                        raise ExpressionError(
                            "shape", f"{what} must be a scalar", parsed[1].start, parsed[1].end
                        )
                    terms.setdefault(name, []).append(force)
                elif name in definitions:
                    self._project(force, definitions[name], what, key, parsed[1], terms)
        return {name: se.Add(*parts) for name, parts in terms.items()}

    def _project(
        self,
        force: Any,
        along: Definition,
        what: str,
        key: Scalar,
        tree: Tree,
        terms: dict[str, list[Basic]],
    ) -> None:
        """Add F·∂r/∂q_i to each Q_i."""
        place = along.value
        if isinstance(place, Tensor) != isinstance(force, Tensor) or (
            isinstance(place, Tensor) and place.shape != force.shape
        ):
            raise ExpressionError(
                "shape",
                f"{what} must have the shape of `{along.name}`",
                tree.start,
                tree.end,
                "a force along a vector is a vector of the same length",
            )
        pairs = (
            list(zip(force.entries, place.entries, strict=True))
            if isinstance(place, Tensor)
            else [(force, place)]
        )
        free = set().union(*(x.free_symbols for _, x in pairs))
        for name in self.names.coordinates:
            if symbols.velocity(name) in free:
                self.report(
                    "velocity-in-position",
                    f"a force acts along a position, but `{along.name}` depends on velocities",
                    key.location,
                )
                return
        for name in self.names.coordinates:
            q = symbols.coordinate(name)
            if q in free:
                terms.setdefault(name, []).append(se.Add(*[f * x.diff(q) for f, x in pairs]))

    # constraints

    def _constraints(self, entries: list[tuple[str, Scalar, Node]]) -> tuple[Constraint, ...]:
        found = []
        for name, key, node in entries:
            if name not in self.names.constraints:
                continue
            description = None
            if isinstance(node, MappingNode):
                fields = self._fields(
                    node,
                    f"the constraint `{name}`",
                    ("expr", "description"),
                    later=("unilateral", "restitution"),
                )
                description = self._field_text(fields, "description")
                if "expr" not in fields:
                    self.report(
                        "missing-value",
                        f"the constraint `{name}` has no `expr`",
                        key.location,
                        f"write `{name}: lhs = rhs`",
                    )
                    continue
                node = fields["expr"]
            constraint = self._constraint(name, key, node, description)
            if constraint is not None:
                found.append(constraint)
        return tuple(found)

    def _constraint(
        self, name: str, key: Scalar, node: Node, description: str | None
    ) -> Constraint | None:
        what = f"the constraint `{name}`"
        if not isinstance(node, Scalar) or not node.value.strip():
            self.report(
                "wrong-type",
                f"{what} must be an equation, not {node.what}",
                node.location,
                f"write `{name}: lhs = rhs`",
            )
            return None
        left = right = None
        with self.reporting(node):
            left, right = parse_equation(node.value)
        if left is None:
            return None
        context = Context(f"constraint `{name}`")
        sides = [self._scalar(node, side, context) for side in (left, right) if side is not None]
        if any(s is None for s in sides):
            return None
        expression = sides[0] - sides[1] if len(sides) == 2 else sides[0]
        self.trees[f"constraints.{name}.left"] = left
        free = expression.free_symbols
        rates = [v for v in map(symbols.velocity, self.names.coordinates) if v in free]
        if not rates and not any(symbols.coordinate(q) in free for q in self.names.coordinates):
            self.report(
                "no-unknowns",
                f"constraint `{name}` contains neither a coordinate nor a velocity",
                node.location,
                "it constrains nothing: remove it, or mend it",
            )
            return None
        for v in rates:
            slope = se.expand(expression.diff(v))
            bad = [w for w in rates if w in slope.free_symbols]
            if bad:
                self.report(
                    "not-yet",
                    f"constraint `{name}` is not affine in the velocity `{bad[0].name}`",
                    node.location,
                    "nonlinear velocity constraints are not part of this version",
                )
                return None
        kind: symbols.Kind = "nonholonomic" if rates else "holonomic"
        return Constraint(name, kind, expression, left, right, description, key.location)

    # the initial state

    def _initial(self) -> tuple[dict[str, InitialValue], dict[str, InitialValue]]:
        positions: dict[str, InitialValue] = {}
        velocities: dict[str, InitialValue] = {}
        seen: dict[str, Scalar] = {}
        attempted: set[str] = set()
        for name, key, node in self._entries("initial"):
            canonical = self._initial_name(name)
            if canonical is None:
                every = [n for q in self.names.coordinates for n in (q, f"{q}'")]
                close = nearest(name, every)
                self.report(
                    "unknown-name",
                    f"`initial` names `{shorten(name)}`, which is not a coordinate or a velocity",
                    key.location,
                    "did you mean " + " or ".join(f"`{c}`" for c in close) + "?" if close else None,
                )
                continue
            if canonical in seen:
                self.report(
                    "duplicate-key",
                    f"`{canonical}` has two initial values",
                    key.location,
                    "`x_dot` and `x'` are the same thing; keep one of them",
                    (("the first one is here", seen[canonical].location),),
                )
                continue
            seen[canonical] = key
            attempted.add(canonical)
            if canonical in map(self._initial_name, self.initial_overrides):
                continue
            self._initial_entry(canonical, node, positions, velocities)
        for name, text in self.initial_overrides.items():
            where = f"--set-initial {name}={text}"
            canonical = self._initial_name(name)
            if canonical is None:
                every = [n for q in self.names.coordinates for n in (q, f"{q}'")]
                close = nearest(name, every)
                help_ = f"its initial values are {', '.join(every)}"
                if name in self.names.parameters:
                    help_ = f"`{name}` is a parameter: give --set {name}={text}"
                elif close:
                    help_ = "did you mean " + " or ".join(f"`{c}`" for c in close) + "?"
                self.report(
                    "unknown-name",
                    f"the model has no initial value `{shorten(name)}`",
                    SourceLocation(where, 0, 0),
                    help_,
                )
                continue
            attempted.add(canonical)
            node = _scalar_of(Source(_override_text(text), where, numbered=False))
            self._initial_entry(canonical, node, positions, velocities)
        self._report_missing_initial(attempted)
        return positions, velocities

    def _initial_name(self, name: str) -> str | None:
        for q in self.names.coordinates:
            if name == q:
                return q
            if name in (f"{q}'", f"{q}_dot"):
                return f"{q}'"
        return None

    def _initial_entry(
        self,
        name: str,
        node: Node,
        positions: dict[str, InitialValue],
        velocities: dict[str, InitialValue],
    ) -> None:
        what = f"the initial value of `{name}`"
        fixed = True
        location = node.location
        if isinstance(node, MappingNode):
            fields = self._fields(node, what, ("guess",))
            if "guess" not in fields:
                self.report(
                    "missing-value", f"{what} needs a number or {{guess: …}}", node.location
                )
                return
            fixed, node = False, fields["guess"]
        context = Context(what, coordinates=False, definitions=False, time=False)
        if isinstance(node, Scalar):
            with self.reporting(node):
                value, _ = self._quantity(node, what, context)
                table = velocities if name.endswith("'") else positions
                table[name.rstrip("'")] = InitialValue(value, fixed, location)
        else:
            self.report(
                "wrong-type",
                f"{what} must be a number, an expression of parameters or {{guess: …}}",
                node.location,
            )

    def _report_missing_initial(self, attempted: set[str]) -> None:
        missing = [
            n for q in self.names.coordinates for n in (q, f"{q}'") if n not in attempted
        ]
        if not missing:
            return
        entry = self.root.entries.get("initial")
        self.report(
            "missing-initial",
            "no initial value for " + ", ".join(f"`{n}`" for n in missing[:12])
            + (f" and {len(missing) - 12} more" if len(missing) > 12 else ""),
            entry[0].location if entry else self.source.location(0, 0),
            "every coordinate and velocity needs a number, or {guess: …} where the constraints"
            " decide:\n"
            + ("" if entry else "initial:\n")
            + "\n".join(f"  {n}: 0" for n in missing[:12]),
        )

    # the rest

    def _outputs(self) -> tuple[dict[str, Basic], dict[str, str]]:
        found: dict[str, Basic] = {}
        units: dict[str, str] = {}
        taken = {
            *self.names.coordinates,
            *(f"{q}{s}" for q in self.names.coordinates for s, _ in DOTS),
            *("t", "time", "energy_kinetic", "energy_potential", "energy_total"),
            *("power_applied", "power_constraint", "power_time", "energy_balance"),
            "residual_equation",
        }
        for name, key, node in self._entries("outputs"):
            if not self._valid_name(name, key, "output"):
                continue
            if name in taken:
                self.report(
                    "duplicate-name",
                    f"the output `{name}` has the name of a column that every result has",
                    key.location,
                    "rename the output",
                )
                continue
            if isinstance(node, MappingNode):
                fields = self._fields(
                    node, f"the output `{name}`", ("expr", "unit", "description")
                )
                unit = self._field_text(fields, "unit")
                if unit and self._si_unit(unit, fields["unit"]):
                    units[name] = unit
                if "expr" not in fields:
                    self.report(
                        "missing-value", f"the output `{name}` has no `expr`", key.location
                    )
                    continue
                node = fields["expr"]
            parsed = self._scalar_tree(node, f"the output `{name}`")
            if parsed is None:
                continue
            context = Context(f"the output `{name}`", accelerations=True, multipliers=True)
            value = self._scalar(*parsed, context)
            if value is not None:
                found[name] = value
                self.trees[f"outputs.{name}"] = parsed[1]
        return found, units

    def _settings(self) -> Settings:
        node = self._get("simulation")
        if node is None or (isinstance(node, Scalar) and not node.value.strip()):
            return Settings()
        if not isinstance(node, MappingNode):
            self.report(
                "wrong-type", f"`simulation` must be a mapping, not {node.what}", node.location
            )
            return Settings()
        known = tuple(f.name for f in dataclasses.fields(Settings))
        fields = self._fields(node, "`simulation`", known)
        values: dict[str, Any] = {}
        for name, field in fields.items():
            if isinstance(field, Scalar):
                with self.reporting(field):
                    values[name] = self._setting(name, field)
            elif name == "times" and isinstance(field, Sequence):
                times = []
                for item in field.items:
                    if isinstance(item, Scalar):
                        with self.reporting(item):
                            times.append(self._setting_number("times", item))
                    else:
                        self.report("wrong-type", "a time is a number", item.location)
                values[name] = tuple(times)
            else:
                self.report(
                    "wrong-type", f"`{name}` must be a value, not {field.what}", field.location
                )
        settings = Settings(**values)
        try:
            settings.check()
        except SettingError as error:
            place = fields.get(error.key, node)
            self.report("bad-setting", str(error), place.location, error.help)
        return settings

    def _setting(self, name: str, node: Scalar) -> Any:
        text = node.value.strip()
        if name in ("method", "formulation", "engine"):
            return text
        if name == "through_singular":
            if text not in ("true", "false"):
                raise ExpressionError(
                    "bad-setting", f"`{name}` must be true or false", 0, len(node.value)
                )
            return text == "true"
        value = self._setting_number(name, node)
        if name in ("samples", "max_steps"):
            if value != int(value):
                raise ExpressionError(
                    "bad-setting", f"`{name}` must be a whole number", 0, len(node.value)
                )
            return int(value)
        return (value,) if name == "times" else value

    def _setting_number(self, name: str, node: Scalar) -> float:
        context = Context(f"`{name}`", coordinates=False, definitions=False, time=False)
        return self._quantity(node, f"`{name}`", context)[0]


class _Broken(Exception):
    """Something whose own error has been reported; what uses it stays silent."""


def _raise_broken() -> Any:
    raise _Broken


def _override_text(value: object) -> str:
    return repr(value) if isinstance(value, float) else str(value)


def _scalar_of(source: Source) -> Scalar:
    text = source.text
    return Scalar(source, 0, 0, 0, len(text), text, None)


_UNIT_HELP = "units are written as `kg`, `m/s^2`, `N*m`, `deg`"


Item = TypeVar("Item")


class _Lazy(Generic[Item]):
    """Named values that may need each other, evaluated once; cycles are reported."""

    def __init__(self, loader: _Loader, what: str):
        self.loader, self.what = loader, what
        self.makers: dict[str, tuple[Callable[[], Item], Node]] = {}
        self.values: dict[str, Item] = {}
        self.open: list[str] = []

    def add(self, name: str, make: Callable[[], Item], node: Node) -> None:
        """Declare a value and how to make it."""
        self.makers[name] = (make, node)

    def get(self, name: str) -> Item:
        """Return a value, making it if need be; raise _Broken if it has none."""
        if name in self.values:
            return self.values[name]
        if name in self.loader.broken:
            raise _Broken
        make, node = self.makers[name]
        if name in self.open:
            circle = [*self.open[self.open.index(name) :], name]
            self.loader.report(
                "circular",
                f"the {self.what} `{name}` is defined by itself: " + " → ".join(circle),
                node.location,
                "break the circle",
            )
            self.loader.broken.update(circle)
            raise _Broken
        if len(self.open) >= MAX_CHAIN:
            raise ExpressionError(
                "too-deep", f"{self.what}s refer to each other {MAX_CHAIN} deep", 0, 1
            )
        self.open.append(name)
        try:
            value = make()
        except _Broken:
            self.loader.broken.add(name)
            raise
        finally:
            self.open.pop()
        self.values[name] = value
        return value

    def all(self) -> dict[str, Item]:
        """Return all values that could be made, in the order of the file."""
        for name in self.makers:
            with suppress(_Broken):
                self.get(name)
        return {name: self.values[name] for name in self.makers if name in self.values}
