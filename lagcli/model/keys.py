"""Schemas of the entries of model files, as JSON Schema for the loader, editors and the docs.

The schema (draft-07) describes the structure: keys, and the types of their values. Expressions,
names and units are checked when a model is loaded.
"""

from __future__ import annotations

from typing import Any

from lagcli.model.model import EXTENSIONS, INTERPOLATIONS
from lagcli.settings.kinds import Choice, Flag, Names, Setting, Times, Tolerances, WholeNumber

JsonSchema = dict[str, Any]

#: A name, with dots (``crank.x``), or a family such as ``x[i = 1..N]``; primes are derivatives.
_NAME = r"^\s*[^\W\d]\w*'*\s*(\[.*\])?(\.\w+)*\s*'*\s*$"


#: A function with its arguments.
FUNCTION = r"^\s*[^\W\d]\w*\s*\([^()]+\)\s*$"


def described(description: str, value: JsonSchema) -> JsonSchema:
    """Return a schema with a description."""
    return {"description": description, **value}


def one_of(*values: JsonSchema) -> JsonSchema:
    """Return the schema of a value that fits one of several schemas."""
    return {"anyOf": list(values)}


def list_of(item: JsonSchema, at_least: int = 0) -> JsonSchema:
    """Return the schema of a list of different items."""
    return {"type": "array", "items": item, "minItems": at_least, "uniqueItems": True}


def named(value: JsonSchema) -> JsonSchema:
    """Return the schema of a mapping of declared names to values."""
    return {
        "type": "object",
        "propertyNames": {"pattern": _NAME},
        "additionalProperties": value,
    }


def mapping(properties: dict[str, JsonSchema], *required: str) -> JsonSchema:
    """Return the schema of a mapping with these keys, and which of them are required."""
    schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return {**schema, "required": list(required)} if required else schema


def keys_of(schema: JsonSchema) -> tuple[str, ...]:
    """Return the keys of a mapping, in the order of the documentation."""
    return tuple(schema["properties"])


# YAML reads 12 as a number; it is accepted as text
TEXT: JsonSchema = {"type": ["string", "number"]}
SCALAR = TEXT
EXPRESSION: JsonSchema = {"type": ["string", "number", "array"]}
EMPTY: JsonSchema = {"type": "null"}
_POINT = one_of(TEXT, list_of(TEXT))
_POINTS = one_of(TEXT, list_of(_POINT), EMPTY)
_LINES = one_of(TEXT, list_of(_POINT), named(_POINT), EMPTY)
_DESCRIPTION = described("text", TEXT)

