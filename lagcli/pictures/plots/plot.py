"""Plots of results: of runs, of sweeps, and of analyses."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from lagcli.errors import ModelError, UsageError, check_texts
from lagcli.pictures.plots.figure import FigureFile, check_picture
from lagcli.pictures.plots.run_plot import plot_runs
from lagcli.pictures.run_file import RunFile, check_source
from lagcli.results.formats import kind_of
from lagcli.results.metadata import KIND
from lagcli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from lagcli.model.model import Model

Source = str | os.PathLike[str] | Trajectory


def plot(
    results: Source | Sequence[Source],
    output: str | os.PathLike[str],
    names: Sequence[str] = (),
    *,
    title: str | None = None,
    size: tuple[float, float] | None = None,
    dpi: float = 150,
    model: str | None = None,
    bands: Sequence[str] = (),
    force: bool = False,
) -> tuple[str, ...]:
    """Plot results to a file.

    Parameters
    ----------
    results : path or Trajectory, or sequence of them
        Runs, drawn together, or one file of a sweep, a fit, branches or modes.
    output : path
        File name ending in ``.png``, ``.svg`` or ``.pdf``.
    names : sequence of str
        Quantities to plot: see docs/pictures.md. By default, for runs, coordinates, multipliers and
        energies; for a sweep, its measures; for a fit, the observed quantities; for branches, the
        varying ones.
    title : str, optional
        By default the model's name, and the status of a run that is not complete.
    size : (float, float), optional
        Width and height, inches.
    dpi : float
        Resolution; for a vector format, only the thinning of long runs depends on it.
    model : str, optional
        A model file instead of the text in the result.
    bands : sequence of str
        Spreads of parameters, ``l=0.01`` or ``l=5%``, for bands around the curves of runs with
        derivatives; for a sweep, the part of the rows between the ends of bands, ``90%``.
    force : bool
        Replace an existing file.

    Returns
    -------
    tuple of str
        Notes for the reader of the picture.

    Raises
    ------
    UsageError
        A name is unknown, there is nothing to draw, the picture is too large, or matplotlib is not
        installed.
    FileError
        A file cannot be read or written.
    """
    check_texts("names", names, "['phi', 'lambda.guide']")
    check_texts("bands", bands, "['l=5%']")
    path = os.fspath(output)
    kind = check_picture(path, force)
    sources: list[Source]
    if isinstance(results, (str, os.PathLike, Trajectory)) or not isinstance(results, Iterable):
        sources = [results]
    else:
        sources = list(results)
    for source in sources:
        check_source("plot", source)
    target = FigureFile(path, kind, title, size, dpi, force)
    kinds = [(source, file_kind(source)) for source in sources]
    file, what = next(((str(x), of) for x, of in kinds if of != KIND), ("", KIND))
    if what == KIND:
        return plot_runs([RunFile(source, model) for source in sources], names, target, bands)
    if len(sources) > 1:
        raise UsageError(f"{file} ({what}) cannot share a figure; plot it separately")
    if bands and what != "sweep":
        raise _no_band(file, what)
    if what == "sweep":
        return _plot_sweep(file, names, target, model, bands)
    if what == "fit":
        from lagcli.pictures.plots.analysis_plot import plot_fit

        plot_fit(file, names, target)
        return ()
    from lagcli.pictures.plots.analysis_plot import plot_analysis
    from lagcli.results.hdf5.analysis_file import read_analysis, read_units

    content, units = read_analysis(file), read_units(file)
    plot_analysis(content, names, target, model=_model_of(file), units=units, path=file)
    return ()


def _model_of(file: str) -> Model | None:
    """Return the model of an analysis; None if it is not that of this version, or lacks data."""
    from lagcli.analysis.output.files import stored_model

    try:
        return stored_model(file)
    except ModelError:
        return None


def _no_band(file: str, kind: str) -> UsageError:
    """Return the error of bands in a plot of an analysis."""
    return UsageError(
        f"--band is for sweeps and for runs with --sensitivity; {file} is the file of"
        f" {'an' if kind[0] in 'aeiou' else 'a'} {kind}"
    )


def _plot_sweep(
    file: str, names: Sequence[str], target: FigureFile, model: str | None, bands: Sequence[str]
) -> tuple[str, ...]:
    from lagcli.pictures.plots.bands import read_part
    from lagcli.pictures.plots.sweep_plot import PlottedTable, Rows, plot_row_bands, plot_table

    table = PlottedTable(file)
    part = read_part(bands) if bands else None
    if not table.kept or (all(map(table.knows, names)) and (names or table.measures)):
        plot_table(table, names, target, part)
        return ()
    if part is not None:
        return plot_row_bands(file, model, names, target, part)
    rows = Rows(file, model)
    notes = plot_runs(rows.runs, names, target)
    drawn = len(rows.runs)
    return (*notes, f"{drawn} of {rows.good} rows drawn") if drawn < rows.good else notes


def file_kind(source: Source) -> str:
    """Return the kind of a source: a run, a sweep, a fit or another analysis."""
    return KIND if isinstance(source, Trajectory) else kind_of(source)
