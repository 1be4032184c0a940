"""Notation of the names of a model: Greek letters, subscripts, dots, in text, LaTeX and MathML."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Self

from lagcli.equations.typesetting.latex_symbol import (
    Accent,
    InvalidLatex,
    LatexAtom,
    LatexRow,
    Part,
    Scripts,
    Word,
    parse,
    to_latex,
)
from lagcli.errors import Diagnostic

if TYPE_CHECKING:
    from lagcli.model.model import Model

_LETTERS = """
    alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu
    nu xi omicron pi rho sigma tau upsilon phi chi psi omega
""".split()  # noqa: SIM905 - a list of quoted words is harder to read
_GREEK_SIGNS = "αβγδεζηθικλμνξοπρστυφχψω"
GREEK = dict(zip(_LETTERS, _GREEK_SIGNS, strict=True))
GREEK.update({name.capitalize(): sign.upper() for name, sign in GREEK.items()})
LATEX_GREEK = {sign: f"\\{name}" for name, sign in GREEK.items()}
LATEX_GREEK.update({"φ": r"\varphi", "ε": r"\varepsilon", "ϕ": r"\phi", "ϑ": r"\vartheta"})
# LaTeX has no macros for capitals that look like Latin letters
LATEX_GREEK.update(zip("ΑΒΕΖΗΙΚΜΝΟΡΤΧ", "ABEZHIKMNOPTX", strict=True))
LATEX_GREEK.update({"ο": "o", "Υ": r"\Upsilon"})


def dotted(letter: str, dots: int) -> str:
    """Return a letter in MathML with dots above it."""
    if not dots:
        return letter
    # full stops, because the accents ˙ and ¨ touch low letters in some browsers
    mark = f'<mo stretchy="false" lspace="0" rspace="0">{"." * dots}</mo>'
    return f'<mover>{letter}<mstyle scriptlevel="0">{mark}</mstyle></mover>'


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
SCRIPT = {
    **{"T": "𝒯", "V": "𝒱", "L": "ℒ", "M": "ℳ", "B": "ℬ", "J": "𝒥"},
    **{"Q": "𝒬", "H": "ℋ"},
}
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
        See `lagcli.equations.typesetting.latex_symbol.parse`.
    """
    return _part_mathml(parse(latex))


def _part_mathml(part: Part) -> str:
    match part:
        case LatexAtom():
            return _atom_mathml(part.text)
        case Accent():
            return _accent(part)
        case Word():
            word = part.text
            if part.font == r"\mathcal":
                word = "".join(SCRIPT.get(c, c) for c in word)
            if part.font == r"\mathbf":
                word = "".join(_shifted(c, _BOLD) for c in word)
            return f'<mi mathvariant="normal">{escape(word)}</mi>'
        case Scripts():
            scripts = [_part_mathml(x) for x in (part.below, part.above) if x is not None]
            tag = "msubsup" if len(scripts) == 2 else "msub" if part.below is not None else "msup"
            return f"<{tag}>{_part_mathml(part.base)}{''.join(scripts)}</{tag}>"
        case LatexRow():
            shown = [
                _part_mathml(x)
                for x in part.parts
                if not (isinstance(x, LatexAtom) and x.text in _STYLES)
            ]
            return shown[0] if len(shown) == 1 else f"<mrow>{''.join(shown)}</mrow>"


def _accent(part: Accent) -> str:
    base = _part_mathml(part.base)
    if part.command in (r"\dot", r"\ddot"):
        return dotted(base, len(part.command) - len(r"\dot") + 1)
    if part.command == r"\boldsymbol":
        letter = (
            _GREEK.get(part.base.text, part.base.text) if isinstance(part.base, LatexAtom) else ""
        )
        return base.replace(letter, _shifted(letter, _BOLD_ITALIC)) if letter.isalpha() else base
    mark = f'<mo stretchy="false">{_ACCENTS[part.command]}</mo>'
    return f'<mover accent="true">{base}{mark}</mover>'


def _atom_mathml(text: str) -> str:
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


SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
#: Subscript letters in Unicode.
_INDEX_SIGNS = str.maketrans("0123456789ijknpsu+−-", "₀₁₂₃₄₅₆₇₈₉ᵢⱼₖₙₚₛᵤ₊₋₋")
_MEMBER = re.compile(r"([^\[]+)(\[.*\])(.*)")
_DOTS = ("", "\u0307", "\u0308")


