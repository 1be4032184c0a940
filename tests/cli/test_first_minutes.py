"""`lagcli models`, `new` and `schema`: what a new user tries first."""

import json

import fastjsonschema
import pytest
import yaml

from lagcli.cli.app import run


@pytest.fixture
def lagcli(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        status = run(list(arguments))
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return status, out, err

    return call


def test_models_are_listed_and_printed(lagcli, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    status, out, _ = lagcli("models")
    assert status == 0
    assert max(map(len, out.splitlines())) <= 80
    assert "\nslider_crank  " in out
    found = json.loads(lagcli("models", "--json")[1])
    assert found["command"] == "models"
    assert {"atwood", "chain"} < {model["name"] for model in found["models"]}
    status, out, _ = lagcli("models", "chain")
    assert "name: chain" in out.splitlines()
    status, _, err = lagcli("models", "chian")
    assert (status, err) == (
        2,
        "error: there is no shipped model `chian`; did you mean `chain`?\n",
    )


def test_a_shipped_model_by_its_name(lagcli):
    assert "rod:  x² + y²" in lagcli("derive", "pendulum_cartesian")[1]
    assert lagcli("simulate", "atwood", "--t-end", "0.1", "-q", "-o", "a.h5")[0] == 0
    status, _, err = lagcli("derive", "atwod")
    assert status == 4
    assert "did you mean `atwood`, which is shipped with lagcli?" in err
    status, _, err = lagcli("derive", "models/atwood.yaml")  # outside a checkout
    assert status == 4
    assert "no file models/atwood.yaml; the name of the shipped model is `atwood`" in err
    status, _, err = lagcli("derive", "quite_another.yaml")
    assert status == 4
    assert "no file quite_another.yaml; `lagcli models` lists the shipped ones" in err


def test_a_new_model_runs(lagcli, tmp_path):
    status, out, err = lagcli("new", "swing.yaml")
    assert (status, out) == (0, "")
    assert "next: lagcli derive swing.yaml" in err
    assert lagcli("simulate", "swing.yaml", "-o", "swing.h5")[1].startswith("swing: completed")
    assert lagcli("animate", "swing.h5", "-o", "swing.html")[0] == 0
    status, _, err = lagcli("new", "swing.yaml")
    assert status == 4
    assert "exists already" in err
    assert lagcli("new", "swing.yaml", "--coordinates", "a,b", "--force", "-q") == (0, "", "")
    assert lagcli("simulate", "swing.yaml", "-q")[0] == 0


def test_a_copy_of_a_shipped_model(lagcli, tmp_path):
    assert lagcli("new", "sub.lag.yaml", "--from", "four_bar", "-q")[0] == 0
    assert (tmp_path / "sub.lag.yaml").read_text().count("name: sub\n") == 1
    assert lagcli("simulate", "sub.lag.yaml", "--t-end", "0.1")[1].startswith("sub: completed")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["swing"], "swing is not a YAML file; name it swing.yaml"),
        (["a.yaml", "--coordinates", "m,1"], "--coordinates m,1 cannot be the names"),
        (["a.yaml", "--from", "four_bars"], "did you mean `four_bar`?"),
        (["a.yaml", "--from", "chain", "--coordinates", "x"], "leave out --coordinates"),
    ],
)
def test_wrong_calls_of_new(lagcli, tmp_path, arguments, said):
    status, _, err = lagcli("new", *arguments)
    assert status == 2
    assert said in err
    assert not list(tmp_path.iterdir())


def test_the_schema_is_printed_and_written(lagcli, tmp_path):
    schema = json.loads(lagcli("schema")[1])
    assert schema["$schema"].startswith("http://json-schema.org/draft-07/")
    assert lagcli("schema", "-o", "lagcli.schema.json")[0] == 0
    assert json.loads((tmp_path / "lagcli.schema.json").read_text()) == schema
    lagcli("new", "swing.yaml")
    fastjsonschema.compile(schema)(yaml.safe_load((tmp_path / "swing.yaml").read_text()))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["info", "swing.yaml"], "swing.yaml is a model file, not a result; `lagcli simulate"),
        (["plot", "swing.yaml", "-o", "a.png"], "swing.yaml is a model file, not a result"),
        (["report", "swing.yaml", "-o", "a.html"], "swing.yaml is a model file, not a result"),
        (["simulate", "swing.yaml", "-o", "a.yaml"], "the suffix .yaml is not a result format"),
        (
            ["play", "swing.h5"],
            "this is a result file, not a model\n   help: `lagcli info swing.h5`",
        ),
        (
            ["derive", "swing.h5"],
            "swing.h5:1:1: error[not-text]: this is a result file",
        ),
    ],
)
def test_a_command_that_takes_the_file_is_named(lagcli, arguments, said):
    lagcli("new", "swing.yaml")
    lagcli("simulate", "swing.yaml", "-o", "swing.h5", "--samples", "2")
    status, _, err = lagcli(*arguments)
    assert status == 2
    assert said in err


@pytest.mark.parametrize(
    ("written", "help_"),
    [("xdot", "`x'`"), ("xddot", "`x''`"), ("thetadot", "`theta'`"), ("qdot[1]", "`q[1]'`")],
)
def test_velocities_of_other_notations(lagcli, tmp_path, written, help_):
    (tmp_path / "m.yaml").write_text(
        "coordinates: [x, theta, 'q[1..2]']\nT: x'^2 + theta'^2 + q[1]'^2\n"
        f"outputs: {{a: {written}}}\ninitial: {{}}\n"
    )
    status, _, err = lagcli("derive", "m.yaml")
    assert status == 2
    assert f"help: a time derivative is written with primes: {help_}" in err
