"""Kinds of settings, and containers of their values: partial and complete."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import pairwise
from operator import index
from typing import Any, ClassVar, Generic, Self, TypeVar, overload

from lagcli.errors import UsageError

T = TypeVar("T")

#: Returns the requirement on a number, with a remedy if there is one; None if it is in range.
Check = Callable[[float], tuple[str, str | None] | None]


class SettingError(ValueError):
    """A setting out of its range, with its ``key``."""

    def __init__(self, key: str, message: str, help_: str | None = None):
        super().__init__(message)
        self.key, self.help = key, help_


class Setting(Generic[T]):
    """A setting: its declaration for the command line, model files, Python and the documentation.

    As a descriptor, it returns itself on a class, a value of type T on complete settings, and a
    value or None on overrides.

    Parameters
    ----------
    help : str
        For the command line and the documentation; ``{unit}`` stands for the unit.
    default : T or None
        None if the value is optional, or follows from others.
    unit : str
    stated : str
        Text printed as default; by default the default.
    metavar : str
        Placeholder of the value in the command line's help, if its type is not enough.
    check : callable, optional
        Check of the range of numbers.
    choices : tuple of str
        Allowed words.
    core : bool
        Whether the core uses the setting: it is a field of `lag_settings` then.
    """

    name: str

    def __init__(
        self,
        help: str,
        default: T | None = None,
        *,
        unit: str = "",
        stated: str = "",
        metavar: str | None = None,
        check: Check | None = None,
        choices: tuple[str, ...] = (),
        core: bool = False,
    ):
        self.help = help.format(unit=unit)
        self.default, self.unit, self.metavar = default, unit, metavar
        self.check, self.choices, self.core = check, choices, core
        shown = default is not None and default is not False and default != math.inf
        self.stated = stated or (plain(default) if shown else "")

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, values: None, owner: type) -> Self: ...
    @overload
    def __get__(self, values: CompleteValues, owner: type) -> T: ...
    @overload
    def __get__(self, values: GivenValues, owner: type) -> T | None: ...
    def __get__(self, values: object, owner: type) -> Any:
        # called only if the instance has no value
        return self if values is None else None

    def convert(self, value: Any) -> Any:
        """Convert a given value."""
        return value

    def problems(self, value: Any) -> Iterator[SettingError]:
        """Yield the errors of a value."""
        raise NotImplementedError

    def error(self, message: str, help_: str | None = None) -> SettingError:
        """Return an error about this setting."""
        return SettingError(self.name, message, help_)


class RealNumber(Setting[T]):
    """A number."""

    what = "a number"

    def convert(self, value: Any) -> Any:
        """Return a number of another type, such as NumPy's, as one of Python's.

        `problems` rejects what is no number, which stays as it is.
        """
        if isinstance(value, bool) or not hasattr(value, "__float__"):
            return value
        if getattr(value, "ndim", 0):  # an array of one number, which NumPy before 2.4 converts
            return value
        try:
            number = float(value)
        except OverflowError:
            return math.inf if value > 0 else -math.inf
        except (TypeError, ValueError):
            return value
        return value if isinstance(value, int) else number

    def problems(self, value: Any) -> Iterator[SettingError]:
        """Yield the errors of a value."""
        yield from self.number_problems(self.name, value)

    def number_problems(self, what: str, value: Any) -> Iterator[SettingError]:
        """Yield the errors of a number; messages call it ``what``."""
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            yield self.error(f"{what} must be {self.what}, not {value!r}")
        elif isinstance(value, float) and not math.isfinite(value):
            yield self.error(f"{what} must be a finite number, not {value}")
        elif self.check is not None and (problem := self.check(value)) is not None:
            shown = value if isinstance(value, int) else f"{value:g}"
            yield self.error(f"{what} {problem[0]}, not {shown}", problem[1])


class WholeNumber(RealNumber[T]):
    """A whole number."""

    what = "a whole number"

    def convert(self, value: Any) -> Any:
        """Return a whole number of another type as one of Python's."""
        if isinstance(value, bool) or not hasattr(value, "__index__"):
            return value
        try:
            return index(value)
        except TypeError:
            return value

    def number_problems(self, what: str, value: Any) -> Iterator[SettingError]:
        """Yield the errors of a number; messages call it ``what``."""
        if isinstance(value, float):
            yield self.error(f"{what} must be {self.what}, not {value!r}")
        else:
            yield from super().number_problems(what, value)


class Choice(Setting[T]):
    """One of a list of words."""

    def problems(self, value: Any) -> Iterator[SettingError]:
        """Yield the errors of a value."""
        if not isinstance(value, str) or value not in self.choices:
            same = [word for word in self.choices if word.lower() == str(value).lower()]
            known = "known are " + ", ".join(self.choices)
            help_ = f"did you mean `{same[0]}`?" if same else known
            yield self.error(f"there is no {self.name} `{value}`", help_)


