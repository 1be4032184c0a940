"""The cases of the table: a model, its geometry for the other programs, a span and a start."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lagcli
from comparison import mechanisms, models
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare

Array = NDArray[np.float64]
MODELS = Path(__file__).parents[3] / "models"
#: Samples that every program returns, equally spaced, the start included.
SAMPLES = 101


@dataclass(frozen=True)
class Start:
    """A consistent initial state and the parameters' values: what every program begins from.

    Parameters
    ----------
    q, v : (nq,) arrays
    parameters : mapping of str to float
    sizes : (2 nq,) array, optional
        Sizes of q and v along the motion, for absolute tolerances; ones by default.
    """

    q: Array
    v: Array
    parameters: Mapping[str, float]
    sizes: Array | None = None


@dataclass(frozen=True)
class Case:
    """One motion.

    Parameters
    ----------
    name, title : str
    model : callable
        Returns the text of the model.
    geometry : callable
        One of `comparison.mechanisms`.
    t_end : float
        s.
    bodies : int
        Masses; 0 where their number is not what the case is about.
    stiff : bool
    """

    name: str
    title: str
    model: Callable[[], str]
    geometry: Callable[..., mechanisms.Geometry]
    t_end: float
    bodies: int = 0
    stiff: bool = False

    @property
    def times(self) -> Array:
        """The sample times, s."""
        return np.linspace(0, self.t_end, SAMPLES)

    def load(self) -> Model:
        """Read the model."""
        return lagcli.load_text(self.model())

    @cached_property
    def start(self) -> Start:
        """The consistent initial state, as lagcli finds it."""
        model = self.load()
        found = prepare(model, SettingsOverrides(t_end=self.t_end)).start
        return Start(found.state.q, found.state.v, model.parameter_values)


def _shipped(name: str) -> str:
    return (MODELS / f"{name}.yaml").read_text(encoding="utf-8")


def chain(n: int, t_end: float) -> Case:
    """Return the chain of n bodies."""
    return Case(
        f"chain_{n}",
        f"Chain of {n} bodies",
        partial(models.chain, n),
        mechanisms.chain,
        t_end,
        bodies=n,
    )


def _stiff_chain(n: int, stiffness: float, damping: float, t_end: float) -> Case:
    return Case(
        f"stiff_chain_{stiffness:.0e}".replace("e+0", "e"),
        f"Stiff chain of {n} bodies, springs {stiffness:g} N/m, dampers {damping:g} N s/m",
        partial(models.chain, n, stiffness, damping),
        mechanisms.stiff_chain,
        t_end,
        bodies=n,
        stiff=True,
    )


CASES = {
    case.name: case
    for case in [
        Case(
            "pendulum",
            "Cartesian pendulum",
            partial(_shipped, "pendulum_cartesian"),
            mechanisms.pendulum,
            10.0,
        ),
        Case(
            "slider_crank",
            "Slider-crank",
            partial(_shipped, "slider_crank"),
            mechanisms.slider_crank,
            10.0,
        ),
        Case(
            "andrews",
            "Andrews' squeezer",
            partial(_shipped, "andrews_squeezer"),
            mechanisms.andrews,
            0.05,
        ),
        chain(5, 2.0),
        chain(20, 2.0),
        chain(100, 2.0),
        chain(500, 1.0),
        _stiff_chain(10, 1e6, 1e3, 1.0),
        _stiff_chain(10, 1e8, 1e5, 1.0),
    ]
}
