"""Arguments and options that several commands share, and the options for settings."""

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Annotated, Any, Literal

import typer

from lagcli.cli import completion
from lagcli.cli.quantities import NumberIn, NumbersIn
from lagcli.errors import UsageError
from lagcli.results.formats import SUFFIX_NAMES
from lagcli.settings.kinds import Choice, Flag, Names, Setting, Times, WholeNumber
from lagcli.settings.settings import SettingsOverrides

#: Exit statuses that do not belong to an exception.
BUG_STATUS, FAILED_STATUS, INTERRUPTED_STATUS = 1, 3, 130


ModelPath = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        autocompletion=completion.models,
        help="Model file (YAML), name of a shipped model, or - for standard input.",
    ),
]
SetParameter = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        autocompletion=completion.parameters,
        help="Set a parameter, e.g. m=2 or 'l=30 cm'. Repeatable.",
    ),
]
SetInitial = Annotated[
    list[str] | None,
    typer.Option(
        "--set-initial",
        metavar="NAME=VALUE",
        autocompletion=completion.initial_values,
        help="Set and fix an initial value, e.g. phi=0.3 or phi_dot=2; 'phi={guess: 0.3}' frees it."
        " Repeatable.",
    ),
]
PresetName = Annotated[
    str | None,
    typer.Option(
        "--preset",
        metavar="PRESET",
        autocompletion=completion.presets,
        help="Take the values of a preset of the model; --set and --set-initial replace them.",
    ),
]
ResultFile = Annotated[
    str,
    typer.Argument(
        metavar="FILE", autocompletion=completion.results, help=f"Result file, {SUFFIX_NAMES}."
    ),
]
ViewModel = Annotated[
    str | None,
    typer.Option(
        "--model",
        metavar="MODEL",
        autocompletion=completion.models,
        help="Model file whose view is used, instead of the text in the result.",
    ),
]
Output = Annotated[str | None, typer.Option("--output", "-o", metavar="FILE", help="Output file.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only results and errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
NoColor = Annotated[bool, typer.Option("--no-color", help="Disable colours (as NO_COLOR does).")]


_EXAMPLES = {"--set-initial": "phi=0.3", "--steady": '"phi\'=10"'}


def assignments(option: str, items: Iterable[str] | None) -> dict[str, str]:
    """Split NAME=VALUE items.

    Raises
    ------
    UsageError
        An item has no ``=``, no name or no value, or a name occurs twice.
    """
    values: dict[str, str] = {}
    for item in items or ():
        name, equals, value = item.partition("=")
        name, value = name.strip(), value.strip()
        if not (equals and name and value):
            example = _EXAMPLES.get(option, "m=2")
            raise UsageError(
                f"{option} {item!r} is not of the form NAME=VALUE, as in {option} {example}"
            )
        if name in values:
            raise UsageError(
                f"{option} gives `{name}` twice: {values[name]} and {value}; keep one of them"
            )
        values[name] = value
    return values


CommandFunction = Callable[..., int | None]


def with_settings(
    *names: str, without: tuple[str, ...] = ()
) -> Callable[[CommandFunction], CommandFunction]:
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

    def decorate(function: CommandFunction) -> CommandFunction:
        @functools.wraps(function)
        def command(**arguments: Any) -> int | None:
            given = {option.name: arguments.pop(option.name) for option in options}
            return function(settings=_overrides(given), **arguments)

        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(function).parameters.values():
            own = parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            parameters += options if parameter.name == "settings" else [own]
        # Typer reads the signature, and the annotations
        command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        command.__annotations__ = {p.name: p.annotation for p in parameters}
        return command

    return decorate


#: Placeholders of quantities by their unit.
_METAVARS = {"s": "TIME", "1/s": "RATE"}


def _option(setting: Setting[Any]) -> inspect.Parameter:
    """Return the parameter from which Typer makes the option of a setting."""
    stated = f" [default: {setting.stated}]" if setting.stated else ""
    type_: Any = float
    parser: Callable[[str], Any] | None = None
    match setting:
        case Flag():
            type_ = bool
        case WholeNumber():
            type_ = int
        case Times():
            parser = NumbersIn(setting.unit)
        case Names():
            type_ = str
        case Choice():
            type_ = Literal[setting.choices]
        case _ if setting.unit:
            parser = NumberIn(setting.unit)
    option = typer.Option(
        "--" + setting.name.replace("_", "-"),
        help=setting.help + stated,
        metavar=setting.metavar or _METAVARS.get(setting.unit),
        parser=parser,
    )
    return inspect.Parameter(
        setting.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=False if type_ is bool else None,
        annotation=Annotated[type_ if type_ is bool else type_ | None, option],
    )


def _overrides(given: dict[str, Any]) -> SettingsOverrides:
    """Return the settings given by options."""
    for name, value in given.items():
        setting = SettingsOverrides.DECLARED[name]
        if value is not None and isinstance(setting, Names):
            from lagcli.model.names.members import split_names

            given[name] = split_names(value)
        elif value is False:
            given[name] = None  # a flag that is not given does not override the model file
    return SettingsOverrides(**given)
