"""The words of pages in other languages."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.live.languages import Language
from lagcli.live.words import words_of

PACKAGE = Path(lagcli.__file__).parent


@pytest.mark.parametrize("lang", [*Language][1:])
def test_translations_have_what_varies(lang: str) -> None:
    for english, text in words_of(lang).items():
        assert text.count("{}") == english.count("{}"), english
        assert text.strip()


def test_what_the_live_scripts_say_is_translated() -> None:
    said: set[str] = set()
    for script in (PACKAGE / "live" / "assets").glob("*.js"):
        text = script.read_text("utf-8")
        said |= set(re.findall(r'(?<![\w.])say\(\s*"([^"]+)"', text))
    assert len(said) > 15
    said -= {"Reset all"}  # the example of words.js, also on the page
    assert said <= words_of("de").keys()


def test_what_the_core_says_of_a_start_is_translated() -> None:
    source = (PACKAGE / "engine" / "core" / "fmi" / "instance.c").read_text("utf-8")
    said = set(
        re.findall(
            r'fail\(fmu, "((?:the (?:initial values|constraints)|a contact) [^"%]+)"', source
        )
    )
    assert said - {"the initial values are not finite"} <= words_of("de").keys()


def test_english_needs_no_words_and_others_are_refused() -> None:
    assert words_of("en") == {}
    with pytest.raises(UsageError, match="known are en, de, fr, es"):
        words_of("it")
