"""Execution of a sweep: run the missing rows, journal them, write the file."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from numbers import Integral
from pathlib import Path
from typing import Any

from lagcli.column_units import NOT_STATED
from lagcli.engine.contract import Interrupted
from lagcli.errors import FileError, UsageError, check_texts, check_values
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.model.reading import read_text
from lagcli.model.sections.presets import with_preset
from lagcli.prose import counted
from lagcli.results.formats import format_of
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.cancellation import Interruption
from lagcli.sweeps.columns import named_measure
from lagcli.sweeps.file.journal import Journal
from lagcli.sweeps.file.resume import OpenedSweep, opened
from lagcli.sweeps.file.store import export_csv
from lagcli.sweeps.plan.plan import Spec
from lagcli.sweeps.row_results import COMPLETED, MissingRows, Results
from lagcli.sweeps.rows.workers import Chunks, run_here
from lagcli.sweeps.validate import PreparedSweep, SweepRequest, prepare_sweep

#: Function that runs the missing rows of a sweep and yields their results, in any order.
Executor = Callable[[Spec, Chunks, Callable[[], None]], Iterable[Results]]


@dataclass(frozen=True)
class Summary:
    """Summary of a sweep.

    Parameters
    ----------
    status : str
        ``completed`` (every row has a result, possibly a failure) or ``interrupted``.
    output : str or None
        The result file; for an interrupted sweep, the journal for ``resume``, or None if it was
        removed during the sweep.
    rows, done, ok : int
        Numbers of all rows, of those with a result, and of completed ones.
    failed : dict of str to int
        Numbers of failed rows, by cause.
    warnings : dict of str to int
        Numbers of completed rows with values that are not finite, by warning.
    run : int
        Number of rows run now, not taken from the journal.
    rows_per_second : float
        Rows per second of these.
    seconds : float
    keep : str
    measures : list of str
    ranges : dict of str to dict
        Of the measures that have values: ``min``, ``max``, the rows ``row_min`` and ``row_max`` of
        these, and the ``unit``, None if it is not known.
    notes : list of str
        Problems of the journal of a resumed sweep.
    """

    status: str
    output: str | None
    rows: int
    done: int
    ok: int
    failed: dict[str, int]
    warnings: dict[str, int]
    run: int
    rows_per_second: float
    seconds: float
    keep: str
    measures: list[str]
    ranges: dict[str, dict[str, Any]]
    notes: list[str]

    def as_dict(self) -> dict[str, Any]:
        """Return the summary as JSON values."""
        return asdict(self)


def sweep(
    model: str | Path | Model,
    vary: Sequence[str],
    output: str | os.PathLike[str],
    *,
    measures: Sequence[str] | Mapping[str, str] = (),
    keep: str | None = None,
    sample: str | None = None,
    seed: int = 0,
    zipped: bool = False,
    set: Mapping[str, object] | None = None,
    set_initial: Mapping[str, object] | None = None,
    preset: str | None = None,
    jobs: int | None = None,
    resume: bool = False,
    retry_failed: bool = False,
    strict: bool = False,
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
    settings: SettingsOverrides | None = None,
    **options: Any,
) -> Summary:
    """Simulate a model for many values of its parameters and initial values.

    Parameters
    ----------
    model : path or Model
        Model, or its file. A Model is used with its text and the values it was loaded with.
    vary : sequence of str
        ``m=1:2:0.1``, ``l=0.2,0.3``, ``@file.csv``, …; see docs/sweeps.md.
    output : str or path
        ``.h5``, or ``.csv`` for only the measures.
    measures : sequence of str, or mapping of names to expressions
        ``max(abs(lambda.guide))``, ``peak=max(x)``, ….
    keep : "measures" or "trajectories", optional
        Whether to store the samples of each row. By default, if no measure is given, the file is
        HDF5 and they take less than 1 GB.
    sample, seed, zipped
        As for `lagcli.sweeps.plan.plan.make_plan`.
    set, set_initial : mappings, optional
        Values that replace the model's in all rows.
    preset : str, optional
        A preset of the model, whose values ``vary``, ``set`` and ``set_initial`` replace.
    jobs : int, optional
        Number of processes; by default the number of available processors. Results do not depend on
        it.
    resume : bool
        Continue an interrupted sweep, or start one.
    retry_failed : bool
        With ``resume``, repeat failed rows.
    strict : bool
        Count rows as failed for which `simulate` would warn about energy balance, residuals,
        inertia or values that are not finite.
    force : bool
        Replace an existing file, and restart.
    progress : callable, optional
        Called with the numbers of completed and of all rows.
    executor : callable, optional
        Runs the rows on other machines.
    settings : SettingsOverrides, optional
    **options
        Settings by name, instead of ``settings``.

    Returns
    -------
    Summary
        A failed row does not stop the others: its status and message are in the file.

    Raises
    ------
    UsageError, ModelError
        The options, the model or a measure is invalid; or the sweep to resume is a different one.
    FileError
        A file cannot be read or written. Completed rows remain in the journal.
    """
    began = time.monotonic()
    path = os.fspath(output)
    _check_arguments(vary, measures, {"set": set, "set_initial": set_initial})
    seed = _whole("seed", seed)
    if jobs is not None and _whole("jobs", jobs) < 1:
        raise UsageError(f"`jobs` must be at least 1, not {jobs}")
    if options:
        settings = SettingsOverrides(**options).over(settings or SettingsOverrides())
    text, name = (model.text, model.path) if isinstance(model, Model) else read_text(model)
    data = model.data if isinstance(model, Model) else None
    if isinstance(model, Model):
        set = {**model.set, **(set or {})}
        set_initial = {**model.set_initial, **(set_initial or {})}
    if preset is not None:
        loaded = load_text(text, name, set, set_initial, data)
        varied = [item.partition("=")[0].strip() for item in vary]
        set, set_initial = with_preset(loaded, preset, set or {}, set_initial or {}, varied)
    given = measures.items() if isinstance(measures, Mapping) else map(named_measure, measures)
    request = SweepRequest(vary, sample, seed, zipped, tuple(given), keep, strict)
    prepared = prepare_sweep(
        text, name, set or {}, set_initial or {}, settings, request, path, data
    )
    with opened(prepared, path, resume, retry_failed, force) as state:
        runs = _Sweep(prepared, state, path, began)
        if state.journal is None:
            return runs.summary("completed", path, 0)
        jobs = jobs or _processors()
        return runs.run(
            state.journal,
            jobs,
            progress or (lambda done, rows: None),
            executor or partial(run_here, jobs=jobs),
        )


def _check_arguments(
    vary: object, measures: object, replaced: Mapping[str, Mapping[str, object] | None]
) -> None:
    """Reject arguments whose Python types are wrong, by their names.

    Raises
    ------
    UsageError
    """
    check_texts("vary", vary, "['m=1:2:0.1']")
    texts = [*measures, *measures.values()] if isinstance(measures, Mapping) else measures
    check_texts("measures", texts, "['peak=max(x)'], or a dict such as {'peak': 'max(x)'}")
    for argument, values in replaced.items():
        check_values(argument, values)


def _whole(argument: str, value: object) -> int:
    """Return an argument that is a whole number; raise UsageError if it is none."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise UsageError(f"`{argument}` must be a whole number, not {value!r}")
    return int(value)


