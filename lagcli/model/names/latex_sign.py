r"""The LaTeX of a sign: letters, accents, fonts, subscripts and superscripts, and nothing else.

A model may state how a coordinate is written (``latex: '\vartheta_{1}'``). TeX is a programming
language that reads and writes files, so what a model says is never passed on as text: it is read
by the grammar of this module, which lists every command and character that it knows. LaTeX,
Markdown, MathML and matplotlib's mathtext are all written from the tree that comes out.

    row   = { atom [ "_" group ] [ "^" group ] }
    group = atom
    atom  = letter | digit | mark | symbol | "{" row "}" | accent group | font "{" word "}"
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_TOKEN = re.compile(r"\s+|\\[A-Za-z]+|\\.|.", re.DOTALL)
_COMMAND_AT_END = re.compile(r"\\[A-Za-z]+$")

_GREEK = """
    alpha beta gamma delta epsilon varepsilon zeta eta theta vartheta iota kappa lambda mu nu xi
    pi varpi rho varrho sigma varsigma tau upsilon phi varphi chi psi omega
    Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega
"""
_SIGNS = """
    ell hbar partial nabla infty prime ast star perp parallel sum cdot times circ cdots dagger
    quad textstyle displaystyle
"""
#: Commands that stand for themselves.
SYMBOLS = frozenset(f"\\{name}" for name in (_GREEK + _SIGNS).split()) | {
    *(r"\,", r"\;", r"\:", r"\ ")
}
#: Commands that change one atom: marks above it, and bold.
ACCENTS = frozenset(
    f"\\{name}"
    for name in (
        *("dot", "ddot", "hat", "tilde", "bar", "vec", "check", "breve"),
        *("widehat", "widetilde", "overline", "boldsymbol"),
    )
)
#: Commands of other packages, and what amsmath has in their place.
SYNONYMS = {r"\bm": r"\boldsymbol"}
#: Commands that set a word in another font.
FONTS = frozenset(
    f"\\{name}"
    for name in (
        *("mathrm", "mathit", "mathbf", "mathsf", "mathcal"),
        *("text", "textrm", "operatorname"),
    )
)
#: Characters that stand for themselves, beside ASCII letters and digits.
MARKS = frozenset("+-*/=,.;:()[]'|")

_DEEPEST = 20
_LONGEST = 200


class NotASign(ValueError):
    """LaTeX that is not a sign.

    Parameters
    ----------
    message : str
        What is wrong with it.
    start, end : int
        The characters that are.
    """

    def __init__(self, message: str, start: int, end: int):
        super().__init__(message)
        self.start, self.end = start, end


@dataclass(frozen=True)
class LatexSymbol:
    """A letter, a digit, a mark, or a command that stands for itself."""

    text: str


@dataclass(frozen=True)
class Accent:
    """Something with a mark above, or in bold: ``\\vec{r}``."""

    command: str
    base: Part


@dataclass(frozen=True)
class Word:
    """Letters, digits and spaces in a font: ``\\mathrm{rod}``."""

    font: str
    text: str


@dataclass(frozen=True)
class Scripts:
    """Something with a subscript, a superscript, or both."""

    base: Part
    below: Part | None
    above: Part | None


@dataclass(frozen=True)
class LatexRow:
    """What stands side by side."""

    parts: tuple[Part, ...]


Part = LatexSymbol | Accent | Word | Scripts | LatexRow


def parse(latex: str) -> Part:
    """Read the LaTeX of a sign.

    Parameters
    ----------
    latex : str
        E.g. ``\\dot{q}_{i\\beta}``.

    Returns
    -------
    Part
        One symbol, or a row of them.

    Raises
    ------
    NotASign
        There is a command or a character in it that is not listed in this module, or a brace too
        many.
    """
    if len(latex) > _LONGEST:
        raise NotASign(f"it is longer than {_LONGEST} characters", 0, len(latex))
    return _Reader(latex).whole()


def to_latex(part: Part) -> str:
    """Return a sign as LaTeX, made of what this module lists and nothing else."""
    match part:
        case LatexSymbol():
            return part.text
        case Accent():
            return f"{part.command}{{{to_latex(part.base)}}}"
        case Word():
            return part.font + "{" + part.text.replace("_", r"\_") + "}"
        case Scripts():
            base = to_latex(part.base)
            found = f"{{{base}}}" if isinstance(part.base, LatexRow | Scripts) else base
            for sign, script in (("_", part.below), ("^", part.above)):
                if script is not None:
                    found += f"{sign}{{{to_latex(script)}}}"
            return found
        case LatexRow():
            found = ""
            for text in map(to_latex, part.parts):
                # a letter behind a command would be read as a part of its name
                apart = text[:1].isalpha() and _COMMAND_AT_END.search(found)
                found += f" {text}" if apart else text
            return found


class _Reader:
    def __init__(self, latex: str):
        self.tokens = [(m.group(), m.start()) for m in _TOKEN.finditer(latex)]
        self.at, self.end = 0, len(latex)

    @property
    def token(self) -> str:
        """The next token; empty at the end."""
        return self.tokens[self.at][0] if self.at < len(self.tokens) else ""

    def fail(self, message: str) -> NotASign:
        token, start = self.tokens[self.at] if self.token else ("", self.end)
        return NotASign(message, start, start + len(token))

    def skip_spaces(self) -> None:
        while self.token.isspace():
            self.at += 1

    def whole(self) -> Part:
        row = self.row(0)
        if self.token:
            raise self.fail("`}` closes nothing")
        if row == LatexRow(()):
            raise self.fail("it is empty")
        return row

    def row(self, depth: int) -> Part:
        """Read up to the end or a closing brace."""
        if depth > _DEEPEST:
            raise self.fail(f"braces are nested more than {_DEEPEST} deep")
        parts: list[Part] = []
        while True:
            self.skip_spaces()
            if self.token in ("", "}"):
                return parts[0] if len(parts) == 1 else LatexRow(tuple(parts))
            parts.append(self.scripts(self.atom(depth), depth))

    def scripts(self, base: Part, depth: int) -> Part:
        found: dict[str, Part] = {}
        while True:
            self.skip_spaces()
            kind = self.token
            if kind not in ("_", "^") or not kind:
                break
            if kind in found:
                raise self.fail(f"a second `{kind}` needs braces around what stands before it")
            self.at += 1
            found[kind] = self.atom(depth)
        return Scripts(base, found.get("_"), found.get("^")) if found else base

    def atom(self, depth: int) -> Part:
        """Read one letter, command or group."""
        self.skip_spaces()
        token = SYNONYMS.get(self.token, self.token)
        if not token:
            raise self.fail("something is missing at its end")
        if token == "{":
            self.at += 1
            row = self.row(depth + 1)
            if not self.token:
                raise self.fail("a `}` is missing")
            self.at += 1
            return row
        if token in ACCENTS:
            self.at += 1
            if depth >= _DEEPEST:
                raise self.fail(f"accents are nested more than {_DEEPEST} deep")
            return Accent(token, self.atom(depth + 1))
        if token in FONTS:
            self.at += 1
            return Word(token, self.word(token))
        if token in SYMBOLS or token in MARKS or (token.isascii() and token.isalnum()):
            self.at += 1
            return LatexSymbol(token)
        shown = token if token.isprintable() else f"U+{ord(token[-1]):04X}"
        raise self.fail(f"`{shown}` is not among the commands and characters of a sign")

    def word(self, font: str) -> str:
        """Read the braces after a change of fonts: letters, digits and spaces."""
        if self.token != "{":
            raise self.fail(f"`{font}` needs braces")
        self.at += 1
        letters: list[str] = []
        while self.token != "}":
            if not self.token:
                raise self.fail("a `}` is missing")
            token = self.token
            letter = {r"\_": "_", r"\ ": " "}.get(token, " " if token.isspace() else token)
            if len(letter) > 1 or not letter.isascii() or not (letter.isalnum() or letter in " _-"):
                raise self.fail(f"inside `{font}` stand letters, digits, spaces and `-`")
            letters.append(letter)
            self.at += 1
        self.at += 1
        return "".join(letters)
