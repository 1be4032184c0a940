"""Greek letters in LaTeX, and dotted letters in MathML."""

from __future__ import annotations

_LETTERS = """
    alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu
    nu xi omicron pi rho sigma tau upsilon phi chi psi omega
""".split()  # noqa: SIM905 - a list of quoted words is harder to read
_SIGNS = "αβγδεζηθικλμνξοπρστυφχψω"
GREEK = dict(zip(_LETTERS, _SIGNS, strict=True))
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
