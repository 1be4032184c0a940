"""The program `lagcli`: commands, exit statuses, and error handling."""

import atexit
import os
import signal
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from lagcli.cli import streams
from lagcli.cli.options import BUG_STATUS, FAILED_STATUS, INTERRUPTED_STATUS, USAGE_STATUS
from lagcli.cli.parameters import HELP, Command, CommandParameter, parameters_of
from lagcli.cli.parsing import CommandLineError, split, values
from lagcli.errors import LagcliError
from lagcli.simulations.memory import check_address_space
from lagcli.simulations.threads import limit_process
from lagcli.version import __version__

_FIRST = ("derive", "simulate", "sweep")
_FILES = sorted(os.listdir(Path(__file__).parent / "commands"))
_NAMES = [f[:-3].replace("_", "-") for f in _FILES if f.endswith(".py") and f[0] != "_"]
#: The commands, in the order of the help; each is the function with the name of its module.
COMMANDS = (*_FIRST, *(name for name in _NAMES if name not in _FIRST))

_VERSION = CommandParameter("version", ("--version",), "Print the version and exit.")
#: The program itself.
PROGRAM = Command(
    "lagcli",
    "Lagrange's equations of the first kind from a model file: derive, simulate, inspect.",
    (_VERSION,),
)
EPILOG = (
    "Exit status: 0 done; 1 a bug in lagcli; 2 usage or model error; 3 the integration"
    " failed (the partial result is kept); 4 input/output error; 130 interrupted."
)


def command(name: str) -> Command:
    """Return one of the commands; its module is imported."""
    module = name.replace("-", "_")
    function = getattr(import_module(f"lagcli.cli.commands.{module}"), module)
    parameters = getattr(function, "parameters", None) or parameters_of(function)
    described = function.__doc__ or ""  # `python -OO` leaves docstrings out
    lines = (line.strip() for line in described.splitlines())
    return Command(f"lagcli {name}", "\n".join(lines).strip(), parameters, function)


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
        status = _dispatched(arguments)
        sys.stdout.flush()
    except LagcliError as error:
        _flush()
        _say(_rendered(error))
        return error.exit_status
    except KeyboardInterrupt:
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


def _dispatched(arguments: list[str]) -> int:
    """Call the command of a command line, or print what the program's own options ask for."""
    if not arguments:
        _say(_help())
        return USAGE_STATUS
    requested = PROGRAM
    try:
        given, rest = split(arguments, (_VERSION, HELP), mixed=False)
        match next(iter(given), None):
            case "version":
                print(f"lagcli {__version__}")
                return 0
            case "help":
                print(_help())
                return 0
        if not rest:
            raise CommandLineError("Missing command.")
        name, *words = rest
        if name not in COMMANDS:
            raise _no_such_command(name)
        requested = command(name)
        given, others = split(words, (*requested.parameters, HELP))
        if HELP.name in given:
            from lagcli.cli.help import page

            print(page(requested))
            return 0
        options = values(given, others, requested.parameters)
    except CommandLineError as error:
        from lagcli.cli.help import misuse

        _say(misuse(requested, str(error)))
        return USAGE_STATUS
    return _called(requested, options)


def _called(requested: Command, options: dict[str, Any]) -> int:
    """Call a command, and print errors as JSON with ``--json``."""
    assert requested.function is not None
    check_address_space()
    try:
        return requested.function(**options) or 0
    except LagcliError as error:
        if options.get("json"):
            from lagcli.cli.summary import error_object, to_json

            streams.tell(to_json(error_object(error)))
        raise


def _help() -> str:
    """Return the help of the program."""
    from lagcli.cli.help import page

    return page(PROGRAM, [command(name) for name in COMMANDS], EPILOG)


def _no_such_command(name: str) -> CommandLineError:
    from difflib import get_close_matches

    near = ", ".join(map(repr, get_close_matches(name, COMMANDS)))
    return CommandLineError(f"No such command {name!r}." + f" Did you mean {near}?" * bool(near))


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
