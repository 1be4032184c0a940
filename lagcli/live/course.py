"""A folder of live pages with an index, for a course."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from urllib.parse import quote

from lagcli.errors import UsageError
from lagcli.live.page import live_page
from lagcli.model.model import Model
from lagcli.pictures.page import page
from lagcli.pictures.words import words_of

INDEX = "index.html"


def course(models: Sequence[Model], lang: str = "en") -> dict[str, str]:
    """Return the pages of models, and their index, by the names of their files.

    Raises
    ------
    UsageError
        Two models have the same name; or as `live_page`, whose other errors it raises too.
    """
    words = words_of(lang)
    names = [f"{model.name}.html" for model in models]
    for name in names:
        if names.count(name) > 1 or name == INDEX:
            raise UsageError(f"{name} would be the page of several models; rename one of them")
    pages = {name: live_page(model, lang) for name, model in zip(names, models, strict=True)}
    title = words.get("Models", "Models")
    entries = "\n".join(
        f'<li><a href="{quote(name)}">{escape(model.title)}</a>{_about(model)}</li>'
        for name, model in zip(names, models, strict=True)
    )
    body = f"<main>\n<h1>{escape(title)}</h1>\n<ul>\n{entries}\n</ul>\n</main>"
    style = files("lagcli.live").joinpath("assets", "index.css").read_text(encoding="utf-8")
    return {**pages, INDEX: page(title, body, styles=[style], lang=lang)}


def _about(model: Model) -> str:
    """Return the first paragraph of a model's description."""
    first = (model.description or "").strip().split("\n\n")[0]
    return f"<p>{escape(' '.join(first.split()))}</p>" if first else ""
