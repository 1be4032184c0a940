"""Integration with derivatives of a System that switches, or whose forces jump."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import IntegrationRequest, Outcome
from lagcli.engine.integrate.scipy_engine import run_integration
from lagcli.engine.sensitivity.integration import Sink
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.sensitivity.switched_tangent import SwitchedTangent
from lagcli.engine.system import System
from lagcli.settings.methods import METHODS
from lagcli.settings.settings import Settings

#: Methods of the reference engine, and the substitute for others.
_OWN = tuple(name for name, method in METHODS.items() if "scipy" in method.formulations)
_METHOD = "DOP853"


class SwitchedProblem:
    """A System and the directions in which its motion is differentiated, for many runs.

    The reference engine takes the steps, regardless of the settings.

    Parameters
    ----------
    system : System
    names : sequence of n str
        Names of the directions.
    scales : (n,) array
        Derivatives are carried with respect to θ / scale.
    """

    def __init__(self, system: System, names: Sequence[str], scales: Array):
        self.system, self.names, self.scales = system, tuple(names), scales

    def engine(self, settings: Settings) -> str:
        """Return the engine that takes the steps."""
        return "scipy"

    def integrate(
        self,
        request: IntegrationRequest,
        start: StartDerivatives,
        parameters: Array,
        sink: Sink,
        progress: Callable[[float], None] | None = None,
    ) -> Outcome:
        """Integrate the motion with its derivatives.

        Parameters
        ----------
        request : IntegrationRequest
        start : StartDerivatives
            With respect to θ / scale.
        parameters : (n, np) array
            Derivatives of the parameters with respect to θ / scale.
        sink : callable
            Takes the samples in blocks, in order.
        progress : callable, optional
            As in `lagcli.engine.contract.Engine`.
        """
        settings = request.settings
        if settings.engine != "scipy":
            method = settings.method if settings.method in _OWN else _METHOD
            request = request._replace(settings=settings.replace(engine="scipy", method=method))
        run = SwitchedTangent(
            self.system, request, start, parameters, self.names, self.scales, sink, progress
        )
        found = run_integration(run)
        found.methods = (request.settings.method,)
        found.event_changes = np.array(run.times).reshape(len(run.times), len(self.scales))
        found.notes = tuple(run.notes)
        return found
