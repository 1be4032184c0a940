"""Names of the files beside a CSV file."""

from __future__ import annotations

import os


def events_path(path: str) -> str:
    """Return the name of the table beside a CSV file: ``run.events.csv`` of ``run.csv``."""
    stem, suffix = os.path.splitext(path)
    return f"{stem}.events{suffix}"


def sidecar_path(path: str) -> str:
    """Return the name of the sidecar.

    Parameters
    ----------
    path : str
        The CSV file.

    Returns
    -------
    str
        ``PATH.json``.
    """
    return f"{path}.json"
