"""Analysis files: arrays by name, and the content as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

import h5py
import numpy as np

from lagcli.arrays import Array
from lagcli.errors import FileError
from lagcli.json_schema import check_json, published_schema
from lagcli.json_values import json_values
from lagcli.results.hdf5.container import add_array, new_file, set_text
from lagcli.results.hdf5.inputs import read_inputs, write_inputs
from lagcli.results.hdf5.opening import open_verified
from lagcli.results.hdf5.structure import text_attribute
from lagcli.results.metadata import check_model, shortened, to_json
from lagcli.trajectory.samples import SCHEMA_VERSION, SIGN_CONVENTION, InputTable

#: The schema of values that replace those of a model.
_VALUES = {"type": "object", "additionalProperties": {"type": "string"}}


@contextmanager
def new_analysis_file(
    path: str,
    content: Mapping[str, Any],
    facts: Mapping[str, Any],
    inputs: Mapping[str, InputTable],
    force: bool,
) -> Iterator[h5py.File]:
    """Create a file for the result of an analysis, written atomically.

    Parameters
    ----------
    path : str
    content : mapping
        Content printed by ``--json``; its ``command`` is the kind of the file.
    facts : mapping
        Provenance: ``lagcli_version``, ``model``, ``model_sha256``, ``parameters``, ….
    inputs : mapping of str to InputTable
        Tables of the model's inputs.
    force : bool
        Replace an existing file.

    Yields
    ------
    h5py.File
        The file, to which the arrays are added.

    Raises
    ------
    FileError
        The file exists, or cannot be written.
    """
    texts = {
        "kind": content["command"],
        "schema_version": SCHEMA_VERSION,
        "sign_convention": SIGN_CONVENTION,
        **facts,
        "content": json_values(content),
    }
    with new_file(path, force) as (root, sink):
        for name, value in texts.items():
            text = value if isinstance(value, str) else to_json(value)
            set_text(root["/"].id, name, text)
        write_inputs(root["/"], inputs)
        yield root
        sink.check()


def write_analysis(
    path: str,
    content: Mapping[str, Any],
    arrays: Mapping[str, Array],
    facts: Mapping[str, Any],
    inputs: Mapping[str, InputTable],
    force: bool = False,
) -> None:
    """Write the result of an analysis with arrays by name; see `new_analysis_file`."""
    with new_analysis_file(path, content, facts, inputs, force) as root:
        for name, values in arrays.items():
            add_array(root["/"], name, np.asarray(values, dtype=float))


class ModelText(NamedTuple):
    """The model of an analysis: its text, given values and tables of inputs.

    Parameters
    ----------
    text, path : str
    set, set_initial : dict of str to str
    inputs : dict of str to InputTable
        Empty in files of earlier versions.
    """

    text: str
    path: str
    set: dict[str, str]
    set_initial: dict[str, str]
    inputs: dict[str, InputTable]


def read_model_text(path: str | os.PathLike[str]) -> ModelText:
    """Return the model of an analysis file.

    Raises
    ------
    FileError
        As `read_analysis`; also if the file contains no model.
    """
    with open_verified(path) as opened:
        text, origin = (text_attribute(opened.root, name) for name in ("model", "model_path"))
        if text is None:
            raise FileError(f"{os.fspath(path)} contains no model")
        check_model(text, text_attribute(opened.root, "model_sha256") or "")
        return ModelText(
            text,
            origin or os.fspath(path),
            **_given_values(opened.root),
            inputs=read_inputs(opened.root),
        )


def _given_values(root: h5py.File) -> dict[str, dict[str, str]]:
    """Return the values that replace those of the model: ``set`` and ``set_initial``."""
    given = {}
    for name in ("set", "set_initial"):
        given[name] = json.loads(text_attribute(root, name) or "{}")
        check_json(given[name], _VALUES, name)
    return given


def read_units(path: str | os.PathLike[str]) -> dict[str, str]:
    """Return the units of an analysis file, as in ``Record.units``; none if it has none.

    Raises
    ------
    FileError
        As `read_analysis`.
    """
    with open_verified(path) as opened:
        units: dict[str, str] = json.loads(text_attribute(opened.root, "units") or "{}")
        check_json(units, _VALUES, "units")
        return units


@contextmanager
def opened_analysis(
    path: str | os.PathLike[str], command: str
) -> Iterator[tuple[h5py.File, dict[str, Any]]]:
    """Open an analysis file.

    Parameters
    ----------
    path : str or path
    command : str
        The command that must have written it; empty for any.

    Yields
    ------
    root : h5py.File
    content : dict

    Raises
    ------
    FileError
        The file is missing, damaged, or of another kind.
    """
    with open_verified(path) as opened:
        text = text_attribute(opened.root, "content")
        if text is None or (command and opened.kind != command):
            made = f"lagcli {command}" if command else "an analysis"
            raise FileError(f"cannot read {os.fspath(path)}: it is not a file of {made}")
        # numbers that JSON lacks are null; fit files had them once
        content = json.loads(text, parse_constant=lambda _: None)
        check_json(content, _schema(opened.kind), "content")
        _given_values(opened.root)
        yield opened.root, content


def _schema(kind: str) -> Mapping[str, Any]:
    """Return the schema of a kind of analysis file, which has ``analysisFile``."""
    if kind.isalpha():
        with suppress(KeyError):
            schema = published_schema(kind)
            if schema.get("analysisFile"):
                return schema
    raise ValueError(f"kind is {shortened(kind)}, which this version does not have")


def read_analysis(path: str | os.PathLike[str], command: str = "") -> dict[str, Any]:
    """Return the content of an analysis file; see `opened_analysis`."""
    with opened_analysis(path, command) as (_, content):
        return content
