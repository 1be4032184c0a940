"""lagcli: its integration, called as `lagcli.simulate` calls it, timed without the rest."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison.cases import Case
from comparison.methods import Method, decades, stiff_only
from lagcli.engine.contract import Block, IntegrationRequest, Outcome
from lagcli.engine.evaluator import Evaluator
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
        self.prepared = simulation.prepare(self.model, self.settings(1e-9))

    def settings(self, tolerance: float, **more: Any) -> Settings:
        """Return the complete settings of a run."""
        times = tuple(self.case.times)
        given = SettingsOverrides(
            times=times, rtol=tolerance, atol=tolerance, method=self.method, **more
        )
        return resolve(given, self.model.settings)

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
