"""The model of an analysis file."""

from __future__ import annotations

import os

from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.results.hdf5.analysis_file import read_model_text
from lagcli.simulations.inputs import input_data


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
    given = read_model_text(path)
    return load_text(given.text, given.path, given.set, given.set_initial, input_data(given.inputs))