class _Sweep:
    """One execution of a sweep."""

    def __init__(self, prepared: PreparedSweep, state: OpenedSweep, path: str, began: float):
        self.prepared, self.state, self.path, self.began = prepared, state, path, began
        self.row_status = state.row_status

    def run(
        self,
        journal: Journal,
        jobs: int,
        progress: Callable[[int, int], None],
        executor: Executor,
    ) -> Summary:
        self.journal = journal
        missing = MissingRows(self.row_status)
        before = self.row_status.done
        chunks = Chunks(missing, self.prepared.row_bytes, jobs)
        done, all_ = before, self.prepared.spec.plan.length
        with Interruption(signal.SIGINT, signal.SIGTERM) as interruption:

            def check_cancelled() -> None:
                if interruption.requested():
                    raise Interrupted

            try:
                for results in executor(self.prepared.spec, chunks, check_cancelled):
                    self._keep(results)
                    done += len(results.numbers)
                    progress(done, all_)
                    check_cancelled()
            except (Interrupted, KeyboardInterrupt):
                kept = None if journal.lost else journal.path
                journal.close()
                return self.summary("interrupted", kept, done - before)
        seconds = time.monotonic() - self.began
        self._write(seconds)
        journal.remove()
        return self.summary("completed", self.path, done - before)

    def summary(self, status: str, output: str | None, run: int) -> Summary:
        """Return the summary of the sweep, given the number of rows run now."""
        row_status, spec = self.row_status, self.prepared.spec
        seconds = time.monotonic() - self.began
        return Summary(
            status=status,
            output=output,
            rows=len(row_status.status),
            done=row_status.done,
            ok=row_status.count(COMPLETED),
            failed=row_status.failures(),
            warnings=row_status.warnings(),
            run=run,
            rows_per_second=run / seconds,
            seconds=seconds,
            keep=spec.keep,
            measures=[name for name, _ in spec.measures],
            ranges={
                column.name: {
                    "min": known.low,
                    "row_min": known.low_row,
                    "max": known.high,
                    "row_max": known.high_row,
                    "unit": None if column.unit == NOT_STATED else column.unit,
                }
                for column, known in zip(self.prepared.measures, row_status.ranges(), strict=True)
                if known is not None
            },
            notes=self.state.notes,
        )

    def _keep(self, results: Results) -> None:
        folder = os.path.dirname(self.journal.path) or "."
        if self.journal.lost and not os.path.isdir(folder):
            raise FileError(
                f"cannot write {self.journal.path}: the folder {folder} was removed while the sweep"
                f" ran, and with it {counted(self.row_status.done, 'row')}; run the sweep again"
            )
        try:
            self.journal.append(results)
        except FileError as error:
            kept = f"{counted(self.row_status.done, 'row')} kept"
            raise self._noted(error, kept, "goes on") from error
        self.row_status.enter(results)

    def _noted(self, error: FileError, kept: str, does: str) -> FileError:
        """Return an error with the number of stored rows."""
        path = self.journal.path
        if self.journal.lost:
            note = f"{path} was removed while the sweep ran, and its rows with it; run it again"
        else:
            note = f"{kept} in {path}; the same command with --resume {does}"
        return FileError(f"{error}\n   note: {note}")

    def _write(self, seconds: float) -> None:
        try:
            if format_of(self.path).sweeps == "table":
                self._write_csv(seconds)
            else:
                self._write_hdf5(self.path, seconds, self.state.replace)
        except FileError as error:
            raise self._noted(error, "all rows are kept", "writes the file") from error

    def _write_hdf5(self, path: str, seconds: float, force: bool) -> None:
        from lagcli.sweeps.file.store import write_sweep

        facts = {
            "rows": self.row_status.statuses(),
            "failures": self.row_status.failures(),
            "seconds": {"total": seconds},
        }
        results = self.journal.results(*self.prepared.spec.size)
        write_sweep(path, self.prepared, results, facts, force)

    def _write_csv(self, seconds: float) -> None:
        """Write CSV from a temporary sweep file."""
        hidden = f"{self.path}.{os.getpid()}.h5"
        try:
            self._write_hdf5(hidden, seconds, force=True)
            export_csv(hidden, self.path, self.state.replace)
        finally:
            Path(hidden).unlink(missing_ok=True)


def _processors() -> int:
    """Return the number of processors available to this process, which a batch system may limit."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
