"""Common parts of the pages of runs and of analyses: frame, equations, model file, pictures."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Iterable, Sequence
from html import escape
from string import Template
from typing import NamedTuple

from lagcli.arrays import Array
from lagcli.pictures.page import asset, page, paragraphs, script_data
from lagcli.pictures.plots.figure import FigureTarget, HeldFigure
from lagcli.pictures.plots.mode_plot import DRAWN
from lagcli.pictures.report.equations import EquationSystem
from lagcli.pictures.words import Words, words_of

Links = Sequence[tuple[str, str]]  # anchors and titles


def report_page(
    system: EquationSystem,
    *,
    template: str,
    title: str | None,
    contents: Links,
    styles: Iterable[str],
    scripts: Sequence[str],
    lang: str,
    layout: str = "without-motion",
    status: str = "",
    start: Sequence[Array] = (),
    conserved: str = "",
    steps: str = "",
    **parts: str,
) -> str:
    """Return the page of a run or of an analysis.

    Parameters
    ----------
    system : EquationSystem
    template : str
        The asset with the page's sections, in which ``parts`` are inserted.
    title : str, optional
        Title instead of the model's.
    contents : sequence of (anchor, title)
        The sections, in the order of the page.
    styles, scripts : iterables of str
        Texts of the scripts.
    lang : str
        Language of the page's own words.
    layout : str
        See `lagcli.pictures.page.page`.
    status : str
        HTML before the contents.
    start : sequence of arrays
        Initial coordinates and velocities.
    conserved, steps : str
        HTML of conserved quantities, and of the derivation.
    **parts : str
        HTML.
    """
    model = system.model
    name = title or model.title
    sections = {
        "equations": _filled(
            "equations.html",
            freedom=system.freedom(),
            definitions=system.definitions(),
            energies=system.energies(),
            forces=system.forces(),
            constraints=system.constraints(),
            equations=system.motion(),
            convention=system.convention(),
            steps=steps,
        ),
        "system": _filled(
            "system.html",
            coordinates=system.coordinates(start),
            parameters=system.parameters(),
            conserved=conserved,
        ),
        "model": _filled("model.html", model=highlighted(model.text)),
    }
    body = _filled(
        "report_page.html",
        title=escape(name),
        description=paragraphs(model.description),
        status=status,
        contents="\n".join(
            f'<li><a href="#{anchor}">{heading}</a></li>' for anchor, heading in contents
        ),
        content=_filled(template, **sections, **parts),
    )
    if words := words_of(lang, "report_words.json"):
        data = f'<script type="application/json" id="words">{script_data(words)}</script>'
        body = f"{Words(words).page(body)}\n{data}"
        scripts = [*scripts, asset("translation.js"), _TRANSLATE]
    return page(
        name,
        body,
        styles=styles,
        scripts=scripts,
        layout=layout,
        images=True,
        lang=lang,
    )


#: For texts that scripts write to the page.
_TRANSLATE = """new Translation(
  JSON.parse(document.getElementById("words").textContent),
).observe(document.body);"""


def _filled(template: str, **parts: str) -> str:
    return Template(asset(template)).substitute(parts)


_LINE = re.compile(
    r"""
    (?P<comment>(?:(?<=\s)|^)\#.*$)
    | (?P<text>"(?:[^"\\]|\\.)*"|'(?:[^']|'')*')
    | (?P<key>(?:^\s*(?:-\s+)?|(?<=[{,]))\s*[^\s\#:{}\[\],"'][^:{},"\#]*(?=:(?:\s|$)))
    | (?P<number>(?<![\w.])\d+\.?\d*(?:[eE][+-]?\d+)?(?![\w.]))
    """,
    re.VERBOSE,
)


def highlighted(text: str) -> str:
    """Return the text of a YAML file as HTML for ``<pre>``.

    Every character of the text is kept, escaped; keys, numbers, quoted texts and comments are in a
    ``<span>`` of that class.
    """
    return "\n".join(map(_line, text.splitlines()))


def _line(line: str) -> str:
    parts: list[str] = []
    end = 0
    for match in _LINE.finditer(line):
        parts.append(escape(line[end : match.start()]))
        parts.append(f'<span class="yaml-{match.lastgroup}">{escape(match[0])}</span>')
        end = match.end()
    return "".join([*parts, escape(line[end:])])


#: Colours of light pictures, and the corresponding ones of dark pages.
_DARK = {
    "#ffffff": "#16191d",
    "#000000": "#e8e8e8",
    "#202020": "#ececec",
    "#262626": "#e8e8e8",
    "#404040": "#a8b0b8",
    "#d9d9d9": "#343a42",
    "#8c8c8c": "#8c939b",
    "white": "#16191d",
}


def picture(draw: Callable[[FigureTarget], object], caption: str) -> str:
    """Return a picture in HTML.

    Parameters
    ----------
    draw : callable
        Function that draws to the given target.
    caption : str
        Alternative text.

    Raises
    ------
    UsageError
        matplotlib is not installed.
    """
    target = HeldFigure("svg", dpi=100)
    draw(target)
    svg = target.content.decode()
    images = "".join(
        f'<img class="{name}" alt="{escape(caption)}" src="data:image/svg+xml;base64,'
        f'{base64.b64encode(svg.encode()).decode()}">'
        for name, svg in (("light", svg), ("dark", _darkened(svg)))
    )
    return f'<figure class="picture" aria-label="{escape(caption)}">{images}</figure>'


def _darkened(svg: str) -> str:
    """Return a picture for dark pages."""
    for light, dark in _DARK.items():
        svg = svg.replace(f": {light}", f": {dark}")
    # letters have no colour attribute; pictures of a mechanism keep their hues
    more = f'text{{fill:#e8e8e8}}[id^="{DRAWN}"]{{filter:invert(0.91) hue-rotate(180deg)}}'
    return svg.replace('<style type="text/css">', f'<style type="text/css">{more}', 1)


class AnalysisSection(NamedTuple):
    """A part of a page.

    Parameters
    ----------
    anchor, title, body : str
        Title and body are HTML.
    """

    anchor: str
    title: str
    body: str


def section_html(section: AnalysisSection) -> str:
    """Return a part of a page with its heading."""
    return f'<section id="{section.anchor}"><h2>{section.title}</h2>{section.body}</section>'
