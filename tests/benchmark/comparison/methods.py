"""What every program of the table provides: methods, prepared once and run at a setting."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from comparison.cases import Case

Array = NDArray[np.float64]


class Solver(Protocol):
    """A method, prepared for one case."""

    def at(self, setting: float) -> Callable[[], Any]:
        """Prepare a run at a tolerance (or a step size): what is returned is timed."""
        ...

    def positions(self, result: Any) -> Array:
        """Return q at the case's sample times, in the model's coordinates, from a run's result."""
        ...


@dataclass(frozen=True)
class Method:
    """A way to integrate.

    Parameters
    ----------
    program, name : str
    prepare : callable
        Derives and compiles for a case.
    settings : callable
        Returns a case's tolerances (or step sizes), from the loosest on.
    unfit : callable
        Returns why the method is not for a case; empty if it is.
    unit : str
        What a setting is: "rtol", "h" (s).
    packages : tuple of str
        Distributions that it needs; it is left out of the table where they are not installed.
    """

    program: str
    name: str
    prepare: Callable[[Case], Solver]
    settings: Callable[[Case], Sequence[float]]
    unfit: Callable[[Case], str] = lambda case: ""
    unit: str = "rtol"
    packages: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """What the table calls it."""
        return f"{self.program} {self.name}".strip()


def stiff_only(case: Case) -> str:
    """Return why a method for stiff cases is not for a case."""
    return "" if case.stiff else "the case is not stiff"


def not_stiff(case: Case) -> str:
    """Return why a method for other cases is not for a stiff one."""
    return "the case is stiff" if case.stiff else ""


def decades(first: int, last: int) -> tuple[float, ...]:
    """Return the tolerances 10^-first, …, 10^-last."""
    return tuple(10.0**-k for k in range(first, last + 1))
