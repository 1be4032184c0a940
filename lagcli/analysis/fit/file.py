"""Fit files, with one group for each experiment; the fitted model as a model file."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np

from lagcli.analysis.fit.result import FitResult, FittedData
from lagcli.analysis.fit.uncertainty import ParameterCombination
from lagcli.errors import UsageError
from lagcli.json_schema import check_json
from lagcli.model.expression.units import to_si
from lagcli.model.model import Model
from lagcli.model.rewriting import rewrite
from lagcli.results.atomic import check_writable, write_file
from lagcli.results.hdf5.analysis_file import new_analysis_file, opened_analysis
from lagcli.results.hdf5.container import add_array, add_texts, attach_axes, make_axis, set_text
from lagcli.results.hdf5.inputs import read_inputs
from lagcli.results.hdf5.structure import group, read_arrays, read_texts, text_attribute
from lagcli.results.metadata import check_model, check_times
from lagcli.version import __version__

#: Datasets along ``parameter``, and their descriptions.
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
_BY_START = {
    "starts": "where searches began",
    "ends": "where searches ended",
    "costs": "chi-square at the ends",
}
#: The axes of all datasets: of the file, and of each experiment.
_LAYOUT: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(_BY_PARAMETER, ("parameter",)),
    **dict.fromkeys(_MATRICES, ("parameter", "parameter")),
    **dict.fromkeys(("starts", "ends"), ("searches", "parameter")),
    "costs": ("searches",),
}
_DATA = {
    "time": ("time",),
    "measured": ("time", "observed"),
    "model": ("time", "observed"),
    "sigmas": ("observed",),
}
#: The fitted curve, which files of earlier versions lack.
_CURVE = {"curve_time": ("curve_time",), "curve": ("curve_time", "observed")}
#: Attributes with mappings.
_JSON: dict[str, dict[str, Any]] = {
    "units": {"type": "object", "additionalProperties": {"type": "string"}},
    "parameters": {"type": "object", "additionalProperties": {"type": "number"}},
    "options": {"type": "object"},
}
_FACTS = ("model", "model_sha256", "units", "parameters", "options")
#: Fields of a result that have the same name in the content.
_IN_CONTENT = (
    *("level", "intervals", "chi_square", "sigma_estimated"),
    *("probability", "message", "runs", "seconds"),
)


def check_fit_target(path: str) -> None:
    """Raise UsageError unless a file name is that of a fit."""
    if not path.lower().endswith((".h5", ".hdf5")):
        raise UsageError(f"{path}: a fit is written as HDF5; name it fit.h5")


def write_fit(result: FitResult, path: str | os.PathLike[str], force: bool = False) -> None:
    """Write the result of a fit as HDF5, atomically.

    Parameters
    ----------
    result : FitResult
    path : path
        File name ending in ``.h5`` or ``.hdf5``.
    force : bool
        Replace an existing file.

    Raises
    ------
    UsageError
        The suffix is another one.
    FileError
        The file exists and ``force`` is false, or it cannot be written.
    """
    check_fit_target(os.fspath(path))
    facts = {name: getattr(result, name) for name in _FACTS}
    facts["lagcli_version"] = __version__
    content = {"command": "fit", **result.as_dict()}
    with new_analysis_file(os.fspath(path), content, facts, result.inputs, force) as root:
        parameter = add_texts(root, "parameter", result.names)
        observed = add_texts(root, "observed", result.observed)
        for axis, name in ((parameter, "parameter"), (observed, "observed")):
            make_axis(axis, name)
            set_text(axis, "long_name", f"names along {name}")
        for names, axes in (
            (_BY_PARAMETER, [parameter]),
            (_MATRICES, [parameter, parameter]),
            (_BY_START, []),
        ):
            for name, said in names.items():
                dataset = add_array(root, name, getattr(result, name))
                attach_axes(dataset, axes)
                set_text(dataset, "long_name", said)
        for number, data in enumerate(result.data):
            folder = root.create_group(f"data_{number}")
            set_text(folder.id, "path", data.path)
            time = add_array(folder, "time", data.times)
            make_axis(time, "time")
            set_text(time, "units", "s")
            for name in ("measured", "model", "residuals"):
                attach_axes(add_array(folder, name, getattr(data, name)), [time, observed])
            attach_axes(add_array(folder, "sigmas", data.sigmas), [observed])
            drawn = add_array(folder, "curve_time", data.curve_times)
            make_axis(drawn, "curve_time")
            set_text(drawn, "units", "s")
            attach_axes(add_array(folder, "curve", data.curve), [drawn, observed])


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
        The file is missing, damaged, or does not contain a fit.
    """
    with opened_analysis(path, "fit") as (root, content):
        names, observed = read_texts(root, "parameter"), read_texts(root, "observed")
        _check_names(content, names, observed)
        lengths = {"parameter": len(names), "observed": len(observed)}
        fields: dict[str, Any] = dict(read_arrays(root, _LAYOUT, lengths))
        for name in ("values", "start", "starts", "ends"):
            if not np.isfinite(fields[name]).all():
                raise ValueError(f"{name} has values that are not finite")
        text, digest = (text_attribute(root, name) or "" for name in ("model", "model_sha256"))
        check_model(text, digest)
        for name, schema in _JSON.items():
            fields[name] = json.loads(text_attribute(root, name) or "{}")
            check_json(fields[name], schema, name)
        for name in _IN_CONTENT:
            fields[name] = content[name]
        if content["probability"] is None:
            fields["probability"] = np.nan
        folders = [f"data_{number}" for number in range(len(content["data"]))]
        return FitResult(
            model_name=content["model"],
            model=text,
            model_sha256=digest,
            names=names,
            observed=observed,
            data=tuple(_read_data(group(root, name), lengths) for name in folders),
            active=tuple(x["active_bound"] or "" for x in content["parameters"].values()),
            combinations=tuple(
                ParameterCombination(tuple(x), tuple(x.values())) for x in content["unidentified"]
            ),
            freedom=content["degrees_of_freedom"],
            converged=content["status"] == "completed",
            failures=content["failed_runs"],
            guesses=content["guesses"],
            apart=tuple(content["apart"]),
            inputs=read_inputs(root),
            **fields,
        )


