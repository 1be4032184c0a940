"""The words of pages in other languages."""

from __future__ import annotations

import json
from importlib.resources import files

from lagcli.errors import UsageError
from lagcli.live.languages import Language


def words_of(lang: str) -> dict[str, str]:
    """Return the translations of a page's words, by the English ones.

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
    table = files("lagcli.live").joinpath("assets", "words.json").read_text(encoding="utf-8")
    place = [*Language].index(Language(lang)) - 1
    return {english: texts[place] for english, texts in json.loads(table).items()}
