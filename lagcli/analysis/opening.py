"""Opening any lagcli file: a model, a result, a sweep or an analysis."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lagcli.errors import FileError
from lagcli.results.formats import SUFFIXES, kind_of, read

if TYPE_CHECKING:
    from lagcli.model.model import Model
    from lagcli.trajectory.trajectory import Trajectory


def open(path: str | os.PathLike[str]) -> Model | Trajectory | Any:
    """Open a lagcli file.

    Parameters
    ----------
    path : path
        A model file, the name of a shipped model, or a file that lagcli wrote.

    Returns
    -------
    Model
        Of a model file or a shipped model, as `load`.
    Trajectory
        Of a result file, as `read`.
    xarray.Dataset
        Of a sweep: a variable for each measure.
    dict
        Content of an analysis file (check, equilibrium, modes, fit).

    Raises
    ------
    ModelError
        The model is not valid.
    FileError
        The file is missing, damaged, or a sweep while xarray is not installed.
    """
    name = os.fspath(path)
    if not name.lower().endswith(SUFFIXES):
        from lagcli.model.loader import load

        return load(name)
    from lagcli.results.metadata import KIND

    kind = kind_of(name)
    if kind == KIND:
        return read(name)
    if kind == "sweep":
        return _open_sweep(name)
    from lagcli.results.hdf5.analysis_file import read_analysis

    return read_analysis(name)


def _open_sweep(name: str) -> Any:
    """Return a sweep as an xarray.Dataset, after a check of its contents."""
    from lagcli.results.hdf5.opening import DAMAGE, damage
    from lagcli.sweeps.file.store import open_sweep

    try:
        import h5netcdf  # noqa: F401  # xarray reads HDF5 by it, and finds it itself
        import xarray
    except ImportError as error:
        raise FileError(
            f"{name} is a sweep, which opens in xarray: pip install xarray h5netcdf"
        ) from error
    with open_sweep(name):
        pass
    try:
        with Path(name).open("rb") as file:  # as `open_verified` does
            return xarray.load_dataset(file, engine="h5netcdf", phony_dims="access")
    except DAMAGE as error:
        raise damage(name, error) from error
