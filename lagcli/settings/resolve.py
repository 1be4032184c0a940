"""Resolution of settings from several levels to complete ones."""

from __future__ import annotations

import math

from lagcli.errors import UsageError
from lagcli.settings.kinds import SettingError
from lagcli.settings.methods import METHODS
from lagcli.settings.settings import DEFAULTS, Settings, SettingsOverrides


def resolve(*levels: SettingsOverrides) -> Settings:
    """Return complete, checked settings.

    Parameters
    ----------
    *levels
        The highest first: those given for the run, then the model's. Defaults are the lowest level.

    Raises
    ------
    UsageError
        A value is out of its range, or the method does not support the formulation.
    """
    chosen = SettingsOverrides()
    for level in (*levels, DEFAULTS):
        chosen = chosen.over(level)
    try:
        chosen.check()
        settings = _completed(chosen)
        _check_formulation(settings)
    except SettingError as error:
        help_ = f"; {error.help}" if error.help else ""
        raise UsageError(f"{error}{help_}") from None
    return settings


def _completed(chosen: SettingsOverrides) -> Settings:
    values = {name: x.default for name, x in Settings.DECLARED.items() if x.default == math.inf}
    settings = Settings(**{**values, **chosen.as_dict()})
    if settings.times is not None:
        settings = settings.replace(t_end=settings.times[-1])
    if settings.method == "auto" and settings.formulation == "baumgarte":
        settings = settings.replace(method="DOP853")  # the only method that has it
    return settings


def _check_formulation(settings: Settings) -> None:
    """Raise SettingError if the method does not support the formulation."""
    method, formulation = settings.method, settings.formulation
    if method != "auto" and formulation not in METHODS[method].formulations:
        raise SettingError(
            "formulation",
            f"{method} has no Baumgarte stabilization",
            "give --formulation projection, or --method DOP853",
        )
