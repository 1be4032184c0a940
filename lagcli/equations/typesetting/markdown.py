"""Derivations as Markdown with formulas for MathJax, as on GitHub."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import groupby

from lagcli.equations.typesetting.latex import (
    LatexFormula,
    Row,
    displays,
    inline,
    is_item,
    notes_apart,
    paragraphs,
)
from lagcli.equations.typesetting.nodes import Line, Step
from lagcli.model.model import Model

_SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|$~])")


def escape(text: str) -> str:
    """Escape plain text for Markdown."""
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def render_markdown(
    model: Model, steps: Sequence[Step], formula: LatexFormula, numbered: bool
) -> str:
    """Return the steps as Markdown.

    Parameters
    ----------
    model : Model
    steps : sequence of Step
    formula : LatexFormula
    numbered : bool
        Whether the steps are numbered.
    """
    parts = [f"# {escape(model.title)}"]
    if model.description:
        parts.append(escape(model.description))
    for i, step in enumerate(steps, 1):
        parts.append(f"## {i}. {step.title}" if numbered else f"## {step.title}")
        if step.lead:
            parts.append(escape(step.lead))
        parts += _body(step, formula)
        if step.remark:
            parts.append(escape(step.remark))
    return "\n\n".join(parts) + "\n"


def _body(step: Step, formula: LatexFormula) -> list[str]:
    if step.packed:
        return ["\n".join(f"{inline(line, formula, escape)};" for line in step.lines)]
    parts = []
    for alone, group in groupby(step.lines, key=is_item):
        if alone:
            parts.append("\n".join(_item(line, formula) for line in group))
            continue
        for named, belonging in paragraphs(list(group)):
            if named is not None:
                stated = named.remark and not notes_apart(belonging)
                note = f" ({escape(named.remark or '')})" if stated else ""
                parts.append(f"*{escape(str(named.label))}*{note}:")
            parts += [
                "$$\n\\begin{aligned}\n" + _rows(rows) + "\n\\end{aligned}\n$$"
                for rows in displays(belonging, formula)
            ]
    return parts


def _rows(rows: Sequence[Row]) -> str:
    return " \\\\\n".join(row.latex for row in rows)


def _item(line: Line, formula: LatexFormula) -> str:
    note = f": {escape(line.remark)}" if line.remark else ""
    label = f"*{escape(line.label)}*: " if isinstance(line.label, str) else ""
    return f"- {label}${formula.latex(line.sides[0])}${note}"
