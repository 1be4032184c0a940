"""The self-contained page that plays a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Any, NamedTuple

from lagcli.pictures.animation.histories import Histories
from lagcli.pictures.page import PLAYER_SCRIPTS, PLAYER_STYLES, asset, page, script_data
from lagcli.pictures.plots.thinning import evenly
from lagcli.pictures.report.writing import with_code
from lagcli.pictures.run_file import Indices, RunFile
from lagcli.pictures.scene.scene import Scene
from lagcli.pictures.scene.timing import Timing
from lagcli.pictures.scene.view_evaluator import scene_of

_UPLOT = "vendor/uplot/"
#: Scripts that draw coordinates if there is no view.
_HISTORIES_SCRIPTS = (_UPLOT + "uPlot.iife.min.js", "plots.js", "histories.js")
_HISTORIES_STYLES = (_UPLOT + "uPlot.min.css", "plots.css")

#: Number of samples in a page: per second of the animation, and the minimum,
_PER_SECOND, _LEAST = 60, 1000
#: limited by the number of values: about 3 MB.
_NUMBERS = 300_000


class _Subject(NamedTuple):
    """Data to play, scripts that draw them, and the number of samples."""

    data: Any
    samples: int
    scripts: tuple[str, ...] = ()
    styles: tuple[str, ...] = ()
    stage: str = ""


def animation_page(
    run: RunFile,
    samples: Indices,
    when: Timing,
    *,
    title: str,
    view: bool,
    forces: bool,
    notes: Sequence[str],
) -> tuple[str, int]:
    """Return a page that plays a run, and the number of samples in it.

    Parameters
    ----------
    run : Run
    samples : (m,) array of int
        Indices of the samples that the page may contain, increasing.
    when : Timing
        Timing with the initial speed.
    title : str
    view : bool
        Whether the model has a view; otherwise coordinates are drawn.
    forces : bool
        Whether the arrows of constraint forces are initially shown.
    notes : sequence of str
        Notes on the run for the reader.
    """
    subject = (_scene if view else _histories)(run, samples, when)
    options = {"label": title, "speed": when.speed, "forces": forces, "autoplay": True}
    start = f"""const data = {script_data(subject.data)};
const options = {{...{script_data(options)}, {subject.stage}}};
const player = new Player(document.getElementById("player"), data, options);"""
    text = page(
        title,
        _body(title, _about(run, when), notes),
        styles=map(asset, (*subject.styles, *PLAYER_STYLES, "animation.css")),
        scripts=[asset(name) for name in (*subject.scripts, *PLAYER_SCRIPTS)],
        start=start,
    )
    return text, subject.samples


def _scene(run: RunFile, samples: Indices, when: Timing) -> _Subject:
    # two samples show which series vary; the others are one number each
    few = scene_of(run, samples[:2])
    assert few is not None
    scene = scene_of(run, _chosen(samples, when, _varying(few)))
    assert scene is not None
    data = scene.to_json()
    for shape in data["shapes"]:
        if shape["kind"] == "trail":
            shape["seconds"] = when.trail
    return _Subject(data, len(scene.time))


def _histories(run: RunFile, samples: Indices, when: Timing) -> _Subject:
    histories = Histories(run, _chosen(samples, when, len(run.coordinates)))
    stage = "stage: (element, plots) => new Histories(element, plots)"
    data = histories.to_json()
    return _Subject(data, len(histories.time), _HISTORIES_SCRIPTS, _HISTORIES_STYLES, stage)


def _chosen(samples: Indices, when: Timing, series: int) -> Indices:
    """Return the samples to store for a number of series."""
    most = max(_LEAST, math.ceil(_PER_SECOND * when.seconds))
    return samples[evenly(len(samples), max(2, min(most, _NUMBERS // max(1, series))))]


def _varying(scene: Scene) -> int:
    """Return the number of series of a scene that vary."""
    series = [x for place in scene.points.values() for x in place]
    for disc in scene.discs:
        series += [x for x in (disc.radius, disc.angle, *(disc.normal or ())) if x is not None]
    series += [x for vector in scene.vectors for x in vector.components]
    return sum(len(x) > 1 for x in series)


def _about(run: RunFile, when: Timing) -> list[str]:
    described = run.model.description if run.record.model else ""
    return [text for text in (described, when.pace and f"{when.pace.capitalize()}.") if text]


def _body(title: str, about: Sequence[str], notes: Sequence[str]) -> str:
    paragraphs = [f"<p>{escape(text)}</p>" for text in about]
    paragraphs += [
        f'<p class="animation-note" role="note">{with_code(note[0].upper() + note[1:])}</p>'
        for note in notes
    ]
    return f"""<main class="animation">
<h1>{escape(title)}</h1>
{"".join(paragraphs)}
<div id="player"></div>
<p class="animation-keys">Space plays and pauses; arrow keys, Page Up and Page Down, Home and End
move the time; F shows and hides forces.</p>
</main>"""
