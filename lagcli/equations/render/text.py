"""Derivations as Unicode text."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from lagcli.equations.presentation.formulas import Line, Step
from lagcli.equations.presentation.typeset import Node, Sign, Symbol
from lagcli.equations.render.breaking import flat, lines
from lagcli.equations.render.formula_text import TextFormula
from lagcli.errors import display_width
from lagcli.model.model import Model

NARROWEST = 40
_INDENT = "  "
_APART = ";  "  # between short formulas side by side
_UNEVEN = 8  # maximum difference of left sides that are aligned, in columns
_SHORT = 3  # maximum columns of a side that stays on the line before it: = 0
_SHORT_LEFT = 8  # maximum columns of a left side that shares its line
_NESTED = "  "  # before what is in brackets that are open at the beginning of a line
_CONTINUED = 4  # indentation of continuation lines, in columns


def render_text(
    model: Model, steps: Sequence[Step], formula: TextFormula, width: int, numbered: bool
) -> str:
    """Return the steps as text.

    Parameters
    ----------
    model : Model
    steps : sequence of Step
    formula : TextFormula
    width : int
        Number of columns, at least `NARROWEST`.
    numbered : bool
        Whether the steps are numbered.
    """
    blocks = [[model.title, *_paragraph(model.description or "", width)]]
    for i, step in enumerate(steps, 1):
        title = f"{i}. {step.title}" if numbered else step.title
        block = _paragraph(title, width)
        block += [_INDENT + x for x in _paragraph(step.lead or "", width - len(_INDENT))]
        write = _packed if step.packed else _group
        block += write(step.lines, formula, width)
        block += [_INDENT + x for x in _paragraph(step.remark or "", width - len(_INDENT))]
        blocks.append(block)
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def _paragraph(text: str, width: int) -> list[str]:
    return textwrap.wrap(" ".join(text.split()), max(width - _excess(text), 10)) if text else []


def _excess(text: str) -> int:
    """Return the display width of a text minus its number of characters."""
    return max(0, display_width(text) - len(text))


def _padded(text: str, width: int) -> str:
    return text + " " * (width - display_width(text))


def heights(step: Step, formula: TextFormula, width: int) -> list[int]:
    """Return the number of lines of each formula of a step that is not packed."""
    return list(map(len, _blocks(step.lines, formula, width)))


def height(step: Step, formula: TextFormula, width: int) -> int:
    """Return the number of lines of a step, including its title and the blank line after it."""
    inner = width - len(_INDENT)
    said = _paragraph(step.lead or "", inner) + _paragraph(step.remark or "", inner)
    write = _packed if step.packed else _group
    title = _paragraph(step.title, width)
    return len(title) + len(said) + len(write(step.lines, formula, width)) + 1


def _group(group: Sequence[Line], formula: TextFormula, width: int) -> list[str]:
    """Return lines aligned at the label and at the equality sign."""
    return [text for block in _blocks(group, formula, width) for text in block]


def _blocks(group: Sequence[Line], formula: TextFormula, width: int) -> list[list[str]]:
    """Return the lines of text of each formula."""
    labels = [_label(line, formula) for line in group]
    margin = max((display_width(x) for x in labels if x), default=-2) + 2
    if margin > width // 3:  # long labels go on separate lines
        margin = 2
    room = width - len(_INDENT) - margin
    left = [display_width(formula.text(line.sides[0])) for line in group if len(line.sides) > 1]
    left = [x for x in left if x <= room // 3]
    aligned = max(left, default=0)
    # what follows a labelled line or a condition is not in one column with it
    continued = any(isinstance(x.label, str) for x in group) and any(x.label is None for x in group)
    aligned_sides = aligned - min(left, default=0) <= _UNEVEN and not continued
    bodies = [_formula(line, formula, room, aligned, aligned_sides) for line in group]
    listed = [display_width(b[0]) for b, x in zip(bodies, group, strict=True) if _is_entry(x)]
    names = max(listed, default=0)
    found: list[list[str]] = []
    for line, label, body in zip(group, labels, bodies, strict=True):
        if _is_entry(line) and line.remark and names <= room // 2:
            body = [_padded(body[0], names)]
        block = []
        if label and display_width(label) + 2 > margin:
            block.append(_INDENT + label)
            label = ""
        body = _with_note(body, line.remark, room)
        for i, text in enumerate(body):
            head = _padded(label if i == 0 else "", margin)
            block.append((_INDENT + head + text).rstrip())
        found.append(block)
    return found


def _is_entry(line: Line) -> bool:
    """Whether a line is a name with its description, or with its value."""
    name, *value = line.sides
    return isinstance(name, Symbol) and all(isinstance(x, Sign) for x in value)


def _packed(group: Sequence[Line], formula: TextFormula, width: int) -> list[str]:
    """Return lines packed side by side, as many as fit."""
    found: list[str] = []
    room = width - len(_INDENT)
    for line in group:
        text = " = ".join(map(formula.text, line.sides))
        if display_width(text) > room:
            found += _unaligned(line, formula, room)
        elif found and display_width(found[-1]) + len(_APART) + display_width(text) <= room:
            found[-1] += _APART + text
        else:
            found.append(text)
    return [_INDENT + text for text in found]


def _label(line: Line, formula: TextFormula) -> str:
    if line.label is None:
        return ""
    return f"{line.label if isinstance(line.label, str) else formula.text(line.label)}:"


def _with_note(body: list[str], note: str | None, room: int) -> list[str]:
    if not note:
        return body
    if len(body) == 1 and display_width(body[0]) + display_width(note) + 3 <= room:
        return [f"{body[0]}   {note}"]
    return [*body, *(f"{_INDENT}{x}" for x in _paragraph(note, room - len(_INDENT)))]


def _formula(
    line: Line, formula: TextFormula, room: int, aligned: int, aligned_sides: bool
) -> list[str]:
    """Return a formula, broken into as many lines as necessary."""
    first, *others = [formula.tokens(side) for side in line.sides]
    lhs = display_width(flat(first))
    whole = display_width(" = ".join(map(formula.text, line.sides)))
    if not others or lhs > aligned or (isinstance(line.label, Node) and whole > room):
        return _unaligned(line, formula, room)
    aligned = aligned if aligned_sides else lhs
    head = _padded(flat(first), aligned)
    rest = " = ".join(flat(side) for side in others)
    if display_width(head) + 3 + display_width(rest) <= room:
        return [f"{head} = {rest}"]
    found = []
    for side in others:
        inner = room - aligned - 3
        broken = lines(side, display_width, inner, inner - 2, _NESTED)
        found.append(f"{head} = {broken[0]}")
        found += [" " * (aligned + 5) + x for x in broken[1:]]
        head = " " * aligned
    return found


def _unaligned(line: Line, formula: TextFormula, room: int) -> list[str]:
    """Return a formula on one line if it fits; otherwise each side on a separate line."""
    whole = " = ".join(map(formula.text, line.sides))
    if display_width(whole) <= room:
        return [whole]
    found: list[str] = []
    parts = [formula.tokens(side) for side in line.sides]
    parts[1:] = [["= ", *part] for part in parts[1:]]
    if len(parts) > 1 and display_width(flat(parts[0])) <= _SHORT_LEFT:
        parts[:2] = [[f"{flat(parts[0])} ", *parts[1]]]
    for i, tokens in enumerate(parts):
        short = flat(tokens)
        if found and len(short) <= _SHORT and display_width(found[-1]) + len(short) < room:
            found[-1] += f" {short}"
            continue
        margin = _CONTINUED // 2 if i else 0
        broken = lines(tokens, display_width, room - margin, room - _CONTINUED, _NESTED)
        found.append(" " * margin + broken[0])
        found += [" " * _CONTINUED + x for x in broken[1:]]
    return found
