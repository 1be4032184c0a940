"""Formulas and derivations in Unicode text; formulas in the grammar of model files."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from lagcli.equations.typesetting import nodes as t
from lagcli.equations.typesetting.nodes import Line, Node, Sign, Step, Symbol
from lagcli.equations.typesetting.notation import SUBSCRIPTS, SUPERSCRIPTS
from lagcli.equations.typesetting.writer import (
    PREFIX,
    Break,
    FormulaWriter,
    Token,
    closed,
    factor_depth,
    flat,
    lines,
)
from lagcli.errors import display_width
from lagcli.model import model as symbols
from lagcli.model.model import Model
from lagcli.prose import wrapped

_VULGAR = {
    Fraction(p, q): sign
    for sign, p, q in (
        *(("½", 1, 2), ("⅓", 1, 3), ("⅔", 2, 3), ("¼", 1, 4), ("¾", 3, 4), ("⅕", 1, 5)),
        *(("⅖", 2, 5), ("⅗", 3, 5), ("⅘", 4, 5), ("⅙", 1, 6), ("⅚", 5, 6), ("⅛", 1, 8)),
        *(("⅜", 3, 8), ("⅝", 5, 8), ("⅞", 7, 8)),
    )
}
_RELATIONS = {"<=": "≤", ">=": "≥", "!=": "≠", "==": "="}
_BRACKETS = (("(", ")"), ("[", "]"), ("{", "}"))


class TextFormula(FormulaWriter):
    """Writer for formulas in Unicode text."""

    plus, minus, negative = "+ ", "− ", "−"

    def text(self, node: Node) -> str:
        """Return a formula on one line."""
        return flat(self.tokens(node))

    def _write_virtualdisplacement(self, node: t.VirtualDisplacement, depth: int) -> list[Token]:
        name = self._symbol(node.of)
        bracketed = name.startswith("δ") or self.names.displacement_is_name(node.of.name)
        return [f"δ({name})" if bracketed else f"δ{name}"]

    def _write_partial(self, node: t.Partial, depth: int) -> list[Token]:
        return [f"∂{self.text(node.of)}/∂{self.text(node.by)}"]

    def _write_rate(self, node: t.Rate, depth: int) -> list[Token]:
        return ["d/dt ", *self._tight(node.of, depth)]

    def _write_sign(self, node: t.Sign, depth: int) -> list[Token]:
        return [node.text]

    def _write_entry(self, node: t.Entry, depth: int) -> list[Token]:
        return [f"{node.matrix.text}[{', '.join(map(self._symbol, node.indices))}]"]

    def _write_indexedsum(self, node: t.IndexedSum, depth: int) -> list[Token]:
        span = f"{node.index}={self.text(node.first)}..{self.text(node.last)}".replace(" ", "")
        return [f"Σ({span}) ", *self._summand(node.term, depth)]

    def _write_quotient(self, node: t.Quotient, depth: int) -> list[Token]:
        below = node.denominator
        top = self._tight(closed(node.numerator), depth + 1, product=True)
        if isinstance(below, t.Power) and not isinstance(below.base, t.Call | t.Number):
            bottom = self.tokens(below, depth + 1)
        else:
            bottom = self._tight(below, depth + 1)
        apart = [Break(depth + 1, "")] if any(isinstance(x, Break) for x in bottom) else []
        return [*top, *apart, "/", *bottom]

    def _write_root(self, node: t.Root, depth: int) -> list[Token]:
        sign, inner = {2: "√", 3: "∛"}[node.degree], node.radicand
        if isinstance(inner, t.Symbol) and not inner.dots:
            return [sign, *self.tokens(inner)]
        return [sign, *self._bracketed(inner, depth, round_=True)]

    def _write_vector(self, node: t.Vector, depth: int) -> list[Token]:
        return ["[", *self._listed(node.items, depth), "]"]

    def _write_component(self, node: t.Component, depth: int) -> list[Token]:
        part = f"_{node.subscript}" if node.subscript.isalpha() else f"[{node.subscript}]"
        if isinstance(node.of, Symbol) and self.names.text(node.of.name) + part in self.names.texts:
            return ["(", *self._tight(node.of, depth), ")", part]
        return [*self._tight(node.of, depth), part]

    def _write_cases(self, node: t.Cases, depth: int) -> list[Token]:
        parts = (node.condition, node.then, node.otherwise)
        return ["if(", *self._listed(parts, depth), ")"]

    def _write_relation(self, node: t.Relation, depth: int) -> list[Token]:
        relation = _RELATIONS.get(node.operator, node.operator)
        left, right = self.tokens(node.left, depth + 1), self.tokens(node.right, depth + 1)
        return [*left, Break(depth), f"{relation} ", *right]

    def _scientific(self, mantissa: str, power: int) -> str:
        return f"{mantissa}×10{str(power).translate(SUPERSCRIPTS)}"

    def _fraction(self, value: Fraction) -> str:
        return _VULGAR.get(value) or f"{value.numerator}/{value.denominator}"

    def _factor_number(self, value: Fraction) -> str:
        text = self.number(value)
        if "/" not in text:
            return text
        top = str(value.numerator).translate(SUPERSCRIPTS)
        return f"{top}⁄{str(value.denominator).translate(SUBSCRIPTS)}"

    def _symbol(self, node: t.Symbol) -> str:
        if node.kind == "constraint":
            return node.name
        if node.kind == "multiplier":
            return self.names.multiplier(node.name)
        if node.kind == "force":
            return f"{self.names.force[0]}_{self.names.text(node.name)}"
        return "π" if node.kind == "constant" else self.names.text(node.name, node.dots)

    def _write_product(self, node: t.Product, depth: int) -> list[Token]:
        tokens: list[Token] = []
        for i, factor in enumerate(node.factors):
            if i:
                tokens.append(Break(factor_depth(node.factors, i, depth)))
            if isinstance(factor, t.Number):
                tokens.append(self._factor_number(factor.value))
            elif isinstance(factor, t.Quotient) and i < len(node.factors) - 1:
                tokens += self._bracketed(factor, depth)
            else:
                tokens += self._factor(node, i, depth)
        return tokens

    def _write_power(self, node: t.Power, depth: int) -> list[Token]:
        top = node.exponent
        raised = f"^({self.text(top)})"
        if isinstance(top, t.Number) and top.value.denominator == 1:
            raised = str(top.value).translate(SUPERSCRIPTS)
        elif isinstance(top, t.Symbol):
            raised = f"^{self.text(top)}"
        base = node.base
        if isinstance(base, t.Call) and base.function in PREFIX and "^" not in raised:
            return [base.function, raised, *self._arguments(base, depth)]
        return [*self._tight(base, depth), raised]

    def _write_call(self, node: t.Call, depth: int) -> list[Token]:
        if node.function == "abs":
            inner = self.tokens(node.arguments[0], depth + 1)
            if "|" not in "".join(x for x in inner if isinstance(x, str)):  # |a |b| − c|
                return ["|", *inner, "|"]
        if node.function == "dot":
            left, right = (self._tight(a, depth) for a in node.arguments)
            return [*left, " · ", *right]
        if node.function == "cross":
            left, right = (self._tight(a, depth) for a in node.arguments)
            return [*left, " × ", *right]
        return [node.function, *self._arguments(node, depth)]

    def _arguments(self, node: t.Call, depth: int) -> list[Token]:
        """Return arguments in parentheses, or after a space: sin φ."""
        first = node.arguments[0]
        if node.function in PREFIX and len(node.arguments) == 1 and isinstance(first, t.Symbol):
            text = self._symbol(first)
            if not first.dots and not text[1:].strip("₀₁₂₃₄₅₆₇₈₉")[:1].isalpha():
                return [f" {text}"]
        return ["(", *self._listed(node.arguments, depth), ")"]

    def _write_logical(self, node: t.Logical, depth: int) -> list[Token]:
        if node.operator == "not":
            return ["not ", *self._bracketed(node.operands[0], depth)]
        tokens: list[Token] = []
        for i, operand in enumerate(node.operands):
            if i:
                tokens += [Break(depth), f"{node.operator} "]
            if isinstance(operand, t.Logical):
                tokens += self._bracketed(operand, depth)
            else:
                tokens += self.tokens(operand, depth + 1)
        return tokens

    def _tight(self, node: Node, depth: int, product: bool = False) -> list[Token]:
        """Return a node as a factor, base or denominator, in parentheses if necessary."""
        compound: tuple[type, ...] = (t.Sum, t.IndexedSum, t.Relation, t.Logical)
        if not product:
            compound += (t.Product, t.Quotient, t.Power, t.Rate)
        dotted = isinstance(node, t.Call) and node.function in ("dot", "cross")
        fraction = isinstance(node, t.Number) and "/" in self.number(node.value)
        prefix = not product and isinstance(node, t.Call) and node.function in PREFIX
        if isinstance(node, compound) or dotted or fraction or prefix:
            return self._bracketed(node, depth)
        return self.tokens(node, depth)

    def _bracketed(self, node: Node, depth: int, round_: bool = False) -> list[Token]:
        inner = self.tokens(node, depth + 1)
        text = "".join(x for x in inner if isinstance(x, str))
        opening, closing = _BRACKETS[0 if round_ else _level(text)]
        return [opening, *inner, closing]


def _level(text: str) -> int:
    """Return the brackets for a text by its depth: ( ), around these [ ], { }, and again ( )."""
    depth = 0
    for char in text:
        if char == "{" and not depth:
            return 0
        depth += (char in "([{") - (char in ")]}")
    return 0 if "(" not in text else 1 if "[" not in text else 2


def grammar_text(node: Node) -> str:
    """Return a formula as text of the model grammar.

    Parameters
    ----------
    node : Node
        Arranged expression; symbols of general laws are not supported.

    Returns
    -------
    str
        Text that `lagcli.model.expression.grammar.parse` reads, with the same value.
    """
    match node:
        case t.Number():
            return _grammar_number(node.value)
        case t.Symbol():
            return _grammar_symbol(node)
        case t.Sum():
            return _grammar_sum(node)
        case t.Product():
            return "*".join(_grammar_factor(f) for f in node.factors)
        case t.Quotient():
            return f"{_grammar_factor(node.numerator)}/{_grammar_base(node.denominator)}"
        case t.Power():
            return f"{_grammar_base(node.base)}^{_grammar_base(node.exponent)}"
        case t.Root():
            return f"{'sqrt' if node.degree == 2 else 'cbrt'}({grammar_text(node.radicand)})"
        case t.Call():
            return f"{node.function}({', '.join(map(grammar_text, node.arguments))})"
        case t.Component():
            part = f".{node.subscript}" if node.subscript.isalpha() else f"[{node.subscript}]"
            return f"{_grammar_base(node.of)}{part}"
        case t.Cases():
            branches = (node.condition, node.then, node.otherwise)
            return f"if({', '.join(map(grammar_text, branches))})"
        case t.Relation():
            return f"{grammar_text(node.left)} {node.operator} {grammar_text(node.right)}"
        case t.Logical():
            parts = tuple(f"({grammar_text(o)})" for o in node.operands)
            return f"not {parts[0]}" if node.operator == "not" else f" {node.operator} ".join(parts)
    raise AssertionError(f"no text in the grammar: {node!r}")


def _grammar_number(value: Fraction) -> str:
    if value.denominator == 1:
        return str(value.numerator)
    if Fraction(repr(float(value))) == value:  # a decimal with the digits of a double
        return repr(float(value))
    if value.numerator.bit_length() > 53 or value.denominator.bit_length() > 53:
        return repr(float(value))  # products of decimals have more digits than significant
    return f"{value.numerator}/{value.denominator}"


def _grammar_symbol(node: t.Symbol) -> str:
    match node.kind:
        case "multiplier":
            return str(symbols.multiplier(node.name).name)
        case "constant":
            return node.name
    return node.name + "'" * node.dots


def _grammar_sum(node: t.Sum) -> str:
    parts = []
    for i, (sign, term) in enumerate(node.terms):
        text = grammar_text(term)
        text = f"({text})" if isinstance(term, t.Sum) else text
        parts.append((" + " if sign > 0 else " - ") + text if i else "-" * (sign < 0) + text)
    return "".join(parts)


def _grammar_factor(node: Node) -> str:
    text = grammar_text(node)
    return f"({text})" if isinstance(node, t.Sum | t.Relation | t.Logical) else text


def _grammar_base(node: Node) -> str:
    """Return a base, exponent or denominator."""
    text = grammar_text(node)
    bare = isinstance(node, t.Symbol | t.Call | t.Root | t.Cases) or text.isdigit()
    return text if bare else f"({text})"


NARROWEST = 40
_INDENT = "  "
_APART = ";  "  # between short formulas side by side
_GAP = "   "  # between columns
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
    return wrapped(" ".join(text.split()), max(width - _excess(text), 10)) if text else []


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
    blocks: list[list[str]] = []
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
        blocks.append(block)
    return blocks


def _is_entry(line: Line) -> bool:
    """Whether a line is a name with its description, or with its value."""
    name, *value = line.sides
    return isinstance(name, Symbol) and all(isinstance(x, Sign) for x in value)


def _packed(group: Sequence[Line], formula: TextFormula, width: int) -> list[str]:
    """Return lines packed side by side, as many as fit."""
    if all(map(_is_entry, group)):
        return _in_columns(group, formula, width)
    packed: list[str] = []
    room = width - len(_INDENT)
    for line in group:
        text = " = ".join(map(formula.text, line.sides))
        if display_width(text) > room:
            packed += _unaligned(line, formula, room)
        elif packed and display_width(packed[-1]) + len(_APART) + display_width(text) <= room:
            packed[-1] += _APART + text
        else:
            packed.append(text)
    return [_INDENT + text for text in packed]


def _in_columns(group: Sequence[Line], formula: TextFormula, width: int) -> list[str]:
    """Return values in as many columns as fit; those with a note follow on lines of their own."""
    entries = [line for line in group if not line.note]
    names = [formula.text(line.sides[0]) for line in entries]
    values = [" = ".join(("", *map(formula.text, line.sides[1:]))) for line in entries]
    room = width - len(_INDENT)
    for count in range(len(entries), 1, -1):
        columns = range(count)
        left, right = (
            [max(map(display_width, texts[i::count])) for i in columns] for texts in (names, values)
        )
        if sum(left) + sum(right) + len(_GAP) * (count - 1) <= room:
            break
    else:
        return _group(group, formula, width)
    cells = [
        _padded(_padded(name, left[i % count]) + value, left[i % count] + right[i % count])
        for i, (name, value) in enumerate(zip(names, values, strict=True))
    ]
    rows = [_GAP.join(cells[i : i + count]).rstrip() for i in range(0, len(cells), count)]
    noted = [line for line in group if line.note]
    return [*(_INDENT + row for row in rows), *(_group(noted, formula, width) if noted else [])]


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
    rows = []
    for side in others:
        inner = room - aligned - 3
        broken = lines(side, display_width, inner, inner - 2, _NESTED)
        rows.append(f"{head} = {broken[0]}")
        rows += [" " * (aligned + 5) + x for x in broken[1:]]
        head = " " * aligned
    return rows


def _unaligned(line: Line, formula: TextFormula, room: int) -> list[str]:
    """Return a formula on one line if it fits; otherwise each side on a separate line."""
    whole = " = ".join(map(formula.text, line.sides))
    if display_width(whole) <= room:
        return [whole]
    rows: list[str] = []
    parts = [formula.tokens(side) for side in line.sides]
    parts[1:] = [["= ", *part] for part in parts[1:]]
    if len(parts) > 1 and display_width(flat(parts[0])) <= _SHORT_LEFT:
        parts[:2] = [[f"{flat(parts[0])} ", *parts[1]]]
    for i, tokens in enumerate(parts):
        short = flat(tokens)
        if rows and len(short) <= _SHORT and display_width(rows[-1]) + len(short) < room:
            rows[-1] += f" {short}"
            continue
        margin = _CONTINUED // 2 if i else 0
        broken = lines(tokens, display_width, room - margin, room - _CONTINUED, _NESTED)
        rows.append(" " * margin + broken[0])
        rows += [" " * _CONTINUED + x for x in broken[1:]]
    return rows
