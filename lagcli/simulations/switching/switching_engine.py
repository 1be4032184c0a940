"""Which engine runs models that switch."""

from __future__ import annotations

from lagcli.engine.integrate.engines import switches
from lagcli.engine.system import System
from lagcli.errors import Diagnostic, UsageError
from lagcli.model.model import Model
from lagcli.settings.methods import methods_of
from lagcli.settings.resolve import compiled_available
from lagcli.settings.settings import Settings


def check_engine_switches(model: Model, system: System, settings: Settings) -> None:
    """Reject models that switch on the SciPy engine, which finds no contacts, events and kinks.

    Parameters
    ----------
    model : Model
    system : System
        Its System.
    settings : Settings
        Complete settings.

    Raises
    ------
    UsageError
    """
    if settings.engine == "compiled" or not switches(system):
        return
    leaving = [c for c in model.constraints if not c.lasting]
    if leaving:
        what, location = f"`{leaving[0].name}` does not always hold", leaving[0].location
    elif model.events:
        what, location = f"`{model.events[0].name}` is an event", model.events[0].location
    else:
        what, location = "its forces have branches (`if`, `abs`, …)", None
    method, formulation = settings.method, settings.formulation
    if not compiled_available():
        help_ = "install a C compiler, and lagcli again: the compiled engine was not built"
    elif method not in methods_of("compiled"):
        help_ = f"leave out the method {method}, which only the SciPy engine has"
    elif formulation == "baumgarte" and method != "DOP853":
        help_ = "give --method DOP853, or --formulation projection"
    else:
        help_ = "leave out `engine: scipy`"
    raise UsageError(
        Diagnostic(
            "not-supported",
            f"only the compiled engine runs models that switch, and {what}",
            location,
            help_,
        )
    )
