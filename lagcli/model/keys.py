"""Keys of model files, declared as JSON Schema for the loader, editors and the documentation.

The schema (draft-07) describes the structure: keys, and the types of their values. Expressions,
names and units are checked when a model is loaded.
"""

from __future__ import annotations

from typing import Any

from lagcli.model.model import EXTENSIONS, INTERPOLATIONS
from lagcli.settings.kinds import Choice, Flag, Names, Setting, Times, Tolerances, WholeNumber
from lagcli.settings.settings import Settings

JsonSchema = dict[str, Any]

#: A name, or a family of names such as ``x[i = 1..N]``; primes are derivatives.
_NAME = r"^\s*[^\W\d]\w*'*\s*(\[.*\])?(\.\w+)?\s*'*\s*$"


#: A function with its arguments.
_FUNCTION = r"^\s*[^\W\d]\w*\s*\([^()]+\)\s*$"


def _described(description: str, value: JsonSchema) -> JsonSchema:
    return {"description": description, **value}


def _one_of(*values: JsonSchema) -> JsonSchema:
    return {"anyOf": list(values)}


def _list(item: JsonSchema, at_least: int = 0) -> JsonSchema:
    return {"type": "array", "items": item, "minItems": at_least, "uniqueItems": True}


def _named(value: JsonSchema) -> JsonSchema:
    return {
        "type": "object",
        "propertyNames": {"pattern": _NAME},
        "additionalProperties": value,
    }


def _mapping(properties: dict[str, JsonSchema], *required: str) -> JsonSchema:
    found = {"type": "object", "properties": properties, "additionalProperties": False}
    return {**found, "required": list(required)} if required else found


def keys_of(schema: JsonSchema) -> tuple[str, ...]:
    """Return the keys of a mapping, in the order of the documentation."""
    return tuple(schema["properties"])


# YAML reads 12 as a number; it is accepted as text
_TEXT: JsonSchema = {"type": ["string", "number"]}
_SCALAR = _TEXT
_EXPRESSION: JsonSchema = {"type": ["string", "number", "array"]}
_EMPTY: JsonSchema = {"type": "null"}
_POINT = _one_of(_TEXT, _list(_TEXT))
_POINTS = _one_of(_TEXT, _list(_POINT), _EMPTY)
_LINES = _one_of(_TEXT, _list(_POINT), _named(_POINT), _EMPTY)
_DESCRIPTION = _described("text", _TEXT)

