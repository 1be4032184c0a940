"""The SciPy engine, for Systems that do not switch."""

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
    """Integrate a System without ``switching``; see the contract in `lagcli.engine.contract`."""
    assert system.switching is None, "only the compiled engine has contacts and events"
    integration = ScipyIntegration(system, request, sink, progress)
    # numbers that overflow are seen by what becomes of them
    with np.errstate(all="ignore"):
        found = outcome(integration.integrate)
        integration.emit()
    found.steps, found.rejected = integration.steps, integration.rejected
    found.evaluations = integration.motion.evaluations
    found.tolerances = integration.sizes.tolerances if integration.sizes else None
    return found
