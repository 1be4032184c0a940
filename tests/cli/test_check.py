"""`lagcli check`: the page, the JSON object and its schema, wrong input."""

import json
from pathlib import Path

import pytest
from documented_schemas import schema

from lagcli.cli.app import run
from lagcli.errors import display_width

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"
FOUND = ROOT / "tests" / "found"
SCHEMA = json.loads((ROOT / "docs" / "schemas" / "check.json").read_text(encoding="utf-8"))
VALID = schema("check")


@pytest.fixture
def lagcli(capsys):
    def call(*arguments):
        status = run([str(x) for x in arguments])
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return status, out, err

    return call


def test_the_page_fits_eighty_columns_and_says_what_is_redundant(lagcli):
    status, out, err = lagcli("check", MODELS / "parallelogram.yaml")
    assert (status, err) == (0, "")
    assert max(map(display_width, out.splitlines())) <= 80
    assert "4 − 3 = 1" in out
    words = " ".join(out.split())
    assert "1 of right_x, right_y, middle_x, middle_y follows from the others." in words
    assert "Not unique: right_x, right_y, middle_x, middle_y." in words
    assert "the start is not an equilibrium or a motion at constant velocities" in words


@pytest.mark.parametrize(
    "name",
    ["parallelogram", "knife_edge_incline", "heavy_top", "driven_slider_crank", "andrews_squeezer"],
)
def test_the_object_follows_its_schema(lagcli, name):
    status, out, _ = lagcli("check", MODELS / f"{name}.yaml", "--json")
    assert status == 0
    found = VALID(json.loads(out))
    assert found["command"] == "check"
    assert found["model"] == name
    assert found["degrees_of_freedom"] == len(found["coordinates"]) - found["rank"]


def test_every_key_of_the_schema_is_described():
    def undescribed(node, path):
        for name, inner in node.get("properties", {}).items():
            if "description" not in inner:
                yield f"{path}/{name}"
            yield from undescribed(inner, f"{path}/{name}")
        for part in (node.get("items"), *node.get("oneOf", ())):
            if isinstance(part, dict):
                yield from undescribed(part, path)

    assert not list(undescribed(SCHEMA, ""))


def test_a_knife_edge_and_a_straight_edge(lagcli, tmp_path):
    out = lagcli("check", MODELS / "knife_edge_incline.yaml", "--json")[1]
    (skate,) = json.loads(out)["constraints"]
    assert (skate["integrable"], skate["integral"]) == ("no", None)
    model = tmp_path / "straight.yaml"
    model.write_text(
        "coordinates: [x, y]\nT: x'^2 + y'^2\nconstraints: {edge: x' = y'}\n"
        "initial: {x: 0.5, y: 0, x': 1, y': {guess: 0}}\n"
    )
    found = VALID(json.loads(lagcli("check", model, "--json")[1]))
    (edge,) = found["constraints"]
    assert (edge["integrable"], edge["integral"], edge["integral_value"]) == ("alone", "x - y", 0.5)
    assert found["start"]["moved"] == {"y'": [0.0, 1.0]}
    assert "x − y = 0.5" in lagcli("check", model)[1]


def test_values_and_initial_values_are_replaced(lagcli):
    path = MODELS / "knife_edge_incline.yaml"
    options = ("--set", "J=0.3", "--set-initial", "phi'=7", "--json")
    found = json.loads(lagcli("check", path, *options)[1])
    (spin,) = (q for q in found["conserved"]["quantities"] if q["name"] == "p_phi")
    assert spin["value"] == pytest.approx(2.1)
    assert spin["unit"] == "kg*m^2/s"
    assert "  Value at the start: 2.1 kg*m^2/s.\n" in lagcli("check", path, *options[:-1])[1]
    assert spin["symmetry"] == {"phi": "1"}


def test_an_adjusted_value_is_distinguished_from_the_given_one(lagcli, tmp_path):
    model = tmp_path / "near.yaml"
    model.write_text(
        "coordinates: [x, y]\nT: x'^2 + y'^2\nconstraints: {edge: x = -0.500000000003}\n"
        "initial: {x: {guess: -0.5}, y: 0, x': 0, y': 1}\n"
    )
    assert "x = −0.500000000003   adjusted from −0.5\n" in lagcli("check", model)[1]
    assert "x  -0.5 → -0.500000000003\n" in lagcli("simulate", model, "--t-end", "1")[1]


def test_a_model_without_a_start_is_an_error(lagcli, tmp_path):
    model = tmp_path / "torn.yaml"
    model.write_text(
        "coordinates: [x]\nT: x'^2\nconstraints: {one: x = 1, two: x = 2}\n"
        "initial: {x: {guess: 0}, x': {guess: 0}}\n"
    )
    status, out, err = lagcli("check", model)
    assert (status, out) == (2, "")
    assert f"{model}:3:15: error[contradicting-constraints]" in err
    assert lagcli("check", tmp_path / "none.yaml")[0] == 4
    assert lagcli("check", model, "--width", "5")[0] == 2
    assert lagcli("check", MODELS / "atwood.yaml", "--set", "q=1")[0] == 2


