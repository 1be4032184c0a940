"""Formulas and derivations in LaTeX, for amsmath and for MathJax."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import groupby
from typing import NamedTuple

from lagcli.equations.typesetting import nodes as t
from lagcli.equations.typesetting.nodes import Line, Logical, Node, Relation, Sign, Step, Symbol
from lagcli.equations.typesetting.notation import (
    LATEX_GREEK,
    SCRIPT,
    latex_ascii,
    latex_word,
    letter,
)
from lagcli.equations.typesetting.writer import (
    PREFIX,
    Break,
    DisplayWriter,
    Token,
    cases_of,
    factor_depth,
    flat,
    lines,
    rows_of,
    spelling_of,
)
from lagcli.model.model import Model

_RELATIONS = {"<=": r"\le", ">=": r"\ge", "!=": r"\ne", "==": "=", "⊥": r"\perp"}
#: Largest numerator, denominator or radicand that is not broken, in characters: half a page wide.
_WIDE = 45
_TALL = (r"\frac", r"\begin")


class LatexFormula(DisplayWriter):
    """Writer for formulas in LaTeX."""

    space = " "

    def latex(self, node: Node) -> str:
        """Return a formula on one line."""
        return flat(self.tokens(node))

    def _write_virtualdisplacement(self, node: t.VirtualDisplacement, depth: int) -> list[Token]:
        bold = self.names.displacement_is_product(node.of.name)
        sign = r"\boldsymbol{\delta}" if bold else r"\delta"
        return [f"{sign} {self._symbol(node.of)}"]

    def _write_partial(self, node: t.Partial, depth: int) -> list[Token]:
        top, bottom = self.latex(node.of), self.latex(node.by)
        return [rf"\frac{{\partial {top}}}{{\partial {bottom}}}"]

    def _write_rate(self, node: t.Rate, depth: int) -> list[Token]:
        return [rf"\frac{{d}}{{dt}} {self._group(self.latex(node.of))}"]

    def _write_sign(self, node: t.Sign, depth: int) -> list[Token]:
        return [node.latex]

    def _write_entry(self, node: t.Entry, depth: int) -> list[Token]:
        return [f"{node.matrix.latex}_{{{', '.join(map(self._symbol, node.indices))}}}"]

    def _write_indexedsum(self, node: t.IndexedSum, depth: int) -> list[Token]:
        first, last = self.latex(node.first), self.latex(node.last)
        sign = rf"\textstyle\sum_{{{node.index}={first}}}^{{{last}}} "
        return [sign, *self._summand(node.term, depth)]

    def _write_quotient(self, node: t.Quotient, depth: int) -> list[Token]:
        """Return a fraction; a wide one as 1/b […], or […]/[…], which can be broken."""
        above, below = node.numerator, node.denominator
        if t.weight(below) > _WIDE:
            top, bottom = self._tight(above, depth + 1), self._tight(below, depth + 1)
            return [*top, Break(depth + 1, ""), "/", *bottom]
        if t.weight(above) > _WIDE:
            inverse = rf"\frac{{1}}{{{self.latex(below)}}}"
            top = self._fenced(self.tokens(above, depth + 1))
            return [inverse, Break(depth, r" \, "), *top]
        return [rf"\frac{{{self.latex(node.numerator)}}}{{{self.latex(node.denominator)}}}"]

    def _write_root(self, node: t.Root, depth: int) -> list[Token]:
        if t.weight(node.radicand) > _WIDE:
            power = rf"^{{1/{node.degree}}}"
            return [*self._fenced(self.tokens(node.radicand, depth + 1)), power]
        degree = "" if node.degree == 2 else f"[{node.degree}]"
        return [rf"\sqrt{degree}{{{self.latex(node.radicand)}}}"]

    def _write_relation(self, node: t.Relation, depth: int) -> list[Token]:
        sign = _RELATIONS.get(node.operator, node.operator)
        left = "".join(map(_text, self._before(node.left, 0)))
        return [f"{left} {sign} {self.latex(node.right)}"]

    def _scientific(self, mantissa: str, power: int) -> str:
        return rf"{mantissa}\cdot 10^{{{power}}}"

    def _fraction(self, value: Fraction) -> str:
        return rf"\tfrac{{{value.numerator}}}{{{value.denominator}}}"

    def _symbol(self, node: t.Symbol) -> str:
        match node.kind:
            case "multiplier":
                return self.names.latex_multiplier(node.name)
            case "force":
                return f"{self.names.force[1]}_{{{self.names.latex(node.name)}}}"
            case "constant":
                return r"\pi"
            case "constraint":
                return latex_word(node.name)
        return self.names.latex(node.name, node.dots)

    def _write_product(self, node: t.Product, depth: int) -> list[Token]:
        tokens: list[Token] = []
        for i, factor in enumerate(node.factors):
            part = self._factor(node, i, depth)
            if i:
                before = node.factors[i - 1]
                apart = needs_space(before, factor)
                space = r" \, " if apart else " "
                tokens.append(Break(factor_depth(node.factors, i, depth), space))
            tokens += part
        return tokens

    def _write_power(self, node: t.Power, depth: int) -> list[Token]:
        raised = f"^{{{self.latex(node.exponent)}}}"
        base = node.base
        if (
            isinstance(base, t.Call)
            and base.function in PREFIX
            and isinstance(node.exponent, t.Number)
        ):
            return [spelling_of(base.function).latex, raised, *self._arguments(base, depth)]
        if isinstance(base, t.Symbol) and base.name in self.names.with_own_latex:
            return [f"{{{self._symbol(base)}}}", raised]
        return [*self._tight(base, depth), raised]

    def _write_call(self, node: t.Call, depth: int) -> list[Token]:
        name, arguments = node.function, node.arguments
        spelling = spelling_of(name)
        if spelling.latex_fences is not None:
            (opening, closing), inner = spelling.latex_fences, self.latex(arguments[0])
            if opening in inner:
                opening, closing = rf"\bigl{opening}", rf" \bigr{closing.lstrip()}"
            return [opening, inner, closing]
        if name in ("dot", "cross"):
            sign = r" \cdot " if name == "dot" else r" \times "
            left, right = ("".join(map(_text, self._tight(a, depth))) for a in arguments)
            return [left + sign + right]
        if name == "exp":
            return [rf"\mathrm{{e}}^{{{self.latex(arguments[0])}}}"]
        if name == "transpose":
            return [*self._tight(arguments[0], depth), r"^{\mathsf{T}}"]
        macro = spelling.latex
        if not macro:
            stem, _, index = name.partition("_")
            macro = rf"\operatorname{{{latex_ascii(stem)}}}" + (f"_{{{index}}}" if index else "")
        return [macro, *self._arguments(node, depth)]

    def _write_vector(self, node: t.Vector, depth: int) -> list[Token]:
        rows = [" & ".join(map(self.latex, items)) for items in rows_of(node)]
        return [r"\begin{pmatrix} " + r" \\ ".join(rows) + r" \end{pmatrix}"]

    def _write_component(self, node: t.Component, depth: int) -> list[Token]:
        of = "".join(map(_text, self._tight(node.of, depth)))
        if isinstance(node.of, Symbol) and self.names.component_is_name(
            node.of.name, node.subscript
        ):
            of = f"({of})"
        return [f"{{{of}}}_{{{node.subscript}}}"]

    def _write_cases(self, node: t.Cases, depth: int) -> list[Token]:
        cases, rest = cases_of(node)
        rows = [rf"{self.latex(x)} & \text{{if }} {self.latex(when)}" for when, x in cases]
        rows.append(rf"{self.latex(rest)} & \text{{else}}")
        return [r"\begin{cases} " + r" \\ ".join(rows) + r" \end{cases}"]

    def _write_logical(self, node: t.Logical, depth: int) -> list[Token]:
        parts = [
            self._group(self.latex(o)) if isinstance(o, t.Logical) else self.latex(o)
            for o in node.operands
        ]
        if node.operator == "not":
            return [rf"\text{{not }} {self._group(parts[0])}"]
        return [rf" \text{{ {node.operator} }} ".join(parts)]

    def _fenced(self, inner: list[Token]) -> list[Token]:
        """Return tokens in brackets of matching size that may be broken across lines."""
        text = "".join(map(_text, inner))
        if any(tall in text for tall in _TALL):
            size = (r"\biggl", r"\biggr")
        elif "(" in text or "[" in text or r"\sqrt" in text:
            size = (r"\bigl", r"\bigr")
        else:
            size = ("", "")
        square = "(" in re.sub(r"\\sqrt\[.\]", "", text) and r"\bigl[" not in text
        opening, closing = ("[", "]") if square else ("(", ")")
        return [f"{size[0]}{opening}", *inner, f"{size[1]}{closing}"]

    def _group(self, text: str) -> str:
        return "".join(map(_text, self._fenced([text])))


def _text(token: Token) -> str:
    return token.space if isinstance(token, Break) else token


def needs_space(before: Node, after: Node) -> bool:
    """Whether two factors need a thin space between them."""
    functions = isinstance(before, t.Call | t.Root | t.Quotient | t.Cases) or (
        isinstance(before, t.Power) and isinstance(before.base, t.Call)
    )
    bracket = isinstance(after, t.Sum) or (
        isinstance(after, t.Power) and isinstance(after.base, t.Sum)
    )
    words = [x.base if isinstance(x, t.Power) else x for x in (before, after)]
    long = any(isinstance(x, t.Symbol) and len(letter(x.name)) > 1 for x in words)
    if isinstance(after, t.VirtualDisplacement):
        return True
    symbol = isinstance(after, t.Symbol)
    closing = isinstance(before, t.Sum)
    return (functions and (bracket or symbol)) or long or bracket or (closing and symbol)


TEXT_WIDTH = 455.0  # in points: 160 mm
_ROWS = 60  # rows of one display; more than a page
_INDENT = 20.0  # points: \quad and the alignment
_NESTED = r"\quad "  # before what is in brackets that are open at the beginning of a row
_NUMBER = 34.0  # points: the number of an equation and the space before it

_PREAMBLE = r"""\documentclass[11pt,a4paper]{article}
\usepackage[utf8]{inputenc}
\usepackage[T1]{fontenc}
\usepackage{amsmath}
\setlength{\textwidth}{160mm}
\setlength{\oddsidemargin}{-0.4mm}
\setlength{\textheight}{240mm}
\setlength{\topmargin}{-15mm}
\allowdisplaybreaks
"""

_ESCAPES = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "−": r"$-$",
    "·": r"$\cdot$",
    "×": r"$\times$",
    "°": r"$^\circ$",
    "§": r"\S{}",
    "²": r"$^2$",
    "³": r"$^3$",
    "≤": r"$\le$",
    "≥": r"$\ge$",
    "≠": r"$\ne$",
    "→": r"$\to$",
    "∂": r"$\partial$",
    "√": r"$\surd$",
    "∞": r"$\infty$",
    "–": "--",
    "—": "---",
    "‘": "`",
    "’": "'",
    "“": "``",
    "”": "''",
    "…": r"\dots{}",
    "\u00a0": "~",
}


_ESCAPES.update({sign: rf"$\mathcal{{{x}}}$" for x, sign in SCRIPT.items()})
_DOTS = {"\u0307": r"\dot", "\u0308": r"\ddot"}


def escape(text: str) -> str:
    """Escape plain text for LaTeX; characters that pdflatex cannot print become their code."""
    parts: list[str] = []
    for char in unicodedata.normalize("NFC", text):
        if char in _DOTS and parts:
            parts[-1] = f"${_DOTS[char]}{{{parts[-1].strip('$')}}}$"
        elif char in _ESCAPES:
            parts.append(_ESCAPES[char])
        elif char in LATEX_GREEK:
            parts.append(f"${LATEX_GREEK[char]}$")
        elif char.isspace():
            parts.append(" ")
        elif char.isascii() or "À" <= char <= "ſ":
            parts.append(char)
        else:
            parts.append(f"[U+{ord(char):04X}]")
    return "".join(parts)


def render_latex(
    model: Model,
    steps: Sequence[Step],
    formula: LatexFormula,
    numbered: bool,
    fragment: bool,
    title: str | None = None,
) -> str:
    """Return the steps as a LaTeX document, or as its body.

    Parameters
    ----------
    model : Model
    steps : sequence of Step
    formula : LatexFormula
    numbered : bool
        Whether the steps are numbered.
    fragment : bool
        Whether to omit the preamble and the end of the document.
    title : str, optional
        Title instead of the model's.
    """
    parts = [rf"\section*{{{escape(title or model.title)}}}"]
    if model.description:
        parts.append(escape(" ".join(model.description.split())))
    labels = _Labels()
    for i, step in enumerate(steps, 1):
        title = f"{i}. {step.title}" if numbered else step.title
        parts.append(rf"\subsection*{{{_title(title)}}}")
        if step.lead:
            parts.append(rf"\noindent {escape(step.lead)}")
        parts += _body(step, formula, labels)
        if step.remark:
            parts.append(rf"\noindent {escape(step.remark)}")
    body = "\n\n".join(parts)
    return body + "\n" if fragment else document(body)


def document(body: str, packages: str = "") -> str:
    """Return a complete document with a body from `render_latex`.

    Parameters
    ----------
    body : str
    packages : str
        Further lines of the preamble.
    """
    return f"{_PREAMBLE}{packages}\\begin{{document}}\n\n{body}\n\n\\end{{document}}\n"


def _title(text: str) -> str:
    """Return a title with k = 2 and r = 1 as formulas."""
    return re.sub(r": ([A-Za-z]) = (\d+)", r": $\1 = \2$", escape(text))


def paragraphs(group: Sequence[Line]) -> list[tuple[Line | None, list[Line]]]:
    """Split lines at labelled ones: (the labelled line or None, lines that belong together)."""
    groups: list[tuple[Line | None, list[Line]]] = []
    for line in group:
        if isinstance(line.label, str):
            groups.append((line, [line]))
        elif groups:
            groups[-1][1].append(line)
        else:
            groups.append((None, [line]))
    return groups


class _Labels:
    """Names of numbered equations, each used once: eq:motion-phi."""

    def __init__(self) -> None:
        self._used: set[str] = set()

    def of(self, step: Step, line: Line) -> str:
        """Return the label of an equation with a coordinate or constraint; empty for others."""
        label = line.label.name if isinstance(line.label, Symbol) else line.label
        if not isinstance(label, str):
            return ""
        words = [step.title.split(":")[0].rpartition(" of the ")[0] or step.title.split(":")[0]]
        letters = unicodedata.normalize("NFD", label.replace(".", "_"))
        label = latex_ascii("".join(c for c in letters if not unicodedata.combining(c)))
        name = "-".join(re.findall(r"[A-Za-z0-9]+", f"{words[0].lower()} {label}"))
        unique, number = name, 1
        while unique in self._used:
            number += 1
            unique = f"{name}-{number}"
        self._used.add(unique)
        return rf"\label{{eq:{unique}}}"


def inline(line: Line, formula: LatexFormula, escape: Callable[[str], str]) -> str:
    """Return a formula for running text, with its note in parentheses."""
    note = f" ({escape(line.note)})" if line.note else ""
    return f"${' = '.join(map(formula.latex, line.sides))}${note}"


def _body(step: Step, formula: LatexFormula, labels: _Labels) -> list[str]:
    if step.packed:
        # TeX breaks inline formulas
        body = ";\n\\quad ".join(inline(line, formula, escape) for line in step.lines)
        return [f"\\begin{{flushleft}}\n{body}\n\\end{{flushleft}}"]
    parts = []
    for alone, group in groupby(step.lines, key=is_item):
        if alone:
            items = [_item(line, formula) for line in group]
            parts.append("\\begin{itemize}\n" + "\n".join(items) + "\n\\end{itemize}")
            continue
        for named, belonging in paragraphs(list(group)):
            display = "\n".join(
                "\\begin{align}\n" + _numbered(rows, step, labels) + "\n\\end{align}"
                for rows in displays(belonging, formula, TEXT_WIDTH - _NUMBER)
            )
            if named is not None:
                stated = named.remark and not notes_apart(belonging)
                note = f" ({escape(named.remark or '')})" if stated else ""
                label = rf"\textit{{{escape(str(named.label))}}}"
                display = f"\\noindent {label}{note}:\n{display}"
            parts.append(display)
    return parts


def notes_apart(group: Sequence[Line]) -> bool:
    """Whether the notes of a labelled group are of single formulas: sticks, slips."""
    return any(line.note for line in group[1:])


def _numbered(rows: Sequence[Row], step: Step, labels: _Labels) -> str:
    """Return rows of a display; the last row of each equation has its number."""
    lines = []
    for i, row in enumerate(rows):
        plain = row.line is None or _is_value(row.line)
        end = r" \notag" if row.line is None or plain else labels.of(step, row.line)
        broken = row.line is None or (i > 0 and rows[i - 1].line is None)
        apart = "" if i == len(rows) - 1 else r" \\[1ex]" if broken and row.line else r" \\"
        lines.append(row.latex + end + apart)
    return "\n".join(lines)


def _is_value(line: Line) -> bool:
    """Whether a line states the value of a parameter, which is not an equation to refer to."""
    return isinstance(line.sides[0], Symbol) and isinstance(line.sides[-1], Sign)


def is_item(line: Line) -> bool:
    """Whether a line is an item of a list: a name, not an equation or inequality."""
    return len(line.sides) == 1 and not isinstance(line.sides[0], Relation | Logical)


def _item(line: Line, formula: LatexFormula) -> str:
    note = f" --- {escape(line.remark)}" if line.remark else ""
    label = rf"\textit{{{escape(line.label)}}}: " if isinstance(line.label, str) else ""
    return rf"\item {label}${formula.latex(line.sides[0])}${note}"


class Row(NamedTuple):
    """A row of a display; the last one of an equation has its line."""

    latex: str
    line: Line | None


def displays(
    group: Sequence[Line], formula: LatexFormula, width: float = TEXT_WIDTH
) -> list[list[Row]]:
    """Return formulas as rows of displays aligned at the equality sign, broken to fit the page.

    Many rows are split into several displays, because TeX keeps a whole display in memory.
    """
    heads = [_head(line, formula) for line in group]
    left = [
        measure(h + flat(formula.tokens(x.sides[0]))) for h, x in zip(heads, group, strict=True)
    ]
    aligned = max(left, default=0.0)
    # with a long left side, or conditions, all lines start at the margin
    flush = aligned > width / 4 or any(len(line.sides) == 1 for line in group)
    parts: list[list[Row]] = [[]]
    apart = notes_apart(group)
    for line, head in zip(group, heads, strict=True):
        note = _note(line) if apart or not isinstance(line.label, str) else []
        if flush:
            texts = _flush(line, head, note, formula, width)
        else:
            texts = _aligned(line, head, note, formula, width - aligned - measure("= "))
        rows = [Row(text, None) for text in texts[:-1]] + [Row(texts[-1], line)]
        for i in range(0, len(rows), _ROWS):
            if parts[-1] and len(parts[-1]) + len(rows[i : i + _ROWS]) > _ROWS:
                parts.append([])
            parts[-1] += rows[i : i + _ROWS]
    return parts


def _head(line: Line, formula: LatexFormula) -> str:
    """Return the coordinate to which a formula belongs, written before the formula."""
    label = line.label
    if label is None or isinstance(label, str):
        return ""
    return rf"{formula.latex(label)}\colon\quad "


def _flush(
    line: Line, head: str, note: list[Token], formula: LatexFormula, width: float
) -> list[str]:
    """Return the rows of a formula, each side on a new one if they do not fit on one."""
    room = width - measure(head)
    sides = [list(formula.tokens(side)) for side in line.sides]
    sides[-1] += note
    whole = " = ".join(map(flat, sides))
    if measure(whole) <= room:
        return [rf"{head}&{whole}"]
    rows: list[str] = []
    for i, side in enumerate(sides):
        tokens = ["= ", *side] if i else side
        if rows and side == ["0"]:
            rows[-1] += " = 0"
            continue
        broken = lines(tokens, measure, room - _INDENT * bool(i), room - 2 * _INDENT, _NESTED)
        rows.append(rf"&\quad {broken[0]}" if i else rf"{head}&{broken[0]}")
        rows += [rf"&\qquad {x}" for x in broken[1:]]
    return rows


def _aligned(
    line: Line, head: str, note: list[Token], formula: LatexFormula, room: float
) -> list[str]:
    """Return the rows of a formula, aligned at the equality sign."""
    first, *others = [formula.tokens(side) for side in line.sides]
    others[-1] = [*others[-1], *note]
    head += flat(first)
    rest = " = ".join(map(flat, others))
    if measure(rest) <= room:
        return [f"{head} &= {rest}"]
    rows: list[str] = []
    for side in others:
        broken = lines(side, measure, room, room - _INDENT, _NESTED)
        rows += [f"{head} &= {broken[0]}", *(rf"&\qquad {x}" for x in broken[1:])]
        head = ""
    return rows


def _note(line: Line) -> list[Token]:
    """Return note and range of a line, written after the formula."""
    parts = [rf"\text{{{escape(line.note)}}}"] if line.note else []
    parts += [f"({line.span.latex})"] if line.span is not None else []
    tokens: list[Token] = []
    for part in parts:
        tokens += [Break(0, r" \qquad "), part]
    return tokens


_PIECE = re.compile(r"\\[A-Za-z]+|\\.|[{}_^]|[A-Za-z]|\d|\s+|.", re.DOTALL)
_SILENT = {r"\dot", r"\ddot", r"\mathit", r"\mathrm", r"\mathcal", r"\mathsf", r"\text"}
_SILENT |= {r"\bigl", r"\bigr", r"\biggl", r"\biggr", r"\operatorname", r"\begin", r"\end", r"\\"}
_SILENT |= {r"\textstyle", r"\tfrac"}
_WIDTHS = {
    **{r"\,": 1.9, r"\quad": 11.0, r"\qquad": 22.0, r"\sqrt": 10.0, "(": 4.3, ")": 4.3},
    **{"[": 4.0, "]": 4.0, ",": 4.9, ".": 3.1, "+": 13.5, "-": 13.5, "=": 14.7, "&": 11.0},
    **{"m": 9.7, "M": 11.0, "w": 8.0, r"\sum": 12.0, r"\cdot": 8.0, r"\partial": 6.5},
}
_SMALL = 0.72  # subscripts and superscripts


def measure(latex: str) -> float:
    """Estimate the width of a formula in points, at 11 pt."""
    pieces = _PIECE.findall(latex)
    width, i, scales = 0.0, 0, [1.0]
    pending: float | None = None
    fractions: list[tuple[int, float, float | None]] = []  # depth, start, width of the numerator
    while i < len(pieces):
        piece, i = pieces[i], i + 1
        scale = scales[-1]
        if piece == "{":
            scales.append(scale * (pending or 1.0))
            pending = None
            continue
        if piece == "}":
            scales.pop()
            if fractions and fractions[-1][0] == len(scales):
                depth, start, top = fractions.pop()
                if top is None:
                    fractions.append((depth, start, width - start))
                    width = start
                else:
                    width = start + max(top, width - start) + 3.0
            continue
        if piece in "_^":
            pending = _SMALL
            continue
        if piece in (r"\frac", r"\tfrac"):
            fractions.append((len(scales), width, None))
            continue
        if piece.isspace() or piece in _SILENT:
            continue
        if piece.startswith("\\") and piece not in _WIDTHS:
            name = piece[1:]
            size = 6.0 * len(name) + 2.0 if f"\\{name}" in _UPRIGHT else 6.6
        else:
            size = _WIDTHS.get(piece, 6.0 if not piece.isupper() else 7.8)
        width += size * scale * (pending or 1.0)
        pending = None
    return width


_UPRIGHT = {r"\sin", r"\cos", r"\tan", r"\sinh", r"\cosh", r"\tanh", r"\log", r"\min", r"\max"}
_UPRIGHT |= {r"\arcsin", r"\arccos", r"\arctan"}
