"""The formats of exported models: one row each."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from lagcli.errors import UsageError

if TYPE_CHECKING:
    from lagcli.export.content import Content
    from lagcli.model.model import Model


class ExportOptions(NamedTuple):
    """Options of exports to FMUs and pages.

    Parameters
    ----------
    fmi : str
        Version of FMI: ``"2.0"`` or ``"3.0"``.
    inputs : sequence of str
        Parameters that are inputs.
    wheels : str, optional
        A folder with wheels for other platforms.
    lang : str
        Language of a page.
    """

    fmi: str = "2.0"
    inputs: Sequence[str] = ()
    wheels: str | None = None
    lang: str = "en"

    def check(self, of: str) -> None:
        """Raise UsageError if there are options of another format than ``"fmu"`` or ``"page"``."""
        mine = ExportOptions()
        if of != "fmu" and self._replace(lang="en") != mine:
            raise UsageError("--fmi, --input and --wheels are options of FMUs: -o model.fmu")
        if of != "page" and self.lang != mine.lang:
            raise UsageError("--lang is an option of pages: -o page.html")


class ExportFormat(NamedTuple):
    """A language, library or standard.

    Parameters
    ----------
    name : str
        As in ``--to``.
    suffix : str
        Of its files.
    chosen : bool
        Whether a file with this suffix has this format unless another one is named.
    write : callable
        Returns the contents of the file of a model.
    """

    name: str
    suffix: str
    chosen: bool
    write: Callable[[Model, ExportOptions], bytes]


def _code(module: str, name: str) -> Callable[[Model, ExportOptions], bytes]:
    """Return the writer of a format that is code of a model's dynamics, by its function."""

    def written(model: Model, options: ExportOptions) -> bytes:
        from lagcli.export.content import content_of

        options.check("code")
        write: Callable[[Content], str] = getattr(import_module(f"lagcli.export.{module}"), name)
        return write(content_of(model)).encode()

    return written


def _fmu(model: Model, options: ExportOptions) -> bytes:
    from lagcli.export.fmu import fmu

    options.check("fmu")
    return fmu(model, options.fmi, options.inputs, options.wheels)


def _page(model: Model, options: ExportOptions) -> bytes:
    from lagcli.live.page import live_page

    options.check("page")
    return live_page(model, options.lang).encode()


#: The formats, by the names that ``--to`` has.
FORMATS = {
    row.name: row
    for row in (
        ExportFormat("c", ".c", True, _code("c", "write_c")),
        ExportFormat("python", ".py", True, _code("python", "write_numpy")),
        ExportFormat("casadi", ".py", False, _code("python", "write_casadi")),
        ExportFormat("jax", ".py", False, _code("python", "write_jax")),
        ExportFormat("matlab", ".m", True, _code("matlab", "write_matlab")),
        ExportFormat("modelica", ".mo", True, _code("modelica", "write_modelica")),
        ExportFormat("fmu", ".fmu", True, _fmu),
        ExportFormat("page", ".html", True, _page),
    )
}
SUFFIXES = tuple(row.suffix for row in FORMATS.values() if row.chosen)


def format_of(to: str | None, path: str | None) -> ExportFormat:
    """Return the format that is named, or that a file name has.

    Raises
    ------
    UsageError
        There is no such format; the suffix is unknown, or that of another format; MATLAB does not
        find a file of this name.
    """
    suffix = "" if path is None else os.path.splitext(path)[1].lower()
    if to is not None:
        if to not in FORMATS:
            raise UsageError(f"--to {to}: there is no such format; known are {', '.join(FORMATS)}")
        if suffix and suffix != FORMATS[to].suffix:
            raise UsageError(f"{path}: files of the format {to} end in {FORMATS[to].suffix}")
        _check_name(FORMATS[to], path)
        return FORMATS[to]
    if path is None:
        raise UsageError(f"name a format, --to {', '.join(FORMATS)}, or a file with -o")
    for row in FORMATS.values():
        if row.chosen and row.suffix == suffix:
            _check_name(row, path)
            return row
    raise UsageError(
        f"{path}: an exported file ends in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}; --to names"
        " the format"
    )


def _check_name(row: ExportFormat, path: str | None) -> None:
    """Raise UsageError if a language does not find a file with this name."""
    stem = "" if path is None else os.path.splitext(os.path.basename(path))[0]
    if row.name == "matlab" and stem and not re.fullmatch(r"[A-Za-z]\w*", stem, re.ASCII):
        better = re.sub(r"\W+", "_", stem, flags=re.ASCII).strip("_0123456789") or "model"
        raise UsageError(
            f"{path}: MATLAB finds a function by the name of its file, which has letters, digits"
            f" and _ only, a letter first: {better}.m"
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
    from lagcli.model.model import check_is_model

    check_is_model(model, "code")
    chosen = format_of(to, None)
    if chosen.name in ("fmu", "page"):
        own = {"fmu": "lagcli.fmu", "page": "lagcli.live_page"}[chosen.name]
        raise UsageError(f"{chosen.name} is not code: {own} returns it")
    return chosen.write(model, ExportOptions()).decode()
