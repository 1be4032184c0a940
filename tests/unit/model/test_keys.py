"""The JSON Schema accepts what the loader accepts, and rejects wrong structures."""

from pathlib import Path

import fastjsonschema
import pytest
import yaml

from lagcli.model.keys import keys_of
from lagcli.model.loader import MODEL, json_schema
from lagcli.settings.settings import Settings

ROOT = Path(__file__).parents[3]
MODELS = sorted((ROOT / "models").rglob("*.yaml"))
WRONG = ROOT / "tests" / "cli" / "wrong"
VALIDATE = fastjsonschema.compile(json_schema())

#: Wrong models whose error is one of structure: a key, a type, something missing.
STRUCTURE = [
    *("L_and_T", "T_missing", "constraints_as_list", "coordinates_empty", "coordinates_missing"),
    *("coordinates_twice", "coordinates_one_name", "settings", "unknown_keys", "later_keys"),
    *("view_not_a_mapping", "view_without_points", "wrong_types", "list_at_the_top"),
]


def read(path):
    return yaml.safe_load(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_the_schema_accepts_shipped_models(path):
    VALIDATE(read(path))


@pytest.mark.parametrize("name", STRUCTURE)
def test_the_schema_rejects_wrong_structures(name):
    with pytest.raises(fastjsonschema.JsonSchemaValueException):
        VALIDATE(read(WRONG / f"{name}.yaml"))


def model(**changes):
    found = {"coordinates": ["x"], "T": "x'^2", "initial": {"x": 0, "x'": 1}}
    return {**found, **changes}


def test_the_schema_accepts_vectors():
    VALIDATE(
        model(
            coordinates={"r": "point", "e": {"kind": "quaternion"}, "q[1..2]": "point"},
            functions={"f(u, v)": "u - v"},
            constraints={"pin": ["r.x", "r.y"], "weld": {"expr": [1, "r.z"]}},
            initial={"r": [0, 0, {"guess": 1}], "q[1].x'": 0, "e": {"guess": [1, 0, 0, 0]}},
        )
    )


@pytest.mark.parametrize(
    "changes",
    [
        {"energy": "x"},
        {"V": ["x"]},
        {"L": "x'^2"},
        {"coordinates": "x"},
        {"coordinates": {"x": {"units": "m"}}},
        {"parameters": {"m": {"unit": "kg"}}},
        {"outputs": {"f": {"unit": "N"}}},
        {"initial": {"x": {"guess": 0, "about": 1}}},
        {"simulation": {"method": "Euler"}},
        {"simulation": {"t_stop": 1}},
        {"view": {"rods": ["O-A"]}},
        {"view": {"points": {"O": [0, 0]}, "discs": {"d": {"center": "O"}}}},
        {"constraints": {"2x": "x = 0"}},
    ],
    ids=str,
)
def test_the_schema_rejects(changes):
    VALIDATE(model())
    with pytest.raises(fastjsonschema.JsonSchemaValueException):
        VALIDATE(model(**changes))


def test_the_schema_describes_every_key_and_setting():
    properties = json_schema()["properties"]
    assert tuple(properties) == keys_of(MODEL)
    assert all(x["description"] for x in properties.values())
    settings, _ = properties["simulation"]["anyOf"]
    assert set(settings["properties"]) == set(Settings.DECLARED)
