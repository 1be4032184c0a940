"""Fit files: HDF5 with the quantities along ``parameter``, and one group for each experiment."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

from lagcli.analysis.fit.result import FitResult, FittedData
from lagcli.analysis.fit.uncertainty import ParameterCombination
from lagcli.errors import FileError
from lagcli.results.hdf5.container import (
    add_array,
    add_texts,
    attach_axes,
    make_axis,
    new_file,
    set_text,
)
from lagcli.results.hdf5.opening import not_of_lagcli, open_verified
from lagcli.results.hdf5.structure import group, numbers, read_texts, text_attribute
from lagcli.results.metadata import check_model, storable, to_json
from lagcli.trajectory.samples import SCHEMA_VERSION
from lagcli.version import __version__

#: What the file says that it is.
KIND = "fit"

#: Datasets with one number for each quantity, and what they are.
_BY_PARAMETER = {
    "values": "values found",
    "start": "values of the model file, from which the first search began",
    "bound_low": "least allowed values",
    "bound_high": "largest allowed values",
    "standard_errors": "standard errors",
    "low": "lower ends of the confidence intervals",
    "high": "upper ends of the confidence intervals",
}
_MATRICES = {"covariance": "covariance", "correlation": "correlation"}
_BY_START = {"starts": "where searches began", "ends": "where searches ended"}
_TEXTS = ("model_name", "model", "model_sha256", "intervals", "message")
_FACTS = (
    *("units", "active", "level", "chi_square", "freedom", "probability", "sigma_estimated"),
    *("converged", "runs", "failures", "parameters", "options", "seconds"),
)


def write_fit(result: FitResult, path: str | os.PathLike[str], force: bool = False) -> None:
    """Write the result of a fit as HDF5, whole or not at all.

    Parameters
    ----------
    result : FitResult
    path : path
        A name that ends with ``.h5`` or ``.hdf5``.
    force : bool
        Replace an existing file.

    Raises
    ------
    FileError
        The file exists and ``force`` is false, or it cannot be written.
    """
    with new_file(os.fspath(path), force) as (root, sink):
        place = root["/"].id
        texts = {"kind": KIND, "schema_version": SCHEMA_VERSION, "lagcli_version": __version__}
        texts |= {name: getattr(result, name) for name in _TEXTS}
        texts |= {name: to_json(getattr(result, name)) for name in _FACTS}
        texts["combinations"] = to_json([[x.names, x.changes] for x in result.combinations])
        for name, text in texts.items():
            set_text(place, name, storable(text))
        parameter = add_texts(root, "parameter", result.names)
        observed = add_texts(root, "observed", result.observed)
        for axis, name in ((parameter, "parameter"), (observed, "observed")):
            make_axis(axis, name)
            set_text(axis, "long_name", f"names along {name}")
        for names, axes in (
            (_BY_PARAMETER, [parameter]),
            (_MATRICES, [parameter, parameter]),
        ):
            for name, said in names.items():
                dataset = add_array(root, name, getattr(result, name))
                attach_axes(dataset, axes)
                set_text(dataset, "long_name", said)
        for name, said in _BY_START.items():
            set_text(add_array(root, name, getattr(result, name)), "long_name", said)
        set_text(add_array(root, "costs", result.costs), "long_name", "chi-square at the ends")
        for number, data in enumerate(result.data):
            folder = root.create_group(f"data_{number}")
            set_text(folder.id, "path", storable(data.path))
            time = add_array(folder, "time", data.times)
            make_axis(time, "time")
            set_text(time, "units", "s")
            for name in ("measured", "model", "residuals"):
                attach_axes(add_array(folder, name, getattr(data, name)), [time, observed])
            attach_axes(add_array(folder, "sigmas", data.sigmas), [observed])
        sink.check()


def read_fit(path: str | os.PathLike[str]) -> FitResult:
    """Read the result of a fit.

    Parameters
    ----------
    path : path
        A file that `write_fit` wrote.

    Returns
    -------
    FitResult

    Raises
    ------
    FileError
        The file is missing, damaged, or holds no fit.
    """
    path = os.fspath(path)
    with open_verified(path, SCHEMA_VERSION) as opened:
        if opened.kind != KIND:
            raise (
                FileError(f"cannot read {path}: it holds a {opened.kind} and not a fit")
                if opened.kind
                else not_of_lagcli(path)
            )
        root = opened.root
        fields: dict[str, Any] = {name: text_attribute(root, name) or "" for name in _TEXTS}
        check_model(fields["model"], fields["model_sha256"])
        for name in _FACTS:
            fields[name] = json.loads(text_attribute(root, name) or "null")
        combinations = json.loads(text_attribute(root, "combinations") or "[]")
        for name in (*_BY_PARAMETER, *_MATRICES, *_BY_START, "costs"):
            fields[name] = np.asarray(numbers(root, name)[()], dtype=np.float64)
        data: list[FittedData] = []
        while f"data_{len(data)}" in root:
            folder = group(root, f"data_{len(data)}")
            parts = [numbers(folder, x)[()] for x in ("time", "measured", "model", "sigmas")]
            data.append(FittedData(text_attribute(folder, "path") or "", *parts))
        probability = fields.pop("probability")
        return FitResult(
            names=read_texts(root, "parameter"),
            observed=read_texts(root, "observed"),
            data=tuple(data),
            active=tuple(fields.pop("active")),
            combinations=tuple(ParameterCombination(tuple(n), tuple(x)) for n, x in combinations),
            probability=np.nan if probability is None else probability,
            **fields,
        )


def describe_fit(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return what a fit file holds, as JSON values: its size, and `FitResult.as_dict`."""
    found = read_fit(path).as_dict()
    return {
        "path": os.fspath(path),
        "format": "hdf5",
        "bytes": os.path.getsize(path),
        "kind": KIND,
        **found,
    }


def is_fit(path: str | os.PathLike[str]) -> bool:
    """Return whether an HDF5 file holds a fit; for the errors see `read_fit`."""
    with open_verified(path, SCHEMA_VERSION) as opened:
        return opened.kind == KIND
