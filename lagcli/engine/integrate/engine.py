"""The integration of a System, with switching or without."""

from __future__ import annotations

from collections.abc import Callable

from lagcli.engine.contract import Block, IntegrationRequest, Outcome
from lagcli.engine.integrate.run import Integration
from lagcli.engine.system import System


def integrate(
    system: System,
    request: IntegrationRequest,
    sink: Callable[[Block], None],
    progress: Callable[[float], None] | None = None,
) -> Outcome:
    """Integrate a System; numerical failure is a status with a message, never an exception.

    Parameters
    ----------
    system : System
    request : IntegrationRequest
    sink : callable
        Takes the samples in blocks, in order; if the run ends early, the samples up to then are
        emitted. An exception raised here ends the run and propagates to the caller.
    progress : callable, optional
        Called with the current time, s, several times per 0.1 s, as far as single steps and samples
        allow. May raise `Interrupted`.
    """
    if switches(system):
        from lagcli.engine.integrate.switching_run import SwitchingIntegration

        return SwitchingIntegration(system, request, sink, progress).run()
    return Integration(system, request, sink, progress).run()


def switches(system: System) -> bool:
    """Return whether a System switches: contacts, limits and events do, and branches of forces."""
    if system.switching is not None or not system.has_kinks:
        return system.switching is not None
    from lagcli.engine.switching.kinks import frozen_of

    return frozen_of(system) is not None
