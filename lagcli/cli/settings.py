"""Options of commands for settings: one for each declared setting."""

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any, Literal

import typer

from lagcli.errors import UsageError
from lagcli.model.names.members import split_names
from lagcli.settings.kinds import Choice, Flag, Names, Setting, Times, WholeNumber
from lagcli.settings.settings import SettingsOverrides

Command = Callable[..., int | None]


def with_settings(*names: str, without: tuple[str, ...] = ()) -> Callable[[Command], Command]:
    """Decorate a command with options that form its keyword parameter ``settings``.

    The command receives a `SettingsOverrides`.

    Parameters
    ----------
    *names : str
        Names of the settings; all by default.
    without : tuple of str
        Names of settings to omit.
    """
    declared = SettingsOverrides.DECLARED
    options = [_option(declared[name]) for name in names or declared if name not in without]

    def decorate(function: Command) -> Command:
        @functools.wraps(function)
        def command(**arguments: Any) -> int | None:
            given = {option.name: arguments.pop(option.name) for option in options}
            return function(settings=_overrides(given), **arguments)

        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(function).parameters.values():
            own = parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            parameters.extend(options if parameter.name == "settings" else [own])
        # Typer reads `inspect.signature` and the annotations
        command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        command.__annotations__ = {p.name: p.annotation for p in parameters}
        return command

    return decorate


def _option(setting: Setting[Any]) -> inspect.Parameter:
    """Return the parameter from which Typer makes the option."""
    stated = f" [default: {setting.stated}]" if setting.stated else ""
    flag = "--" + setting.name.replace("_", "-")
    option = typer.Option(flag, help=setting.help + stated, metavar=setting.metavar)
    type_: Any = float
    match setting:
        case Flag():
            type_ = bool
        case WholeNumber():
            type_ = int
        case Times() | Names():
            type_ = str
        case Choice():
            type_ = Literal[setting.choices]
    return inspect.Parameter(
        setting.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=False if type_ is bool else None,
        annotation=Annotated[type_ if type_ is bool else type_ | None, option],
    )


def _overrides(given: dict[str, Any]) -> SettingsOverrides:
    """Return the settings given by options.

    Raises
    ------
    UsageError
        The times are not a list of numbers.
    """
    for name, value in given.items():
        setting = SettingsOverrides.DECLARED[name]
        if value is not None and isinstance(setting, Times):
            given[name] = _numbers(name, value)
        elif value is not None and isinstance(setting, Names):
            given[name] = split_names(value)
        elif value is False:
            given[name] = None  # a flag that is not given does not override the model file
    return SettingsOverrides(**given)


def _numbers(name: str, text: str) -> list[float]:
    try:
        return [float(x) for x in text.split(",")]
    except ValueError:
        raise UsageError(
            f"--{name} {text!r} is not a list of numbers, as in --{name} 0.5,1,2"
        ) from None
