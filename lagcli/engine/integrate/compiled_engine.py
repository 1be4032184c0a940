"""The compiled engine: steps with projection in C."""

from __future__ import annotations

from collections.abc import Callable

from lagcli.engine.contract import Block, IntegrationRequest, Outcome
from lagcli.engine.integrate.compiled_run import Integration
from lagcli.engine.system import System


def run(
    system: System,
    request: IntegrationRequest,
    sink: Callable[[Block], None],
    progress: Callable[[float], None] | None = None,
) -> Outcome:
    """Integrate a System; see the contract in `lagcli.engine.contract`."""
    if system.switching is not None or freezes(system):
        from lagcli.engine.integrate.switching_run import SwitchingIntegration

        return SwitchingIntegration(system, request, sink, progress).run()
    return Integration(system, request, sink, progress).run()


def freezes(system: System) -> bool:
    """Return whether branches of the equations are fixed within a step."""
    if not system.has_kinks:
        return False
    from lagcli.engine.switching.kinks import frozen_of

    return frozen_of(system) is not None
