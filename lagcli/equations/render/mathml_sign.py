"""One sign in LaTeX, as coordinates and general laws have it, as MathML."""

from __future__ import annotations

import re
from html import escape

from lagcli.equations.render.names import LATEX_GREEK, dotted

_TOKEN = re.compile(r"\s+|\\[A-Za-z]+|\\.|.", re.DOTALL)
_GREEK = {latex: sign for sign, latex in LATEX_GREEK.items() if latex.startswith("\\")}
_GREEK |= {r"\epsilon": "ϵ", r"\varrho": "ϱ", r"\varpi": "ϖ", r"\varsigma": "ς"}
_ACCENTS = {
    **{r"\hat": "^", r"\tilde": "~", r"\bar": "¯", r"\vec": "→"},
    **{r"\widehat": "^", r"\widetilde": "~", r"\overline": "¯", r"\check": "ˇ", r"\breve": "˘"},
}
_UPRIGHT = {r"\mathrm", r"\text", r"\operatorname", r"\mathsf", r"\textrm", r"\mathit", r"\mathbf"}
_SIGNS = {
    **{r"\ell": "ℓ", r"\hbar": "ℏ", r"\partial": "∂", r"\nabla": "∇", r"\infty": "∞"},
    **{r"\prime": "′", r"\ast": "∗", r"\star": "⋆", r"\perp": "⊥", r"\parallel": "∥"},
    **{r"\sum": "∑", r"\cdot": "⋅", r"\times": "×", r"\circ": "∘", r"\cdots": "⋯", r"\dagger": "†"},
}
_SCRIPT = {"L": "ℒ", "T": "𝒯", "V": "𝒱"}
_SPACES = {r"\,": "0.17em", r"\ ": "0.33em", r"\;": "0.28em", r"\:": "0.22em", r"\quad": "1em"}
_DEEPEST = 20


class Unknown(ValueError):
    """LaTeX that is more than a sign."""


def sign_mathml(latex: str) -> str:
    """Return the MathML of a sign: letters, accents, subscripts, superscripts.

    Parameters
    ----------
    latex : str
        E.g. ``\\dot{q}_{i\\beta}``.

    Returns
    -------
    str
        One element, without ``<math>`` around it.

    Raises
    ------
    Unknown
        There is a macro in it that is not known here, or a bracket too many.
    """
    tokens = _TOKEN.findall(latex)
    row, rest = _row(tokens, 0, 0)
    if rest != len(tokens):
        raise Unknown(latex)
    return row


def _row(tokens: list[str], at: int, depth: int) -> tuple[str, int]:
    """Read up to the end or a closing brace: (MathML, place of the end)."""
    if depth > _DEEPEST:
        raise Unknown("too deep")
    parts: list[str] = []
    while at < len(tokens) and tokens[at] != "}":
        if tokens[at].isspace() or tokens[at] in (r"\textstyle", r"\displaystyle"):
            at += 1
            continue
        part, at = _atom(tokens, at, depth)
        part, at = _scripts(part, tokens, at, depth)
        parts.append(part)
    return parts[0] if len(parts) == 1 else f"<mrow>{''.join(parts)}</mrow>", at


def _scripts(base: str, tokens: list[str], at: int, depth: int) -> tuple[str, int]:
    scripts: dict[str, str] = {}
    while at < len(tokens) and tokens[at] in ("_", "^"):
        kind = tokens[at]
        if kind in scripts:
            raise Unknown(kind)
        scripts[kind], at = _atom(tokens, at + 1, depth)
    if not scripts:
        return base, at
    tag = "msubsup" if len(scripts) == 2 else "msub" if "_" in scripts else "msup"
    inside = scripts.get("_", "") + scripts.get("^", "")
    return f"<{tag}>{base}{inside}</{tag}>", at


def _atom(tokens: list[str], at: int, depth: int) -> tuple[str, int]:
    """Read one letter, macro or group."""
    while at < len(tokens) and tokens[at].isspace():
        at += 1
    if at == len(tokens):
        raise Unknown("nothing")
    token = tokens[at]
    if token == "{":
        row, end = _row(tokens, at + 1, depth + 1)
        if end == len(tokens):
            raise Unknown("{")
        return row, end + 1
    if token in (r"\dot", r"\ddot"):
        base, at = _atom(tokens, at + 1, depth + 1)
        return dotted(base, len(token) - len(r"\dot") + 1), at
    if token in _ACCENTS:
        base, at = _atom(tokens, at + 1, depth + 1)
        mark = f'<mo stretchy="false">{_ACCENTS[token]}</mo>'
        return f'<mover accent="true">{base}{mark}</mover>', at
    if token in _UPRIGHT or token == r"\mathcal":
        word, at = _word(tokens, at + 1)
        if token == r"\mathcal":
            word = "".join(_SCRIPT.get(c, c) for c in word)
        return f'<mi mathvariant="normal">{escape(word)}</mi>', at
    at += 1
    if token in _GREEK:
        return f"<mi>{_GREEK[token]}</mi>", at
    if token in _SIGNS:
        return f"<mi>{_SIGNS[token]}</mi>", at
    if token in _SPACES:
        return f'<mspace width="{_SPACES[token]}"/>', at
    if token.isalpha():
        return f"<mi>{escape(token)}</mi>", at
    if token.isdigit():
        return f"<mn>{token}</mn>", at
    if token in "+-*/=,.;:()[]'|":
        return f"<mo>{_PLAIN.get(token, token)}</mo>", at
    raise Unknown(token)


_PLAIN = {"-": "−", "'": "′", "*": "∗"}


def _word(tokens: list[str], at: int) -> tuple[str, int]:
    """Read the braces after a change of fonts, letters and digits only."""
    if at >= len(tokens) or tokens[at] != "{":
        raise Unknown("a font without braces")
    letters = []
    at += 1
    while at < len(tokens) and tokens[at] != "}":
        letter = {r"\_": "_", r"\ ": " "}.get(tokens[at], tokens[at])
        if not (letter.isalnum() or letter in " _-") or len(letter) > 1:
            raise Unknown(letter)
        letters.append(letter)
        at += 1
    if at == len(tokens):
        raise Unknown("{")
    return "".join(letters), at + 1
