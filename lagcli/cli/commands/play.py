"""`lagcli play`: interactive simulation in the browser."""

import os
import sys
import threading
from typing import Annotated

import typer

from lagcli.cli.options import (
    ModelPath,
    PresetName,
    Quiet,
    SetInitial,
    SetParameter,
    assignments,
    with_settings,
)
from lagcli.settings.settings import SettingsOverrides


@with_settings("t_end", "timeout")
def play(
    model: ModelPath,
    port: Annotated[
        int | None,
        typer.Option(min=0, max=65535, help="Port of 127.0.0.1. [default: a free one]"),
    ] = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address without opening a browser.")
    ] = False,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    *,
    settings: SettingsOverrides,
    quiet: Quiet = False,
) -> int:
    """Simulate a model interactively in the browser.

    Each change of a value starts a new run. The page shows the motion, λ and the energies, with
    sliders for parameters and initial values. Only this computer can open it, at the address on
    standard output; Ctrl-C stops the server. A run that takes longer than --timeout, 5 s by
    default, is shown up to the last sample.
    """
    from lagcli.errors import UsageError
    from lagcli.model.loader import load

    try:
        from lagcli.play.server import Server, listen
    except ModuleNotFoundError as error:
        if error.name != "aiohttp":
            raise
        raise UsageError(
            "lagcli play needs aiohttp, which is not installed: pip install 'lagcli[pictures]'"
        ) from None
    from lagcli.play.runs import Played

    given = assignments("--set", set), assignments("--set-initial", set_initial)
    loaded = load(model, *given, preset=preset)
    Played(loaded, settings).check()
    server = Server(lambda: Played(loaded, settings), loaded, listen(port or 0))

    def ready() -> None:
        print(server.address, flush=True)
        if not quiet:
            print("Press Ctrl-C to stop the server", file=sys.stderr)
        if not no_browser:
            import webbrowser

            # a text browser returns when it is closed
            threading.Thread(target=webbrowser.open, args=[server.address], daemon=True).start()

    server.serve(ready)
    if server.busy:
        # a thread that derives equations cannot be stopped; exit without waiting for it
        sys.stdout.flush()
        os._exit(0)
    return 0
