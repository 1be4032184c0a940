"""Open a sweep: new, from its journal, or from its finished file."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

from lagcli.errors import UsageError
from lagcli.prose import counted
from lagcli.results.formats import check_target, format_of
from lagcli.sweeps.file.journal import Journal, check_no_journal, journal_of
from lagcli.sweeps.row_results import COMPLETED, RowStatus
from lagcli.sweeps.validate import PreparedSweep


class OpenedSweep(NamedTuple):
    """A sweep with its open journal (None if no row is missing) and the status of its rows."""

    journal: Journal | None
    row_status: RowStatus
    replace: bool  # whether the result file may already exist
    notes: list[str]  # problems of the journal


@contextmanager
def opened(
    prepared: PreparedSweep, path: str, resume: bool, retry_failed: bool, force: bool
) -> Iterator[OpenedSweep]:
    """Open or create the journal, and read the status of the rows."""
    if retry_failed and not resume:
        raise UsageError("--retry-failed requires --resume")
    journal_path = journal_of(path)
    row_status = RowStatus(*prepared.spec.size)
    described = prepared.spec.described()
    if resume and not os.path.exists(journal_path) and os.path.exists(path):
        yield OpenedSweep(_reopened(prepared, path, row_status, retry_failed), row_status, True, [])
        return
    going_on = resume and os.path.exists(journal_path)
    if not going_on:
        check_target(path, force)
        if not force:
            check_no_journal(path)
    header = {"sweep": described, "replace": force}
    journal = Journal(journal_path, header, resume=going_on)
    notes = []
    try:
        if going_on:
            refuse_difference(journal.header["sweep"], described, journal_path)
            for results in journal.recover(*prepared.spec.size):
                row_status.enter(results)
            if journal.damage:
                notes.append(_cut(journal, row_status))
            if retry_failed:
                row_status.forget_failures()
        replace = force or bool(journal.header.get("replace"))
        yield OpenedSweep(journal, row_status, replace, notes)
    except BaseException:
        journal.close()
        raise


def _cut(journal: Journal, row_status: RowStatus) -> str:
    missing = len(row_status.status) - row_status.done
    return (
        f"{journal.path} was damaged or incomplete at its end:"
        f" {counted(journal.damage, 'byte')} cut off;"
        f" {counted(row_status.done, 'row')} kept, {missing} to run"
    )


def _reopened(
    prepared: PreparedSweep, path: str, row_status: RowStatus, retry_failed: bool
) -> Journal | None:
    """Reopen a finished sweep, to repeat its failed rows if requested."""
    from lagcli.sweeps.file.store import open_sweep

    if format_of(path).sweeps == "table":
        raise UsageError(
            f"{path} is complete, and a {format_of(path).title} file does not say how it was made;"
            " write to .h5 to resume a finished sweep"
        )
    described = prepared.spec.described()
    with open_sweep(path) as file:
        refuse_difference(file.facts["sweep"], described, path)
        for results in file.results():
            row_status.enter(results)
        if not retry_failed or row_status.count(COMPLETED) == len(row_status.status):
            return None
        journal = Journal(journal_of(path), {"sweep": described, "replace": True})
        for results in file.results():
            journal.append(results)
    row_status.forget_failures()
    return journal


def refuse_difference(before: Mapping[str, Any], now: Mapping[str, Any], path: str) -> None:
    """Raise an error if a sweep to be resumed was started with other settings.

    Raises
    ------
    UsageError
        States the difference.
    """
    lines = []
    for key in now:
        old, new = before.get(key), _as_read(now[key])
        if old == new:
            continue
        if key == "model_sha256":
            lines.append("the model file has changed")
        elif isinstance(new, dict) and isinstance(old, dict):
            lines += [
                f"{name}: {_shown(old.get(name))} before, {_shown(new.get(name))} now"
                for name in dict.fromkeys([*old, *new])
                if old.get(name) != new.get(name)
            ]
        else:
            lines.append(f"{key}: {_shown(old)} before, {_shown(new)} now")
    if lines:
        raise UsageError(
            f"{path} belongs to another sweep and cannot be continued:\n"
            + "\n".join(f"  {line}" for line in lines)
            + "\n   help: give the same model and options, another file, or --force to start again"
        )


def _as_read(value: Any) -> Any:
    """Return a JSON value after a round trip through a file."""
    return json.loads(json.dumps(value))


def _shown(value: Any) -> str:
    if value is None:
        return "not given"
    text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    return text if len(text) < 60 else text[:57] + "…"
