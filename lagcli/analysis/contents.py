"""Text output for the contents of analysis files, by command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lagcli.errors import FileError


def format_content(content: Mapping[str, Any]) -> str:
    """Return the text that the command prints for a content.

    Raises
    ------
    FileError
        The content is of a command that this version does not have.
    """
    match content["command"]:
        case "compare":
            from lagcli.analysis.compare.description import format_comparison

            return format_comparison(content)
        case "linearize":
            from lagcli.analysis.linear.description import format_linear

            return format_linear(content)
        case "modes":
            from lagcli.analysis.linear.description import format_modes

            return format_modes(content)
        case "equilibrium" if "branches" in content:
            from lagcli.analysis.equilibria.description import format_diagram

            return format_diagram(content)
        case "equilibrium":
            from lagcli.analysis.equilibria.description import format_equilibria

            return format_equilibria(content)
    raise FileError(
        f"the file was written by lagcli {content['command']}, which this version does not have"
    )