COORDINATE = _mapping(
    {
        "unit": _described("SI unit", _TEXT),
        "kind": _described("`point` or `quaternion`", _TEXT),
        "description": _DESCRIPTION,
        "latex": _described("symbol in LaTeX", _TEXT),
    }
)
PARAMETER = _mapping(
    {
        "value": _described(
            "number, number with a unit, or expression of other parameters", _EXPRESSION
        ),
        "unit": _described("unit of the value", _TEXT),
        "description": _DESCRIPTION,
    },
    "value",
)
_ROWS = {"type": "array", "items": _SCALAR, "minItems": 1}
INPUT = _mapping(
    {
        "file": _described("CSV file, from the folder of the model", _TEXT),
        "time": _described("column of the times; by default `t`", _TEXT),
        "column": _described("column of the values; by default the name of the input", _TEXT),
        "times": _described("times, instead of a file", _ROWS),
        "values": _described("values at these times", _ROWS),
        "unit": _described("unit of the values; by default that in the column's title", _TEXT),
        "interpolation": _described(
            "between the rows; by default `linear`", {"enum": list(INTERPOLATIONS)}
        ),
        "extend": _described("outside the table; an error by default", {"enum": list(EXTENSIONS)}),
        "description": _DESCRIPTION,
    }
)
DEFINITION = _mapping(
    {"expr": _described("expression", _EXPRESSION), "description": _DESCRIPTION}, "expr"
)
LIMIT = _mapping(
    {
        "static": _described("value while it sticks", _SCALAR),
        "kinetic": _described("value while it slips", _SCALAR),
    },
    *("static", "kinetic"),
)
CONSTRAINT = _mapping(
    {
        "expr": _described("equation, or inequality with `>=` or `<=`", _EXPRESSION),
        "restitution": _described("coefficient of restitution of an inequality; 0", _SCALAR),
        "friction": _described(
            "coefficient of friction, or {`static`, `kinetic`}", _one_of(_SCALAR, LIMIT)
        ),
        "slip": _described("sliding velocity that friction opposes", _SCALAR),
        "limit": _described(
            "largest |λ| of a velocity constraint, or {`static`, `kinetic`}",
            _one_of(_SCALAR, LIMIT),
        ),
        "active": _described("`false` for a constraint that an event engages", {"type": "boolean"}),
        "description": _DESCRIPTION,
    },
    "expr",
)
_EVENT_FIELDS = _mapping(
    {
        "when": _described(
            "condition, or a change of a contact: `floor closes`, `opens`, `slips`, `sticks`,"
            " `impacts`",
            _SCALAR,
        ),
        "every": _described("instead of `when`: the period at which it happens, s", _SCALAR),
        "offset": _described(
            "with `every`: the time at which it first happens, s; 0 by default", _SCALAR
        ),
        "stop": _described("whether the run ends", {"type": "boolean"}),
        "record": _described(
            "columns to write to the event table; by default all",
            _one_of({"type": "boolean"}, _TEXT, _list(_TEXT)),
        ),
        "set": _described(
            "coordinate, velocity or parameter → new value, from the values before the event",
            {"type": "object", "additionalProperties": _EXPRESSION},
        ),
        "impulse": _described(
            "generalized impulses, like the forces `Q`",
            {"type": "object", "additionalProperties": _EXPRESSION},
        ),
        "release": _described("constraints to deactivate", _one_of(_TEXT, _list(_TEXT))),
        "engage": _described("constraints to activate", _one_of(_TEXT, _list(_TEXT))),
        "times": _described("maximum number of occurrences", {"type": "integer", "minimum": 1}),
        "description": _DESCRIPTION,
    }
)
EVENT = {**_EVENT_FIELDS, "oneOf": [{"required": ["when"]}, {"required": ["every"]}]}
OUTPUT = _mapping(
    {
        "expr": _described("expression", _SCALAR),
        "unit": _described("SI unit", _TEXT),
        "description": _DESCRIPTION,
    },
    "expr",
)
INITIAL = _mapping(
    {"guess": _described("value from which the solver starts", _EXPRESSION)}, "guess"
)
DISC = _mapping(
    {
        "center": _described("point", _POINT),
        "radius": _described("expression", _SCALAR),
        "angle": _described("angle of the spoke", _SCALAR),
        "normal": _described("axis of the disc, in three dimensions", _EXPRESSION),
    },
    *("center", "radius"),
)
VECTOR = _mapping(
    {
        "at": _described("point, or the points on which a constraint acts", _POINT),
        "velocity": _described("point whose velocity is drawn", _POINT),
        "force": _described("constraint whose force is drawn", _TEXT),
        "components": _described("the vector itself", _EXPRESSION),
        "unit": _described("SI unit", _TEXT),
    }
)
VIEW = _mapping(
    {
        "points": _described(
            "name → `[x, y]` or `[x, y, z]`, or any vector expression of that length; all points"
            " of a view have the same dimension",
            _named(_EXPRESSION),
        ),
        "rods": _described(
            "lines between points: a list (`O-A`, `O-A-B`, or `[O, A]`), or a mapping name → line",
            _LINES,
        ),
        "springs": _described("lines drawn as springs, given like `rods`", _LINES),
        "discs": _described(
            "name → {`center`: point, `radius`, `angle`, `normal`}; the angle rotates a spoke; the"
            " normal is for three dimensions",
            _one_of(_named(DISC), _EMPTY),
        ),
        "grounds": _described("points that are fixed to the ground", _POINTS),
        "guides": _described("lines drawn as guides, given like `rods`", _LINES),
        "edges": _described(
            "outlines of bodies and walls: thin lines without joints, given like `rods`", _LINES
        ),
        "trails": _described("points that leave a trail", _POINTS),
        "labels": _described(
            "point → text, or a list of points to label with their names. By default, points with"
            " short names (`O`, `P1`, `x_A`) are labelled; `labels: []` labels none",
            _one_of(_list(_POINT), _named(_TEXT), _EMPTY),
        ),
        "vectors": _described(
            "name → {`velocity`: point}, {`at`: point, `force`: constraint} or {`at`: point,"
            " `components`: `[…, …]`}, with a `unit`",
            _one_of(_named(VECTOR), _EMPTY),
        ),
    },
    "points",
)
MEASURED = _mapping(
    {
        "file": _described("CSV file, from the folder of the model", _TEXT),
        "time": _described("column of the times; by default `t`", _TEXT),
        "set": _described("parameters of this experiment: name → value", _named(_SCALAR)),
        "initial": _described("initial values of this experiment: name → value", _named(_SCALAR)),
    },
    "file",
)
OBSERVED = _mapping(
    {
        "column": _described("column of the data; by default the name of the quantity", _TEXT),
        "sigma": _described("standard deviation of a measured value", _SCALAR),
        "unit": _described("unit of the column; by default that in its title, or SI", _TEXT),
    }
)
FITTED = _mapping(
    {
        "min": _described("least allowed value", _SCALAR),
        "max": _described("largest allowed value", _SCALAR),
    }
)
FIT = _mapping(
    {
        "data": _described(
            "{`file`, `time`, `set`, `initial`}, or a list of these",
            _one_of(MEASURED, {"type": "array", "items": MEASURED, "minItems": 1}),
        ),
        "observe": _described(
            "coordinate, velocity, multiplier, output or expression → {`column`, `sigma`, `unit`},"
            " or the column",
            {"type": "object", "additionalProperties": _one_of(_TEXT, _EMPTY, OBSERVED)},
        ),
        "parameters": _described(
            "parameter or initial value to be found → {`min`, `max`}",
            _named(_one_of(_EMPTY, FITTED)),
        ),
    },
    *("data", "observe", "parameters"),
)
MODEL = _mapping(
    {
        "name": _described("text; by default the name of the file", _TEXT),
        "title": _described(
            "heading of derivations and pages; by default made from the name", _TEXT
        ),
        "description": _described("text", _TEXT),
        "coordinates": _described(
            "a list of names or families `x[1..N]`, or a mapping name → unit, kind (`point`,"
            " `quaternion`), or {`unit`, `kind`, `description`, `latex`}",
            _one_of(_list(_TEXT, at_least=1), _named(_one_of(_TEXT, _EMPTY, COORDINATE))),
        ),
        "parameters": _described(
            "name → number, number with a unit, expression of other parameters, or {`value`,"
            " `unit`, `description`}",
            _one_of(_named(_one_of(_EXPRESSION, PARAMETER)), _EMPTY),
        ),
        "functions": _described(
            "function with its arguments, `f(x, y)` → expression; expanded where it is used",
            _one_of(
                {
                    "type": "object",
                    "propertyNames": {"pattern": _FUNCTION},
                    "additionalProperties": _EXPRESSION,
                },
                _EMPTY,
            ),
        ),
        "inputs": _described(
            "name → {`file`, `time`, `column`} or {`times`, `values`}, with `unit`,"
            " `interpolation` and `extend`: known functions of time (see [Inputs](#inputs))",
            _one_of(_named(INPUT), _EMPTY),
        ),
        "definitions": _described(
            "name → expression, vector, matrix or rotation, or {`expr`, `description`}",
            _one_of(_named(_one_of(_EXPRESSION, DEFINITION)), _EMPTY),
        ),
        "T": _described("kinetic energy", _SCALAR),
        "V": _described("potential energy; a missing `V` is 0", _SCALAR),
        "L": _described("the Lagrangian, instead of `T` and `V`", _SCALAR),
        "Q": _described(
            "nonconservative forces: by coordinate, or along a definition (see [Forces](#forces))",
            _one_of(_named(_EXPRESSION), _EMPTY),
        ),
        "D": _described("a Rayleigh dissipation function: adds −∂D/∂q' to each equation", _SCALAR),
        "constraints": _described(
            "name → `lhs = rhs`, `lhs >= rhs`, `lhs <= rhs`, or an expression (`= 0`), or {`expr`,"
            " `restitution`, `friction`, `slip`, `limit`, `active`, `description`}; see"
            " [contact.md](contact.md)",
            _one_of(_named(_one_of(_EXPRESSION, CONSTRAINT)), _EMPTY),
        ),
        "initial": _described(
            "a value for every coordinate and every velocity, or {`guess`: value} (see [Initial"
            " values](#initial-values))",
            _one_of(_named(_one_of(_EXPRESSION, INITIAL)), _EMPTY),
        ),
        "outputs": _described(
            "name → expression, or {`expr`, `unit`, `description`}: additional columns of the"
            " result",
            _one_of(_named(_one_of(_SCALAR, OUTPUT)), _EMPTY),
        ),
        "events": _described(
            "name → {`when` or `every`, and actions: `stop`, `record`, `set`, `impulse`, `release`,"
            " `engage`}; see [events.md](events.md)",
            _one_of(_named(EVENT), _EMPTY),
        ),
        "simulation": _described(
            "defaults for the options of `lagcli simulate` with the same names", {}
        ),
        "view": _described(
            "a drawing of the model: points, rods, springs, discs, trails, forces; see"
            " [view.md](view.md)",
            _one_of(VIEW, _EMPTY),
        ),
        "fit": _described("measured data and quantities to fit; see [fit.md](fit.md)", FIT),
    },
    "coordinates",
)


def json_schema() -> JsonSchema:
    """Return the JSON Schema of model files."""
    settings = {x.name: _described(x.help, _setting(x)) for x in Settings.DECLARED.values()}
    properties = dict(MODEL["properties"])
    properties["simulation"] = {
        **properties["simulation"],
        **_one_of(_mapping(settings), _EMPTY),
    }
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "Model file of lagcli",
        **MODEL,
        "properties": properties,
        "oneOf": [
            {"required": ["T"], "not": {"required": ["L"]}},
            {"required": ["L"], "not": {"anyOf": [{"required": ["T"]}, {"required": ["V"]}]}},
        ],
    }


def _setting(setting: Setting[Any]) -> JsonSchema:
    match setting:
        case Choice():
            return {"enum": list(setting.choices)}
        case Flag():
            return {"type": "boolean"}
        case WholeNumber():
            return {"type": ["integer", "string"]}
        case Times():
            return _list(_SCALAR, at_least=1)
        case Names():
            return _one_of(_TEXT, _list(_TEXT, at_least=1))
        case Tolerances():
            return _one_of(_SCALAR, _named(_SCALAR))
    return _SCALAR