def split(name: str) -> tuple[str, str]:
    """Split a name into letter and subscript: x_A, y1, theta_0, rod_1, x[3], r.x, r[3].x."""
    if member := _MEMBER.fullmatch(name):
        letter, subscript = split(member[1] + member[3])
        return letter, subscript + member[2]
    if "." in name:
        base, _, part = name.rpartition(".")
        letter, subscript = split(base)
        return letter, f"{subscript}_{part}" if subscript else part
    base, _, subscript = name.partition("_")
    letters = base.rstrip("0123456789")
    if letters and letters != base and (len(letters) == 1 or letters in GREEK):
        digits = base[len(letters) :]
        return letters, f"{digits}_{subscript}" if subscript else digits
    return base, subscript


def letter(name: str) -> str:
    """Return the letter of a name, or the word if it is not a letter."""
    base, _ = split(name)
    return GREEK.get(base, base)


class Notation:
    """Notation of the names of a model in text, LaTeX and MathML; distinct names look distinct.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        latex = {c.name: c.latex for c in model.coordinates if c.latex}
        self._declare(model.declared_names, model.constraint_names, latex)

    @classmethod
    def of_names(
        cls, declared: Sequence[str], constraints: Sequence[str], latex: Mapping[str, str]
    ) -> Self:
        """Return the notation of a model that is known by its names alone.

        Parameters
        ----------
        declared : sequence of str
            Names of coordinates, parameters, definitions and inputs.
        constraints : sequence of str
            Names of the constraints.
        latex : mapping of str to str
            The declared LaTeX of coordinates.
        """
        notation = cls.__new__(cls)
        notation._declare(declared, constraints, latex)
        return notation

    def _declare(
        self, declared: Sequence[str], constraints: Sequence[str], latex: Mapping[str, str]
    ) -> None:
        looks = {name: "".join(_text(name)) for name in declared}
        self._single = len(constraints) == 1 and "λ" not in looks.values()
        multipliers = {self.multiplier(name) for name in constraints}
        raw = {name for name, look in looks.items() if look in multipliers}
        self._text, self._latex, self._mathml = (
            _distinct({name: look(name) for name in declared}, raw)
            for look in (_text, _latex, _mathml)
        )
        self._own = _valid_latex(latex)
        self.with_own_latex = frozenset(self._own)
        self.declared = frozenset(declared)

    def text(self, name: str, dots: int = 0) -> str:
        """Return a name with dots: x_A' as ẋ_A."""
        letter, subscript = self._text.get(name) or _text(name)
        if len(letter) == 1 and letter.isalpha():
            dotted_name = unicodedata.normalize("NFC", letter + _DOTS[dots]) + subscript
            if not dots or dotted_name not in self.texts:  # ä is a letter, and a with two dots
                return dotted_name
        return letter + subscript + "'" * dots

    @cached_property
    def texts(self) -> frozenset[str]:
        """All declared names as they are written in text."""
        return frozenset(map(self.text, self.declared))

    @cached_property
    def _latexes(self) -> frozenset[str]:
        """All declared names as they are written in LaTeX."""
        return frozenset(map(self.latex, self.declared))

    def component_is_name(self, name: str, part: str) -> bool:
        """Whether the component of a vector looks like a declared name: r.x like r_x."""
        return f"{self.latex(name)}_{{{part}}}" in self._latexes

    def displacement_is_name(self, name: str) -> bool:
        """Whether the virtual displacement of a coordinate looks like a declared name."""
        return f"δ{self.text(name)}" in self.texts

    def displacement_is_product(self, name: str) -> bool:
        """Whether δq of a coordinate, set without a space, looks like a name or a product δ q."""
        return "δ" in self.texts or self.displacement_is_name(name)

    @cached_property
    def force(self) -> tuple[str, str]:
        """The letter of generalized forces, in text and in LaTeX: Q, unless Q_x is declared."""
        return self.before_names(("Q", "Q"), (SCRIPT["Q"], r"\mathcal{Q}"))

    def before_names(self, *letters: tuple[str, str]) -> tuple[str, str]:
        """Return the first of some letters that no other name as its subscript makes a name."""
        for text, latex in letters:
            if any(x.startswith(text) for x in self.texts) and any(
                f"{text}_{self.text(x)}" in self.texts
                or f"{latex}_{{{self.latex(x)}}}" in self._latexes
                for x in self.declared
            ):
                continue
            return text, latex
        return letters[-1]

    def latex(self, name: str, dots: int = 0) -> str:
        """Return a name with dots in LaTeX."""
        macro = ("", r"\dot", r"\ddot")[dots]
        if name in self._own:
            own = self._own[name]
            return f"{macro}{{{own}}}" if dots else own
        letter, subscript = self._latex.get(name) or _latex(name)
        if letter == name and not (name.isascii() and len(name) == 1):  # raw
            letter = rf"\mathit{{{latex_ascii(name)}}}"
        return (f"{macro}{{{letter}}}" if dots else letter) + subscript

    def multiplier(self, constraint: str) -> str:
        """Return λ, with the constraint's name if there are several."""
        if self._single:
            return "λ"
        member = _MEMBER.fullmatch(constraint)
        if member is None:
            return f"λ_{constraint}"
        return f"λ_{member[1]}{_text_index(member[2][1:-1])}{member[3]}"

    def latex_multiplier(self, constraint: str) -> str:
        """Return λ in LaTeX."""
        return r"\lambda" if self._single else rf"\lambda_{{{latex_word(constraint)}}}"

    def mathml(self, name: str, dots: int = 0) -> tuple[str, str]:
        """Return the letter of a name with dots in MathML, and its subscript or an empty string."""
        if name in self._own:
            return dotted(symbol_mathml(self._own[name]), dots), ""
        letter, subscript = self._mathml.get(name) or _mathml(name)
        if letter == name:  # raw, to look different from another name
            letter = f"<mi>{escape(name)}</mi>"
        return dotted(letter, dots), subscript

    def mathml_multiplier(self, constraint: str) -> str:
        """Return the subscript of λ in MathML, or an empty string."""
        return "" if self._single else _mathml_row(constraint)


