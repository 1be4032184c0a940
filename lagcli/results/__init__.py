"""Results: a run to a file and back."""

from lagcli.results.formats import check_target, open_writer, read, write

__all__ = ["check_target", "open_writer", "read", "write"]
