"""Linear models and modes as files: JSON, NumPy, MATLAB, HDF5."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from lagcli.analysis.files import check_analysis_target, write_bytes, write_content
from lagcli.analysis.linear.description import describe_linear, describe_modes, matrices
from lagcli.analysis.linear.linear_model import LinearModel
from lagcli.analysis.linear.modes import ModalAnalysis
from lagcli.model.model import Model

LINEAR_SUFFIXES = (".json", ".npz", ".mat", ".h5")
MODES_SUFFIXES = (".json", ".h5")


def write_linear(linear: LinearModel, model: Model, path: str, force: bool = False) -> None:
    """Write a linear model in the format given by the suffix.

    ``.npz`` and ``.mat`` contain the matrices by name and the names of the states, inputs and
    outputs; ``scipy.signal.StateSpace(A, B, C, D)`` and MATLAB's ``ss(A, B, C, D)`` accept them.

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
        write_bytes(path, held.getvalue(), force)
    elif suffix == ".mat":
        from scipy.io import savemat

        held = io.BytesIO()
        lists: Mapping[str, Any] = {k: np.array(v, dtype=object) for k, v in names.items()}
        savemat(held, {**arrays, **lists, "model": linear.model}, oned_as="column")
        write_bytes(path, held.getvalue(), force)
    else:
        write_content(content, arrays, model, path, force)


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
    write_content(describe_modes(analysis), arrays, model, path, force)


def _parts(values: np.ndarray) -> np.ndarray:
    """Return real and imaginary parts along a new last axis."""
    return np.stack([values.real, values.imag], axis=-1)
