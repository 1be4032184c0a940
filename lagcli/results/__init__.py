"""Result files: writers, readers, summaries."""

from lagcli.results.formats import check_target, open_writer, read, write

__all__ = ["check_target", "open_writer", "read", "write"]
