"""The fitted model as a model file."""

from __future__ import annotations

import os

from lagcli.analysis.fit.result import FitResult
from lagcli.errors import UsageError
from lagcli.model.expression.units import to_si
from lagcli.model.model import Model
from lagcli.model.rewriting import rewrite
from lagcli.results.atomic import check_writable, whole_file


def check_written(path: str, force: bool) -> None:
    """Raise UsageError or FileError if the model file could not be written."""
    if not path.lower().endswith((".yaml", ".yml")):
        raise UsageError(f"{path}: a model is written as YAML; name it fitted.yaml")
    check_writable(path, force)


def write_model(
    model: Model, result: FitResult, path: str | os.PathLike[str], force: bool = False
) -> None:
    """Write a model file with the fitted values; comments and layout are preserved.

    Parameters
    ----------
    model : Model
        The fitted model; values given when it was loaded are written too.
    result : FitResult
    path : path
        Name of the new file.
    force : bool
        Replace an existing file.

    Raises
    ------
    ModelError
        A value cannot be replaced in the text, such as that of an alias.
    FileError
        The file exists and ``force`` is false, or it cannot be written.
    """
    values = {name: str(x) for name, x in model.set.items()}
    initial = {name: str(x) for name, x in model.set_initial.items()}
    for name, value in zip(result.names, result.values.tolist(), strict=True):
        (values if name in model.parameters else initial)[name] = _text(model, name, value)
    text = rewrite(model.text, model.path, values, initial)
    with whole_file(os.fspath(path), force) as file:
        file.write(text.encode())


def _text(model: Model, name: str, value: float) -> str:
    """Return a value in the unit of the file."""
    unit = model.parameters[name].unit if name in model.parameters else model.initial[name].unit
    if unit is None:
        return f"{value:.15g}"
    return f"{value / float(to_si(unit)):.15g} {unit}"
