"""Presets on the command line: the same runs as with their values, and what replaces them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.cli.app import COMMANDS, command, run
from lagcli.sweeps.file.store import open_sweep

SHORT = ("--t-end", "0.1", "--samples", "11", "--quiet")


def test_commands_with_initial_values_have_presets() -> None:
    for name in COMMANDS:
        flags = {flag for parameter in command(name).params for flag in parameter.opts}
        assert ("--set-initial" in flags) == ("--preset" in flags), name


def test_a_run_with_a_preset_is_that_with_its_values(tmp_path: Path) -> None:
    one, other = (str(tmp_path / name) for name in ("one.h5", "other.h5"))
    options = ("--set", "a=11 cm", *SHORT)
    assert run(["simulate", "four_bar", "--preset", "crossed", *options, "-o", one]) == 0
    guesses = ("--set-initial", "theta_2={guess: -0.8}", "--set-initial", "theta_3={guess: -1.5}")
    assert run(["simulate", "four_bar", *guesses, *options, "-o", other]) == 0
    found, expected = lagcli.read(one), lagcli.read(other)
    assert found.q[0, 1] < 0
    np.testing.assert_array_equal(found.q, expected.q)
    np.testing.assert_array_equal(found.multipliers, expected.multipliers)


def test_values_of_the_command_line_replace_those_of_a_preset(tmp_path: Path) -> None:
    target = str(tmp_path / "run.h5")
    preset = ("simulate", "four_bar", "--preset", "slow", *SHORT, "-o", target)
    assert run([*preset]) == 0
    assert lagcli.read(target).v[0, 0] == 4
    assert run([*preset, "--set-initial", "theta_1_dot=5", "--force"]) == 0
    assert lagcli.read(target).v[0, 0] == 5


def test_a_sweep_varies_what_a_preset_sets(tmp_path: Path) -> None:
    target = str(tmp_path / "sweep.h5")
    arguments = ("--preset", "motor", "--vary", "tau=0,0.1", "--set", "mu=5", "-o", target)
    assert run(["sweep", "four_bar", *arguments, *SHORT, "--jobs", "1"]) == 0
    with open_sweep(target) as file:
        assert file.facts["sweep"]["set"] == {"mu": "5"}
        assert file.read(file.columns[0].dataset).tolist() == [0.0, 0.1]


def test_a_preset_that_does_not_exist_is_a_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "four_bar", "--preset", "slwo"]) == 2
    assert "the model has no preset `slwo`; did you mean `slow`?" in capsys.readouterr().err
