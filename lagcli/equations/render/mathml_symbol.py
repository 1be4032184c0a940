"""LaTeX symbols of coordinates and general laws as MathML."""

from __future__ import annotations

from html import escape

from lagcli.equations.render.latex_symbol import (
    Accent,
    LatexAtom,
    LatexRow,
    Part,
    Scripts,
    Word,
    parse,
)
from lagcli.equations.render.letters import LATEX_GREEK, dotted

_GREEK = {latex: sign for sign, latex in LATEX_GREEK.items() if latex.startswith("\\")}
_GREEK |= {r"\epsilon": "ϵ", r"\varrho": "ϱ", r"\varpi": "ϖ", r"\varsigma": "ς"}
_ACCENTS = {
    **{r"\hat": "^", r"\tilde": "~", r"\bar": "¯", r"\vec": "→"},
    **{r"\widehat": "^", r"\widetilde": "~", r"\overline": "¯", r"\check": "ˇ", r"\breve": "˘"},
}
_SIGNS = {
    **{r"\ell": "ℓ", r"\hbar": "ℏ", r"\partial": "∂", r"\nabla": "∇", r"\infty": "∞"},
    **{r"\prime": "′", r"\ast": "∗", r"\star": "⋆", r"\perp": "⊥", r"\parallel": "∥"},
    **{r"\sum": "∑", r"\cdot": "⋅", r"\times": "×", r"\circ": "∘", r"\cdots": "⋯", r"\dagger": "†"},
}
_SCRIPT = {"L": "ℒ", "T": "𝒯", "V": "𝒱"}
_SPACES = {r"\,": "0.17em", r"\ ": "0.33em", r"\;": "0.28em", r"\:": "0.22em", r"\quad": "1em"}
_STYLES = (r"\textstyle", r"\displaystyle")
_PLAIN = {"-": "−", "'": "′", "*": "∗"}
#: First bold letter in Unicode, upright and italic, by first plain letter.
_BOLD = {"A": 0x1D400, "a": 0x1D41A}
_BOLD_ITALIC = {"A": 0x1D468, "a": 0x1D482, "Α": 0x1D71C, "α": 0x1D736}


def symbol_mathml(latex: str) -> str:
    """Return the MathML of a LaTeX symbol: letters, accents, subscripts, superscripts.

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
    InvalidLatex
        See `lagcli.equations.render.latex_symbol.parse`.
    """
    return _mathml(parse(latex))


def _mathml(part: Part) -> str:
    match part:
        case LatexAtom():
            return _symbol(part.text)
        case Accent():
            return _accent(part)
        case Word():
            word = part.text
            if part.font == r"\mathcal":
                word = "".join(_SCRIPT.get(c, c) for c in word)
            if part.font == r"\mathbf":
                word = "".join(_shifted(c, _BOLD) for c in word)
            return f'<mi mathvariant="normal">{escape(word)}</mi>'
        case Scripts():
            scripts = [_mathml(x) for x in (part.below, part.above) if x is not None]
            tag = "msubsup" if len(scripts) == 2 else "msub" if part.below is not None else "msup"
            return f"<{tag}>{_mathml(part.base)}{''.join(scripts)}</{tag}>"
        case LatexRow():
            shown = [
                _mathml(x)
                for x in part.parts
                if not (isinstance(x, LatexAtom) and x.text in _STYLES)
            ]
            return shown[0] if len(shown) == 1 else f"<mrow>{''.join(shown)}</mrow>"


def _accent(part: Accent) -> str:
    base = _mathml(part.base)
    if part.command in (r"\dot", r"\ddot"):
        return dotted(base, len(part.command) - len(r"\dot") + 1)
    if part.command == r"\boldsymbol":
        letter = (
            _GREEK.get(part.base.text, part.base.text) if isinstance(part.base, LatexAtom) else ""
        )
        return base.replace(letter, _shifted(letter, _BOLD_ITALIC)) if letter.isalpha() else base
    mark = f'<mo stretchy="false">{_ACCENTS[part.command]}</mo>'
    return f'<mover accent="true">{base}{mark}</mover>'


def _symbol(text: str) -> str:
    if text in _STYLES:
        return "<mrow></mrow>"
    if text in _SPACES:
        return f'<mspace width="{_SPACES[text]}"/>'
    if text in _SIGNS:
        return f"<mi>{_SIGNS[text]}</mi>"
    letter = _GREEK.get(text, text)
    if letter.isalpha():
        return f"<mi>{letter}</mi>"
    if letter.isdigit():
        return f"<mn>{letter}</mn>"
    return f"<mo>{_PLAIN.get(letter, letter)}</mo>"


def _shifted(letter: str, blocks: dict[str, int]) -> str:
    """Return a letter in another Unicode alphabet, if that has the letter."""
    for first, start in blocks.items():
        index = ord(letter) - ord(first)
        if 0 <= index < (25 if first > "z" else 26):
            return chr(start + index)
    return letter
