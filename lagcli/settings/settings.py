"""The settings of a simulation: declarations, overrides, and complete settings.

The declarations define the options of the command line, the keys of a model file's `simulation`
block, the arguments of `lagcli.simulate`, and the table of the documentation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Self

from lagcli.errors import UsageError
from lagcli.settings.kinds import (
    Choice,
    CompleteValues,
    Flag,
    GivenValues,
    Names,
    RealNumber,
    SettingError,
    Times,
    Tolerances,
    WholeNumber,
    between,
    not_negative,
    positive,
)
from lagcli.settings.methods import FORMULATIONS, METHOD_NAMES, METHODS

#: Shortest duration of a run, s: its steps are normal numbers, with room below.
_SHORTEST = 1e-290
MAX_SAMPLES = 10**8


class _Declared:
    t_start = RealNumber[float]("Start time, {unit}.", 0.0, unit="s")
    t_end = RealNumber[float]("End time, {unit}.", 10.0, unit="s", core=True)
    samples = WholeNumber[int | None](
        "Number of samples, both ends included.", 1001, check=between(1, float(MAX_SAMPLES))
    )
    dt = RealNumber[float | None](
        "Spacing of the samples, {unit}; instead of --samples.", unit="s", check=positive
    )
    times = Times("List of sample times, {unit}.", unit="s", metavar="T1,T2,…")
    rtol = RealNumber[float](
        "Relative tolerance.",
        1e-9,
        check=between(1e-13, 0.1, "doubles cannot resolve less than 1e-13", "1e-9 is usual"),
        core=True,
    )
    atol = Tolerances(
        "Absolute tolerance, for all coordinates and velocities.",
        stated="by their size",
        check=positive,
    )
    method = Choice[str](
        "Integration method: auto begins with DOP853 and continues with Rodas5P or Radau if the"
        " motion is stiff.",
        "auto",
        choices=METHOD_NAMES,
    )
    formulation = Choice[str](
        "How the constraints are enforced: by projection after each step, by Baumgarte"
        " stabilization, or not at all (index1), which shows the drift.",
        "projection",
        choices=FORMULATIONS,
        core=True,
    )
    alpha = RealNumber[float | None](
        "Baumgarte's α, {unit}.", unit="1/s", stated="from the step", check=not_negative, core=True
    )
    beta = RealNumber[float | None](
        "Baumgarte's β, {unit}.", unit="1/s", stated="α", check=not_negative, core=True
    )
    max_step = RealNumber[float](
        "Largest step, {unit}.", math.inf, unit="s", check=positive, core=True
    )
    max_steps = WholeNumber[int]("Maximum number of steps.", 10_000_000, check=positive, core=True)
    timeout = RealNumber[float](
        "Time limit of a run, seconds of wall time.", math.inf, unit="s", check=positive
    )
    impacts = Choice[str](
        "Law of impacts: Poisson's, Newton's, or one contact at a time (sequential).",
        "poisson",
        choices=("poisson", "newton", "sequential"),
        core=True,
    )
    closed = RealNumber[float](
        "Gap below which a contact counts as closed, of the size of its terms.",
        1e-9,
        check=between(1e-13, 1e-3),
        core=True,
    )
    through_singular = Flag("Continue through singular configurations.", False)
    sensitivity = Names(
        "Differentiate q, v and λ with respect to parameters and initial values.",
        metavar="NAME,NAME,…",
    )


#: Settings of which only one may be given.
_GRID = ("samples", "dt", "times")


class SettingsOverrides(_Declared, GivenValues):
    """Settings given by a model file, the command line or a call; all are optional.

    Parameters
    ----------
    **values
        Values by the names of settings; None means not given.

    Raises
    ------
    UsageError
        There is no such setting.
    """

    def as_dict(self) -> dict[str, Any]:
        """Return the given values."""
        return {name: self.__dict__[name] for name in self.DECLARED if name in self.__dict__}

    def over(self, lower: SettingsOverrides) -> Self:
        """Return these settings, completed from a lower level.

        Raises
        ------
        UsageError
            The lower level are no settings.
        """
        if not isinstance(lower, SettingsOverrides):
            raise UsageError(
                f"`settings` is of type {type(lower).__name__}; give settings by name: t_end=2.0"
            )
        values = {**lower.as_dict(), **self.as_dict()}
        if any(name in self.__dict__ for name in _GRID):
            # the higher level's choice replaces the lower's
            values.update({name: getattr(self, name) for name in _GRID})
        if self.times is not None:
            values["t_end"] = self.t_end  # the last time is the end
        return type(self)(**values)

    def check(self) -> None:
        """Raise SettingError for the first value that is out of its range."""
        for problem in self.problems():
            raise problem

    def problems(self) -> Iterator[SettingError]:
        """Yield errors: values out of range, or contradictions between settings."""
        wrong: dict[str, None] = {}
        for name, value in self.as_dict().items():
            for problem in self.DECLARED[name].problems(value):
                wrong[name] = None
                yield problem
        yield from self.replace(**wrong)._time_problems()

    def _time_problems(self) -> Iterator[SettingError]:
        start, end = self.t_start or 0.0, self.t_end
        if end is not None and end <= start:
            yield SettingError(
                "t_end", f"t_end {end:g} is not after t_start {start:g}; give a later t_end"
            )
        elif end is not None and end - start < _SHORTEST:
            yield SettingError(
                "t_end",
                f"a run of {end - start:.3g} s is shorter than steps can be, {_SHORTEST:g} s",
                "give a later t_end",
            )
        given = [name for name in _GRID if name in self.__dict__]
        if len(given) > 1:
            yield SettingError(
                given[1], f"{' and '.join(given)} contradict each other", "give one of them"
            )
        if self.times is not None:
            if self.times[0] < start:
                yield SettingError("times", f"times begin before t_start {start:g}")
            elif end is not None and self.times[-1] > end:
                last, stated = _apart(self.times[-1], end)
                yield SettingError(
                    "times",
                    f"times go beyond t_end {stated}: the last one is {last}",
                    "give a later t_end, or none: then the last time is the end",
                )
        if self.dt is not None and end is not None and (end - start) / self.dt > MAX_SAMPLES:
            yield SettingError("dt", "dt gives more than 10^8 samples", "take a larger dt")


def _apart(a: float, b: float) -> tuple[str, str]:
    """Return two numbers as texts that differ."""
    short = f"{a:g}", f"{b:g}"
    return short if short[0] != short[1] else (repr(a), repr(b))


class Settings(_Declared, CompleteValues):
    """Complete settings, checked; made by `lagcli.settings.settings.resolve`.

    Some values may be None: two of ``samples``, ``dt`` and ``times``; ``atol`` if tolerances follow
    the size; ``alpha`` and ``beta`` if they follow the step.
    """

    def as_dict(self) -> dict[str, Any]:
        """Return the effective values, for the record of a run."""
        values = {name: self.__dict__[name] for name in self.DECLARED}
        return {name: x for name, x in values.items() if x is not None and x != math.inf}

    @property
    def sample_count(self) -> int:
        """The number of samples."""
        if self.times is not None:
            return len(self.times)
        if self.dt is None:
            assert self.samples is not None
            return self.samples
        # the last multiple of dt within rounding of the end counts as the end
        duration = self.t_end - self.t_start
        return math.floor(duration / self.dt * (1 + 1e-12) + 1e-9) + 1


#: The lowest level: default values.
DEFAULTS = SettingsOverrides(
    **{name: x.default for name, x in Settings.DECLARED.items() if x.default != math.inf}
)


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
    if settings.times is not None and settings.t_end is None:
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
