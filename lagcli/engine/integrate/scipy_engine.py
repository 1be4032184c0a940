"""The reference engine, which integrates with SciPy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lagcli.engine.contract import Block, IntegrationRequest, Outcome, outcome
from lagcli.engine.integrate.scipy_integration import ScipyIntegration
from lagcli.engine.system import System


def run(
    system: System,
    request: IntegrationRequest,
    sink: Callable[[Block], None],
    progress: Callable[[float], None] | None = None,
) -> Outcome:
    """Integrate a System; see the contract in `lagcli.engine.contract`."""
    kind = ScipyIntegration
    switches = system.switching is not None
    if system.has_kinks and request.on_event is None and not switches:
        from lagcli.engine.switching.kinks import frozen_of

        switches = frozen_of(system) is not None
    if switches:
        from lagcli.engine.integrate.switched_integration import SwitchedIntegration

        kind = SwitchedIntegration
    return run_integration(kind(system, request, sink, progress))


def run_integration(integration: ScipyIntegration) -> Outcome:
    """Integrate, and return how the run ended and what it took."""
    # numbers that overflow are seen by what becomes of them
    with np.errstate(all="ignore"):
        found = outcome(integration.integrate)
        integration.emit()
    found.events, found.modes = integration.entries, integration.start_modes
    found.limits = integration.limits_of_events
    found.kinks = integration.kinks
    found.steps, found.rejected = integration.steps, integration.rejected
    found.evaluations = integration.motion.evaluations
    found.tolerances = integration.sizes.tolerances if integration.sizes else None
    return found
