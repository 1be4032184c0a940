"""The program: `lagcli`, and `python -m lagcli`."""

import gc
import signal


def main() -> None:
    """Run the command line and exit with its status."""
    # Imported objects live until the end, and a run creates few cycles: repeated garbage collection
    # during imports would take a tenth of a short run.
    gc.set_threshold(200_000)
    # Ctrl-C during imports terminates without a traceback; nothing has begun.
    interruptible = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if interruptible:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from lagcli.cli.app import main as run

    if interruptible:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


if __name__ == "__main__":
    main()