def _valid_latex(latex: Mapping[str, str]) -> dict[str, str]:
    """Return the LaTeX of names, re-serialized, without invalid entries."""
    valid = {}
    for name, text in latex.items():
        with suppress(InvalidLatex):
            valid[name] = to_latex(parse(text))
    return valid


def invalid_latex_warnings(model: Model) -> list[Diagnostic]:
    """Return warnings for coordinates with invalid LaTeX, whose names are written instead."""
    warnings: dict[object, Diagnostic] = {}
    for c in model.coordinates:
        if not c.latex:
            continue
        try:
            parse(c.latex)
        except InvalidLatex as error:
            location = c.latex_location or c.location
            warnings.setdefault(
                location or c.name,
                Diagnostic(
                    "latex-sign",
                    f"`latex` of the coordinate `{c.name}`: {error}; its name is written instead",
                    location,
                    "write letters, Greek (\\varphi), accents (\\vec{r}), \\boldsymbol{r},"
                    " \\mathrm{word},\nsubscripts and superscripts; docs/model-file.md lists all",
                    severity="warning",
                ),
            )
    return list(warnings.values())


#: Greek letters that look like Latin ones.
_ALIKE = str.maketrans("ΑΒΕΖΗΙΚΜΝΟΡΤΥΧο", "ABEZHIKMNOPTYXo")


def _distinct(
    looks: dict[str, tuple[str, str]], raw: Collection[str]
) -> dict[str, tuple[str, str]]:
    """Drop notations that two names share; such names are written raw, and so are others."""
    seen = {name: "".join(look).translate(_ALIKE) for name, look in looks.items()}
    count = Counter(seen.values())
    return {
        name: look if count[seen[name]] == 1 and name not in raw else (name, "")
        for name, look in looks.items()
    }


def _text(name: str) -> tuple[str, str]:
    letter, subscript = split(name)
    letter = GREEK.get(letter, letter)
    subscript, bracket, index = subscript.partition("[")
    if bracket and subscript.isdigit():  # e₀[1], as e₀₁ has another meaning
        return letter, _text_subscript(subscript) + bracket + index
    if bracket:
        return letter, _text_subscript(subscript) + _text_index(index.removesuffix("]"))
    return letter, _text_subscript(subscript)


