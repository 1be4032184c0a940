"""A sweep file as CSV: one line for each row."""

from __future__ import annotations

import csv
import io
import os

from lagcli.results.atomic import whole_file
from lagcli.results.csv.writer import check_csv_target


def export_csv(
    path: str | os.PathLike[str], output: str | os.PathLike[str], force: bool = False
) -> None:
    """Write varied values, measures and statuses of a sweep file as CSV.

    Parameters
    ----------
    path : str or path
        A sweep file, ``.h5``.
    output : str or path
        The CSV file; its columns are ``run``, the varied quantities, the measures, ``status`` and
        ``message``. Numbers have 17 digits; NaN is ``nan``.
    force : bool
        Replace an existing file.

    Raises
    ------
    FileError
        One of the files cannot be read or written, or exists already.
    """
    from lagcli.sweeps.file.store import SLAB, open_sweep
    from lagcli.sweeps.row_results import STATUSES

    output = os.fspath(output)
    check_csv_target(output, force)
    with open_sweep(path) as file, whole_file(output, force) as target:
        columns = [*file.columns, *file.measures]
        write = csv.writer(text := io.StringIO(), lineterminator="\n").writerow
        write(["run", *(c.dataset for c in columns), "status", "message"])
        for start in range(0, file.length, SLAB):
            rows = slice(start, min(start + SLAB, file.length))
            numbers = [file.read(c.dataset, rows).tolist() for c in columns]
            statuses = [STATUSES[s] for s in file.read("status", rows).tolist()]
            lines = zip(
                range(rows.start, rows.stop), *numbers, statuses, file.messages(rows), strict=True
            )
            for line in lines:
                write(line)
            target.write(text.getvalue().encode())
            text.seek(0)
            text.truncate()
        if not file.length:
            target.write(text.getvalue().encode())
