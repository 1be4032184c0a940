"""Linear models and modes as files: JSON, NumPy, MATLAB, HDF5."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from lagcli.analysis.linear.description import describe_linear, describe_modes, matrices
from lagcli.analysis.linear.linear_model import LinearModel
from lagcli.analysis.linear.modes import ModalAnalysis
from lagcli.errors import UsageError
from lagcli.model.model import Model
from lagcli.results.atomic import check_writable, whole_file
from lagcli.results.metadata import to_json
from lagcli.version import __version__

LINEAR_SUFFIXES = (".json", ".npz", ".mat", ".h5")
MODES_SUFFIXES = (".json", ".h5")


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
        "parameters": model.parameter_values,
        "set": {name: str(value) for name, value in model.set.items()},
        "set_initial": {name: str(value) for name, value in model.set_initial.items()},
    }


def write_linear(linear: LinearModel, model: Model, path: str, force: bool = False) -> None:
    """Write a linear model in the format that the suffix says.

    ``.npz`` and ``.mat`` hold the matrices under their names and the names of the states, inputs
    and outputs; ``scipy.signal.StateSpace(A, B, C, D)`` and MATLAB's ``ss(A, B, C, D)`` take them.

    Raises
    ------
    UsageError, FileError
        As `check_analysis_target`.
    """
    check_analysis_target(path, LINEAR_SUFFIXES, force)
    content = describe_linear(linear)
    arrays: dict[str, Any] = dict(matrices(linear))
    names: dict[str, Any] = {
        name: np.array(content[name], dtype=str) for name in ("states", "inputs", "outputs")
    }
    suffix = os.path.splitext(path)[1].lower()
    if suffix == ".npz":
        held = io.BytesIO()
        np.savez(held, allow_pickle=False, **arrays, **names)
        _write(path, held.getvalue(), force)
    elif suffix == ".mat":
        from scipy.io import savemat

        held = io.BytesIO()
        lists: Mapping[str, Any] = {k: np.array(v, dtype=object) for k, v in names.items()}
        savemat(held, {**arrays, **lists, "model": linear.model}, oned_as="column")
        _write(path, held.getvalue(), force)
    else:
        _write_content(content, arrays, model, path, force)


def write_modes(analysis: ModalAnalysis, model: Model, path: str, force: bool = False) -> None:
    """Write modes as JSON or HDF5.

    Raises
    ------
    UsageError, FileError
        As `check_analysis_target`.
    """
    check_analysis_target(path, MODES_SUFFIXES, force)
    arrays = {"eigenvalue": _parts(np.array([m.eigenvalue for m in analysis.modes]))}
    for name in ("position", "velocity", "multipliers"):
        arrays[name] = _parts(np.array([getattr(m, name) for m in analysis.modes]))
    _write_content(describe_modes(analysis), arrays, model, path, force)


def _parts(values: np.ndarray) -> np.ndarray:
    """Return real and imaginary parts along a last axis."""
    return np.stack([values.real, values.imag], axis=-1)


def _write_content(
    content: Mapping[str, Any], arrays: Mapping[str, Any], model: Model, path: str, force: bool
) -> None:
    if path.lower().endswith(".json"):
        _write(path, (to_json(content, indent=1) + "\n").encode(), force)
        return
    from lagcli.results.hdf5.analysis_file import write_analysis

    write_analysis(path, content, arrays, facts_of(model), force)


def _write(path: str, data: bytes, force: bool) -> None:
    with whole_file(path, force) as file:
        file.write(data)
