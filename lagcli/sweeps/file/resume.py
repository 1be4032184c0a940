"""What a sweep finds of itself: nothing, its journal, or its file."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

from lagcli.errors import UsageError
from lagcli.results.formats import check_target, format_of
from lagcli.sweeps.file.journal import Journal, check_no_journal, journal_of
from lagcli.sweeps.file.row_status import Ledger
from lagcli.sweeps.plan.validate import Ready
from lagcli.sweeps.rows.rows import COMPLETED


class OpenedSweep(NamedTuple):
    """An open journal (none where nothing is left to do), and what is done."""

    journal: Journal | None
    ledger: Ledger
    replace: bool  # whether the result file may be there
    notes: list[str]  # what was wrong with the journal


@contextmanager
def opened(
    ready: Ready, path: str, resume: bool, retry_failed: bool, force: bool
) -> Iterator[OpenedSweep]:
    """Find or make the journal, and read what is done."""
    if retry_failed and not resume:
        raise UsageError("--retry-failed goes with --resume")
    journal_path = journal_of(path)
    ledger = Ledger(ready.spec.plan.length)
    described = ready.spec.described()
    if resume and not os.path.exists(journal_path) and os.path.exists(path):
        yield OpenedSweep(_reopened(ready, path, ledger, retry_failed), ledger, True, [])
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
            for results in journal.recover(*ready.spec.size):
                ledger.enter(results)
            if journal.damage:
                notes.append(_cut(journal, ledger))
            if retry_failed:
                ledger.forget_failures()
        replace = force or bool(journal.header.get("replace"))
        yield OpenedSweep(journal, ledger, replace, notes)
    except BaseException:
        journal.close()
        raise


def _cut(journal: Journal, ledger: Ledger) -> str:
    missing = len(ledger.status) - ledger.done
    return (
        f"{journal.path} was damaged or incomplete at its end: {journal.damage} bytes were cut off;"
        f" {ledger.done} rows are kept, the other {missing} are run"
    )


def _reopened(ready: Ready, path: str, ledger: Ledger, retry_failed: bool) -> Journal | None:
    """Take up a finished sweep again: its failed rows, if these are to be run again."""
    from lagcli.sweeps.file.store import open_sweep

    if format_of(path) == "csv":
        raise UsageError(
            f"{path} is complete, and a CSV file does not say how it was made; write to .h5 to"
            " resume a finished sweep"
        )
    described = ready.spec.described()
    with open_sweep(path) as file:
        refuse_difference(file.facts["sweep"], described, path)
        for results in file.results():
            ledger.enter(results)
        if not retry_failed or ledger.count(COMPLETED) == len(ledger.status):
            return None
        journal = Journal(journal_of(path), {"sweep": described, "replace": True})
        for results in file.results():
            journal.append(results)
    ledger.forget_failures()
    return journal


def refuse_difference(before: Mapping[str, Any], now: Mapping[str, Any], path: str) -> None:
    """Raise if a sweep that is to be resumed was begun as another.

    Raises
    ------
    UsageError
        Names what differs.
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
            f"{path} is of another sweep, so that its rows cannot be gone on with:\n"
            + "\n".join(f"  {line}" for line in lines)
            + "\n   help: give the same model and options, another file, or --force to begin anew"
        )


def _as_read(value: Any) -> Any:
    """Return a JSON value as it comes back from a file."""
    return json.loads(json.dumps(value))


def _shown(value: Any) -> str:
    if value is None:
        return "not given"
    text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    return text if len(text) < 60 else text[:57] + "…"
