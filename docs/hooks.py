"""Hooks of MkDocs: pages and models outside `docs/`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
#: Pages of the repository's root, and their places in the site, where README means the index.
PAGES = {"README.md": "first-example.md", "CONTRIBUTING.md": "CONTRIBUTING.md"}
PAGES |= {"CHANGELOG.md": "CHANGELOG.md", "LICENSE": "LICENSE"}
GALLERY = "gallery/README.md"
#: What `make gallery` adds: without it, the pictures of the gallery lead to the models.
MADE = ROOT / "docs" / "gallery" / "pages"
CELL = re.compile(r'\[<img src="(\w+)\.png"([^\]]*)\]\([^)]*\)')
LINK = re.compile(r"\]\(([^)#:]+)(?=[)#])")


def on_files(files: Files, config: Any) -> Files:
    """Add the root's pages and the models."""
    files_of_models = (ROOT / "models").rglob("*.yaml")
    models = sorted(path.relative_to(ROOT).as_posix() for path in files_of_models)
    for source, place in [*PAGES.items(), *zip(models, models, strict=True)]:
        files.append(File.generated(config, place, abs_src_path=str(ROOT / source)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Turn links between `docs/` and its parent folder into the site's."""
    place = page.file.src_uri
    if place == GALLERY:
        markdown = CELL.sub(_cell, markdown)
    if place in PAGES.values():
        return LINK.sub(lambda m: f"]({_of_root(m[1])}", markdown)
    depth = place.count("/")
    leaving = "../" * (depth + 1)

    def inside(link: re.Match[str]) -> str:
        if not link[1].startswith(leaving):
            return link[0]
        return f"]({'../' * depth}{_of_root(link[1].removeprefix(leaving))}"

    return LINK.sub(inside, markdown)


def _cell(cell: re.Match[str]) -> str:
    """Return a picture of the gallery that moves and leads to its report, if both were made."""
    name, rest = cell.groups()
    if not (MADE / f"{name}-report.html").exists():
        return cell[0]
    film = f' data-film="pages/{name}.gif"' if (MADE / f"{name}.gif").exists() else ""
    return f'<a href="pages/{name}-report.html"><img src="{name}.png"{film}{rest}</a>'


def _of_root(target: str) -> str:
    """Return where a path from the repository's root is in the site.

    Folders have no page: the gallery shows their models.
    """
    if (ROOT / target).is_dir() and target.startswith("models"):
        return GALLERY
    return PAGES.get(target, target.removeprefix("docs/"))
