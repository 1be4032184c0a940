"""Block triangular form of a square system, from its structure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple


class CoordinateBlock(NamedTuple):
    """Rows and columns that are solved together; earlier blocks are known."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


def triangular_blocks(incidence: Sequence[set[int]]) -> list[CoordinateBlock]:
    """Order a structurally nonsingular system so that each block depends only on earlier ones.

    Parameters
    ----------
    incidence : sequence of sets of int
        The columns with nonzero entries, by row; as many columns as rows.

    Returns
    -------
    list of CoordinateBlock
        Rows by position in ``incidence``. The strongly connected components of the directed graph
        of a perfect matching (Dulmage–Mendelsohn decomposition of a square system).

    Raises
    ------
    ValueError
        There is no perfect matching: the system is structurally singular.
    """
    row_of = _matching(incidence)
    column_of = {row: column for column, row in row_of.items()}
    needs = [{row_of[c] for c in columns} | {i} for i, columns in enumerate(incidence)]
    reach = [_reachable(i, needs) for i in range(len(needs))]
    found: list[CoordinateBlock] = []
    for i in sorted(range(len(needs)), key=lambda i: (len(reach[i]), i)):
        if any(i in block.rows for block in found):
            continue
        rows = tuple(sorted(j for j in reach[i] if i in reach[j]))
        found.append(CoordinateBlock(rows, tuple(sorted(column_of[j] for j in rows))))
    return found


def _matching(incidence: Sequence[set[int]]) -> dict[int, int]:
    """Return a row for each column, by augmenting paths."""
    row_of: dict[int, int] = {}
    for start in range(len(incidence)):
        came_from: dict[int, tuple[int, int | None]] = {}  # column: (row, column before it)
        queue: list[tuple[int, int | None]] = [(start, None)]
        end: int | None = None
        while queue and end is None:
            row, before = queue.pop(0)
            for column in sorted(incidence[row]):
                if column in came_from:
                    continue
                came_from[column] = (row, before)
                if column not in row_of:
                    end = column
                    break
                queue.append((row_of[column], column))
        if end is None:
            raise ValueError("structurally singular")
        while end is not None:
            row, before = came_from[end]
            row_of[end] = row
            end = before
    return row_of


def _reachable(start: int, needs: Sequence[set[int]]) -> set[int]:
    found, stack = {start}, [start]
    while stack:
        for j in needs[stack.pop()] - found:
            found.add(j)
            stack.append(j)
    return found
