"""`lagcli linearize` and `lagcli modes` from the shell."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from documented_schemas import schema

from lagcli.cli.app import run

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"
CRANK, CHAIN = str(MODELS / "slider_crank.yaml"), str(MODELS / "chain.yaml")
HANGING = ("--set", "N=3", "--set", "theta_0=0 rad")


def valid(command: str, text: str) -> dict[str, object]:
    """Return the object that a command printed, checked against its schema."""
    found = json.loads(text)
    schema(command)(found)
    assert list(found)[:2] == ["command", "model"]
    return dict(found)


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--equilibrium", "--form", "descriptor", "--output", "guide_angle"),
        ("--at", "0.05", "--input", "tau", "--output", "lambda.guide"),
    ],
)
def test_linearize_prints_json_of_its_schema(
    capsys: pytest.CaptureFixture[str], options: tuple[str, ...]
) -> None:
    options = tuple("psi" if o == "guide_angle" else o for o in options)
    assert run(["linearize", CRANK, "--json", *options]) == 0
    found = valid("linearize", capsys.readouterr().out)
    assert found["model"] == "slider_crank"


def test_modes_print_json_of_its_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["modes", CHAIN, *HANGING, "--json"]) == 0
    found = valid("modes", capsys.readouterr().out)
    assert len(found["modes"]) == 3  # type: ignore[arg-type]
    assert run(["modes", str(MODELS / "driven_slider_crank.yaml"), "--json"]) == 0
    assert valid("modes", capsys.readouterr().out)["modes"] == []


def test_text_fits_eighty_columns(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["modes", CHAIN], ["linearize", CRANK, "--equilibrium", "--input", "tau"]):
        assert run(arguments) == 0
        text = capsys.readouterr().out
        assert max(map(len, text.splitlines())) <= 80
    assert "A = " in text
    assert "B = " in text


def test_files_hold_the_same_matrices(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import h5py
    from scipy.io import loadmat

    arguments = ["linearize", CRANK, "--input", "tau", "--output", "lambda.guide"]
    assert run([*arguments, "--json"]) == 0
    expected = json.loads(capsys.readouterr().out)
    for suffix in ("json", "npz", "mat", "h5"):
        assert run([*arguments, "-o", str(tmp_path / f"linear.{suffix}"), "--quiet"]) == 0
    assert json.loads((tmp_path / "linear.json").read_text()) == expected
    held, matlab = np.load(tmp_path / "linear.npz"), loadmat(tmp_path / "linear.mat")
    with h5py.File(tmp_path / "linear.h5") as root:
        for name in "ABCD":
            for file in (held, matlab, root):
                np.testing.assert_array_equal(file[name], expected[name])
        assert json.loads(root.attrs["content"]) == expected
        assert b"slider_crank" in root.attrs["model"]
    assert held["states"].tolist() == expected["states"]
    assert [x[0][0] for x in matlab["outputs"]] == ["lambda.guide"]


def test_files_of_modes_hold_their_shapes(tmp_path: Path) -> None:
    import h5py

    for suffix in ("json", "h5"):
        assert run(["modes", CHAIN, *HANGING, "-o", str(tmp_path / f"m.{suffix}"), "-q"]) == 0
    content = json.loads((tmp_path / "m.json").read_text())
    with h5py.File(tmp_path / "m.h5") as root:
        shapes = root["position"][()]
    assert shapes.shape == (3, 6, 2)
    assert shapes[1].tolist() == list(content["modes"][1]["position"].values())


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["linearize", CRANK, "--input", "taw"], 2, "did you mean `tau`"),
        (["linearize", CRANK, "--input", "r"], 2, "enters the constraint `guide`"),
        (["linearize", CRANK, "--input", "m"], 2, "enters T"),
        (["linearize", CRANK, "--input", "tau", "--input", "tau"], 2, "twice"),
        (["linearize", CRANK, "--output", "lambda.gide"], 2, "lambda.guide"),
        (["linearize", CRANK, "-o", "linear.txt"], 2, "linear.json"),
        (["linearize", CRANK, "--at", "-1"], 2, "starts at t = 0"),
        (["linearize", CRANK, "--at", "1", "--equilibrium"], 2, "choose one"),
        (["modes", CRANK, "--steady", "phi=1"], 2, "finds no symmetry"),
        (["modes", CRANK, "--steady", "foo=1"], 2, "`foo`, which is not declared"),
        (["modes", CRANK, "--steady", "phy'=1"], 2, "did you mean `phi'`"),
        (["modes", CRANK, "--steady", "phi'=fast"], 2, "fast"),
        (["modes", CRANK, "--steady", "phi'=1"], 3, "no steady motion"),
        (["modes", CRANK, "--equilibrium", "--set", "tau=10"], 3, "no equilibrium"),
        (["modes", CRANK, "-o", "modes.npz"], 2, "modes.h5"),
    ],
)
def test_mistakes_are_explained(
    arguments: list[str], status: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments) == status
    assert said in capsys.readouterr().err


def test_a_file_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "linear.json"
    path.write_text("mine")
    assert run(["linearize", CRANK, "-o", str(path)]) == 4
    assert path.read_text() == "mine"
    assert run(["linearize", CRANK, "-o", str(path), "--force"]) == 0
    assert "written" in capsys.readouterr().out


def test_modes_are_animated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "mode.html"
    arguments = ["animate", CHAIN, *HANGING, "--mode", "2", "-o", str(page)]
    assert run([*arguments, "--amplitude", "0.05"]) == 0
    assert "181 samples" in capsys.readouterr().out
    assert "rod" in page.read_text()
    assert run([*arguments[:-3], "9", "-o", str(tmp_path / "x.html")]) == 2
    assert "3 modes" in capsys.readouterr().err
    assert run(["animate", "run.h5", "--equilibrium", "-o", str(tmp_path / "x.html")]) == 2
    assert "--mode" in capsys.readouterr().err


def test_modes_of_a_file_are_animated_as_those_of_the_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import numpy as np

    import lagcli
    from lagcli.analysis.linear.mode_motion import mode_motion, stored_mode_motion

    file, page = str(tmp_path / "modes.h5"), tmp_path / "mode.html"
    assert run(["modes", CHAIN, *HANGING, "-o", file]) == 0
    assert run(["animate", file, "--mode", "2", "-o", str(page)]) == 0
    assert "181 samples" in capsys.readouterr().out
    found = stored_mode_motion(file, 2, amplitude=0.02)
    model = lagcli.load(CHAIN, set={"N": "3"})
    expected = mode_motion(model, 2, amplitude=0.02, equilibrium=True)
    np.testing.assert_allclose(found.q, expected.q, atol=1e-12)
    np.testing.assert_allclose(found.multipliers, expected.multipliers, atol=1e-9)
    assert run(["animate", file, "--mode", "4", "-o", str(tmp_path / "x.html")]) == 2
    assert "3 modes" in capsys.readouterr().err
    assert run(["animate", file, "-o", str(tmp_path / "x.html")]) == 2
    printed = capsys.readouterr().err
    frequencies = [float(line.split()[-3]) for line in printed.splitlines() if " Hz " in line]
    zeros = np.array([0.4157745568, 2.2942803603, 6.2899450829])  # of Laguerre's polynomial L_3
    # lengths of 1/3 m; six digits are printed
    np.testing.assert_allclose(frequencies, np.sqrt(3 * 9.81 * zeros) / (2 * np.pi), rtol=2e-6)
    assert "--mode 1" in printed
    assert run(["animate", file, "--mode", "1", "--at", "1", "-o", str(tmp_path / "x.html")]) == 2
    assert "about one point" in capsys.readouterr().err
