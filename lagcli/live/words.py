"""The words of pages in other languages."""

from __future__ import annotations

import json
from importlib.resources import files

from lagcli.errors import UsageError

#: The languages, English first: its words are those in the scripts.
LANGUAGES = ("en", "de", "fr", "es")


def words_of(lang: str) -> dict[str, str]:
    """Return the translations of a page's words, by the English ones.

    Raises
    ------
    UsageError
        The language is unknown.
    """
    if lang not in LANGUAGES:
        raise UsageError(
            f"--lang {lang}: there is no such language; known are {', '.join(LANGUAGES)}"
        )
    if lang == "en":
        return {}
    table = files("lagcli.live").joinpath("assets", "words.json").read_text(encoding="utf-8")
    place = LANGUAGES.index(lang) - 1
    return {english: texts[place] for english, texts in json.loads(table).items()}
