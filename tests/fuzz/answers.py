"""What commands answer, in this process."""

from __future__ import annotations

import contextlib
import faulthandler
import io
import warnings

from lagcli.cli.app import run

#: Seconds after which a command that does not end stops the test.
HANGS = 120


def answer(*arguments: str) -> tuple[int, str]:
    """Return the status of a command and what it prints."""
    out, err = io.StringIO(), io.StringIO()
    faulthandler.dump_traceback_later(HANGS, exit=True)
    try:
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("error")  # a warning is a stray line on standard error
            status = run(list(arguments))
    finally:
        faulthandler.cancel_dump_traceback_later()
    return status, out.getvalue() + err.getvalue()
