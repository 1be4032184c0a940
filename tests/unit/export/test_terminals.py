"""Terminals of FMUs, and the picture of the mechanism."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from xml.etree import ElementTree as Xml

import pytest
from fmi import Unpacked

import lagcli
from lagcli.export.terminals import Terminal, terminals, terminals_and_icons

LEVERS = """
coordinates: {x: m, phi: rad, s: m}
parameters: {m: 1 kg, J: 1 kg*m^2, r: 0.5 m, k: 1 N/m, c: 1 N*s/m,
  F: 0 N, M: 0 N*m, lever: 0 N, both: 0 N, scaled: 0 N, rest: 0 m}
T: m*(x'^2 + s'^2)/2 + J*phi'^2/2
V: k*(x - rest)^2/2
Q: {x: F + both - c*x', phi: M + lever*r, s: both + 2*scaled}
initial: {x: 0, phi: 0, s: 0, x': 0, phi': 0, s': 1}
"""


def test_inputs_that_are_the_force_along_one_coordinate_have_a_terminal() -> None:
    """Not those with a lever, at two places, with a factor, or in a potential."""
    model = lagcli.load_text(LEVERS)
    inputs = ("F", "M", "lever", "both", "scaled", "rest")
    found = [*terminals(model, inputs)]
    assert found == [Terminal("F", "x", False), Terminal("M", "phi", True)]


def test_the_power_of_a_terminal_is_that_of_the_input(tmp_path: Path) -> None:
    """The energy grows by force times velocity, as its derivative says."""
    model = lagcli.load_text(LEVERS.replace("- c*x'", ""))
    for version, file in (("2.0", "model.png"), ("3.0", "terminalsAndIcons/icon.png")):
        content = lagcli.fmu(model, version, inputs=["F", "M"])
        fmu = Unpacked(content, tmp_path / version)
        assert (file in fmu.names) == (importlib.util.find_spec("matplotlib") is not None)
    root = Xml.parse(fmu.folder / "terminalsAndIcons" / "terminalsAndIcons.xml").getroot()
    instance = fmu.instance()
    instance.begin(0.0, {"F": 3.0, "M": 2.0})
    expected = {
        "F": ("force", "velocity", "position"),
        "M": ("torque", "angular_velocity", "angle"),
    }
    power = 0.0
    instance.step(0.0, 0.5)
    for terminal in root.iter("Terminal"):
        members = {x.get("memberName"): x.get("variableName") for x in terminal}
        name = terminal.get("name", "")
        assert tuple(members) == expected[name]
        force, velocity = (instance.get(members[x])[0] for x in expected[name][:2])
        power += force * velocity
    before = instance.get("energy_total")[0]
    instance.step(0.5, 1e-6)
    assert (instance.get("energy_total")[0] - before) / 1e-6 == pytest.approx(power, rel=1e-4)
    instance.free()


def test_nothing_to_tell_is_no_file() -> None:
    assert terminals_and_icons([], icon=False) is None
    assert b"<Icon" in (terminals_and_icons([], icon=True) or b"")
    assert b"<Icon" not in (terminals_and_icons([Terminal("F", "x", False)], icon=False) or b"")


@pytest.mark.skipif(importlib.util.find_spec("matplotlib") is None, reason="no matplotlib")
def test_the_icon_is_the_mechanism(tmp_path: Path) -> None:
    """A picture with a few colours of lines, if it is wanted."""
    from PIL import Image

    fmu = Unpacked(lagcli.fmu(lagcli.load("slider_crank")), tmp_path / "a")
    picture = Image.open(fmu.folder / "model.png").convert("RGB")
    assert picture.size == (640, 480)
    assert len(picture.getcolors(1 << 16) or []) > 5
    names = Unpacked(lagcli.fmu(lagcli.load("atwood"), icon=False), tmp_path / "b").names
    assert "model.png" not in names
