"""The engines by name, imported on first use."""

from __future__ import annotations

from lagcli.engine.contract import Engine


def engine_named(name: str) -> Engine:
    """Return an engine: ``compiled`` or ``scipy``."""
    if name == "compiled":
        from lagcli.engine.integrate import compiled_engine

        return compiled_engine.run
    from lagcli.engine.integrate import scipy_engine

    return scipy_engine.run
