"""The program `lagcli`: commands, exit statuses, and error handling."""

import atexit
import functools
import gc
import os
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from lagcli.cli import streams
from lagcli.cli.options import BUG_STATUS, FAILED_STATUS, INTERRUPTED_STATUS
from lagcli.errors import LagcliError
from lagcli.simulations.memory import check_address_space
from lagcli.simulations.threads import limit_process
from lagcli.version import __version__

_FIRST = ("derive", "simulate", "sweep")
_FILES = sorted(os.listdir(Path(__file__).parent / "commands"))
_NAMES = [f[:-3].replace("_", "-") for f in _FILES if f.endswith(".py") and f[0] != "_"]
#: The commands, in the order of the help; each is the function with the name of its module.
COMMANDS = (*_FIRST, *(name for name in _NAMES if name not in _FIRST))


class _Interrupted(Exception):
    """Ctrl-C without a run whose samples are kept."""


def program(arguments: Sequence[str] = ()) -> Any:
    """Return the program for these arguments: with only the requested command, or with all.

    Building the options of a command takes milliseconds, so if a command is named, only this one is
    built.
    """
    app = typer.Typer(
        name="lagcli",
        help="Lagrange's equations of the first kind from a model file: derive, simulate, inspect.",
        epilog="Exit status: 0 done; 1 a bug in lagcli; 2 usage or model error; 3 the integration"
        " failed (the partial result is kept); 4 input/output error; 130 interrupted.",
        no_args_is_help=True,
        add_completion=False,
        # plain help: the same on every terminal, without importing a formatter
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["--help", "-h"], "max_content_width": 100},
    )
    app.callback()(_program)
    for name in [a for a in arguments[:1] if a in COMMANDS] or COMMANDS:
        module = name.replace("-", "_")
        app.command(name)(_command(getattr(import_module(f"lagcli.cli.commands.{module}"), module)))
    return typer.main.get_command(app)


def _command(function: Callable[..., int | None]) -> Callable[..., int | None]:
    """Propagate interrupts through Typer, and print errors as JSON with ``--json``."""

    @functools.wraps(function)
    def command(*arguments: Any, **options: Any) -> int | None:
        check_address_space()
        try:
            return function(*arguments, **options)
        except LagcliError as error:
            if options.get("json"):
                from lagcli.cli.summary import error_object, to_json

                streams.tell(to_json(error_object(error)))
            raise
        except KeyboardInterrupt:
            raise _Interrupted from None

    return command


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


def main() -> None:
    """Run the command line and exit with its status.

    An interrupted command is terminated by SIGINT, which a shell reports as status 130: after an
    ordinary exit, the shell would consider the interrupt handled and continue its loop.
    """
    status = 0

    def die_of_interrupt() -> None:
        if status == INTERRUPTED_STATUS:
            _flush()
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            os.kill(os.getpid(), signal.SIGINT)

    if os.name == "posix":
        atexit.register(die_of_interrupt)  # registered first, called last
    limit_process()
    # a closed pipe (`lagcli derive … | head`) terminates the process like any other filter
    if hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    streams.set_up()
    status = run(sys.argv[1:])
    # skip the garbage collection at exit
    gc.freeze()
    sys.exit(status)


def run(arguments: list[str]) -> int:
    """Run one command and return its exit status."""
    try:
        result = program(arguments).main(arguments, prog_name="lagcli", standalone_mode=False)
        sys.stdout.flush()
    except LagcliError as error:
        _flush()
        _say(_rendered(error))
        return error.exit_status
    except (_Interrupted, KeyboardInterrupt):
        _say("interrupted")
        return INTERRUPTED_STATUS
    except MemoryError:
        _say(
            "error: there is not enough memory for this; ask for fewer samples, close other"
            " programs, or raise the limit (ulimit -v)"
        )
        return FAILED_STATUS
    except Exception as error:
        return _other(error)
    return result if isinstance(result, int) else 0


def _flush() -> None:
    """Flush standard output; discard the rest if it cannot be written."""
    try:
        sys.stdout.flush()
    except (LagcliError, OSError):
        streams.discard()


def _other(error: Exception) -> int:
    """Report a usage error of the command line itself, or a bug."""
    _flush()
    if hasattr(error, "show") and hasattr(error, "exit_code"):
        error.show()
        return int(error.exit_code)
    if type(error).__name__ == "Abort":
        _say("interrupted")
        return INTERRUPTED_STATUS
    if type(error).__name__ == "Exit":
        return int(getattr(error, "exit_code", 0))
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
    print(text, file=sys.stderr)