def _check_names(
    content: Mapping[str, Any], names: tuple[str, ...], observed: tuple[str, ...]
) -> None:
    """Raise ValueError unless the axes have the names of the content, and at least one."""
    if not names or tuple(content["parameters"]) != names:
        raise ValueError("parameter does not have the names of content.parameters")
    if not observed or len(set(observed)) < len(observed):
        raise ValueError("observed does not have one or more different names")
    for combination in content["unidentified"]:
        if not set(combination) <= set(names):
            raise ValueError("content.unidentified has other names than parameter")


def _read_data(folder: h5py.Group, lengths: Mapping[str, int]) -> FittedData:
    """Return an experiment of an open file."""
    arrays = read_arrays(folder, _DATA, {"observed": lengths["observed"]})
    check_times(arrays["time"])
    if (arrays["sigmas"] < 0).any():
        raise ValueError(f"{folder.name}/sigmas has negative values")
    path = text_attribute(folder, "path") or ""
    times, model = arrays["time"], arrays["model"]
    drawn = {"curve_time": times, "curve": model}
    if "curve" in folder:
        drawn = read_arrays(folder, _CURVE, {"observed": lengths["observed"]})
        check_times(drawn["curve_time"])
    return FittedData(
        *(path, times, arrays["measured"], model, arrays["sigmas"]),
        *(drawn["curve_time"], drawn["curve"]),
    )


def check_written(path: str, force: bool) -> None:
    """Raise UsageError or FileError if the model file could not be written."""
    if not path.lower().endswith((".yaml", ".yml")):
        raise UsageError(f"{path}: a model is written as YAML; name it fitted.yaml")
    check_writable(path, force)


def write_model(model: Model, result: FitResult, path: str | os.PathLike[str], force: bool) -> None:
    """Write a model file with the fitted values, and with guesses that lead to the assembly found.

    Comments and layout are preserved.

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
    for name, value in result.guesses.items():
        initial[name] = f"{{guess: {_text(model, name, value)}}}"
    text = rewrite(model.text, model.path, values, initial)
    write_file(os.fspath(path), text.encode(), force)


def _text(model: Model, name: str, value: float) -> str:
    """Return a value in the unit of the file."""
    unit = model.parameters[name].unit if name in model.parameters else model.initial[name].unit
    if unit is None:
        return f"{value:.15g}"
    return f"{value / float(to_si(unit)):.15g} {unit}"