def _text_subscript(subscript: str) -> str:
    if not subscript:
        return ""
    if subscript.isascii() and subscript.isdigit():
        return subscript.translate(SUBSCRIPTS)
    return f"_{subscript}"


def _text_index(index: str) -> str:
    """Return the index of a member: ₃, ᵢ₋₁, _N, _(N−1), [1,2]."""
    lowered = index.translate(_INDEX_SIGNS)
    if not any(x.isascii() for x in lowered):
        return lowered
    if "," in index:
        return f"[{index}]"
    return f"_{index}" if index.isidentifier() else f"_({index})"


def _latex(name: str) -> tuple[str, str]:
    letter, subscript = split(name)
    letter = _latex_letter(GREEK.get(letter, letter))
    if not subscript:
        return letter, ""
    return letter, f"_{{{_latex_subscript(subscript)}}}"


#: Matches the index of a general member, such as i, i−1 or N+1.
_INDEX = re.compile(r"([A-Za-z]\w*)([+−]\d+)?")


def _latex_subscript(subscript: str) -> str:
    subscript, _, index = subscript.removesuffix("]").partition("[")
    parts = [_latex_letter(GREEK.get(p, p), r"\mathrm") for p in subscript.split("_") if p]
    return ",".join([*parts, *([_latex_index(index)] if index else [])])


def _latex_index(index: str) -> str:
    """Return the index of a member: 3, i, i-1."""
    general = _INDEX.fullmatch(index)
    if general is None:
        return index
    name, offset = general[1], (general[2] or "").replace("−", "-")
    return _latex_letter(GREEK.get(name, name)) + offset


def _mathml(name: str) -> tuple[str, str]:
    letter, subscript = split(name)
    return f"<mi>{escape(GREEK.get(letter, letter))}</mi>", subscript and _mathml_row(subscript)


def _mathml_row(subscript: str) -> str:
    """Return a subscript with its parts separated by commas."""
    parts = [p for p in re.split(r"[_.,\[\]]", subscript) if p]
    shown = [
        f"<mn>{p}</mn>" if p.isdigit() else f"<mi>{escape(GREEK.get(p, p))}</mi>" for p in parts
    ]
    comma = '<mo separator="true">,</mo>'
    return f"<mrow>{comma.join(shown)}</mrow>" if len(shown) > 1 else shown[0]


def _latex_letter(text: str, font: str = r"\mathit") -> str:
    if text in LATEX_GREEK:
        return LATEX_GREEK[text]
    if text.isascii() and (len(text) == 1 or text.isdigit()):
        return text
    return f"{font}{{{latex_ascii(text)}}}"


def latex_word(name: str) -> str:
    """Return a constraint's name as an upright subscript: p4,x; rod,1; pin,x,i."""
    member = _MEMBER.fullmatch(name)
    index = member[2][1:-1] if member else ""
    name = member[1] + member[3] if member else name
    words = ",".join(latex_ascii(p) for p in re.split("[_.]", name) if p)
    return rf"\mathrm{{{words}}}" + (f",{_latex_index(index)}" if index else "")


def latex_ascii(text: str) -> str:
    """Return a word for use inside \\mathrm; characters that TeX lacks become their code."""
    parts = []
    for char in unicodedata.normalize("NFC", text):
        if char.isascii() and char.isalnum():
            parts.append(char)
        elif char == "_":
            parts.append(r"\_")
        elif char in LATEX_GREEK:
            parts.append(f"{{{LATEX_GREEK[char]}}}" if len(text) > 1 else LATEX_GREEK[char])
        elif "À" <= char <= "ſ":
            parts.append(rf"\text{{{char}}}")
        elif not unicodedata.combining(char):
            parts.append(f"u{ord(char):04X}")
    return "".join(parts)


def unit_text(unit: str, product: str = "·") -> str:
    """Return a unit with superscripts: ``N*m^2`` as N·m²."""
    raised = re.sub(r"(?:\^|\*\*)(-?\d+)", lambda m: m[1].translate(SUPERSCRIPTS), unit)
    return raised.replace("*", product)
