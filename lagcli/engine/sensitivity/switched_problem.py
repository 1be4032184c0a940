"""Integration with derivatives of a System that switches, or whose forces jump."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lagcli.arrays import Array
from lagcli.engine.contract import IntegrationRequest, Outcome
from lagcli.engine.sensitivity.integration import Sink
from lagcli.engine.sensitivity.start import StartDerivatives
from lagcli.engine.system import System


class SwitchedProblem:
    """A System and the directions in which its motion is differentiated, for many runs.

    DOP853 takes the steps, regardless of the settings.

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
            As in `lagcli.engine.integrate.engine.integrate`.
        """
        from lagcli.engine.sensitivity.switched_run import DifferentiatedIntegration

        return DifferentiatedIntegration(
            self.system, request, start, parameters, self.names, self.scales, sink, progress
        ).run()
