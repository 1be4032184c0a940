r"""LaTeX symbols: letters with accents, fonts, subscripts and superscripts.

A model may give the LaTeX of a coordinate (``latex: '\vartheta_{1}'``). TeX is a programming
language that reads and writes files, so the text is never passed through: it is parsed by the
grammar of this module, which lists every allowed command and character. LaTeX, Markdown, MathML and
matplotlib's mathtext are all written from the resulting tree.

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
#: Commands written unchanged.
SYMBOLS = frozenset(f"\\{name}" for name in (_GREEK + _SIGNS).split()) | {
    *(r"\,", r"\;", r"\:", r"\ ")
}
#: Commands that modify one atom: accents and bold.
ACCENTS = frozenset(
    f"\\{name}"
    for name in (
        *("dot", "ddot", "hat", "tilde", "bar", "vec", "check", "breve"),
        *("widehat", "widetilde", "overline", "boldsymbol"),
    )
)
#: Commands of other packages, and their equivalents in amsmath.
SYNONYMS = {r"\bm": r"\boldsymbol"}
#: Commands that set a word in another font.
FONTS = frozenset(
    f"\\{name}"
    for name in (
        *("mathrm", "mathit", "mathbf", "mathsf", "mathcal"),
        *("text", "textrm", "operatorname"),
    )
)
#: Characters written unchanged, in addition to ASCII letters and digits.
MARKS = frozenset("+-*/=,.;:()[]'|")

_DEEPEST = 20
_LONGEST = 200


class InvalidLatex(ValueError):
    """LaTeX that is not a valid symbol.

    Parameters
    ----------
    message : str
        Description of the error.
    start, end : int
        The range of the invalid characters.
    """

    def __init__(self, message: str, start: int, end: int):
        super().__init__(message)
        self.start, self.end = start, end


@dataclass(frozen=True)
class LatexAtom:
    """A letter, a digit, a mark, or a command without arguments."""

    text: str


@dataclass(frozen=True)
class Accent:
    """An accented or bold part: ``\\vec{r}``."""

    command: str
    base: Part


@dataclass(frozen=True)
class Word:
    """Letters, digits and spaces in a font: ``\\mathrm{rod}``."""

    font: str
    text: str


@dataclass(frozen=True)
class Scripts:
    """A part with a subscript, a superscript, or both."""

    base: Part
    below: Part | None
    above: Part | None


@dataclass(frozen=True)
class LatexRow:
    """Parts side by side."""

    parts: tuple[Part, ...]


Part = LatexAtom | Accent | Word | Scripts | LatexRow


def parse(latex: str) -> Part:
    """Parse the LaTeX of a symbol.

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
    InvalidLatex
        The text has a command or a character that this module does not list, or unbalanced
        braces.
    """
    if len(latex) > _LONGEST:
        raise InvalidLatex(f"it is longer than {_LONGEST} characters", 0, len(latex))
    return _Reader(latex).whole()


def to_latex(part: Part) -> str:
    """Return a symbol as LaTeX; only commands listed in this module occur."""
    match part:
        case LatexAtom():
            return part.text
        case Accent():
            return f"{part.command}{{{to_latex(part.base)}}}"
        case Word():
            return part.font + "{" + part.text.replace("_", r"\_") + "}"
        case Scripts():
            base = to_latex(part.base)
            latex = f"{{{base}}}" if isinstance(part.base, LatexRow | Scripts) else base
            for sign, script in (("_", part.below), ("^", part.above)):
                if script is not None:
                    latex += f"{sign}{{{to_latex(script)}}}"
            return latex
        case LatexRow():
            latex = ""
            for text in map(to_latex, part.parts):
                # a letter after a command would be read as part of its name
                apart = text[:1].isalpha() and _COMMAND_AT_END.search(latex)
                latex += f" {text}" if apart else text
            return latex


class _Reader:
    def __init__(self, latex: str):
        self.tokens = [(m.group(), m.start()) for m in _TOKEN.finditer(latex)]
        self.at, self.end = 0, len(latex)

    @property
    def token(self) -> str:
        """The next token; empty at the end."""
        return self.tokens[self.at][0] if self.at < len(self.tokens) else ""

    def fail(self, message: str) -> InvalidLatex:
        token, start = self.tokens[self.at] if self.token else ("", self.end)
        return InvalidLatex(message, start, start + len(token))

    def skip_spaces(self) -> None:
        while self.token.isspace():
            self.at += 1

    def whole(self) -> Part:
        row = self.row(0)
        if self.token:
            raise self.fail("`}` has no opening brace")
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
        scripts: dict[str, Part] = {}
        while True:
            self.skip_spaces()
            kind = self.token
            if kind not in ("_", "^") or not kind:
                break
            if kind in scripts:
                raise self.fail(f"a second `{kind}` needs braces around the part before it")
            self.at += 1
            scripts[kind] = self.atom(depth)
        return Scripts(base, scripts.get("_"), scripts.get("^")) if scripts else base

    def atom(self, depth: int) -> Part:
        """Read one letter, command or group."""
        self.skip_spaces()
        token = SYNONYMS.get(self.token, self.token)
        if not token:
            raise self.fail("it ends too early")
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
            return LatexAtom(token)
        shown = token if token.isprintable() else f"U+{ord(token[-1]):04X}"
        raise self.fail(f"`{shown}` is not an allowed command or character")

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
                raise self.fail(f"`{font}` may contain letters, digits, spaces and `-`")
            letters.append(letter)
            self.at += 1
        self.at += 1
        return "".join(letters)
