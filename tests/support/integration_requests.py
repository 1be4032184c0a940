"""Integration requests that differ from others."""

from __future__ import annotations

from typing import Any

from lagcli.engine.contract import IntegrationRequest


def changed(request: IntegrationRequest, **changes: Any) -> IntegrationRequest:
    """Return a request with other fields or settings."""
    settings = {k: x for k, x in changes.items() if k in request.settings.DECLARED and k != "times"}
    fields = {k: x for k, x in changes.items() if k not in settings}
    fields.setdefault("settings", request.settings.replace(**settings))
    return request._replace(**fields)
