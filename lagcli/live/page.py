"""The live page: one self-contained HTML file that simulates a model in the browser."""

from __future__ import annotations

import base64
import gzip
from html import escape
from importlib.resources import files
from string import Template

from lagcli.live.content import live_content
from lagcli.live.module import module
from lagcli.model.loader import load_text
from lagcli.model.model import Model, check_is_model
from lagcli.pictures.page import PLAYER_SCRIPTS, PLAYER_STYLES, asset, page, script_data
from lagcli.pictures.run_file import RunFile, in_unit, with_expressions
from lagcli.pictures.words import words_of
from lagcli.settings.settings import SettingsOverrides

_PLAY = ("lagcli.play", "assets")
_LIVE = ("lagcli.live", "assets")
#: Scripts of the page that `lagcli play` has, too, after those of the player.
_SHARED = (
    *("controls.js", "presets.js", "scenarios.js", "drag.js", "phase.js", "happened.js"),
    *("equations.js", "pictures.js", "play.js"),
)
#: Scripts of the worker, which simulates.
_WORKER = ("words.js", "core.js", "answers.js", "runs.js", "worker.js")
#: What the page may do besides running its own script and style: compile the core, start a worker.
_POLICY = ("script-src 'wasm-unsafe-eval'", "worker-src blob:", "img-src data:")
#: The settings of a run that its page has.
_OF_RUN = (
    *("t_start", "t_end", "samples", "dt", "times", "rtol", "atol", "method", "formulation"),
    *("alpha", "beta", "max_step", "max_steps", "impacts", "closed"),
)


def live_page_of_run(run: RunFile, lang: str) -> str:
    """Return a page that simulates the model of a run, with its values and settings.

    Parameters
    ----------
    run : RunFile
    lang : str

    Raises
    ------
    UsageError, ModelError, NumericalError, FileError
        As `RunFile.model` and `live_page`.
    """
    options = {name: x for name, x in run.record.options.items() if name in _OF_RUN}
    options["method"] = options["method"].split(", ")[-1]  # those that `auto` selected
    if options.get("times") is not None:
        options["times"] = tuple(options["times"])
    return live_page(_model_of(run), lang, SettingsOverrides(**options))


def _model_of(run: RunFile) -> Model:
    """Return the model of a run with its values: guesses remain guesses, and expressions follow."""
    model = run.model
    written, given = with_expressions(model)
    initial = {}
    for name, start in written.initial.items():
        text = in_unit(model.initial[name].value, start.unit)
        initial[name] = text if start.fixed else f"{{guess: {text}}}"
    return load_text(model.text, model.path, given, initial, model.data)


def live_page(model: Model, lang: str = "en", settings: SettingsOverrides | None = None) -> str:
    """Return a page that simulates a model.

    Parameters
    ----------
    model : Model
    lang : str
        Language of the page's own words: ``"en"``, ``"de"``, ``"fr"`` or ``"es"``.
    settings : SettingsOverrides, optional
        Instead of those of the model.

    Raises
    ------
    UsageError
        The model's own run fails; the language is unknown.
    ModelError, NumericalError
        There is no consistent initial state.
    FileError
        The core for pages is not there.
    """
    check_is_model(model, "live_page")
    words = words_of(lang)
    core = module()
    content = live_content(model, settings)
    model, data, resources = content.model, content.data, content.resources
    data["hello"]["page"] = model.title
    scripts = [
        asset("vendor/uplot/uPlot.iife.min.js"),
        asset("plots.js"),
        asset("arms.js"),
        asset("balance.js"),
        *(asset(name) for name in PLAYER_SCRIPTS),
        *(_text(_PLAY, name) for name in _SHARED),
        *(_text(_LIVE, name) for name in ("words.js", "simulator.js")),
        asset("translation.js"),
    ]
    styles = [
        asset("vendor/uplot/uPlot.min.css"),
        asset("plots.css"),
        *(asset(name) for name in PLAYER_STYLES),
        asset("balance.css"),
        _text(_PLAY, "play.css"),
        _text(_LIVE, "live.css"),
    ]
    said = "This page simulates the model in the browser, which needs JavaScript."
    body = Template(_text(_LIVE, "live.html")).substitute(
        body=Template(_text(_PLAY, "play_body.html")).substitute(
            name=escape(model.title), description=escape(model.description or "")
        ),
        still=content.still,
        missing=words.get(said, said),
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
