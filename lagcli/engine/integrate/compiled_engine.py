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
    switches = system.switching is not None
    if system.has_kinks and request.on_event is None and not switches:
        from lagcli.engine.switching.kinks import frozen_of

        switches = frozen_of(system) is not None
    if switches:
        from lagcli.engine.integrate.switching_run import SwitchingIntegration

        return SwitchingIntegration(system, request, sink, progress).run()
    return Integration(system, request, sink, progress).run()