class Flag(Setting[bool]):
    """Yes or no."""

    def problems(self, value: Any) -> Iterator[SettingError]:
        """Yield the errors of a value."""
        if not isinstance(value, bool):
            yield self.error(f"{self.name} must be true or false, not {value!r}")


class Times(Setting[tuple[float, ...] | None]):
    """Increasing times."""

    def convert(self, value: Any) -> tuple[float, ...]:
        """Return the times as numbers.

        Raises
        ------
        UsageError
            The value is not a list of times.
        """
        try:
            times = tuple(value)
            if not any(isinstance(x, str) for x in times):
                return tuple(map(float, times))
        except (TypeError, ValueError, OverflowError):
            pass
        raise UsageError(f"{self.name} must be numbers, not {value!r}")

    def problems(self, value: Any) -> Iterator[SettingError]:
        """Yield the errors of a value."""
        if not value:
            yield self.error("times must hold at least one time")
        elif not all(math.isfinite(x) for x in value):
            yield self.error("times must be finite numbers")
        elif any(b <= a for a, b in pairwise(value)):
            yield self.error("times must increase")


class Tolerances(RealNumber[float | Mapping[str, float] | None]):
    """One number for all coordinates and velocities, or numbers by their names."""

    def convert(self, value: Any) -> Any:
        """Return numbers of other types as those of Python."""
        convert = super().convert
        if isinstance(value, Mapping):
            return {name: convert(x) for name, x in value.items()}
        return convert(value)

    def problems(self, value: Any) -> Iterator[SettingError]:
        """Yield the errors of a value."""
        if not isinstance(value, Mapping):
            yield from super().problems(value)
            return
        for name, x in value.items():
            yield from self.number_problems(f"{self.name} of `{name}`", x)


class Names(Setting[tuple[str, ...] | None]):
    """Names of quantities of the model."""

    def convert(self, value: Any) -> Any:
        """Return a given value as it is kept."""
        if isinstance(value, str):
            return (value,)
        try:
            return tuple(value)
        except TypeError:
            raise UsageError(f"{self.name} must be a list of names, not {value!r}") from None

    def problems(self, value: Any) -> Iterator[SettingError]:
        """Yield the errors of a value."""
        if not value or not all(isinstance(name, str) and name.strip() for name in value):
            yield self.error(f"{self.name} must be a list of names, not {list(value)!r}")


def positive(value: float) -> tuple[str, None] | None:
    """Check that a number is greater than 0."""
    return ("must be greater than 0", None) if value <= 0 else None


def not_negative(value: float) -> tuple[str, None] | None:
    """Check that a number is not less than 0."""
    return ("must not be negative", None) if value < 0 else None


def between(
    low: float, high: float, if_below: str | None = None, if_above: str | None = None
) -> Check:
    """Return a check that a number lies in a range, with remedies for numbers outside."""

    def check(value: float) -> tuple[str, str | None] | None:
        if low <= value <= high:
            return None
        help_ = if_below if value < low else if_above
        return f"must lie between {plain(low)} and {plain(high)}", help_

    return check


def plain(value: Any) -> str:
    """Format a value for reading: 1e-9, 10^8."""
    if isinstance(value, float):
        return f"{value:g}".replace("1e+0", "10^").replace("e-0", "e-")
    return str(value)


class SettingValues:
    """Immutable values of the settings that a class declares.

    Parameters
    ----------
    **values
        Values; None means not given.

    Raises
    ------
    UsageError
        There is no such setting.
    """

    DECLARED: ClassVar[Mapping[str, Setting[Any]]]

    def __init_subclass__(cls) -> None:
        classes: Iterable[type] = reversed(cls.__mro__)
        declared = [x for c in classes for x in vars(c).values() if isinstance(x, Setting)]
        cls.DECLARED = {x.name: x for x in declared}

    def __init__(self, **values: Any):
        for name, value in values.items():
            if name not in self.DECLARED:
                raise _unknown(name, self.DECLARED)
            if value is not None:
                self.__dict__[name] = self.DECLARED[name].convert(value)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"settings do not change; `replace` gives others ({name})")

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in self.__dict__.items())
        return f"{type(self).__name__}({values})"

    def replace(self, **changes: Any) -> Self:
        """Return these settings with other values; None removes one."""
        return type(self)(**{**self.__dict__, **changes})


def _unknown(name: str, known: Iterable[str]) -> UsageError:
    # imported on demand: at start-up it would take a millisecond
    from difflib import get_close_matches

    near = get_close_matches(name, known, 1)
    help_ = f"did you mean `{near[0]}`?" if near else "known are " + ", ".join(known)
    return UsageError(f"there is no setting `{name}`; {help_}")


class GivenValues(SettingValues):
    """Partial values; those not given are None."""


class CompleteValues(SettingValues):
    """Values of all settings."""

    def __init__(self, **values: Any):
        super().__init__(**values)
        for name in self.DECLARED:
            self.__dict__.setdefault(name, None)
