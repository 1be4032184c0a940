"""The formats of exported code: one row each."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from lagcli.errors import UsageError

if TYPE_CHECKING:
    from lagcli.export.content import Content
    from lagcli.model.model import Model


class CodeFormat(NamedTuple):
    """A language or library.

    Parameters
    ----------
    name : str
        As in ``--to``.
    suffix : str
        Of its files.
    chosen : bool
        Whether a file with this suffix has this format unless another one is named.
    write : callable
        Returns the code of a model.
    """

    name: str
    suffix: str
    chosen: bool
    write: Callable[[Content], str]


def _c(content: Content) -> str:
    from lagcli.export.c import write_c

    return write_c(content)


def _numpy(content: Content) -> str:
    from lagcli.export.python import write_numpy

    return write_numpy(content)


def _casadi(content: Content) -> str:
    from lagcli.export.python import write_casadi

    return write_casadi(content)


def _jax(content: Content) -> str:
    from lagcli.export.python import write_jax

    return write_jax(content)


def _matlab(content: Content) -> str:
    from lagcli.export.matlab import write_matlab

    return write_matlab(content)


def _modelica(content: Content) -> str:
    from lagcli.export.modelica import write_modelica

    return write_modelica(content)


#: The formats, by the names that ``--to`` has.
FORMATS = {
    row.name: row
    for row in (
        CodeFormat("c", ".c", True, _c),
        CodeFormat("python", ".py", True, _numpy),
        CodeFormat("casadi", ".py", False, _casadi),
        CodeFormat("jax", ".py", False, _jax),
        CodeFormat("matlab", ".m", True, _matlab),
        CodeFormat("modelica", ".mo", True, _modelica),
    )
}
SUFFIXES = tuple(row.suffix for row in FORMATS.values() if row.chosen)


def format_of(to: str | None, path: str | None) -> CodeFormat:
    """Return the format that is named, or that a file name has.

    Raises
    ------
    UsageError
        There is no such format; the suffix is unknown, or that of another format.
    """
    suffix = "" if path is None else os.path.splitext(path)[1].lower()
    if to is not None:
        if to not in FORMATS:
            raise UsageError(f"--to {to}: there is no such format; known are {', '.join(FORMATS)}")
        if suffix and suffix != FORMATS[to].suffix:
            raise UsageError(f"{path}: files of the format {to} end in {FORMATS[to].suffix}")
        return FORMATS[to]
    if path is None:
        raise UsageError(f"name a format, --to {', '.join(FORMATS)}, or a file with -o")
    for row in FORMATS.values():
        if row.chosen and row.suffix == suffix:
            return row
    raise UsageError(
        f"{path}: a file of code ends in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}; --to names"
        " the format"
    )


def code(model: Model, to: str) -> str:
    """Return the equations of a model as code.

    Parameters
    ----------
    model : Model
    to : str
        ``"c"``, ``"python"``, ``"casadi"``, ``"jax"``, ``"matlab"`` or ``"modelica"``.

    Raises
    ------
    UsageError
        There is no such format, or the model cannot be written as code: it switches, or it has too
        many unknowns, or a function that the language lacks.
    ModelError, NumericalError
        There is no consistent initial state.
    """
    from lagcli.export.content import content_of

    return format_of(to, None).write(content_of(model))
