"""`python -m lagcli`."""

from lagcli.cli.app import main

if __name__ == "__main__":
    main()
