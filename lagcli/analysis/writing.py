"""Writing any result: a run, or the result of an analysis as its command does."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from lagcli.errors import UsageError
from lagcli.results.formats import write as write_trajectory
from lagcli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from lagcli.analysis.compare.comparison import FormulationComparison
    from lagcli.analysis.compare.two_models import ModelComparison
    from lagcli.analysis.equilibria.diagram import BifurcationDiagram
    from lagcli.analysis.equilibria.equilibrium import Equilibria
    from lagcli.analysis.fit.result import FitResult
    from lagcli.analysis.linear.linear_model import LinearModel
    from lagcli.analysis.linear.modes import ModalAnalysis
    from lagcli.model.model import Model


def write(
    result: Trajectory
    | LinearModel
    | ModalAnalysis
    | Equilibria
    | BifurcationDiagram
    | FormulationComparison
    | ModelComparison
    | FitResult,
    output: str | os.PathLike[str],
    force: bool = False,
    meta: bool = False,
) -> None:
    """Write a result in the format given by the suffix, atomically.

    Parameters
    ----------
    result : Trajectory, or the result of an analysis
        A run; nt, nq, nc and the number of outputs may be 0. What `linearize`, `modes`,
        `equilibrium`, `follow_equilibria`, `compare`, `compare_models` and `fit` return is written
        as ``-o`` of their commands does.
    output : str or path
        File name. Of a run: ``.h5`` (``.hdf5``), ``.csv``, or ``-``, CSV on standard output. Of an
        analysis: ``.h5`` or, but for fits, ``.json``; of a linear model also ``.npz`` and ``.mat``.
    force : bool
        Replace an existing file.
    meta : bool
        Write the sidecar of a CSV file; HDF5 files contain all metadata.

    Raises
    ------
    FileError
        The file exists and ``force`` is false, or it cannot be written; standard output cannot be
        written (a full disk). A closed pipe remains a ``BrokenPipeError``.
    UsageError
        The suffix is unknown; a sidecar is requested with standard output or of an analysis; the
        object is no result.
    """
    if isinstance(result, Trajectory):
        write_trajectory(result, output, force, meta)
        return
    path = os.fspath(output)
    if meta:
        raise UsageError("only CSV files of runs have a sidecar: omit `meta`")
    _write_analysis(result, path, force)


def _write_analysis(result: object, path: str, force: bool) -> None:
    from lagcli.analysis.compare.comparison import FormulationComparison
    from lagcli.analysis.compare.description import describe_comparison, describe_models
    from lagcli.analysis.compare.two_models import ModelComparison
    from lagcli.analysis.equilibria.description import (
        describe_diagram,
        describe_equilibria,
        diagram_arrays,
    )
    from lagcli.analysis.equilibria.diagram import BifurcationDiagram
    from lagcli.analysis.equilibria.equilibrium import Equilibria
    from lagcli.analysis.fit.file import write_fit
    from lagcli.analysis.fit.result import FitResult
    from lagcli.analysis.linear.description import write_linear, write_modes
    from lagcli.analysis.linear.linear_model import LinearModel
    from lagcli.analysis.linear.modes import ModalAnalysis
    from lagcli.sweeps.run import Summary

    match result:
        case LinearModel():
            write_linear(result, path, force)
        case ModalAnalysis():
            write_modes(result, path, force)
        case Equilibria():
            _write_content(describe_equilibria(result), {}, result.model, path, force)
        case BifurcationDiagram():
            arrays = diagram_arrays(result)
            _write_content(describe_diagram(result), arrays, result.model, path, force)
        case FormulationComparison():
            _write_content(describe_comparison(result), {}, result.model, path, force)
        case ModelComparison(models=(first, second)):
            content = describe_models(result, first.name, second.name)
            _write_content(content, {}, first, path, force)
        case FitResult():
            write_fit(result, path, force)
        case Summary():
            raise UsageError(f"the results of this sweep are in its own file, {result.output}")
        case _:
            raise UsageError(
                f"lagcli.write: the argument is of type {type(result).__name__}; it writes runs and"
                " the results of linearize, modes, equilibrium, follow_equilibria, compare,"
                " compare_models and fit"
            )


def _write_content(
    content: Mapping[str, Any], arrays: Mapping[str, Any], model: Model, path: str, force: bool
) -> None:
    from lagcli.analysis.output.files import (
        ANALYSIS_SUFFIXES,
        check_analysis_target,
        write_content,
    )

    check_analysis_target(path, ANALYSIS_SUFFIXES, force)
    write_content(content, arrays, model, path, force)
