"""Reports in other languages: no English word of the catalogue remains, and all numbers stay."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from random_cases import some

from lagcli.cli.app import run
from lagcli.pictures.words import words_of

pytest.importorskip("matplotlib")

VOID = ("br", "hr", "img", "input", "link", "meta")
FEW = ("--t-end", "0.3", "--samples", "21")
#: What is reported, in each case in one of the languages.
CASES = {
    "a run": ("de", "simulate", "slider_crank", *FEW, "--sensitivity", "m"),
    "contacts": ("fr", "simulate", "bouncing_ball", "--t-end", "5", "--samples", "21"),
    "a failed run": ("es", "simulate", "parallelogram", "--set-initial", "alpha_1'=6"),
    "a sweep": ("de", "sweep", "slider_crank", "--vary", "m=1,2", *FEW, "--jobs", "1"),
    "modes": ("fr", "modes", "four_bar", "--equilibrium"),
    "branches": ("es", "equilibrium", "bead_on_rotating_hoop", "--along", "Omega=2:4"),
    "two models": ("de", "compare", "slider_crank", "slider_crank_textbook", *FEW[:2]),
    "a linear model": ("fr", "linearize", "four_bar", "--equilibrium", "--input", "tau"),
}


class Texts(HTMLParser):
    """The texts of a page that are its own words: not formulas, code, or what the model says."""

    def __init__(self) -> None:
        super().__init__()
        self.kept: list[tuple[str, bool]] = [("", False)]
        self.lang, self.found = "", list[str]()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.lang = given.get("lang") or self.lang if tag == "html" else self.lang
        own = tag in ("math", "script", "style", "code", "pre", "title")
        keeps = self.kept[-1][1] or own or given.get("translate") == "no"
        keeps = keeps or given.get("class") == "name"
        if not keeps:
            self.found += [given.get(x) or "" for x in ("aria-label", "title", "alt")]
        if tag not in VOID:
            self.kept.append((tag, keeps))

    def handle_endtag(self, tag: str) -> None:
        while self.kept.pop()[0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        if not self.kept[-1][1]:
            self.found.append(" ".join(data.split()))


def texts(page: Path) -> Texts:
    parser = Texts()
    parser.feed(page.read_text(encoding="utf-8"))
    return parser


@pytest.mark.parametrize("what", some(CASES, 3))
def test_reports_speak_other_languages(what: str, tmp_path: Path) -> None:
    lang, command, *arguments = CASES[what]
    file, page, english = (tmp_path / name for name in ("x.h5", "x.html", "en.html"))
    run([command, *arguments, "-o", str(file), "--quiet"])
    assert run(["report", str(file), "-o", str(page), "--lang", lang, "--quiet"]) == 0
    assert run(["report", str(file), "-o", str(english), "--quiet"]) == 0
    found, before = texts(page), texts(english)
    assert (found.lang, before.lang) == (lang, "en")
    words = words_of(lang, "report_words.json")
    same = {text for text, other in words.items() if other == text}
    assert not {*words} - same & {*found.found}
    # what both have alike are names, units and formulas, not sentences
    left = {x for x in {*found.found} & {*before.found} if not re.search("[=≥≤∂∈]", x)}
    sentences = {x for x in left if len(re.findall(r"\b[a-z]{2,}\b", x)) > 2}
    assert not sentences - same
    assert len({*found.found} - {*before.found}) > 25
    numbers = re.compile(r"[−-]?\d[\d.]*")
    one, other = (numbers.findall("\n".join(x.found)) for x in (found, before))
    assert one == other


def test_pdf_is_in_english(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from lagcli.errors import UsageError
    from lagcli.pictures import pdf
    from lagcli.pictures.report import report

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pdf, "check_latex", lambda: None)
        with pytest.raises(UsageError, match="--lang is for pages"):
            report("run.h5", tmp_path / "x.pdf", lang="de")


def test_scripts_of_reports_speak_the_language(tmp_path: Path, visit, until) -> None:  # type: ignore[no-untyped-def]
    file, page = tmp_path / "x.h5", tmp_path / "x.html"
    assert run(["simulate", "slider_crank", *FEW, "-o", str(file), "--quiet"]) == 0
    assert run(["report", str(file), "-o", str(page), "--lang", "de", "--quiet"]) == 0
    opened = visit(page)
    opened.wait_for_selector(".uplot")
    until(opened, "document.querySelector('#theme').textContent === 'Dunkel'")
    assert opened.evaluate("document.documentElement.lang") == "de"
    shown = opened.evaluate("document.body.innerText")
    assert opened.locator("[aria-label=Abspielen]").count() == 1
    for english in ("Play", "Reset zoom", "Show this time"):
        assert not re.search(rf"\b{english}\b", shown)
