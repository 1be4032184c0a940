"""Wrong models: each stored beside the expected standard error, letter by letter.

`LAGCLI_REWRITE=1 pytest tests/cli/test_wrong_models.py` rewrites the `.stderr` files. Read each
change as a newcomer would: is it clear what to fix?
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lagcli.cli.app import run

FOLDER = Path(__file__).parent / "wrong"
RIGHT = "pendulum"  # a right model, for options that are wrong
NAMES = sorted(p.stem for p in FOLDER.glob("*.yaml") if p.stem != RIGHT)

OPTIONS = {
    "set_unknown": ["--set", "lenght=2"],
    "set_far_from_all": ["--set", "tau=2"],
    "set_product": ["--set", "m=2x"],
    "set_coordinate": ["--set", "x=2"],
    "set_velocity": ["--set", "x_dot=2"],
    "set_unit": ["--set", "m=2 kgg"],
    "set_huge": ["--set", "length=1e999"],
    "set_circular": ["--set", "m=2*m"],
    "set_several": ["--set", "lenght=2", "--set", "m=1,5", "--set-initial", "z=0"],
    "set_initial_parameter": ["--set-initial", "m=2"],
    "set_initial_unknown": ["--set-initial", "z=2"],
    "set_initial_coordinate": ["--set-initial", "x=y"],
    "set_initial_twice": ["--set-initial", "x_dot=1", "--set-initial", "x'=2"],
}

SECONDS = 1.0  # of CPU time, for any wrong model


@pytest.fixture(autouse=True)
def _in_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)


@pytest.fixture(scope="module", autouse=True)
def _imported() -> None:
    """Import what a first run imports."""
    run(["simulate", "--quiet", str(FOLDER / f"{RIGHT}.yaml"), "--t-end", "0.001"])


def check(name: str, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    began = time.process_time()
    status = run(["simulate", "--quiet", *arguments])
    seconds = time.process_time() - began
    out, err = capsys.readouterr()
    golden = FOLDER / f"{name}.stderr"
    if os.environ.get("LAGCLI_REWRITE"):
        golden.write_text(err, encoding="utf-8")
    assert err == golden.read_text(encoding="utf-8")
    assert status == 2
    assert out == ""
    assert "error[" in err
    assert "Traceback" not in err
    assert seconds < SECONDS


@pytest.mark.parametrize("name", NAMES)
def test_wrong_model(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    check(name, [f"{name}.yaml"], capsys)


@pytest.mark.parametrize("name", OPTIONS)
def test_wrong_option(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    check(name, [f"{RIGHT}.yaml", *OPTIONS[name]], capsys)


def test_every_golden_text_belongs_to_a_test() -> None:
    assert len(NAMES) >= 45
    assert {p.stem for p in FOLDER.glob("*.stderr")} == {*NAMES, *OPTIONS}


def test_the_right_model_is_right(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", "--quiet", f"{RIGHT}.yaml", "--t-end", "0.01"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("name", NAMES)
def test_errors_stand_in_the_order_of_the_file(name: str) -> None:
    places = []
    for line in (FOLDER / f"{name}.stderr").read_text(encoding="utf-8").splitlines():
        if line.startswith(f"{name}.yaml:"):
            places.append(tuple(map(int, line.split(":")[1:3])))
    assert places == sorted(places)
    assert len(places) >= 1


@pytest.mark.parametrize(
    ("change", "status", "words"),
    [
        (("x: length", "x: length/2"), 2, ["inconsistent-start", "`rod`", "guess"]),
        (("x': 0", "x': 1"), 2, ["inconsistent-start", "`rod`", "differentiated", "x'"]),
        (
            ("constraints:\n", "constraints:\n  other: x^2 + y^2 = 4*length^2\n"),
            2,
            ["`other`", "residual"],
        ),
        (("V: m*g*y", "V: m*g*log(y)"), 3, ["log(y)", "y = 0"]),
    ],
)
def test_wrong_starts(
    change: tuple[str, str],
    status: int,
    words: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = Path(f"{RIGHT}.yaml").read_text(encoding="utf-8")
    assert change[0] in text
    path = tmp_path / "start.yaml"
    path.write_text(text.replace(*change), encoding="utf-8")
    assert run(["simulate", "-q", str(path)]) == status
    err = capsys.readouterr().err
    for word in words:
        assert word in err


# what is no file


def say(path: object, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    status = run(["simulate", "-q", str(path)])
    return status, capsys.readouterr().err


def test_missing_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "slider_crank.yaml").write_text("")
    status, err = say(tmp_path / "slidercrank.yaml", capsys)
    assert status == 4
    assert f"did you mean {tmp_path / 'slider_crank.yaml'}?" in err
    status, err = say(tmp_path / "slider_crank", capsys)
    assert status == 4
    assert "did you mean" in err


def test_missing_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, err = say(tmp_path / "nowhere" / "m.yaml", capsys)
    assert (status, err) == (4, f"error: there is no folder {tmp_path / 'nowhere'}\n")


def test_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, err = say(tmp_path, capsys)
    assert status == 4
    assert "is a folder" in err


def test_no_permission(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    status, err = say(f"{RIGHT}.yaml", capsys)
    assert (status, err) == (4, f"error: cannot read {RIGHT}.yaml: permission denied\n")


def test_names_that_no_file_has(capsys: pytest.CaptureFixture[str]) -> None:
    for path in ("a\0b.yaml", "x" * 5000):
        status, err = say(path, capsys)
        assert status == 4
        assert "cannot read" in err


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="no such device here")
def test_dev_null(capsys: pytest.CaptureFixture[str]) -> None:
    status, err = say("/dev/null", capsys)
    assert status == 2
    assert "contains no model" in err


# whole processes


def process(arguments: list[str], text: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "lagcli", *arguments],
        input=text,
        capture_output=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONIOENCODING": "utf-8"},
    )


def test_process_fails_as_run_does() -> None:
    done = process(["simulate", "name_misspelt.yaml"])
    assert done.returncode == 2
    assert done.stdout == b""
    assert done.stderr == Path("name_misspelt.stderr").read_bytes()


def test_standard_input() -> None:
    done = process(["simulate", "-"], Path("name_misspelt.yaml").read_bytes())
    assert done.returncode == 2
    golden = Path("name_misspelt.stderr").read_text(encoding="utf-8")
    assert done.stderr.decode() == golden.replace("name_misspelt.yaml", "<stdin>")


def test_empty_standard_input() -> None:
    done = process(["derive", "-"])
    assert done.returncode == 2
    assert b"<stdin>:1:1: error[empty-file]" in done.stderr
