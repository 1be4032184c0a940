"""The languages of pages."""

from enum import StrEnum


class Language(StrEnum):
    """A language; English is first: its words are those in the scripts."""

    en = "en"
    de = "de"
    fr = "fr"
    es = "es"
