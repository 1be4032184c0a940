"""Resolution of settings from several levels to complete ones with a compatible engine and
method."""

from __future__ import annotations

import math
from importlib.util import find_spec

from lagcli.errors import UsageError
from lagcli.settings.kinds import SettingError
from lagcli.settings.methods import METHODS, has, methods_of
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
        A value is out of its range, or no engine supports the request.
    """
    chosen = SettingsOverrides()
    for level in (*levels, DEFAULTS):
        chosen = chosen.over(level)
    try:
        chosen.check()
        settings = _completed(chosen)
        _check_engine(settings)
    except SettingError as error:
        help_ = f"; {error.help}" if error.help else ""
        raise UsageError(f"{error}{help_}") from None
    return settings


def _completed(chosen: SettingsOverrides) -> Settings:
    values = {name: x.default for name, x in Settings.DECLARED.items() if x.default == math.inf}
    settings = Settings(**{**values, **chosen.as_dict()})
    if settings.times is not None:
        settings = settings.replace(t_end=settings.times[-1])
    if chosen.engine is None:
        suits = has("compiled", settings.method, settings.formulation) and compiled_available()
        settings = settings.replace(engine="compiled" if suits else "scipy")
    if settings.method == "auto" and not _chooses(settings):
        settings = settings.replace(method="DOP853")
    return settings


def _chooses(settings: Settings) -> bool:
    """Return whether `auto` can choose between several methods."""
    return settings.engine == "compiled" and settings.formulation != "baumgarte"


def compiled_available() -> bool:
    """Return whether the compiled engine was built when the package was installed."""
    return find_spec("lagcli.engine.core.binding") is not None


def _check_engine(settings: Settings) -> None:
    """Raise SettingError if the engine does not support the request."""
    method, formulation = settings.method, settings.formulation
    compiled = methods_of("compiled")
    if settings.engine != "compiled":
        if method not in methods_of("scipy"):
            raise _only_compiled(settings)
        return
    if method != "auto" and method not in compiled:
        raise SettingError(
            "engine",
            f"the compiled engine has no method {method}",
            f"its methods are {', '.join(('auto', *compiled))}; --engine scipy has it",
        )
    if not has("compiled", method, formulation):
        raise SettingError(
            "formulation",
            f"the compiled engine's {method} has no Baumgarte stabilization",
            "give --formulation projection, --method DOP853, or --engine scipy with --method Radau",
        )
    if not compiled_available():
        raise SettingError(
            "engine",
            "the compiled engine was not built: there was no C compiler at installation",
            "install one and lagcli again, or give --engine scipy",
        )


def _only_compiled(settings: Settings) -> SettingError:
    """Return the error for a method of the compiled engine that is not available."""
    method = settings.method
    other = "Radau" if METHODS[method].implicit else "DOP853"
    if settings.formulation == "baumgarte":
        return SettingError(
            "formulation",
            f"{method} has no Baumgarte stabilization",
            f"give --formulation projection, or --method {other}",
        )
    if not compiled_available():
        return SettingError(
            "method",
            f"{method} needs the compiled engine, which was not built: there was no C compiler at"
            " installation",
            f"install one and lagcli again, or give --method {other}",
        )
    return SettingError(
        "method",
        f"only the compiled engine has {method}",
        f"give --engine compiled, or --method {other}",
    )
