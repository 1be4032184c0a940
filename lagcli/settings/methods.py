"""The integration methods, their engines and their capabilities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

FORMULATIONS = ("projection", "baumgarte", "index1")
ENGINES = ("compiled", "scipy")

_NO_BAUMGARTE = ("projection", "index1")


class Method(NamedTuple):
    """An integration method.

    Parameters
    ----------
    name : str
        Also the name of SciPy's class, for methods of the reference engine.
    description : str
        Description for the command line's help and the documentation.
    order : str
    implicit : bool
        Whether the method is implicit and needs derivatives of the equations of motion.
    dense : str
        Description of the dense output.
    formulations : mapping of engine to formulations
        The engines that have the method, and the formulations that each supports with it.
    error_order : int
        Order of the error estimate of SciPy's method, used to choose its first step; 0 for methods
        that begin at order one.
    exact : bool
        Whether it needs exact derivatives to keep its order, as Rosenbrock methods do.
    """

    name: str
    description: str
    order: str
    implicit: bool
    dense: str
    formulations: Mapping[str, tuple[str, ...]]
    error_order: int = 0
    exact: bool = False


#: Every method except `auto`, which selects one of the compiled engine.
METHODS = {
    method.name: method
    for method in (
        Method(
            name="DOP853",
            description="Dormand-Prince",
            order="8",
            implicit=False,
            dense="polynomial of order 7",
            formulations={"compiled": FORMULATIONS, "scipy": FORMULATIONS},
            error_order=7,
        ),
        Method(
            name="Taylor",
            description="power series",
            order="by the tolerance",
            implicit=False,
            dense="the power series",
            formulations={"compiled": _NO_BAUMGARTE},
        ),
        Method(
            name="Rodas5P",
            description="Rosenbrock",
            order="5",
            implicit=True,
            dense="polynomial of order 4",
            formulations={"compiled": _NO_BAUMGARTE},
            exact=True,
        ),
        Method(
            name="RK45",
            description="Dormand-Prince",
            order="5",
            implicit=False,
            dense="polynomial of order 4",
            formulations={"scipy": FORMULATIONS},
            error_order=4,
        ),
        Method(
            name="RK23",
            description="Bogacki-Shampine",
            order="3",
            implicit=False,
            dense="cubic Hermite polynomial",
            formulations={"scipy": FORMULATIONS},
            error_order=2,
        ),
        Method(
            name="Radau",
            description="Radau IIA",
            order="5",
            implicit=True,
            dense="collocation polynomial",
            formulations={"compiled": _NO_BAUMGARTE, "scipy": FORMULATIONS},
            error_order=3,
        ),
        Method(
            name="BDF",
            description="backward differentiation",
            order="1 to 5",
            implicit=True,
            dense="backward differences",
            formulations={"scipy": FORMULATIONS},
        ),
        Method(
            name="LSODA",
            description="Adams or BDF, depending on the stiffness",
            order="1 to 12",
            implicit=True,
            dense="Nordsieck array",
            formulations={"scipy": FORMULATIONS},
        ),
    )
}
#: Methods that can be requested.
METHOD_NAMES = ("auto", *METHODS)


def methods_of(engine: str) -> tuple[str, ...]:
    """Return the names of an engine's methods."""
    return tuple(name for name, method in METHODS.items() if engine in method.formulations)


def has(engine: str, method: str, formulation: str) -> bool:
    """Return whether an engine supports a method, or `auto`, with a formulation."""
    if method == "auto":
        return True
    return formulation in METHODS[method].formulations.get(engine, ())
