"""Settings made complete and checked: engine, method, sample times, tolerances."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from lagcli.engine.contract import Engine
from lagcli.errors import UsageError
from lagcli.model.model import DEFAULTS, Model, SettingError, Settings

Array = NDArray[np.float64]

DEFAULT_SAMPLES = 1001
#: What the compiled engine can do; the reference engine can do all.
COMPILED_METHODS = ("auto", "DOP853", "Taylor", "Rodas5P", "Radau")
#: Of these, those without Baumgarte stabilization.
UNDAMPED = ("Taylor", "Rodas5P", "Radau")


def resolve(settings: Settings, model: Model) -> Settings:
    """Return complete settings: the given ones, the model's, the defaults; checked.

    Raises
    ------
    UsageError
        A value is out of its range.
    """
    chosen = settings.over(model.settings).over(DEFAULTS)
    if chosen.times is not None:
        times = tuple(float(x) for x in chosen.times)
        chosen = dataclasses.replace(chosen, times=times)
    elif chosen.samples is None and chosen.dt is None:
        chosen = dataclasses.replace(chosen, samples=DEFAULT_SAMPLES)
    if chosen.engine is None:
        chosen = dataclasses.replace(chosen, engine="compiled" if _suits(chosen) else "scipy")
    if chosen.method == "auto" and (chosen.engine == "scipy" or chosen.formulation == "baumgarte"):
        # there is nothing to choose
        chosen = dataclasses.replace(chosen, method="DOP853")
    try:
        chosen.check()
        _check_engine(chosen)
    except SettingError as error:
        help_ = f"; {error.help}" if error.help else ""
        raise UsageError(f"{error}{help_}") from None
    return chosen


def _suits(settings: Settings) -> bool:
    """Return whether the compiled engine can do what the settings ask for."""
    return (
        settings.method in COMPILED_METHODS
        and not (settings.method in UNDAMPED and settings.formulation == "baumgarte")
        and compiled_available()
    )


def compiled_available() -> bool:
    """Return whether the compiled engine was built when the package was installed."""
    return find_spec("lagcli.engine.core.binding") is not None


def _check_engine(settings: Settings) -> None:
    if settings.engine != "compiled":
        if settings.method in ("Taylor", "Rodas5P"):
            raise _only_compiled(settings)
        return
    if settings.method not in COMPILED_METHODS:
        raise SettingError(
            "engine",
            f"the compiled engine has no method {settings.method}",
            f"its methods are {', '.join(COMPILED_METHODS)}; --engine scipy has all",
        )
    if settings.method in UNDAMPED and settings.formulation == "baumgarte":
        raise SettingError(
            "formulation",
            f"the compiled engine's {settings.method} knows no Baumgarte stabilization",
            "give --formulation projection, --method DOP853, or --engine scipy with --method Radau",
        )
    if not compiled_available():
        raise SettingError(
            "engine",
            "the compiled engine was not built: there was no C compiler at installation",
            "install one and lagcli again, or give --engine scipy",
        )


def _only_compiled(settings: Settings) -> SettingError:
    """Return the error for a method of the compiled engine that cannot be had."""
    method = settings.method
    other = "DOP853" if method == "Taylor" else "Radau"
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


def sample_times(settings: Settings) -> Array:
    """Return the sample times of complete settings, s."""
    if settings.times is not None:
        return np.array(settings.times)
    start, end = settings.t_start, settings.t_end
    assert start is not None
    assert end is not None
    if settings.dt is not None:
        return np.minimum(start + settings.dt * np.arange(sample_count(settings)), end)
    assert settings.samples is not None
    return np.array([end]) if settings.samples == 1 else np.linspace(start, end, settings.samples)


def engine_of(settings: Settings) -> Engine:
    """Return the engine that complete settings name."""
    if settings.engine == "compiled":
        from lagcli.engine.integrate import compiled_engine

        return compiled_engine.run
    from lagcli.engine.integrate import scipy_engine

    return scipy_engine.run


def sample_count(settings: Settings) -> int:
    """Return the number of samples that complete settings ask for."""
    if settings.times is not None:
        return len(settings.times)
    if settings.dt is None:
        assert settings.samples is not None
        return settings.samples
    start, end = settings.t_start, settings.t_end
    assert start is not None
    assert end is not None
    # the last multiple of dt within rounding of the end counts as the end
    return int(np.floor((end - start) / settings.dt * (1 + 1e-12) + 1e-9)) + 1


def absolute_tolerances(
    given: float | Mapping[str, float] | None, coordinates: tuple[str, ...]
) -> float | Array:
    """Return the absolute tolerances on q, v and the work; 0 where they follow the size."""
    if not isinstance(given, Mapping):
        return given or 0.0
    names = (*coordinates, *(f"{q}'" for q in coordinates))
    return np.array([*(given.get(name, 0.0) for name in names), 0.0])