def test_a_run_monitors_what_check_finds(lagcli, tmp_path):
    target = tmp_path / "run.h5"
    options = ("--t-end", "0.1", "-o", target, "--json")
    summary = json.loads(lagcli("simulate", MODELS / "heavy_top.yaml", *options)[1])
    found = json.loads(lagcli("check", MODELS / "heavy_top.yaml", "--json")[1])
    expected = {
        q["name"]: (q["in_momenta"], q["value"])
        for q in found["conserved"]["quantities"]
        if q["kind"] == "momentum"
    }
    assert set(summary["conserved"]) == set(expected) == {"J_1", "J_2"}
    info = json.loads(lagcli("info", target, "--json")[1])
    for name, (formula, value) in expected.items():
        for said in (summary["conserved"][name], info["conserved"][name]):
            assert said["formula"] == formula
            assert said["first"] == pytest.approx(value, rel=1e-12)
            assert 0 < said["drift"] < 1e-6
    text = lagcli("info", target)[1]
    assert "conserved           J_1 = X*p_Y - Y*p_X" in text
    assert "J_2 = e0*p_e2/2" in " ".join(text.split())
    shown = lagcli("simulate", MODELS / "heavy_top.yaml", "--t-end", "0.1")[1]
    assert "conserved   J_1 = -70.3" in shown


def test_the_energy_alone_is_not_monitored(lagcli):
    summary = json.loads(lagcli("simulate", MODELS / "atwood.yaml", "--json")[1])
    assert summary["conserved"] == {}


def test_families_are_written_with_an_index(lagcli):
    status, out, _ = lagcli("check", "chain")
    assert status == 0
    assert "rod[i]:" in out
    assert "½ Σ(j=1..N) mⱼ (ẋⱼ² + ẏⱼ²)" in out
    assert "rod[3]" not in out


@pytest.mark.parametrize(
    ("name", "found"),
    [("press", []), pytest.param("sarrus", ["energy"], marks=pytest.mark.slow)],
)
def test_momenta_that_vanish_on_the_constraints_are_not_conserved_quantities(lagcli, name, found):
    out = json.loads(lagcli("check", FOUND / f"{name}.yaml", "--json")[1])
    assert [q["name"] for q in out["conserved"]["quantities"]] == found


@pytest.mark.slow
def test_four_coordinates_are_searched_for_all_symmetries(lagcli):
    out = json.loads(lagcli("check", FOUND / "bennett.yaml", "--json")[1])
    assert out["conserved"]["searched"] == "linear"


def test_next_to_a_singular_configuration_there_are_no_frequencies(lagcli):
    text = " ".join(lagcli("check", FOUND / "singular_start.yaml")[1].split())
    assert "The start is next to a singular configuration" in text
    assert "rad/s" not in text
    out = VALID(json.loads(lagcli("check", FOUND / "singular_start.yaml", "--json")[1]))
    assert (out["near_singular_start"], out["time_scales"]) == (True, None)


def test_what_is_printed_has_no_factors_of_one_and_no_rests_of_iterations(lagcli, tmp_path):
    file = tmp_path / "twice.yaml"
    file.write_text(
        "coordinates: [x, y]\n"
        "T: x'^2/2 + y'^2/2\n"
        "constraints: {one: x*y - y = 0, two: y - x*y = 0, same: 2*y*x - 2*y = 0}\n"
        "initial: {x: {guess: 1.1}, y: 2, x': 0, y': 0}\n"
    )
    status, out, _ = lagcli("check", file)
    assert status == 0
    assert "λ_one − λ_two + 2 λ_same" in out
    assert "1 λ" not in out


def test_a_common_root_divides_the_virtual_displacements_once(lagcli, tmp_path):
    file = tmp_path / "leg.yaml"
    file.write_text(
        "coordinates: [x, y]\n"
        "parameters: {l: 2}\n"
        "T: x'^2/2 + y'^2/2\n"
        "constraints: {leg: 'norm([x - 1, y, 0]) = l'}\n"
        "initial: {x: 1, y: {guess: 2}, x': 0, y': {guess: 0}}\n"
    )
    _, out, _ = lagcli("check", file)
    assert "[(x − 1) δx + y δy]/norm([x − 1, y, 0]) = 0" in out


def test_a_summary_leaves_out_the_multipliers_of_first_order_coordinates(lagcli):
    """Their λ is 0; nor has a conserved quantity that is 0 a sign."""
    status, out, err = lagcli("simulate", FOUND / "vortices.yaml", "--t-end", "0.1")
    assert (status, err) == (0, "")
    assert "conserved" in out
    assert "lambda" not in out
    assert "multipliers" not in out
    assert "= -0 " not in out
