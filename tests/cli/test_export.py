"""`lagcli export`: formats, files, refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

from lagcli.cli.app import run


def test_a_file_has_the_format_of_its_suffix(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "crank.c"
    assert run(["export", "slider_crank", "-o", str(target), "--set", "m=2"]) == 0
    text = target.read_text("utf-8")
    assert "int main(void)" in text
    assert "SHA-256" in text
    assert "slider_crank_parameters[NP + 1] = {2.0," in text
    assert "written:" in capsys.readouterr().err
    assert run(["export", "slider_crank", "-o", str(target)]) == 4


def test_code_is_printed_without_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["export", "slider_crank", "--to", "jax"]) == 0
    assert "import jax" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["slider_crank"], "name a format"),
        (["slider_crank", "-o", "x.txt"], "an exported file ends in"),
        (["bouncing_ball", "--to", "c"], "`floor` does not"),
        (["slider_crank", "--to", "rust"], "rust"),
        (["slider_crank", "-o", "my-crank.m"], "by the name of its file"),
        (["slider_crank", "-o", "2.m"], ": model.m"),
        (["slider_crank", "-o", "x.c", "--input", "tau"], "options of FMUs"),
        (["slider_crank", "-o", "x.fmu", "--input", "torque"], "unknown"),
        (["slider_crank", "-o", "x.fmu", "--wheels", "."], "there is no wheel of lagcli"),
        (["slider_crank", "-o", "x.fmu", "--wheels", "nowhere"], "nowhere"),
    ],
)
def test_a_mistake_has_status_2_and_a_remedy(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["export", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_an_fmu_is_written_once(tmp_path: Path) -> None:
    target = tmp_path / "ball.fmu"
    assert run(["export", "bouncing_ball", "-o", str(target), "--fmi", "3.0", "-q"]) == 0
    content = target.read_bytes()
    assert content.startswith(b"PK")
    assert run(["export", "bouncing_ball", "-o", str(target)]) == 4
    assert target.read_bytes() == content
