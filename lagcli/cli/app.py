"""The program `lagcli`: commands, exit statuses, and error handling."""

import atexit
import functools
import os
import signal
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from lagcli.cli import streams
from lagcli.cli.options import BUG_STATUS, FAILED_STATUS, INTERRUPTED_STATUS, CommandFunction
from lagcli.errors import LagcliError
from lagcli.simulations.memory import check_address_space
from lagcli.simulations.threads import limit_process
from lagcli.version import __version__

_FIRST = ("derive", "simulate", "sweep")
_FILES = sorted(os.listdir(Path(__file__).parent / "commands"))
_NAMES = [f[:-3].replace("_", "-") for f in _FILES if f.endswith(".py") and f[0] != "_"]
#: The commands, in the order of the help; each is the function with the name of its module.
COMMANDS = (*_FIRST, *(name for name in _NAMES if name not in _FIRST))

EPILOG = (
    "Exit status: 0 done; 1 a bug in lagcli; 2 usage or model error; 3 the integration"
    " failed (the partial result is kept); 4 input/output error; 130 interrupted."
)


class Commands(TyperGroup):
    """The commands, of which only those that are called or described are imported."""

    def __init__(self, **attributes: Any):
        super().__init__(**attributes)
        self.commands = dict.fromkeys(COMMANDS)  # type: ignore[assignment]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command as Typer runs it; None if there is none of this name."""
        return command(cmd_name) if cmd_name in COMMANDS else None


def command(name: str) -> Any:
    """Return one of the commands as Typer runs it; its module is imported."""
    module = name.replace("-", "_")
    function = getattr(import_module(f"lagcli.cli.commands.{module}"), module)
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(name)(_guarded(function))
    return typer.main.get_command(alone)


def program() -> Any:
    """Return the program as Typer runs it."""
    # plain help is the same on every terminal, and imports no formatter
    app = typer.Typer(
        name="lagcli",
        cls=Commands,
        help="Lagrange's equations of the first kind from a model file: derive, simulate, inspect.",
        epilog=EPILOG,
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["--help", "-h"], "max_content_width": 100},
    )
    app.callback()(_program)
    return typer.main.get_command(app)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"lagcli {__version__}")
        raise typer.Exit


def _program(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    pass


class _Interrupted(Exception):
    """Ctrl-C where no partial result is kept; Typer would exit without a message."""


def _guarded(function: CommandFunction) -> CommandFunction:
    """Return a command that ends with its status, and prints errors as JSON with ``--json``."""

    @functools.wraps(function)
    def command(**options: Any) -> None:
        check_address_space()
        try:
            status = function(**options)
        except LagcliError as error:
            if options.get("json"):
                from lagcli.cli.summary import error_object, to_json

                streams.tell(to_json(error_object(error)))
            raise
        except KeyboardInterrupt:
            raise _Interrupted from None
        raise typer.Exit(status or 0)

    return command


def main() -> None:
    """Run the command line and exit with its status.

    The process ends without the interpreter's cleaning up, which would take as long as a short run.
    An interrupted command is terminated by SIGINT, which a shell reports as status 130: after an
    ordinary exit, the shell would consider the interrupt handled and continue its loop.
    """
    status: int | None = None

    def end() -> None:
        if status is None:
            return
        _flush()
        with suppress(OSError):
            sys.stderr.flush()
        if status == INTERRUPTED_STATUS and os.name == "posix":
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            os.kill(os.getpid(), signal.SIGINT)
        os._exit(status)

    atexit.register(end)  # registered first, called last
    limit_process()
    # a closed pipe (`lagcli derive … | head`) terminates the process like any other filter
    if hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    streams.set_up()
    status = run(sys.argv[1:])
    sys.exit(status)


def run(arguments: list[str]) -> int:
    """Run one command and return its exit status."""
    try:
        status = _status(arguments)
        sys.stdout.flush()
    except LagcliError as error:
        _flush()
        _say(_rendered(error))
        return error.exit_status
    except (_Interrupted, KeyboardInterrupt):
        _flush()
        _say("interrupted")
        return INTERRUPTED_STATUS
    except MemoryError:
        _say(
            "error: there is not enough memory for this; ask for fewer samples, close other"
            " programs, or raise the limit (ulimit -v)"
        )
        return FAILED_STATUS
    except Exception as error:
        return _bug(error)
    return status


def _status(arguments: list[str]) -> int:
    """Let Typer run a command line, and return the status that it exits with."""
    try:
        program().main(arguments, prog_name="lagcli")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0
    return 0


def _flush() -> None:
    """Flush standard output; discard the rest if it cannot be written."""
    try:
        sys.stdout.flush()
    except (LagcliError, OSError):
        streams.discard()


def _bug(error: Exception) -> int:
    """Report a bug."""
    _flush()
    import platform
    import traceback

    traceback.print_exception(error)
    _say(
        "\nThis is a bug in lagcli. Please report it with the lines above, the model file, the"
        f" command and: lagcli {__version__}, Python {platform.python_version()},"
        f" {platform.system()} {platform.machine()}."
    )
    return BUG_STATUS


def _rendered(error: LagcliError) -> str:
    text = str(error)
    return text if ": error[" in text or text.startswith("error[") else f"error: {text}"


def _say(text: str) -> None:
    from lagcli.cli.styles import print_problem

    print_problem(text)
