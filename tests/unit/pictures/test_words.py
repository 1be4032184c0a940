"""The words of pages in other languages."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.pictures.languages import Language
from lagcli.pictures.page import asset
from lagcli.pictures.words import Words, words_of

PACKAGE = Path(lagcli.__file__).parent


TABLES = ("words.json", "report_words.json")


@pytest.mark.parametrize("table", TABLES)
def test_every_language_has_every_word_with_what_varies(table: str) -> None:
    for english, texts in json.loads(asset(table)).items():
        assert len(texts) == len([*Language]) - 1, english
        for text in texts:
            assert text.count("{}") == english.count("{}"), english
            assert text.strip()


def test_words_are_in_one_table() -> None:
    one, other = (json.loads(asset(table)).keys() for table in TABLES)
    assert not one & other


def test_sentences_lists_and_names_are_translated() -> None:
    words = Words(words_of("de", "report_words.json"))
    assert words.of("Mode 3") == "Mode 3"
    assert words.of("122 steps, 19 rejected") == "122 Schritte, 19 verworfen"
    assert words.of("floor: impact 47, rest 1; at_rest: opens 2.") == (
        "floor: Stöße 47, Ruhe 1; at_rest: öffnet 2."
    )
    first, second = "Impacts are inelastic: ε = 0.", "There are no samples."
    assert words.of(f"{first} {second}") == f"{words.of(first)} {words.of(second)}"
    # what is not known as a whole stays: no sentence is in two languages
    unknown = "There are no samples. There are no giraffes."
    assert words.of(unknown) == unknown
    assert words.of("completed, purple") == "completed, purple"


def test_formulas_code_and_what_the_model_says_stay() -> None:
    words = Words(words_of("es", "report_words.json"))
    kept = (
        '<p translate="no">Time &amp; Speed <b>Energy</b></p><code>Time</code><math>Time</math>'
        '<span class="name">Time</span><pre title="Time">Time</pre>'
    )
    assert words.page(kept) == kept
    text = '<h2>\n Energy\n</h2><br><p title="Time">Value<img alt="Time"> 3</p>'
    found = '<h2>\n Energía\n</h2><br><p title="Tiempo">Valor<img alt="Tiempo"> 3</p>'
    assert words.page(f"{kept}{text}{kept}") == f"{kept}{found}{kept}"


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
