"""The pages of the documentation form one whole: every page is reachable, every name exists."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

import lagcli

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
API = sorted((DOCS / "api").glob("*.md"))
NAMES = [n for page in API for n in re.findall(r"^::: (\S+)$", page.read_text("utf-8"), re.M)]


def links(page: Path) -> set[Path]:
    """Return the files of the repository that a page links to; all must exist."""
    found = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text("utf-8"))
    targets = {(page.parent / target).resolve() for target in found}
    assert not [t for t in targets if not t.exists()], page
    return targets


def test_every_decision_is_in_the_index_once() -> None:
    text = (DOCS / "decisions" / "README.md").read_text("utf-8")
    listed = re.findall(r"^- (\d{4}-\d{2}): \[[^\]]+\]\((\S+\.md)\): \S", text, re.M)
    assert all(name.startswith(date) for date, name in listed)
    assert sorted(n for _, n in listed) == sorted(f.name for f in DOCS.glob("decisions/2*.md"))
    dates = [date for date, _ in listed]
    assert dates == sorted(dates, reverse=True), "newest first"


def test_index_leads_to_every_page() -> None:
    seen: set[Path] = set()
    pages = [DOCS / "index.md"]
    while pages:
        page = pages.pop()
        if page not in seen:
            seen.add(page)
            pages += [t for t in links(page) if t.suffix == ".md" and t.is_relative_to(DOCS)]
    assert not set(DOCS.rglob("*.md")) - seen


def test_folders_that_are_linked_have_models() -> None:
    # docs/hooks.py leads such links to the gallery; the site has no page of another folder
    pages = [*DOCS.rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    folders = {t for page in pages for t in links(page) if t.is_dir()}
    assert folders
    assert all(t.is_relative_to(ROOT / "models") for t in folders)


def test_navigation_has_every_page() -> None:
    navigation = (ROOT / "mkdocs.yml").read_text("utf-8")
    pages = {f.relative_to(DOCS).as_posix() for f in DOCS.rglob("*.md")}
    named = set(re.findall(r"- (?:[^:\n]*: )?(\S+\.md)$", navigation, re.M))
    assert {p for p in pages if not p.startswith("decisions/2")} <= named


@pytest.mark.parametrize("name", NAMES)
def test_names_of_the_reference_exist(name: str) -> None:
    try:
        import_module(name)
    except ImportError:
        module, _, attribute = name.rpartition(".")
        assert getattr(import_module(module), attribute).__doc__


def test_reference_has_every_public_function() -> None:
    documented = {name.rpartition(".")[2] for name in NAMES}
    assert {n for n in lagcli.__all__ if not n.startswith("_")} <= documented


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda path: path.name)
def test_tables_are_those_of_the_declarations(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(DOCS)
    text = page.read_text("utf-8")
    assert import_module("tables").with_tables(text) == text, "run `python docs/tables.py`"


def test_every_table_is_in_a_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(DOCS)
    pages = "".join(page.read_text("utf-8") for page in DOCS.glob("*.md"))
    for name in import_module("tables").TABLES:
        assert f"<!-- table of {name} -->" in pages
