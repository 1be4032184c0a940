"""Notation of the names of a model: Greek letters, subscripts, dots."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from contextlib import suppress
from html import escape
from typing import TYPE_CHECKING, Self

from lagcli.columns import SLIP
from lagcli.equations.render.latex_symbol import InvalidLatex, parse, to_latex
from lagcli.equations.render.letters import GREEK, LATEX_GREEK, dotted
from lagcli.equations.render.mathml_symbol import symbol_mathml
from lagcli.errors import Diagnostic

if TYPE_CHECKING:
    from lagcli.model.model import Model

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
        declared = [*model.coordinate_names, *model.parameters, *model.definitions, *model.inputs]
        latex = {c.name: c.latex for c in model.coordinates if c.latex}
        self._declare(declared, len(model.constraints), latex)

    @classmethod
    def of_names(cls, declared: Sequence[str], constraints: int, latex: Mapping[str, str]) -> Self:
        """Return the notation of a model that is known by its names alone.

        Parameters
        ----------
        declared : sequence of str
            Names of coordinates, parameters, definitions and inputs.
        constraints : int
            Number of constraints.
        latex : mapping of str to str
            The declared LaTeX of coordinates.
        """
        notation = cls.__new__(cls)
        notation._declare(declared, constraints, latex)
        return notation

    def _declare(self, declared: Sequence[str], constraints: int, latex: Mapping[str, str]) -> None:
        self._text = _distinct({name: _text(name) for name in declared})
        self._latex = _distinct({name: _latex(name) for name in declared})
        self._mathml = _distinct({name: _mathml(name) for name in declared})
        self._own = _valid_latex(latex)
        self.with_own_latex = frozenset(self._own)
        self.declared = frozenset(declared)
        self._single = constraints == 1 and "lambda" not in self.declared

    def text(self, name: str, dots: int = 0) -> str:
        """Return a name with dots: x_A' as ẋ_A."""
        letter, subscript = self._text.get(name) or _text(name)
        if len(letter) == 1 and letter.isalpha():
            return unicodedata.normalize("NFC", letter + _DOTS[dots]) + subscript
        return letter + subscript + "'" * dots

    def latex(self, name: str, dots: int = 0) -> str:
        """Return a name with dots in LaTeX."""
        macro = ("", r"\dot", r"\ddot")[dots]
        if name in self._own:
            own = self._own[name]
            return f"{macro}{{{own}}}" if dots else own
        letter, subscript = self._latex.get(name) or _latex(name)
        return (f"{macro}{{{letter}}}" if dots else letter) + subscript

    def multiplier(self, constraint: str) -> str:
        """Return λ, with the constraint's name if there are several."""
        if self._single:
            return "λ"
        name, dot, friction = constraint.partition(SLIP)
        family, bracket, index = name.removesuffix("]").partition("[")
        return f"λ_{family}{_text_index(index) if bracket else ''}{dot}{friction}"

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
    """Return the LaTeX of names, re-serialized, without what is invalid."""
    valid = {}
    for name, text in latex.items():
        with suppress(InvalidLatex):
            valid[name] = to_latex(parse(text))
    return valid


def invalid_latex_warnings(model: Model) -> list[Diagnostic]:
    """Return warnings for coordinates with invalid LaTeX, whose names are written instead."""
    found: dict[object, Diagnostic] = {}
    for c in model.coordinates:
        if not c.latex:
            continue
        try:
            parse(c.latex)
        except InvalidLatex as error:
            location = c.latex_location or c.location
            found.setdefault(
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
    return list(found.values())


def _distinct(looks: dict[str, tuple[str, str]]) -> dict[str, tuple[str, str]]:
    """Drop notations that two names share; such names are written raw."""
    count: dict[tuple[str, str], int] = {}
    for look in looks.values():
        count[look] = count.get(look, 0) + 1
    return {name: look if count[look] == 1 else (name, "") for name, look in looks.items()}


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
    for char in unicodedata.normalize("NFD", text):
        if char.isascii() and char.isalnum():
            parts.append(char)
        elif char == "_":
            parts.append(r"\_")
        elif char in LATEX_GREEK:
            parts.append(LATEX_GREEK[char])
        elif not unicodedata.combining(char):
            parts.append(f"u{ord(char):04X}")
    return "".join(parts)
