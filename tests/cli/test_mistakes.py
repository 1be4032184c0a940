"""Mistakes of the first days: what the program says about each, letter by letter.

`LAGCLI_REWRITE=1 pytest tests/cli/test_mistakes.py` rewrites the texts. Read each change as a
newcomer would: does it say what is wrong, where, and what to do?
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import pytest

from lagcli.cli.app import run

GOLDEN = Path(__file__).parent / "golden" / "mistakes"
MODELS = Path(__file__).parents[2] / "models"

#: Name → arguments and exit status.
MISTAKES = {
    "model_in_place_of_a_result": (["info", "model.yaml"], 2),
    "result_in_place_of_a_model": (["play", "run.h5"], 2),
    "model_animated": (["animate", "model.yaml", "-o", "film.html"], 2),
    "dot_for_prime": (["simulate", "xdot.yaml"], 2),
    "dot_for_prime_of_a_greek_letter": (["simulate", "thetadot.yaml"], 2),
    "unit_of_an_initial_value": (["simulate", "model.yaml", "--set-initial", "phi=2 degg"], 2),
    "unknown_initial_value": (["simulate", "model.yaml", "--set-initial", "phj=1"], 2),
    "unknown_parameter": (["simulate", "model.yaml", "--set", "mass=1"], 2),
    "nonholonomic_start": (["simulate", "skate.yaml"], 2),
    "no_inertia": (["simulate", "no_inertia.yaml"], 3),
    "fixed_start": (["simulate", "fixed_start.yaml"], 2),
    "unresolved_start": (["simulate", "unresolved_start.yaml"], 3),
    "redundant": (["simulate", "redundant.yaml", "--t-end", "0.1"], 0),
    "implicit_product": (["simulate", "implicit_product.yaml"], 2),
    "misspelled_model": (["simulate", "slider_krank"], 4),
    "table_in_place_of_a_model": (["derive", "table.csv"], 2),
    "prime_and_digit": (["derive", "prime_and_digit.yaml"], 2),
    "printed_index": (["derive", "printed_index.yaml"], 2),
    "differential_quotient": (["derive", "differential_quotient.yaml"], 2),
    "contact_in_the_second_kind": (["derive", "bouncing_ball", "--kind", "second"], 2),
    "sweep_to_standard_output": (["sweep", "model.yaml", "--vary", "m=1 kg,2 kg", "-o", "-"], 2),
    "singular": (["simulate", "singular.yaml", "--quiet"], 3),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("mistakes")
    for file in GOLDEN.glob("*.yaml"):
        shutil.copy(file, found)
    shutil.copy(MODELS / "slider_crank.yaml", found / "model.yaml")
    (found / "table.csv").write_text("t,x\n0,1\n", encoding="utf-8")
    arguments = ["simulate", str(found / "model.yaml"), "-o", str(found / "run.h5"), "--quiet"]
    assert run([*arguments, "--t-end", "0.1"]) == 0
    return found


@pytest.mark.parametrize("name", MISTAKES)
def test_what_is_reported(
    name: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    arguments, status = MISTAKES[name]
    capsys.readouterr()
    assert run(arguments) == status
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    said = (out + err).replace(str(folder), ".").replace(str(MODELS), "models")
    said = re.sub(
        r"(?m)^  (time|residuals|energy|method|tolerance) .*\n( {14}.*\n)*", "", said
    )  # vary
    golden = GOLDEN / f"{name}.txt"
    if os.environ.get("LAGCLI_REWRITE"):
        golden.write_text(said, encoding="utf-8")
    assert said == golden.read_text(encoding="utf-8")
    if "error[" in said:
        assert re.search(r"(?m)^(--set|\S+:\d+:\d+)", said), "no place"
        assert "help:" in said, "no remedy"
