"""Shipped models are found by name; files take precedence."""

import pytest

from lagcli.errors import FileError, UsageError
from lagcli.model.loader import load
from lagcli.model.shipped import find_model, shipped_model, shipped_models


def test_a_name_denotes_a_shipped_model():
    assert load("slider_crank").name == "slider_crank"
    assert load("slider_crank", set={"m": 2}).parameter_values["m"] == 2
    assert "chain" in shipped_models()


def test_a_file_takes_precedence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "chain").write_text("name: mine")
    assert find_model("chain") == find_model("./chain")
    assert find_model("atwood") == shipped_models()["atwood"]


def test_a_path_is_not_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for path in ("./atwood", "atwood.yaml", tmp_path / "atwood"):
        with pytest.raises(FileError, match="there is no file"):
            load(path)


def test_a_similar_name_is_suggested(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileError, match="did you mean `atwood`, which is shipped"):
        load("atwod")
    with pytest.raises(UsageError, match="did you mean `atwood`"):
        shipped_model("atwod")
