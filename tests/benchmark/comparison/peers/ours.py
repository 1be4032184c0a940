"""lagcli: its integration, called as `lagcli.simulate` calls it, timed without the rest."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison.cases import Case
from comparison.methods import Method, decades, stiff_only
from comparison.ported_cases import PortedCase
from lagcli.engine.contract import Block, IntegrationRequest, Outcome
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate import run as run_module
from lagcli.engine.integrate.methods import Methods
from lagcli.engine.integrate.prepared import find_elimination, prepare, unrolled
from lagcli.engine.integrate.run import Integration
from lagcli.engine.system import System
from lagcli.settings.methods import METHOD_NAMES
from lagcli.settings.settings import Settings, SettingsOverrides, resolve
from lagcli.simulations import simulation


class Ours:
    """Model, equations, tapes and start of a case, ready to be integrated."""

    def __init__(self, case: Case, method: str):
        self.case, self.method = case, method
        self.model = case.load()
        self.prepared = simulation.prepare(self.model, self.given(1e-9))

    def given(self, tolerance: float, **more: Any) -> SettingsOverrides:
        """Return the settings of a run that are not those of the model."""
        times = tuple(self.case.times)
        return SettingsOverrides(
            times=times, rtol=tolerance, atol=tolerance, method=self.method, **more
        )

    def settings(self, tolerance: float, **more: Any) -> Settings:
        """Return the complete settings of a run."""
        return resolve(self.given(tolerance, **more), self.model.settings)

    def at(self, setting: float, **more: Any) -> _Ready:
        """Prepare a run at a tolerance."""
        settings = self.settings(setting, **more)
        ready = replace(self.prepared, settings=settings)
        system, request = ready.system, ready.request
        # unrolled from the beginning, as for many runs: what that takes is no part of a run
        evaluator = Evaluator(system, request.state.p)
        order = request.elimination or find_elimination(evaluator, [request.state])
        prepared = unrolled(system, prepare(system, order))
        return _Ready(system, request._replace(prepared=prepared))

    def positions(self, result: tuple[Outcome, list[Block]]) -> NDArray[np.float64]:
        """Return q, once the run is seen to be complete."""
        run, blocks = result
        if run.status != "completed":
            raise RuntimeError(run.message)
        return np.concatenate([block.q for block in blocks])


class _Ready:
    """A run that is made ready again, apart from its time, before each repetition."""

    def __init__(self, system: System, request: IntegrationRequest):
        self.system, self.request = system, request
        self.make_ready()

    def make_ready(self) -> None:
        """Choose the order of elimination and put the tapes in order."""
        self.blocks: list[Block] = []
        self.integration = Integration(self.system, self.request, self.blocks.append, None)

    def __call__(self) -> tuple[Outcome, list[Block]]:
        return self.integration.run(), self.blocks


class Default:
    """A run with default options: what it prepares on its way is timed apart."""

    def __init__(self, case: PortedCase):
        self.nq = case.nq
        self.prepared = simulation.prepare(case.load(), case.settings())

    def at(self, setting: float) -> _DefaultRun:
        """Prepare a run; its tolerance is the default one."""
        assert setting == self.prepared.settings.rtol
        return _DefaultRun(self.prepared.system, self.prepared.request)

    positions = Ours.positions


class _DefaultRun(_Ready):
    """A run that notes the time in which it made programs, power series and Jacobians, s.

    Attributes
    ----------
    before, within : float
        Before the first step, and during the run.
    """

    def make_ready(self) -> None:
        """Make the run, and reset the clocks."""
        _note_preparations()
        began = time.process_time()
        super().make_ready()
        self.before = time.process_time() - began
        _spent_apart.clear()

    @property
    def within(self) -> float:
        """Seconds of the run in which it prepared something."""
        return sum(_spent_apart)


#: Seconds of the preparations of a run.
_spent_apart: list[float] = []


@cache
def _note_preparations() -> None:
    """Note the time of preparations from now on: in this process, which times nothing else."""
    for owner, name in (
        (Integration, "ready"),
        (run_module, "unrolled"),
        (Methods, "_go_on"),
    ):
        setattr(owner, name, _noted(getattr(owner, name)))


def _noted(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that notes its time."""

    def timed(*arguments: Any) -> Any:
        before, began = list(_spent_apart), time.process_time()
        try:
            return function(*arguments)
        finally:  # with what it calls, which must not count twice
            _spent_apart[:] = [*before, time.process_time() - began]

    return timed


def _default_rtol(case: PortedCase) -> tuple[float, ...]:
    return (float(resolve(case.settings(), case.load().settings).rtol),)


def _method(name: str) -> Method:
    return Method(
        "lagcli",
        name,
        lambda case: Ours(case, name),
        lambda case: decades(4, 12) if case.bodies < 100 else decades(5, 11)[::2],
        lambda case: "" if name in ("DOP853", "Taylor") else stiff_only(case),
    )


#: The stiff methods run where they are meant for.
METHODS = tuple(_method(name) for name in METHOD_NAMES)
#: Takes ported models.
DEFAULT = Method("lagcli", "default", Default, _default_rtol)
