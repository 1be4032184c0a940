"""The units in which parameters and initial values were given, for axes and labels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from lagcli.errors import LagcliError
from lagcli.model.expression.units import read_unit, si_notation
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.simulations.inputs import input_data
from lagcli.trajectory.samples import InputTable


class GivenUnit(NamedTuple):
    """A unit of a model file that is not SI, and its value in SI."""

    unit: str
    factor: float


def given_units_of(
    text: str, path: str, inputs: Mapping[str, InputTable]
) -> Mapping[str, GivenUnit]:
    """Return the units of the text of a model; none if it is not a model of this version.

    Parameters
    ----------
    text, path : str
        The text as it is in a file, without the values of a run, and the file's name.
    inputs : mapping of str to InputTable
    """
    try:
        return given_units(load_text(text, path, data=input_data(inputs)))
    except LagcliError:
        return {}


def given_units(model: Model) -> Mapping[str, GivenUnit]:
    """Return the units of parameters and initial values that are given in others than SI."""
    stated = {name: x.unit for name, x in model.parameters.items()}
    stated |= {name: x.unit for name, x in model.initial.items()}
    return {
        name: GivenUnit(unit, float(read_unit(unit).factor))
        for name, unit in stated.items()
        if unit and float(read_unit(unit).factor) != 1.0 and si_notation(unit) != unit
    }
