"""Plots of results: of runs, of sweeps, and of analyses."""

from __future__ import annotations

import os
from collections.abc import Sequence

from lagcli.errors import UsageError
from lagcli.pictures.plots.figure_file import FigureFile, check_picture
from lagcli.pictures.plots.run_plot import plot_runs
from lagcli.pictures.plots.sweep_plot import PlottedTable, plot_table
from lagcli.pictures.plots.sweep_rows import Rows
from lagcli.pictures.run_file import RunFile
from lagcli.results.formats import format_read
from lagcli.trajectory.trajectory import Trajectory

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
    force: bool = False,
) -> tuple[str, ...]:
    """Plot results to a file.

    Parameters
    ----------
    results : path or Trajectory, or sequence of them
        Runs, drawn over each other, or one file of a sweep, of branches or of modes.
    output : path
        A name that ends with ``.png``, ``.svg`` or ``.pdf``.
    names : sequence of str
        What to plot: see docs/pictures.md. By default, of runs, coordinates, multipliers and
        energies; of a sweep, its measures; of branches, what changes.
    title : str, optional
        By default the model's name, and what went wrong with a run that is not complete.
    size : (float, float), optional
        Width and height, inches.
    dpi : float
        Dots per inch; a vector format has them for nothing but how finely long runs are drawn.
    model : str, optional
        A model file in place of the text in the result.
    force : bool
        Replace an existing file.

    Returns
    -------
    tuple of str
        What the reader of the picture should know.

    Raises
    ------
    UsageError
        A name is unknown, there is nothing to draw, the picture is too large, or matplotlib is not
        installed.
    FileError
        A file cannot be read or written.
    """
    path = os.fspath(output)
    kind = check_picture(path, force)
    sources = [results] if isinstance(results, (str, os.PathLike, Trajectory)) else list(results)
    target = FigureFile(path, kind, title, size, dpi, force)
    analysis = next((found for found in map(_analysis, sources) if found is not None), None)
    if analysis is not None:
        if len(sources) > 1:
            raise UsageError(f"{analysis} is a file of an analysis, which is plotted alone")
        from lagcli.pictures.plots.analysis_plot import plot_analysis
        from lagcli.results.hdf5.analysis_file import read_analysis

        plot_analysis(read_analysis(analysis), names, target)
        return ()
    sweep = next((found for found in map(_sweep, sources) if found is not None), None)
    if sweep is None:
        plot_runs([RunFile(source, model) for source in sources], names, target)
        return ()
    if len(sources) > 1:
        raise UsageError(f"{sweep} is a sweep, which is plotted alone")
    table = PlottedTable(sweep)
    if not table.kept or (all(map(table.knows, names)) and (names or table.measures)):
        plot_table(table, names, target)
        return ()
    rows = Rows(sweep, model)
    plot_runs(rows.runs, names, target)
    drawn = len(rows.runs)
    return (f"{drawn} of {rows.good} rows are drawn",) if drawn < rows.good else ()


def _analysis(source: Source) -> str | None:
    """Return the name of a file of an analysis; None for anything else."""
    if isinstance(source, Trajectory) or format_read(source).sweeps != "all":
        return None
    from lagcli.results.hdf5.analysis_file import analysis_kind

    path = os.fspath(source)
    return path if analysis_kind(path) else None


def _sweep(source: Source) -> str | None:
    """Return the name of a sweep file; None for anything else."""
    if isinstance(source, Trajectory) or format_read(source).sweeps != "all":
        return None
    from lagcli.sweeps.file.store import is_sweep

    path = os.fspath(source)
    return path if is_sweep(path) else None
