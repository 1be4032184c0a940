"""Files of analyses: their names, their provenance, JSON and HDF5."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from lagcli.errors import UsageError
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.model.result_units import result_units
from lagcli.results.atomic import check_writable, write_file
from lagcli.results.metadata import to_json
from lagcli.simulations.inputs import input_data, input_tables
from lagcli.version import __version__

#: The formats of results of analyses, unless they have others.
ANALYSIS_SUFFIXES = (".json", ".h5")


def check_analysis_target(path: str, suffixes: tuple[str, ...], force: bool) -> None:
    """Raise if a file of an analysis could not be written under this name.

    Raises
    ------
    UsageError
        The suffix is none of these.
    FileError
        As `check_writable`.
    """
    stem, suffix = os.path.splitext(path)
    if path == "-":
        raise UsageError(
            "-: an analysis is not written to standard output; --json prints it, and -o writes a"
            f" file that ends in {' or '.join(suffixes)}"
        )
    if suffix.lower() not in suffixes:
        raise UsageError(
            f"{path}: the suffix {suffix or '(none)'} is not a format for this; use"
            f" {', '.join(stem + s for s in suffixes[:-1])} or {stem}{suffixes[-1]}"
        )
    check_writable(path, force)


def facts_of(model: Model) -> dict[str, Any]:
    """Return the provenance that files of analyses have."""
    return {
        "lagcli_version": __version__,
        "model": model.text,
        "model_sha256": model.sha256,
        "model_path": model.path,
        "units": result_units(model),
        "parameters": model.declared_values,
        "set": {name: str(value) for name, value in model.set.items()},
        "set_initial": {name: str(value) for name, value in model.set_initial.items()},
    }


def write_content(
    content: Mapping[str, Any], arrays: Mapping[str, Any], model: Model, path: str, force: bool
) -> None:
    """Write the content of an analysis, as JSON or with its arrays as HDF5.

    Raises
    ------
    FileError
        As `write_file`.
    """
    if path.lower().endswith(".json"):
        write_file(path, (to_json(content, indent=1) + "\n").encode(), force)
        return
    from lagcli.results.hdf5.analysis_file import write_analysis

    write_analysis(path, content, arrays, facts_of(model), input_tables(model), force)


def stored_model(path: str | os.PathLike[str]) -> Model:
    """Return the model of an analysis file, with the tables of inputs that it had.

    Parameters
    ----------
    path : path
        HDF5.

    Raises
    ------
    FileError
        The file cannot be read, or contains no model.
    ModelError
        The model is not valid in this version.
    """
    from lagcli.results.hdf5.analysis_file import read_model_text

    given = read_model_text(path)
    return load_text(given.text, given.path, given.set, given.set_initial, input_data(given.inputs))
