"""The settings that the core uses: `lag_settings`, in ``settings.h``, which the build writes.

The build imports this module, so it imports only the standard library.
"""

from __future__ import annotations

import math
from typing import Any

from lagcli.settings.kinds import Choice, Flag, RealNumber, Setting, WholeNumber
from lagcli.settings.settings import Settings

#: The settings by their names, which are also those of the fields.
CORE_SETTINGS = {name: x for name, x in Settings.DECLARED.items() if x.core}


def c_type(setting: Setting[Any]) -> str:
    """Return the type of a setting's field in C."""
    if isinstance(setting, WholeNumber):
        return "int64_t"
    if isinstance(setting, RealNumber):
        return "double"
    assert isinstance(setting, Choice | Flag)
    return "int"


def core_values(settings: Settings) -> dict[str, float]:
    """Return the values of the fields: of a choice its place, of a number not given NaN."""
    values = {name: getattr(settings, name) for name in CORE_SETTINGS}
    for name, setting in CORE_SETTINGS.items():
        if setting.choices:
            values[name] = setting.choices.index(values[name])
        elif values[name] is None:
            values[name] = math.nan
    return values
