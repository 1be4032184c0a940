"""The engines by name, imported on first use."""

from __future__ import annotations

from lagcli.engine.contract import Engine
from lagcli.engine.system import System


def engine_named(name: str) -> Engine:
    """Return an engine: ``compiled`` or ``scipy``."""
    if name == "compiled":
        from lagcli.engine.integrate import compiled_engine

        return compiled_engine.run
    from lagcli.engine.integrate import scipy_engine

    return scipy_engine.run


def switches(system: System) -> bool:
    """Return whether a System switches, which only the compiled engine supports.

    Contacts, limits and events of the model do, and branches of forces.
    """
    if system.switching is not None or not system.has_kinks:
        return system.switching is not None
    from lagcli.engine.switching.kinks import frozen_of

    return frozen_of(system) is not None
