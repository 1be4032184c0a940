"""The units in which parameters and initial values were given, for axes and labels of results."""

from __future__ import annotations

from collections.abc import Mapping

from lagcli.errors import LagcliError
from lagcli.model.given_units import GivenUnit, given_units
from lagcli.model.loader import load_text
from lagcli.simulations.inputs import input_data
from lagcli.trajectory.samples import InputTable


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
