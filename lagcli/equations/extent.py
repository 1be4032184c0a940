"""How much of a system is printed: written out, as matrices with abbreviations, or a part of it.

What a person asked for must be there within seconds and be short enough to be read, unless the
whole is asked for. Small systems are written out. Where that takes too many lines, the entries of
M, f, B and γ are given with abbreviations, if that is much shorter; and of lists that are still too
long, the first items.
"""

from __future__ import annotations

import math
from dataclasses import replace

import symengine as se

from lagcli.equations.formulas import Line, Step
from lagcli.equations.lagrange import Equations
from lagcli.equations.matrices import Matrices, cut_short, first_part
from lagcli.equations.typeset import weight

#: Lines of text, about, that are printed at most.
ROOM = 380
#: Operations in M, f and B up to which equations are written out: that takes some seconds.
_OPERATIONS = 12_000
#: The part of the lines that matrices must save to be preferred.
_SHORTER = 0.5
#: Letters for each sign that `weight` counts, and letters of a line.
_SIGN, _LINE = 2.3, 88.0


def is_large(equations: Equations) -> bool:
    """Whether it would take long to write the equations out."""
    total = 0
    for row, f in zip(equations.mass_matrix, equations.forcing, strict=True):
        total += sum(map(se.count_ops, row.values())) + se.count_ops(f)
        if total > _OPERATIONS:
            return True
    for c in equations.constraints:
        total += sum(map(se.count_ops, c.row.values()))
        if total > _OPERATIONS:
            return True
    return False


def prefers_matrices(written_out: float, before: float, matrices: Matrices) -> bool:
    """Whether matrices are so much shorter than what is written out that they are easier to read.

    Parameters
    ----------
    written_out : float
        Lines of everything with the equations written out.
    before : float
        Lines of what stands before the matrices.
    matrices : Matrices
    """
    return before + matrices.size < _SHORTER * written_out


def size(steps: list[Step]) -> float:
    """Return about how many lines of text steps take, titles included."""
    return sum(map(_size, steps))


def shortened(steps: list[Step], room: float = ROOM) -> list[Step]:
    """Return steps that fit into so many lines: of lists that are too long, the first items."""
    sizes = sorted(map(_size, steps))
    allowed = room
    for i, smallest in enumerate(sizes):
        # what short lists leave is for the long ones
        if smallest > (fair := (room - sum(sizes[:i])) / (len(sizes) - i)):
            allowed = fair
            break
    return [step if _size(step) <= allowed else _first(step, allowed) for step in steps]


def _first(step: Step, room: float) -> Step:
    """Return the first items of a step."""
    items = _items(step)
    share = (room - _TITLE) / max(_size(step) - _TITLE, 1.0)
    shown = first_part(items, lambda item: sum(map(_lines, item)), share)
    said = cut_short(len(shown), len(items))
    remark = " ".join(x for x in (said, step.remark) if x)
    return replace(step, lines=tuple(line for item in shown for line in item), remark=remark)


def _items(step: Step) -> list[list[Line]]:
    """Return the lines of a step by items: a constraint and what stands below it are one."""
    found: list[list[Line]] = []
    labelled = any(line.label is not None for line in step.lines)
    for line in step.lines:
        if labelled and line.label is None and found:
            found[-1].append(line)
        else:
            found.append([line])
    return found


_TITLE = 2.0  # lines: the title and a blank one


def _size(step: Step) -> float:
    return _TITLE + sum(map(_lines, step.lines)) + math.ceil(len(step.remark or "") / _LINE)


def _lines(line: Line) -> float:
    return float(math.ceil(_SIGN * sum(map(weight, line.sides)) / _LINE))
