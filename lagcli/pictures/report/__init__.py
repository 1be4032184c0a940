"""The report of a run or an analysis: one self-contained HTML page, or a PDF of a run."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, NamedTuple

from lagcli.errors import UsageError
from lagcli.prose import counted
from lagcli.results.atomic import check_writable, write_file
from lagcli.results.metadata import KIND

if TYPE_CHECKING:
    from lagcli.trajectory.trajectory import Trajectory

_SUFFIXES, _PDF = (".html", ".htm"), ".pdf"


class Report(NamedTuple):
    """A written report.

    Parameters
    ----------
    output : str
        Path of the page.
    size : int
        Size, bytes.
    samples : int or None
        Number of samples of the run; none for an analysis.
    notes : tuple of str
        Notes on the run for the reader.
    """

    output: str
    size: int
    samples: int | None
    notes: tuple[str, ...]

    @property
    def summary(self) -> str:
        """One line on the report."""
        samples = "" if self.samples is None else f"{counted(self.samples, 'sample')}, "
        return f"{self.output}: {samples}{self.size / 1000:.0f} kB"


def report(
    source: str | os.PathLike[str] | Trajectory,
    output: str | os.PathLike[str],
    *,
    title: str | None = None,
    model: str | None = None,
    modes: str | None = None,
    lang: str = "en",
    force: bool = False,
) -> Report:
    """Write the report of a run: equations, animation, plots and figures on one HTML page.

    For a sweep or an analysis file (equilibria, branches, modes, linear models, comparisons, fits),
    the page contains the results, in tables and plots, and the equations; its plots need
    matplotlib.

    The page needs no network, and is smaller than 6 MB for any number of samples: long runs are
    thinned for the plots, such that the extremes of every curve in each of some hundred intervals
    are exact.

    Parameters
    ----------
    source : path or Trajectory
        A result file that contains its model (HDF5, or CSV with its sidecar), a file of a sweep or
        an analysis (HDF5), or a run in memory.
    output : path
        The page, ``.html``; or a document with the equations and plots of a run, ``.pdf``, which
        needs an installed LaTeX.
    title : str, optional
        Title instead of the model's name.
    model : path, optional
        A model file instead of the text in the result: the same model, with another view.
    modes : str, optional
        For a run: add the modes of its model about its ``start``, the ``equilibrium`` next to it,
        or its state at a time, s; their plot needs matplotlib.
    lang : str
        Language of the page's own words: ``"en"``, ``"de"``, ``"fr"`` or ``"es"``. Texts of the
        model and messages of the program stay as they are.
    force : bool
        Replace an existing file.

    Returns
    -------
    Report

    Raises
    ------
    FileError
        The result cannot be read, or the page cannot be written.
    UsageError
        The result contains no model, its view cannot be drawn, the output is not a file name of a
        page, the language is unknown, or a PDF is asked for without LaTeX or of an analysis.
    ModelError
        The text of the model is invalid for this version.
    """
    from lagcli.pictures.plots.plot import file_kind
    from lagcli.pictures.report.run_report import assembled
    from lagcli.pictures.run_file import RunFile, check_source

    check_source("report", source)
    output = os.fspath(output)
    stem, suffix = os.path.splitext(output)
    if output == "-":
        raise UsageError("a page is written to a file; name one: -o report.html")
    if suffix.lower() not in (*_SUFFIXES, _PDF):
        raise UsageError(
            f"{output}: the suffix {suffix or '(none)'} is not that of a page; name it {stem}.html,"
            f" or {stem}.pdf for a document by LaTeX"
        )
    printed = suffix.lower() == _PDF
    if printed:
        from lagcli.pictures.pdf import check_latex

        check_latex()
        if modes is not None:
            raise UsageError("--modes is for pages, and PDF has none; write .html")
        if lang != "en":
            raise UsageError("--lang is for pages, and PDF is in English; write .html")
    check_writable(output, force)
    kind = file_kind(source)
    if kind != KIND and printed:
        raise UsageError(f"PDF is for runs; the report of {kind} is a page: -o {stem}.html")
    if kind != KIND:
        from lagcli.pictures.report.analysis_report import analysis_page

        if model is not None:
            raise UsageError("--model is for runs; a file of an analysis contains its model")
        if modes is not None:
            raise UsageError(f"--modes is for runs; {os.fspath(source)} is a file of {kind}")  # type: ignore[arg-type]
        page = analysis_page(os.fspath(source), kind, title, lang).encode(errors="replace")  # type: ignore[arg-type]
        write_file(output, page, force)
        return Report(output, len(page), None, ())
    run = RunFile(source, model)
    if printed:
        from lagcli.pictures.report.pdf_report import assembled_pdf

        page = assembled_pdf(run, title)
    else:
        page = assembled(run, title, modes, lang).encode(errors="replace")
    write_file(output, page, force)
    status, message = run.record.status, run.record.message
    ended = f"the run is marked {status}{f': {message}' if message else ''}; the report says so"
    notes = () if status in ("completed", "") else (ended,)
    return Report(output, len(page), run.count, notes)
