"""Results: a Trajectory to a file and back, and what a file holds."""

from lagcli.results.formats import check_target, read, write
from lagcli.results.info import describe, format_info

__all__ = ["check_target", "describe", "format_info", "read", "write"]
