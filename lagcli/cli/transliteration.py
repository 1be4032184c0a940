"""Output in encodings that lack the characters of formulas."""

from __future__ import annotations

import unicodedata

_DIRECT = {
    "−": "-",
    "–": "-",
    "…": "...",
    "⋯": "...",
    "→": "->",
    "·": "*",
    "×": "*",
    "≤": "<=",
    "≥": ">=",
    "≠": "!=",
    "±": "+-",
    "∞": "inf",
    "∂": "d",
    "√": "sqrt",
    "⊥": "_|_",
    "°": " deg",
    "∠": " at ",
    "λ": "lambda",  # other names in Unicode
    "Λ": "Lambda",
    "\u0307": "'",
    "\u0308": "''",
    "’": "'",
    "“": "'",  # not a quote of JSON
    "”": "'",
}
_LIFTED = {"<super>": "^", "<sub>": "_"}


def replacement(error: UnicodeError) -> tuple[str, int]:
    """Return ASCII text for characters that an encoding lacks; an error handler of codecs.

    ``½ m ẋ²`` becomes ``1/2 m x'^2``, and λ ``lambda``; characters without a replacement become
    ``?``.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object
    found = (_plain(text, i) for i in range(error.start, error.end))
    return "".join(found).encode(error.encoding, "replace").decode(error.encoding), error.end


def _plain(text: str, at: int) -> str:
    char = text[at]
    if char in _DIRECT:
        return _DIRECT[char]
    kind, lifted, before = _lift(char), "", _lift(text[at - 1]) if at else ""
    if kind:
        lifted = "" if kind == before else _LIFTED[kind]
        return lifted + unicodedata.normalize("NFKD", char).translate(_MINUS)
    words = unicodedata.name(char, "").split()
    if words[:1] == ["GREEK"] and "LETTER" in words:
        name = words[words.index("LETTER") + 1].lower()
        dots = sum((2 if x == "\u0308" else 1) for x in unicodedata.normalize("NFD", char)[1:])
        return (name if "SMALL" in words else name.capitalize()) + "'" * dots
    parts = unicodedata.normalize("NFKD", char)
    if parts == char:
        return "" if unicodedata.combining(char) else "?"
    kept = (x for x in parts if x in _DIRECT or not unicodedata.combining(x))
    return "".join(_DIRECT.get(x, x) for x in kept).replace("⁄", "/")


def _lift(char: str) -> str:
    kind = unicodedata.decomposition(char).partition(" ")[0]
    return kind if kind in _LIFTED else ""


_MINUS = str.maketrans("−", "-")
