"""The live page: one self-contained HTML file that simulates a model in the browser."""

from __future__ import annotations

import base64
import gzip
from html import escape
from importlib.resources import files
from string import Template

from lagcli.live.content import live_content
from lagcli.live.module import module
from lagcli.live.words import words_of
from lagcli.model.model import Model
from lagcli.pictures.page import PLAYER_SCRIPTS, PLAYER_STYLES, asset, page, script_data

_PLAYER = ("lagcli.pictures", "assets")
_PLAY = ("lagcli.play", "assets")
_LIVE = ("lagcli.live", "assets")
#: Scripts of the page that `lagcli play` has, too, after those of the player.
_SHARED = (
    *("controls.js", "scenarios.js", "drag.js", "phase.js", "happened.js", "equations.js"),
    *("pictures.js", "play.js"),
)
#: Scripts of the worker, which simulates.
_WORKER = ("words.js", "core.js", "answers.js", "runs.js", "worker.js")
#: What the page may do beside its own script and style: compile the core, and start its worker.
_POLICY = ("script-src 'wasm-unsafe-eval'", "worker-src blob:", "img-src data:")


def live_page(model: Model, lang: str = "en") -> str:
    """Return a page that simulates a model.

    Parameters
    ----------
    model : Model
    lang : str
        Language of the page's own words: ``"en"``, ``"de"``, ``"fr"`` or ``"es"``.

    Raises
    ------
    UsageError
        The model's own run fails; the language is unknown.
    ModelError, NumericalError
        There is no consistent initial state.
    FileError
        The core for pages is not there.
    """
    words = words_of(lang)
    core = module()
    model, data, resources = live_content(model)
    data["hello"]["page"] = model.title
    scripts = [
        asset("vendor/uplot/uPlot.iife.min.js"),
        asset("plots.js"),
        asset("balance.js"),
        *(asset(name) for name in PLAYER_SCRIPTS),
        *(_text(_PLAY, name) for name in _SHARED),
        *(_text(_LIVE, name) for name in ("words.js", "translation.js", "simulator.js")),
    ]
    styles = [
        asset("vendor/uplot/uPlot.min.css"),
        asset("plots.css"),
        *(asset(name) for name in PLAYER_STYLES),
        asset("balance.css"),
        _text(_PLAY, "play.css"),
        _text(_LIVE, "live.css"),
    ]
    body = Template(_text(_LIVE, "live.html")).substitute(
        body=_text(_PLAY, "play_body.html"),
        title=escape(model.title),
        content=script_data(data),
        words=script_data(words),
        worker="\n".join(_text(_LIVE, name) for name in _WORKER),
        core=_packed(core),
        model=_packed(resources.model),
        values=_packed(resources.values),
    )
    return page(
        model.title,
        body,
        styles=styles,
        scripts=scripts,
        start=_text(_LIVE, "live.js"),
        sources=_POLICY,
        lang=lang,
    )


def _text(place: tuple[str, str], name: str) -> str:
    package, folder = place
    return files(package).joinpath(folder, name).read_text(encoding="utf-8")


def _packed(data: bytes) -> str:
    """Return bytes as text: base64 of gzip, the same for the same bytes."""
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()
