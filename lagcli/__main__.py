"""The program: `lagcli`, and `python -m lagcli`."""

import gc


def main() -> None:
    """Run the command line and exit with its status."""
    # Imported objects live until the end, and a run creates few cycles: repeated garbage collection
    # during imports would take a tenth of a short run.
    gc.set_threshold(200_000)
    from lagcli.cli.app import main as run

    run()


if __name__ == "__main__":
    main()
