"""Terminals of FMUs, inputs that are forces with what they do work on, and the icon."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple
from xml.etree import ElementTree as Xml

from lagcli.columns import ColumnName
from lagcli.model.expression.functions import derivative
from lagcli.model.expression.units import read_unit
from lagcli.model.model import Model
from lagcli.model.result_units import result_units
from lagcli.pictures.scene.automatic_view import with_view
from lagcli.pictures.scene.still import still_picture
from lagcli.pictures.scene.view_evaluator import ViewEvaluator
from lagcli.simulations.simulation import Simulation

#: Size of the icon, pixels: so many that the names in the picture do not touch.
SIZE = (640, 480)
#: Half the width of the icon in the units of its coordinate system, of 0.1 mm.
_HALF = 100.0


class Terminal(NamedTuple):
    """An input that is the whole force, or torque, along one coordinate.

    Parameters
    ----------
    name : str
        The input's.
    coordinate : str
        Its velocity times the input is the power of the input.
    rotates : bool
        Whether the input is a torque.
    """

    name: str
    coordinate: str
    rotates: bool


def terminals(model: Model, inputs: Sequence[str]) -> Iterator[Terminal]:
    """Yield the inputs whose power is the input times the velocity of a coordinate.

    Others act on several coordinates, by a lever, or not by a force; no variable of the FMU is
    what they do work on.
    """
    units = result_units(model)
    others = [e for e in (model.potential, model.dissipation) if e is not None]
    for name in inputs:
        slopes = {
            q: derivative(force, symbol)
            for q, force in model.applied_forces.items()
            for symbol in force.free_symbols
            if symbol.name == name
        }
        elsewhere = any(name == symbol.name for e in others for symbol in e.free_symbols)
        if len(slopes) == 1 and not elsewhere:
            [(q, slope)] = slopes.items()
            unit = units.get(q, "")
            if slope == 1:
                yield Terminal(name, q, bool(unit) and read_unit(unit).dimension.rad != 0)


def draw_icon(simulation: Simulation) -> bytes | None:
    """Return a PNG file with the mechanism in its own run.

    None if the model has no view and none can be found, or without matplotlib, which draws it.
    """
    model = with_view(simulation.model)
    if model.view is None:
        return None
    run = simulation.trajectory()
    scene = ViewEvaluator(model).scene(vars(run), run.terms, model.parameter_values)
    return still_picture(scene, SIZE)


def terminals_and_icons(found: Sequence[Terminal], icon: bool) -> bytes | None:
    """Return terminalsAndIcons.xml; None if there is nothing to tell."""
    if not found and not icon:
        return None
    root = Xml.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    if icon:
        shown = Xml.SubElement(root, "GraphicalRepresentation")
        height = _HALF * SIZE[1] / SIZE[0]
        corners = {"x1": -_HALF, "y1": -height, "x2": _HALF, "y2": height}
        place = {name: repr(x) for name, x in corners.items()}
        Xml.SubElement(shown, "CoordinateSystem", place | {"suggestedScalingFactorTo_mm": "0.1"})
        Xml.SubElement(shown, "Icon", place)
    if found:
        listed = Xml.SubElement(root, "Terminals")
        for one in found:
            _add(listed, one)
    Xml.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, "utf-8")


def _add(listed: Xml.Element, one: Terminal) -> None:
    force, moves = ("torque", "angular velocity") if one.rotates else ("force", "velocity")
    about = f"{one.name}, a {force} on the system, and what it does work on"
    terminal = Xml.SubElement(
        listed, "Terminal", name=one.name, matchingRule="plug", description=about
    )
    members = {
        force: (one.name, "inflow"),
        moves.replace(" ", "_"): (str(ColumnName("v", coordinate=one.coordinate)), "signal"),
        "angle" if one.rotates else "position": (one.coordinate, "signal"),
    }
    for member, (variable, kind) in members.items():
        attributes = {"variableName": variable, "memberName": member, "variableKind": kind}
        Xml.SubElement(terminal, "TerminalMemberVariable", attributes)
