"""Models that others wrote, as cases: from `tests/found` and from the published problems."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import reader
from numpy.typing import NDArray

import lagcli
from comparison.cases import SAMPLES, Start
from comparison.tape_equations import TapeEquations, tape_equations
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides, resolve

Array = NDArray[np.float64]
FOUND = Path(__file__).parents[3] / "tests" / "found"
#: Part of the largest coordinate, or velocity, below which a coordinate's size is not taken.
_LEAST_SIZE = 1e-9


@dataclass(frozen=True)
class PortedCase:
    """One model.

    Parameters
    ----------
    name : str
        Of the table.
    file : str
        In `tests/found`; empty for a published problem of `cases`.
    values : mapping of str to float, optional
        Values of parameters other than the model's.
    free : tuple of str, optional
        Initial values of a published problem that are guesses.
    """

    name: str
    file: str = ""
    values: Mapping[str, float] | None = None
    free: tuple[str, ...] = ()

    @cached_property
    def text(self) -> str:
        """The text of the model."""
        if self.file:
            return (FOUND / f"{self.file}.yaml").read_text(encoding="utf-8")
        problem = reader.Case(self.name)
        start = next(r for r in problem.references if r.time == 0) if self.free else None
        text = problem.model_text(self.free, start)
        return f"{text}simulation: {{t_end: {problem.t_end!r}}}\n"

    def load(self) -> Model:
        """Read the model."""
        return lagcli.load_text(self.text, set=self.values)

    def settings(self, longer: float = 1.0, **more: Any) -> SettingsOverrides:
        """Return the settings of a run, whose duration may be several times the model's."""
        return SettingsOverrides(samples=SAMPLES, t_end=longer * self.t_end, **more)

    @cached_property
    def t_end(self) -> float:
        """End of the run, s."""
        return float(resolve(SettingsOverrides(), self.load().settings).t_end)

    @property
    def times(self) -> Array:
        """The sample times, s."""
        return np.linspace(0, self.t_end, SAMPLES)

    @cached_property
    def start(self) -> Start:
        """The initial state, and the sizes of coordinates and velocities along the motion."""
        model = self.load()
        run = lagcli.simulate(model, self.settings())
        sizes = [np.abs(x).max(axis=0) for x in (run.q, run.v)]
        sizes = [np.maximum(x, _LEAST_SIZE * x.max()) for x in sizes]
        at = np.concatenate([np.where(x > 0, x, 1.0) for x in sizes])
        return Start(run.q[0], run.v[0], model.parameter_values, 2.0 ** np.round(np.log2(at)))

    @property
    def nq(self) -> int:
        """Number of coordinates."""
        return len(self.start.q)

    @property
    def sizes(self) -> Array:
        """Sizes of q and v, powers of two."""
        assert self.start.sizes is not None
        return self.start.sizes

    @cached_property
    def equations(self) -> TapeEquations:
        """The equations that all programs are given."""
        return tape_equations(self.load(), self.settings())


CASES = {
    case.name: case
    for case in [
        PortedCase("armx5", "armx5"),
        PortedCase("beam40", "beam40"),
        PortedCase("bennett", "bennett"),
        PortedCase("bricard_a04", "bricard_a04"),
        PortedCase("condenser_microphone", "condenser_microphone"),
        PortedCase("delta_robot", "delta_robot"),
        PortedCase("door_two_hinges", "door_two_hinges"),
        PortedCase("jansen_leg", "jansen_leg"),
        PortedCase("mems_duffing", "mems_duffing"),
        PortedCase("net_rods, 3 a side", "net_rods", {"N": 3}),
        PortedCase("net_rods, 5 a side", "net_rods", {"N": 5}),
        PortedCase("press", "press"),
        PortedCase("ring100", "ring100"),
        PortedCase("sarrus", "sarrus"),
        PortedCase("stewart", "stewart"),
        PortedCase("whipple_bicycle", "whipple_bicycle"),
        PortedCase("whitworth", "whitworth"),
        PortedCase("ball_on_turntable"),
        PortedCase("bead_rotating_hoop"),
        PortedCase("car_axis"),
        PortedCase("chaplygin_sleigh"),
        PortedCase("heavy_top"),
        PortedCase("knife_edge_incline"),
        PortedCase("pendulum_chain_n10"),
        PortedCase("pendulum_iftomm_a01"),
        PortedCase("rolling_disk_steady"),
        PortedCase("slider_crank_ivptestset", free=("phi2", "x3", "phi2'", "x3'")),
        PortedCase("spherical_pendulum"),
    ]
}
