"""The report of a run: one page that holds all that it needs."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from lagcli.results.atomic import whole_file

if TYPE_CHECKING:
    from lagcli.trajectory import Trajectory


def report(
    source: str | os.PathLike[str] | Trajectory,
    output: str | os.PathLike[str],
    *,
    title: str | None = None,
    model: str | None = None,
    force: bool = False,
) -> None:
    """Write the report of a run: equations, animation, plots and figures on one HTML page.

    The page fetches nothing, and is below 6 MB whatever the number of samples: long runs are
    thinned for the plots, of every curve the least and the largest value of each of some hundred
    intervals are kept as they are.

    Parameters
    ----------
    source : path or Trajectory
        A result file that holds its model (HDF5, or CSV with its sidecar), or a run in memory.
    output : path
        The page.
    title : str, optional
        In place of the model's name.
    model : path, optional
        A model file in place of the text that the result holds: the same model, with another view.
    force : bool
        Replace an existing file.

    Raises
    ------
    FileError
        The result cannot be read, or the page cannot be written.
    UsageError
        The result holds no model, or the view cannot be drawn.
    ModelError
        The text of the model is none for this version.
    """
    from lagcli.pictures.report.assembly import assembled
    from lagcli.pictures.run_file import Run

    page = assembled(Run(source, model), title)
    with whole_file(os.fspath(output), force) as file:
        file.write(page.encode())
