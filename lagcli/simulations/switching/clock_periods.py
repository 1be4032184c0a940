"""Check the clocks of a model's events before a run."""

from __future__ import annotations

from lagcli.engine.switching.clocks import clocks_of
from lagcli.engine.system import System
from lagcli.errors import Diagnostic, ModelError
from lagcli.model.model import Model
from lagcli.settings.settings import Settings


def check_clocks(model: Model, system: System, settings: Settings) -> None:
    """Raise ModelError if a clock's period is not positive, or too short for the times of a run."""
    if system.switching is None or system.switching.clocks is None:
        return
    clocks = [event.clock for event in model.events if event.clock is not None]
    values = clocks_of(system.switching, tuple(model.parameter_values.values()))
    span = settings.t_start, settings.t_end
    faults = [
        Diagnostic("clock", fault, clock.location, "give a longer time, as in `every: 10 ms`")
        for clock, value in zip(clocks, values, strict=True)
        if (fault := value.fault(span))
    ]
    if faults:
        raise ModelError(faults)
