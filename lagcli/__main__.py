"""The program: `lagcli`, and `python -m lagcli`."""

import gc


def main() -> None:
    """Run the command line and exit with its status."""
    # What is imported lives to the end, and a run leaves little in cycles: to look through it all
    # time and again while modules are imported would cost a tenth of a short run.
    gc.set_threshold(200_000)
    from lagcli.cli.app import main as run

    run()


if __name__ == "__main__":
    main()
