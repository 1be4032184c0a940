"""Selection of the printed steps: one or several kinds of equations, in short or as a
derivation."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

from lagcli.equations.presentation.extent import Extent
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.index_form import IndexForm, with_hint
from lagcli.equations.presentation.kinds import (
    ABBREVIATIONS,
    ENTRIES,
    ENTRIES_OF_ONE,
    MAGGI,
    SECOND,
    determinant_step,
    maggi_steps,
    projected,
    second_kind_steps,
    solved_step,
    split_step,
)
from lagcli.equations.presentation.overview import (
    before_equations,
    convention,
    in_matrices,
    in_short,
    many_parameters_last,
    overview,
    quantities,
)
from lagcli.equations.presentation.steps import before_equations as derivation_before_equations
from lagcli.equations.presentation.steps import steps as derivation
from lagcli.equations.reduction.elimination import (
    solve_accelerations,
    solve_first_kind,
)
from lagcli.equations.reduction.partition import CoordinatePartition
from lagcli.equations.reduction.second_kind import Maggi, second_kind
from lagcli.equations.typesetting.nodes import Node, Step, Sum, children
from lagcli.prose import counted

#: Kinds of equations of motion.
KINDS = ("first", "second", "maggi")
_NAMES = {
    "first": "first kind",
    "second": "second kind",
    "maggi": "Maggi's equations",
}


class Contents(NamedTuple):
    """The requested content of a printed derivation.

    Parameters
    ----------
    kinds : sequence of str
        One or several of `KINDS`, in the order of printing.
    partition : CoordinatePartition or None
        Coordinate partition; required for kinds other than the first and for ``solve``.
    solve : bool
        Whether λ and the accelerations are given in closed form.
    steps : bool
        Whether the derivation is shown.
    full : bool
        Whether everything is written out, regardless of length.
    """

    kinds: Sequence[str] = ("first",)
    partition: CoordinatePartition | None = None
    solve: bool = False
    steps: bool = False
    full: bool = False


def shown_steps(f: Formulas, contents: Contents) -> tuple[Step, ...]:
    """Return the steps to print, in order."""
    kinds, p = contents.kinds, contents.partition
    before = _first(f, contents) if "first" in kinds else _without_equations(f, contents)
    motion: dict[str, list[Step]] = {}
    after: list[Step] = []
    for kind in kinds:
        if kind != "first" and p is not None:
            motion[kind] = _other(f, kind, contents, p)
            after += motion[kind]
        if contents.solve and p is not None and (kind == "first" or p.independent):
            after.append(_solved(f, kind, contents, p))
    if len(kinds) > 1 and p is not None:
        after.append(_compared(motion, kinds, f, p))
    steps = [*before, *_arranged(f, after, contents.full)]
    if "first" in kinds or "maggi" in kinds or contents.solve:
        steps.append(convention(f))
    steps = list(many_parameters_last(steps))
    return _cited(steps if contents.full else with_hint(steps))


_NUMBER = re.compile(r"\((8\.\d+)\)")


def _cited(steps: Iterable[Step]) -> tuple[Step, ...]:
    """Return steps in which only the first one that cites an equation names the source."""
    cited, named = [], False
    for step in steps:
        if not named and step.remark and _NUMBER.search(step.remark):
            remark = _NUMBER.sub(r"(textbook, §8, eq. \1)", step.remark, count=1)
            step, named = replace(step, remark=remark), True
        cited.append(step)
    return tuple(cited)


def _arranged(f: Formulas, steps: list[Step], full: bool) -> list[Step]:
    """Return steps in index form, shortened unless everything is to be written out."""
    return steps if full else Extent(f).shortened(IndexForm(f.model).steps(steps))


def _first(f: Formulas, contents: Contents) -> list[Step]:
    """Return the first kind, without the sign convention, which comes last."""
    p, full = contents.partition, contents.full
    if contents.steps and not in_matrices(f, full):
        derived = derivation(f, _coordinates(f, p), full)
        return _arranged(f, [*quantities(f), *derived], full)
    steps = list(overview(f, full))
    if contents.steps:
        steps = list(in_short(f, "The derivation is long; --full writes it out."))
    split = [split_step(f, p)] if p is not None and not contents.steps else []
    return [*steps[:-1], *_arranged(f, split, full)]


def _without_equations(f: Formulas, contents: Contents) -> list[Step]:
    """Return coordinates, energies and constraints."""
    p = contents.partition
    if contents.steps:
        steps = [*quantities(f), *derivation_before_equations(f, contents.full)]
        steps += _coordinates(f, p)
    else:
        steps = [*before_equations(f), *([split_step(f, p)] if p is not None else [])]
    return _arranged(f, steps, contents.full)


def _coordinates(f: Formulas, p: CoordinatePartition | None) -> list[Step]:
    if p is None:
        return []
    steps = (split_step(f, p), determinant_step(f, p))
    return [step for step in steps if step is not None]


def _other(f: Formulas, kind: str, contents: Contents, p: CoordinatePartition) -> list[Step]:
    if kind == "second":
        return second_kind_steps(f, second_kind(p, contents.full), contents.steps)
    return maggi_steps(f, Maggi(p), contents.full)


def _solved(f: Formulas, kind: str, contents: Contents, p: CoordinatePartition) -> Step:
    if kind == "second":
        solved = solve_accelerations(second_kind(p, contents.full))
    elif kind == "maggi":
        solved = solve_accelerations(Maggi(p))
    else:
        solved = solve_first_kind(p)
    return solved_step(f, solved, _NAMES[kind], kind == "first" and bool(p.surplus))


_COUNTED = (SECOND, MAGGI, ENTRIES, ENTRIES_OF_ONE, ABBREVIATIONS)


def _compared(
    motion: dict[str, list[Step]], kinds: Sequence[str], f: Formulas, p: CoordinatePartition
) -> Step:
    """Return the number of equations and terms of each kind."""
    k, r, n = len(f.coordinates), len(f.equations.constraints), len(p.independent)
    sizes = {
        "first": f"{counted(k + r, 'equation')} in {counted(k, 'coordinate')}"
        f" and {counted(r, 'multiplier')}",
        "second": f"{counted(n, 'equation')} in {counted(n, 'coordinate')}",
        "maggi": f"{counted(n, 'equation')} and {counted(r, 'constraint')} in"
        f" {counted(k, 'coordinate')}",
    }
    said = []
    for kind in kinds:
        if kind == "first":
            lines = [f.equation_line(i) for i in range(k)]
            lines += map(f.constraint_line, f.equations.constraints)
        else:
            lines = [x for s in motion[kind] if s.title in _COUNTED for x in s.lines]
            if any(s.lines == projected(f) for s in motion[kind]):
                lines = []
        count = terms_in(x for line in lines for x in line.sides)
        name = _NAMES[kind][0].upper() + _NAMES[kind][1:]
        size = counted(count, "term") if lines else "not written out"
        if kind != "first" and not n:
            said.append(f"{name}: no equations, because the constraints determine the motion.")
            continue
        said.append(f"{name}: {sizes[kind]}, {size}.")
    said.append("Terms are counted as printed, those in brackets and under roots one by one.")
    return Step("Size of the equations", (), " ".join(said))


def terms_in(nodes: Iterable[Node]) -> int:
    """Count the terms of formulas, including those of sums within factors."""
    return sum(map(_terms, nodes))


def _terms(node: Node) -> int:
    if isinstance(node, Sum):
        return terms_in(term for _, term in node.terms)
    return max(1, sum(_terms(x) for x in children(node) if _has_sum(x)))


def _has_sum(node: Node) -> bool:
    return isinstance(node, Sum) or any(map(_has_sum, children(node)))
