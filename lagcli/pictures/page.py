"""Self-contained pages: scripts, styles and data in one HTML file without network access."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from typing import Any

from lagcli.json_values import json_values

#: Scripts that draw and play scenes, in the order of their dependencies.
PLAYER_SCRIPTS = ("camera.js", "motion.js", "labels.js", "shapes.js", "scene.js", "player.js")
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


def content_policy(script: str, style: str) -> str:
    """Return a content security policy that permits only this script and style.

    Each of them is between two line ends in its element.
    """

    def digest(text: str) -> str:
        return base64.b64encode(hashlib.sha256(f"\n{text}\n".encode()).digest()).decode()

    return (
        f"default-src 'none'; script-src 'sha256-{digest(script)}';"
        f" style-src 'sha256-{digest(style)}'; base-uri 'none'; form-action 'none'"
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
    """
    style = "\n".join(styles)
    script = "\n".join([*scripts, start] if start else scripts)
    policy = content_policy(script, style) + ("; img-src data:" if images else "")
    kind = f' class="{layout}"' if layout else ""
    return f"""<!doctype html>
<html lang="en">
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
