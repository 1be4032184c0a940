"""Self-contained HTML pages: the frame with scripts, styles and data; numbers, units and tables."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from typing import Any

from lagcli.equations.typesetting.notation import SUPERSCRIPTS, unit_text
from lagcli.json_values import json_values

#: Scripts that draw and play scenes, in the order of their dependencies.
PLAYER_SCRIPTS = (
    *("instants.js", "camera.js", "motion.js", "labels.js", "shapes.js", "scene.js", "player.js"),
)
PLAYER_STYLES = ("player.css",)


def asset(name: str) -> str:
    """Return the text of a file in ``lagcli/pictures/assets``."""
    return files("lagcli.pictures").joinpath("assets", name).read_text(encoding="utf-8")


def script_data(value: Any) -> str:
    """Return a value as JSON for use in a script of a page.

    Parameters
    ----------
    value : mappings, sequences, NumPy arrays, texts, numbers
        Numbers that are not finite become null.
    """
    text = json.dumps(
        json_values(value), ensure_ascii=False, allow_nan=False, separators=(",", ":")
    )
    # both characters occur only in texts; they could end the script or begin a comment
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def content_policy(script: str, style: str, sources: Sequence[str]) -> str:
    """Return a content security policy that permits only this script and style, and more sources.

    Each of them is between two line ends in its element.
    """
    own = "script-src "
    more = "".join(f" {source.removeprefix(own)}" for source in sources if source.startswith(own))
    rest = "".join(f"; {source}" for source in sources if not source.startswith(own))

    def digest(text: str) -> str:
        return base64.b64encode(hashlib.sha256(f"\n{text}\n".encode()).digest()).decode()

    return (
        f"default-src 'none'; script-src 'sha256-{digest(script)}'{more};"
        f" style-src 'sha256-{digest(style)}'; base-uri 'none'; form-action 'none'{rest}"
    )


def page(
    title: str,
    body: str,
    *,
    styles: Iterable[str] = (),
    scripts: Sequence[str] = (),
    start: str = "",
    layout: str = "",
    images: bool = False,
    sources: Sequence[str] = (),
    lang: str = "en",
) -> str:
    """Return a self-contained page.

    Parameters
    ----------
    title : str
        Plain text.
    body : str
        HTML.
    styles, scripts : iterables of str
        Texts of the scripts; see `asset`.
    start : str
        Script to run last.
    layout : str
        Class of the body.
    images : bool
        Whether images with data URLs are permitted.
    sources : sequence of str
        More of the content security policy; ``script-src`` is added to that of the script.
    lang : str
        Language of the page.
    """
    style = "\n".join(styles)
    script = "\n".join([*scripts, start] if start else scripts)
    policy = content_policy(script, style, (*sources, *["img-src data:"] * images))
    kind = f' class="{layout}"' if layout else ""
    return f"""<!doctype html>
<html lang="{lang}">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{escape(title)}</title>
<style>
{style}
</style>
</head>
<body{kind}>
{body}
<script>
{script}
</script>
</body>
</html>
"""


def number(value: float | None, digits: int = 6) -> str:
    """Format a number: −5.15836, 2.4·10⁻⁹; a dash for None."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    mantissa = mantissa.replace("-", "−")
    if not exponent:
        return mantissa
    return f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPTS)}"


def unit(text: str | None) -> str:
    """Format a unit: m/s², N m."""
    if not text or text == "1":
        return ""
    return unit_text(text, " ")


def axis_unit(text: str | None) -> str:
    """Format a unit for an axis: 1 for a number; empty if unknown."""
    return "1" if text == "1" else unit(text)


def table(
    caption: str,
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    numeric: Sequence[int] = (),
    kind: str = "",
) -> str:
    """Return a table that scrolls on a narrow screen.

    Parameters
    ----------
    caption, head : text and texts
        HTML.
    rows : iterable of sequences of str
        HTML; the first cell of a row is its header. Columns without text are omitted.
    numeric : sequence of int
        Indices of numerical columns.
    kind : str
        A class, for the style sheet.
    """
    filled = list(rows)
    wide = [i for i in range(len(head)) if not i or any(row[i] for row in filled)]
    classes = ['class="number"' if i in numeric else "" for i in range(len(head))]
    titles = "".join(f'<th scope="col" {classes[i]}>{head[i]}</th>' for i in wide)
    lines = []
    for row in filled:
        cells = "".join(f"<td {classes[i]}>{row[i]}</td>" for i in wide[1:])
        lines.append(f'<tr><th scope="row">{row[0]}</th>{cells}</tr>')
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(_plain(caption))}">'
        f'<table class="{kind}"><caption>{caption}</caption><thead><tr>{titles}</tr></thead>'
        f"<tbody>{''.join(lines)}</tbody></table></div>"
    )


def _plain(html: str) -> str:
    return re.sub(r"<[^>]*>", "", html)


def own_words(text: str | None) -> str:
    """Return a text of the model in HTML, which is not translated."""
    return f'<span translate="no">{escape(text)}</span>' if text else ""


def message(text: str) -> str:
    """Return a message of the program in HTML, which is in English on every page."""
    return f'<span lang="en" translate="no">{with_code(text)}</span>' if text else ""


def paragraphs(text: str | None) -> str:
    """Return a description of the model: its paragraphs, escaped."""
    blocks = (text or "").strip().split("\n\n")
    lines = (" ".join(block.split()) for block in blocks)
    return "".join(f'<p translate="no">{escape(line)}</p>' for line in lines if line)


def with_code(text: str) -> str:
    """Return a text in HTML, with names in backticks as code."""
    return re.sub("`([^`]+)`", r"<code>\1</code>", escape(text))
