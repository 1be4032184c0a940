"""Arguments and options of commands, read from the annotations of their functions."""

from __future__ import annotations

from collections.abc import Callable
from types import NoneType, UnionType
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin

from lagcli.cli.quantities import REAL, WHOLE, NumberIn


class Argument:
    """Declaration of an argument, in the annotation of a parameter: ``Annotated[str, Argument()]``.

    Parameters
    ----------
    metavar : str
        Name of the value in help and messages; in brackets if the usage shows it as it is.
    help : str
    """

    flags: tuple[str, ...] = ()
    least: int | None = None
    most: int | None = None
    unit: str | None = None

    def __init__(self, *, metavar: str, help: str):
        self.metavar, self.help = metavar, help


class Option:
    """Declaration of an option, in the annotation of a parameter: ``Annotated[int, Option()]``.

    Parameters
    ----------
    *flags : str
        By default the name of the parameter.
    help : str
    metavar : str, optional
        Placeholder of the value in the help; by default its type.
    least, most : int, optional
        Range of a number.
    unit : str, optional
        Unit of a number, which may be given in another unit of its dimension.
    """

    def __init__(
        self,
        *flags: str,
        help: str,
        metavar: str | None = None,
        least: int | None = None,
        most: int | None = None,
        unit: str | None = None,
    ):
        self.flags, self.help, self.metavar = flags, help, metavar
        self.least, self.most, self.unit = least, most, unit


class CommandParameter(NamedTuple):
    """An argument or option of a command.

    Parameters
    ----------
    name : str
        Name of the function's parameter.
    flags : tuple of str
        Of an option, such as ``--output`` and ``-o``; an argument has none.
    help : str
    metavar : str or None
    type : callable
        Converts the text of a value; ``bool`` marks a switch, an option without a value.
    choices : tuple of str
        The allowed values, if they are listed.
    many : bool
        Whether it can have several values, which form a list.
    required : bool
    default : Any
    least, most : int or None
        Range of a number.
    """

    name: str
    flags: tuple[str, ...]
    help: str
    metavar: str | None = None
    type: Callable[[str], Any] = bool
    choices: tuple[str, ...] = ()
    many: bool = False
    required: bool = False
    default: Any = False
    least: int | None = None
    most: int | None = None

    @property
    def is_switch(self) -> bool:
        """Whether it is an option without a value."""
        return self.type is bool

    @property
    def type_name(self) -> str:
        """The name of the values' type, in help and messages."""
        ranged = self.least is not None or self.most is not None
        return getattr(self.type, "__name__", "") + " range" * ranged

    @property
    def range(self) -> str:
        """The range of a number, such as ``x>=1``; empty if there is none."""
        if self.least is None:
            return "" if self.most is None else f"x<={self.most}"
        return f"x>={self.least}" if self.most is None else f"{self.least}<=x<={self.most}"


class Command(NamedTuple):
    """A command, or the program itself.

    Parameters
    ----------
    name : str
        As it is called: ``lagcli simulate``.
    help : str
        Paragraphs; the first is the summary.
    parameters : tuple of CommandParameter
        Without `HELP`, which every command has.
    function : callable or None
        None for the program itself.
    """

    name: str
    help: str
    parameters: tuple[CommandParameter, ...]
    function: Callable[..., int | None] | None = None

    @property
    def summary(self) -> str:
        """The first sentence of the help."""
        return self.help.partition("\n\n")[0].replace("\n", " ")


HELP = CommandParameter("help", ("--help", "-h"), "Show this message and exit.")


def parameters_of(
    function: Callable[..., Any], **instead: tuple[CommandParameter, ...]
) -> tuple[CommandParameter, ...]:
    """Return the parameters that a function declares in its annotations, in its order.

    Parameters
    ----------
    function : callable
        Each parameter is annotated ``Annotated[type, Option(…)]`` or ``Annotated[type,
        Argument(…)]``, with a type of ``str``, ``int``, ``float``, an enumeration or literal words,
        a list of one of these, or ``bool``; its module evaluates annotations (it has no
        ``from __future__ import annotations``).
    **instead
        Parameters in place of one of the function.
    """
    code = function.__code__
    names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    given = function.__defaults__ or ()
    positional = names[: code.co_argcount]
    defaults = dict(zip(positional[len(positional) - len(given) :], given, strict=True))
    defaults.update(function.__kwdefaults__ or {})
    parameters: list[CommandParameter] = []
    for name in names:
        if name in instead:
            parameters += instead[name]
        else:
            annotated = function.__annotations__[name]
            declared = annotated.__metadata__[0]
            has_default = name in defaults
            parameters.append(
                parameter(name, annotated.__origin__, declared, defaults.get(name), not has_default)
            )
    return tuple(parameters)


def parameter(
    name: str, annotation: Any, declared: Argument | Option, default: Any, required: bool
) -> CommandParameter:
    """Return a parameter from its declaration.

    Parameters
    ----------
    name : str
    annotation : type
        Type of the value: see `parameters_of`.
    declared : Argument or Option
    default : Any
    required : bool
    """
    if get_origin(annotation) in (Union, UnionType):
        (annotation,) = (x for x in get_args(annotation) if x is not NoneType)
    many = get_origin(annotation) is list
    if many:
        (annotation,) = get_args(annotation)
    choices: tuple[str, ...] = ()
    if get_origin(annotation) is Literal:
        choices = get_args(annotation)
    elif hasattr(annotation, "__members__"):  # an enumeration of words
        choices = tuple(annotation)
    flags = declared.flags
    if isinstance(declared, Option) and not flags:
        flags = (f"--{name.replace('_', '-')}",)
    plain = {float: REAL, int: WHOLE}.get(annotation, annotation)
    converts = str if choices else NumberIn(declared.unit) if declared.unit else plain
    return CommandParameter(
        *(name, flags, declared.help, declared.metavar, converts, choices),
        *(many, required, default, declared.least, declared.most),
    )
