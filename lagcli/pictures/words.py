"""The words of pages in other languages."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterable, Mapping
from html import escape, unescape

from lagcli.errors import UsageError
from lagcli.pictures.languages import Language
from lagcli.pictures.page import asset


def words_of(lang: str, *tables: str) -> dict[str, str]:
    """Return the translations of a page's words, by the English ones.

    Parameters
    ----------
    lang : str
    *tables : str
        Assets with the words, besides ``words.json``, those of the scripts.

    Raises
    ------
    UsageError
        The language is unknown.
    """
    if lang not in [*Language]:
        raise UsageError(
            f"--lang {lang}: there is no such language; known are {', '.join(Language)}"
        )
    if lang == "en":
        return {}
    place = [*Language].index(Language(lang)) - 1
    return {
        english: texts[place]
        for table in ("words.json", *tables)
        for english, texts in json.loads(asset(table)).items()
    }


#: Elements whose content and attributes are no words: formulas, code, files.
_NOT = frozenset(("script", "style", "math", "pre", "code", "textarea"))
_VOID = frozenset(("br", "hr", "img", "input", "link", "meta", "path", "line", "rect"))
_ATTRIBUTES = re.compile(r'(?<=\s)(aria-label|title|alt|placeholder)="([^"]*)"')
_IMAGE = re.compile(r"(?<=data:image/svg\+xml;base64,)[\w+/=]+")
_LETTERS = re.compile(r"[^\W\d_]{2}")
#: Between sentences, and between the parts of a list, from the larger to the smaller.
_BREAKS = (re.compile(r"(?<=\.)\s+(?=[^\W\d_])"), re.compile("; "), re.compile(", "))
#: What something is said of: a name, or known words.
_HEAD = re.compile(r"([^:]+): (?=\S)")


class Words:
    """Translates the texts of a page.

    Parameters
    ----------
    words : mapping of str to str
        Translations by English texts; {} stands for what varies in both.
    """

    def __init__(self, words: Mapping[str, str]):
        self._whole = {text: other for text, other in words.items() if "{}" not in text}
        varying = sorted((x for x in words if "{}" in x), key=len, reverse=True)
        self._patterns = [
            (re.compile(re.escape(text).replace(r"\{\}", "(.+?)"), re.DOTALL), words[text])
            for text in varying
        ]

    def of(self, text: str) -> str:
        """Return a text: as a whole, or its sentences, or the parts of a list, if all are known."""
        found = self._whole.get(text)
        for between in _BREAKS:
            parts = between.split(text)
            if found is None and len(parts) > 1:
                found = self._joined(parts, between.findall(text))
        found = self._known(text) if found is None else found
        if found is None and text.endswith("."):
            other = self.of(text[:-1])
            found = f"{other}." if other != text[:-1] else None
        head = _HEAD.match(text)
        if found is None and head and (head[1] in self._whole or " " not in head[1]):
            rest = text[head.end() :]
            other = self.of(rest)
            if other != rest:
                found = f"{self._part(head[1])}: {other}"
        return text if found is None else found

    def _joined(self, parts: Iterable[str], between: list[str]) -> str | None:
        translated = []
        for part in parts:
            other = self.of(part)
            if other == part and _LETTERS.search(part) and self._known(part) is None:
                return None
            translated.append(other)
        return "".join(x for pair in zip(translated, [*between, ""], strict=True) for x in pair)

    def _known(self, text: str) -> str | None:
        if text in self._whole:
            return self._whole[text]
        for pattern, other in self._patterns:
            if match := pattern.fullmatch(text):
                parts = iter(match.groups())
                return re.sub(r"\{\}", lambda _, parts=parts: self._part(next(parts)), other)  # type: ignore[misc]
        return None

    def _part(self, text: str) -> str:
        return self._whole.get(text, text)

    def page(self, html: str) -> str:
        """Return a part of a page in HTML; elements with ``translate="no"`` stay as they are.

        Formulas, code and names of the model, of the class ``name``, do as well. Pictures are SVG.
        """
        made: list[str] = []
        kept: list[tuple[str, bool]] = []  # open elements, and whether they stay as they are
        for token in re.split(r"(<[^>]*>)", html):
            keeps = bool(kept) and kept[-1][1]
            if not token.startswith("<"):
                made.append(token if keeps else self._text(token))
                continue
            name = (re.match(r"</?([\w-]+)", token) or [""])[0].lstrip("</")
            if token.startswith("</"):
                while kept and kept.pop()[0] != name:
                    pass
            elif not token.startswith("<!"):
                own = name in _NOT or 'translate="no"' in token or 'class="name"' in token
                if not (keeps or own):
                    token = _ATTRIBUTES.sub(
                        lambda m: f'{m[1]}="{escape(self.of(unescape(m[2])))}"', token
                    )
                    token = _IMAGE.sub(lambda m: self._image(m[0]), token)
                if name not in _VOID and not token.endswith("/>"):
                    kept.append((name, keeps or own))
            made.append(token)
        return "".join(made)

    def _text(self, token: str) -> str:
        text = unescape(token)
        words = " ".join(text.split())
        if not _LETTERS.search(words):
            return token
        other = self.of(words)
        if other == words:
            return token
        start = text[: len(text) - len(text.lstrip())]
        return start + escape(other, quote=False) + text[len(text.rstrip()) :]

    def _image(self, data: str) -> str:
        return base64.b64encode(self.page(base64.b64decode(data).decode()).encode()).decode()
