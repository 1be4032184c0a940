"""The integration methods and their capabilities."""

from __future__ import annotations

from typing import NamedTuple

FORMULATIONS = ("projection", "baumgarte", "index1")


class Method(NamedTuple):
    """An integration method.

    Parameters
    ----------
    name : str
    description : str
        Description for the command line's help and the documentation.
    order : str
    implicit : bool
        Whether the method is implicit and needs derivatives of the equations of motion.
    dense : str
        Description of the dense output.
    formulations : tuple of str
        The formulations that it supports.
    exact : bool
        Whether it needs exact derivatives to keep its order, as Rosenbrock methods do.
    """

    name: str
    description: str
    order: str
    implicit: bool
    dense: str
    formulations: tuple[str, ...] = ("projection", "index1")
    exact: bool = False


#: Every method except `auto`, which selects one of them.
METHODS = {
    method.name: method
    for method in (
        Method(
            name="DOP853",
            description="Dormand-Prince",
            order="8",
            implicit=False,
            dense="polynomial of order 7",
            formulations=FORMULATIONS,
        ),
        Method(
            name="Taylor",
            description="power series",
            order="by the tolerance",
            implicit=False,
            dense="the power series",
        ),
        Method(
            name="Rodas5P",
            description="Rosenbrock",
            order="5",
            implicit=True,
            dense="polynomial of order 4",
            exact=True,
        ),
        Method(
            name="Radau",
            description="Radau IIA",
            order="5",
            implicit=True,
            dense="polynomial of order 4",
        ),
    )
}
#: Methods that can be requested.
METHOD_NAMES = ("auto", *METHODS)