COORDINATE = mapping(
    {
        "unit": described("SI unit", TEXT),
        "kind": described("`point` or `quaternion`", TEXT),
        "description": _DESCRIPTION,
        "latex": described("symbol in LaTeX", TEXT),
    }
)
_NUMBER = {"type": ["string", "number", "object"]}
BODY = mapping(
    {
        "mass": described("mass", _NUMBER),
        "length": described("of a rod along its x axis, with the points `a` and `b`", _NUMBER),
        "inertia": described(
            "moment of inertia about the center of mass; in space three of them, or a matrix; by"
            " default that of a rod with `length`, else none: a point mass without an angle",
            {"type": ["string", "number", "object", "array"]},
        ),
        "shape": described(
            "in space, in place of `inertia`: `box(a, b, c)`, `cylinder(r, h)` along z,"
            " `sphere(r)` or `rod(l)` along x",
            TEXT,
        ),
        "com": described("center of mass in the frame of the points; 0", EXPRESSION),
        "points": described("name → vector in the frame of the body", named(EXPRESSION)),
    }
)
#: The keys of machines, which are expanded to the others.
MACHINE = ("dimension", "gravity", "bodies", "joints", "forces")
#: A joint or force as a mapping: {kind: [A, B], key: value}.
CALL: JsonSchema = {"type": "object", "minProperties": 1}
PARAMETER = mapping(
    {
        "value": described(
            "number, number with a unit, or expression of other parameters", EXPRESSION
        ),
        "unit": described("unit of the value", TEXT),
        "min": described("lower end of the slider in `lagcli play`", TEXT),
        "max": described("upper end of the slider", TEXT),
        "description": _DESCRIPTION,
    },
    "value",
)
_ROWS = {"type": "array", "items": SCALAR, "minItems": 1}
INPUT = mapping(
    {
        "file": described("CSV file, from the folder of the model", TEXT),
        "time": described("column of the times; by default `t`", TEXT),
        "column": described("column of the values; by default the name of the input", TEXT),
        "times": described("times, instead of a file", _ROWS),
        "values": described("values at these times", _ROWS),
        "unit": described("unit of the values; by default that in the column's title", TEXT),
        "interpolation": described(
            "between the rows; by default `linear`", {"enum": list(INTERPOLATIONS)}
        ),
        "extend": described("outside the table; an error by default", {"enum": list(EXTENSIONS)}),
        "description": _DESCRIPTION,
    }
)
DEFINITION = mapping(
    {"expr": described("expression", EXPRESSION), "description": _DESCRIPTION}, "expr"
)
LIMIT = mapping(
    {
        "static": described("value while it sticks", SCALAR),
        "kinetic": described("value while it slips", SCALAR),
    },
    *("static", "kinetic"),
)
CONSTRAINT = mapping(
    {
        "expr": described("equation, or inequality with `>=` or `<=`", EXPRESSION),
        "restitution": described("coefficient of restitution of an inequality; 0", SCALAR),
        "friction": described(
            "coefficient of friction, or {`static`, `kinetic`}", one_of(SCALAR, LIMIT)
        ),
        "slip": described("sliding velocity that friction opposes", SCALAR),
        "limit": described(
            "largest |λ| of a velocity constraint, or {`static`, `kinetic`}",
            one_of(SCALAR, LIMIT),
        ),
        "active": described("`false` for a constraint that an event engages", {"type": "boolean"}),
        "description": _DESCRIPTION,
    },
    "expr",
)
_EVENT_FIELDS = mapping(
    {
        "when": described(
            "condition, or a change of a contact: `floor closes`, `opens`, `slips`, `sticks`,"
            " `impacts`",
            SCALAR,
        ),
        "every": described("instead of `when`: the period at which it happens, s", SCALAR),
        "offset": described(
            "with `every`: the time at which it first happens, s; 0 by default", SCALAR
        ),
        "stop": described("whether the run ends", {"type": "boolean"}),
        "record": described(
            "columns to write to the event table; by default all",
            one_of({"type": "boolean"}, TEXT, list_of(TEXT)),
        ),
        "set": described(
            "coordinate, velocity or parameter → new value, from the values before the event",
            {"type": "object", "additionalProperties": EXPRESSION},
        ),
        "impulse": described(
            "generalized impulses, like the forces `Q`",
            {"type": "object", "additionalProperties": EXPRESSION},
        ),
        "release": described("constraints to deactivate", one_of(TEXT, list_of(TEXT))),
        "engage": described("constraints to activate", one_of(TEXT, list_of(TEXT))),
        "times": described("maximum number of occurrences", {"type": "integer", "minimum": 1}),
        "description": _DESCRIPTION,
    }
)
EVENT = {**_EVENT_FIELDS, "oneOf": [{"required": ["when"]}, {"required": ["every"]}]}
OUTPUT = mapping(
    {
        "expr": described("expression", SCALAR),
        "unit": described("SI unit", TEXT),
        "description": _DESCRIPTION,
    },
    "expr",
)
INITIAL = mapping({"guess": described("value from which the solver starts", EXPRESSION)}, "guess")
PRESET = mapping(
    {
        "description": _DESCRIPTION,
        "parameters": described("name → value, as under `parameters`", named(SCALAR)),
        "initial": described(
            "name → value or {`guess`: value}, as under `initial`",
            named(one_of(EXPRESSION, INITIAL)),
        ),
    }
)
DISC = mapping(
    {
        "center": described("point", _POINT),
        "radius": described("expression", SCALAR),
        "angle": described("angle of the spoke", SCALAR),
        "normal": described("axis of the disc, in three dimensions", EXPRESSION),
    },
    *("center", "radius"),
)
VECTOR = mapping(
    {
        "at": described("point, or the points on which a constraint acts", _POINT),
        "velocity": described("point whose velocity is drawn", _POINT),
        "force": described("constraint whose force is drawn", TEXT),
        "components": described("the vector itself", EXPRESSION),
        "unit": described("SI unit", TEXT),
    }
)
VIEW = mapping(
    {
        "points": described(
            "name → `[x, y]` or `[x, y, z]`, or any vector expression of that length; all points"
            " of a view have the same dimension",
            named(EXPRESSION),
        ),
        "rods": described(
            "lines between points: a list (`O-A`, `O-A-B`, or `[O, A]`), or a mapping name → line",
            _LINES,
        ),
        "ropes": described("lines drawn as ropes, given like `rods`", _LINES),
        "springs": described("lines drawn as springs, given like `rods`", _LINES),
        "dampers": described("lines drawn as dampers, given like `rods`", _LINES),
        "belts": described("belts around rollers at two points, given like `rods`", _LINES),
        "discs": described(
            "name → {`center`: point, `radius`, `angle`, `normal`}; the angle rotates a spoke; the"
            " normal is for three dimensions",
            one_of(named(DISC), EMPTY),
        ),
        "grounds": described("points that are fixed to the ground", _POINTS),
        "guides": described("lines drawn as guides, given like `rods`", _LINES),
        "walls": described(
            "lines drawn as walls or floors, with hatching on the right of each, given like `rods`",
            _LINES,
        ),
        "edges": described("outlines: thin lines without joints, given like `rods`", _LINES),
        "plates": described("filled outlines of bodies, given like `rods`", _LINES),
        "sliders": described("points drawn as blocks along the nearest guide", _POINTS),
        "masses": described(
            "points drawn as masses, filled; by default those whose velocities occur in `T`:"
            " points of coordinates or definitions such as `x_A'`",
            _POINTS,
        ),
        "trails": described("points that leave a trail", _POINTS),
        "labels": described(
            "point → text, or a list of points to label with their names. By default, points with"
            " short names (`O`, `P1`, `x_A`) are labelled; `labels: []` labels none",
            one_of(list_of(_POINT), named(TEXT), EMPTY),
        ),
        "vectors": described(
            "name → {`velocity`: point}, {`at`: point, `force`: constraint} or {`at`: point,"
            " `components`: `[…, …]`}, with a `unit`",
            one_of(named(VECTOR), EMPTY),
        ),
    },
    "points",
)
MEASURED = mapping(
    {
        "file": described("CSV file, from the folder of the model", TEXT),
        "time": described("column of the times; by default `t`", TEXT),
        "set": described("parameters of this experiment: name → value", named(SCALAR)),
        "initial": described("initial values of this experiment: name → value", named(SCALAR)),
    },
    "file",
)
OBSERVED = mapping(
    {
        "column": described("column of the data; by default the name of the quantity", TEXT),
        "sigma": described("standard deviation of a measured value", SCALAR),
        "unit": described("unit of the column; by default that in its title, or SI", TEXT),
    }
)
FITTED = mapping(
    {
        "min": described("least allowed value", SCALAR),
        "max": described("largest allowed value", SCALAR),
    }
)
FIT = mapping(
    {
        "data": described(
            "{`file`, `time`, `set`, `initial`}, or a list of these",
            one_of(MEASURED, {"type": "array", "items": MEASURED, "minItems": 1}),
        ),
        "observe": described(
            "coordinate, velocity, multiplier, output or expression → {`column`, `sigma`, `unit`},"
            " or the column",
            {"type": "object", "additionalProperties": one_of(TEXT, EMPTY, OBSERVED)},
        ),
        "parameters": described(
            "parameter or initial value to be found → {`min`, `max`}",
            named(one_of(EMPTY, FITTED)),
        ),
    },
    *("data", "observe", "parameters"),
)


def of_setting(setting: Setting[Any]) -> JsonSchema:
    """Return the schema of the value of a setting of simulations."""
    match setting:
        case Choice():
            return {"enum": list(setting.choices)}
        case Flag():
            return {"type": "boolean"}
        case WholeNumber():
            return {"type": ["integer", "string"]}
        case Times():
            return list_of(SCALAR, at_least=1)
        case Names():
            return one_of(TEXT, list_of(TEXT, at_least=1))
        case Tolerances():
            return one_of(SCALAR, named(SCALAR))
    return SCALAR
