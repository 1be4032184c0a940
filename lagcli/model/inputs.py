"""Inputs: known functions of time, given by tables."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import symengine as se
from symengine import Basic

from lagcli.errors import SourceLocation
from lagcli.model.expression.functions import is_opaque
from lagcli.model.model import TIME

if TYPE_CHECKING:
    from array import array

#: Interpolations between the rows of a table, and the number of finite derivatives.
INTERPOLATIONS: Mapping[str, int] = MappingProxyType({"step": 0, "linear": 1, "cubic": 3})

#: Values of an input outside its table.
EXTENSIONS = ("hold", "periodic")


class InputData(NamedTuple):
    """The table of an input, in SI units.

    Parameters
    ----------
    times, values : array of float
        Increasing times, s.
    unit : str or None
        Unit of the values in the file.
    file : str
        Path of the CSV file, as given in the model; empty for a table in the model.
    sha256 : str
        SHA-256 of the file; empty if there is none.
    """

    times: array[float]
    values: array[float]
    unit: str | None = None
    file: str = ""
    sha256: str = ""


class Input(NamedTuple):
    """A known function of time, given by a table.

    Parameters
    ----------
    name : str
    data : InputData
    interpolation : str
        One of `INTERPOLATIONS`.
    extend : str or None
        One of `EXTENSIONS`; None if the function is undefined outside the table.
    description : str, optional
    location : SourceLocation, optional
        Location of its name in the model file.
    """

    name: str
    data: InputData
    interpolation: str
    extend: str | None = None
    description: str | None = None
    location: SourceLocation | None = None

    @property
    def smoothness(self) -> int:
        """Number of times it can be differentiated."""
        return INTERPOLATIONS[self.interpolation]


def input_function(name: str, order: int = 0) -> Basic:
    """Return a known function of time, u(t), or a derivative of it."""
    found = se.Function(name)(TIME)
    for _ in range(order):
        found = found.diff(TIME)
    return found


def read_input(expression: Basic) -> tuple[str, int] | None:
    """Return the name of a known function of time and the order of its derivative.

    None for any other expression.
    """
    function, order = expression, 0
    if isinstance(expression, se.Derivative):
        function, order = expression.args[0], len(expression.args) - 1
    if is_opaque(function):
        return None
    if isinstance(function, se.FunctionSymbol) and function.args == (TIME,):
        return function.get_name(), order
    return None


def as_symbols(expression: Basic) -> Basic:
    """Return an expression with the inputs and their derivatives as symbols: u, u', u''."""
    found = {x: read_input(x) for x in expression.atoms(se.FunctionSymbol, se.Derivative)}
    return expression.xreplace(
        {x: se.Symbol(read[0] + "'" * read[1]) for x, read in found.items() if read is not None}
    )
