"""Animations of a run: an interactive page, GIF, or MP4."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from html import escape
from typing import Any, NamedTuple, Protocol

import numpy as np

from lagcli.arrays import Array, Image, Indices
from lagcli.equations.typesetting.notation import unit_text
from lagcli.errors import UsageError
from lagcli.model.model import Model
from lagcli.pictures.animation.film import check_film, write_gif, write_mp4
from lagcli.pictures.curves import Catalogue, read_curves
from lagcli.pictures.page import PLAYER_SCRIPTS, PLAYER_STYLES, asset, page, script_data, with_code
from lagcli.pictures.plots.figure import new_figure
from lagcli.pictures.plots.run_plot import Panel, PanelDrawing, asked
from lagcli.pictures.run_file import RunFile, check_source
from lagcli.pictures.scene.automatic_view import with_view
from lagcli.pictures.scene.curve_picture import curve_image
from lagcli.pictures.scene.drawing import SceneDrawing
from lagcli.pictures.scene.raster import Raster
from lagcli.pictures.scene.scene import Scene
from lagcli.pictures.scene.still import still, still_image
from lagcli.pictures.scene.timing import Timing, timing
from lagcli.pictures.scene.view_evaluator import scene_of
from lagcli.pictures.selection import evenly
from lagcli.pictures.style import PALETTE, ROLES
from lagcli.results.atomic import check_writable, whole_file, write_file
from lagcli.results.metadata import model_title
from lagcli.trajectory.trajectory import Trajectory

SUFFIXES = (".html", ".gif", ".mp4")
FPS = {".gif": 25.0, ".mp4": 50.0}
SIZE = (640, 480)
_SMALLEST, _LARGEST = 64, 8192  # pixels

_NAMED = 8  # largest number of points in a note
#: Number of samples from which films are interpolated.
_FILMED = 20_000


class Animation(NamedTuple):
    """A written animation.

    Parameters
    ----------
    output : str
        The path of the file.
    start, end : float
        The part of the motion, s.
    speed : float
        Seconds of the motion per second.
    frames : int
        Frame rate of a film; number of samples in a page.
    notes : tuple of str
        Notes on the run for the reader.
    """

    output: str
    start: float
    end: float
    speed: float
    frames: int
    notes: tuple[str, ...]

    @property
    def summary(self) -> str:
        """One line on the animation."""
        when = Timing(self.start, self.end, self.speed)
        frames = "samples" if self.output.lower().endswith(".html") else "frames"
        return (
            f"{self.output}: t = {self.start:g} to {self.end:g} s, {when.pace or 'real time'},"
            f" {self.frames} {frames}, {os.path.getsize(self.output) / 1000:.0f} kB"
        )


Progress = Callable[[float, float], AbstractContextManager[Callable[[float], object]]]


@contextmanager
def _unseen(start: float, end: float) -> Iterator[Callable[[float], object]]:
    yield lambda reached: None


class Drawing(Protocol):
    """A drawing of frames."""

    def frame(self, time: float, note: str = "") -> Image:
        """Return the picture at a time, with a line of text."""


def animate(
    source: str | os.PathLike[str] | Trajectory,
    output: str | os.PathLike[str],
    *,
    model: str | None = None,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    duration: float | None = None,
    fps: float | None = None,
    size: tuple[int, int] | None = None,
    forces: bool = True,
    force: bool = False,
    progress: Progress = _unseen,
) -> Animation:
    """Animate a run.

    Parameters
    ----------
    source : path or Trajectory
        A result file, or a run in memory.
    output : path
        ``.html`` is a self-contained page that plays the motion without a network; ``.gif`` and
        ``.mp4`` are films.
    model : str, optional
        A model file with another view, instead of the text in the result.
    start, end : float, optional
        The part of the motion, s.
    speed, duration : float, optional
        See `timing`.
    fps : float, optional
        Frames per second of a film; 25 for GIF, 50 for MP4.
    size : (width, height), optional
        Size of a film, pixels; 640 by 480.
    forces : bool
        Whether the arrows of constraint forces are shown; in a page, initially.
    force : bool
        Replace an existing file.
    progress : callable, optional
        Called with the start and the end of a film, s; returns a context manager whose value is
        called with the current time.

    Raises
    ------
    UsageError
        The options contradict each other or the run; the run has no samples; ffmpeg is missing.
    ModelError
        The model in the result is invalid for this version.
    FileError
        A file cannot be read or written, or ffmpeg failed.
    """
    check_source("animate", source)
    output = os.fspath(output)
    suffix = _suffix(output)
    _check_film_options(suffix, fps, size)
    check_writable(output, force)
    run = RunFile(source, model)
    if not run.count:
        raise UsageError(f"{run.name} contains no samples to animate")
    times = run.columns(["time"])["time"]
    when = timing(times[0], times[-1], start=start, end=end, speed=speed, duration=duration)
    viewed = with_view(run.model) if run.knows_model else None
    if viewed is not None and viewed.view is None:
        viewed = None
    notes = _notes(run, times[-1], viewed)
    title = model_title(run.record.model) or os.path.basename(run.name)
    if suffix == ".html":
        inside = _within(times, when, len(times))
        text, samples = animation_page(
            run, inside, when, viewed, title=title, forces=forces, notes=notes
        )
        write_file(output, text.encode(), force)
        return Animation(output, *when, samples, notes)
    rate = FPS[suffix] if fps is None else fps
    wide, high = SIZE if size is None else size
    moments = when.frames(rate)
    check_film(suffix, len(moments), (wide, high), rate)
    inside = _within(times, when, _FILMED)
    scene = scene_of(run, inside, viewed) if viewed else None
    drawing: Drawing
    if scene is not None:
        drawing = SceneDrawing(scene, wide, high, forces=forces, trail=when.trail)
    else:
        drawing = HistoriesDrawing(Histories(run, inside, tex=True), wide, high)
    digits = _digits(when.end - when.start)

    def draw(time: float) -> Image:
        clock = f"t = {time:.{digits}f} s"
        return drawing.frame(time, "   ".join(filter(None, (title, clock, when.pace))))

    write = write_gif if suffix == ".gif" else write_mp4
    with whole_file(output, force) as file, progress(when.start, when.end) as reached:
        write(draw, moments.tolist(), rate, file, reached)
    return Animation(output, *when, len(moments), notes)


def _suffix(output: str) -> str:
    stem, suffix = os.path.splitext(output)
    if output == "-":
        raise UsageError("an animation is written to a file; name one: -o animation.html")
    if suffix.lower() not in SUFFIXES:
        raise UsageError(
            f"{output}: the suffix {suffix or '(none)'} is not an animation format; use"
            f" {stem}.html (a page that plays it), {stem}.gif or {stem}.mp4"
        )
    return suffix.lower()


def _check_film_options(suffix: str, fps: float | None, size: tuple[int, int] | None) -> None:
    """Raise an error if the options are invalid for the format, or out of range."""
    for name, value in (("--fps", fps), ("--size", size)):
        if suffix == ".html" and value is not None:
            raise UsageError(
                f"{name} is for films (GIF, MP4): a page is played as fast as the screen shows it,"
                " and fills its window"
            )
    if fps is not None and not (math.isfinite(fps) and 0 < fps <= 1000):
        raise UsageError(f"--fps must lie between 0 and 1000, not {fps:g}")
    for pixels in size or ():
        if not _SMALLEST <= pixels <= _LARGEST:
            raise UsageError(
                f"--size must lie between {_SMALLEST} and {_LARGEST} pixels, not {pixels}"
            )


_ENDINGS = {
    "failed": "failed",
    "interrupted": "was interrupted",
    "stopped-by-event": "was stopped by an event",
}


def _notes(run: RunFile, last: float, viewed: Model | None) -> tuple[str, ...]:
    """Return notes on the run for the reader; ``viewed`` is its model with a view, if any."""
    status, message = run.record.status, run.record.message
    notes: tuple[str, ...] = ()
    if status not in ("completed", ""):
        what = _ENDINGS.get(status, f"is marked {status}")
        # the message of an event states its time, which is after the last sample
        at = "" if status == "stopped-by-event" and message else f" at t = {last:.6g} s"
        notes = (f"the run {what}{at}{f': {message}' if message else ''}",)
    if viewed is not None and viewed.view is not None:
        if run.model.view is None:
            edges = [s for s in viewed.view.segments if s.kind == "edge"]
            corners = {end for s in edges for end in (s.start, s.end)}
            names = [name for name in viewed.view.points if name not in corners]
            more = ", …" if len(names) > _NAMED else ""
            notes += (
                "the model has no view; the points recognized by their names are drawn:"
                f" {', '.join(names[:_NAMED])}{more}",
            )
        return notes
    why = (
        "its model has no view, and no point is recognized"
        if run.knows_model
        else "the result contains no model, and therefore no view"
    )
    return (*notes, f"{why}; coordinates are drawn over the time")


def _within(times: Array, when: Timing, most: int) -> Any:
    """Return a maximum number of samples of a part of the run, and those next to it on both
    sides."""
    first = max(0, int(np.searchsorted(times, when.start, side="right")) - 1)
    last = min(len(times), int(np.searchsorted(times, when.end)) + 1)
    return first + evenly(last - first, most)


def _digits(span: float) -> int:
    """Return the number of decimals of a time that distinguish a thousandth of the run."""
    return max(0, min(9, math.ceil(2.5 - math.log10(span)))) if span > 0 else 2


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
    still: str = ""  # HTML for pages without JavaScript


def animation_page(
    run: RunFile,
    samples: Indices,
    when: Timing,
    viewed: Model | None,
    *,
    title: str,
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
    viewed : Model, optional
        The model with its view; otherwise coordinates are drawn.
    title : str
    forces : bool
        Whether the arrows of constraint forces are initially shown.
    notes : sequence of str
        Notes on the run for the reader.
    """
    subject = _scene(run, samples, when, viewed) if viewed else _histories(run, samples, when)
    options = {"label": title, "speed": when.speed, "forces": forces, "autoplay": True}
    start = f"""const data = {script_data(subject.data)};
const options = {{...{script_data(options)}, {subject.stage}}};
const player = new Player(document.getElementById("player"), data, options);"""
    text = page(
        title,
        _body(title, _about(run, when), notes, subject.still),
        images=bool(subject.still),
        styles=map(asset, (*subject.styles, *PLAYER_STYLES, "animation.css")),
        scripts=[asset(name) for name in (*subject.scripts, *PLAYER_SCRIPTS)],
        start=start,
    )
    return text, subject.samples


def _scene(run: RunFile, samples: Indices, when: Timing, viewed: Model) -> _Subject:
    # two samples show which series vary; the others are one number each
    few = scene_of(run, samples[:2], viewed)
    assert few is not None
    scene = scene_of(run, _chosen(samples, when, _varying(few)), viewed)
    assert scene is not None
    data = scene.to_json()
    for shape in data["shapes"]:
        if shape["kind"] == "trail":
            shape["seconds"] = when.trail
    return _Subject(data, len(scene.time), still=still(still_image(scene, viewed.title)))


def _histories(run: RunFile, samples: Indices, when: Timing) -> _Subject:
    histories = Histories(run, _chosen(samples, when, len(run.coordinates)))
    stage = "stage: (element, plots) => new Histories(element, plots)"
    data = histories.to_json()
    shown = still(histories.image()) if len(histories.time) > 1 else ""
    return _Subject(data, len(histories.time), _HISTORIES_SCRIPTS, _HISTORIES_STYLES, stage, shown)


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


def _body(title: str, about: Sequence[str], notes: Sequence[str], still: str) -> str:
    paragraphs = [f"<p>{escape(text)}</p>" for text in about]
    paragraphs += [
        f'<p class="animation-note" role="note">{with_code(note[0].upper() + note[1:])}</p>'
        for note in notes
    ]
    return f"""<main class="animation">
<h1>{escape(title)}</h1>
{"".join(paragraphs)}
<div id="player"></div>{still}
<p class="animation-keys">Space plays and pauses; arrow keys move the time; in the player, so do
Page Up and Page Down, Home and End, and F shows and hides forces.</p>
</main>"""


_DPI = 100
_MARKED = 10  # largest number of curves with a moving dot


class Histories:
    """The coordinates of a run at some samples.

    Parameters
    ----------
    run : Run
    samples : (m,) array of int
        Indices of the samples, increasing.
    tex : bool
        See `Catalogue`.
    """

    def __init__(self, run: RunFile, samples: Indices, tex: bool = False):
        self.run = run
        self.panels: list[Panel] = asked(Catalogue(run, tex), run.coordinates)
        values = read_curves(run, {curve for panel in self.panels for curve in panel.curves})
        self.values = {name: column[samples] for name, column in values.items()}
        self.time: Array = self.values["t"]

    def image(self) -> str:
        """Return the curves of the first panel as an image in HTML."""
        curves = self.panels[0].curves
        values = np.column_stack([self.values[curve.name] for curve in curves])
        labels = [curve.label for curve in curves]
        unit = unit_text(curves[0].unit)
        return curve_image(self.time, values, labels, unit)

    def to_json(self) -> dict[str, Any]:
        """Return the data for ``assets/histories.js``."""
        return {
            "time": self.time,
            "palette": PALETTE,
            "plots": [
                {
                    "title": "",
                    "unit": unit_text(panel.curves[0].unit),
                    "series": [
                        {
                            "name": c.name,
                            "label": c.label,
                            "values": self.values[c.name],
                        }
                        for c in panel.curves
                    ],
                }
                for panel in self.panels
            ],
        }


class HistoriesDrawing:
    """Draws coordinates as functions of time, with marks at the current time.

    Parameters
    ----------
    histories : Histories
    width, height : int
        Pixels.
    """

    def __init__(self, histories: Histories, width: int, height: int):
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self.histories = histories
        unit = max(0.6, min(1.6, min(width, height) / 420))
        self.raster = Raster(width, height, unit, ROLES["paper"])
        self.strip = 26 * max(1.0, unit)
        size = (width / _DPI, height / _DPI)
        panels = histories.panels
        with new_figure(size, _DPI) as figure:
            canvas = FigureCanvasAgg(figure)
            figure.get_layout_engine().set(rect=(0, 0, 1, 1 - self.strip / height))
            drawing = PanelDrawing(figure, [histories.run], [histories.values], width)
            drawing.draw([panels], [1.0] * len(panels))
            canvas.draw()  # for the layout alone
            figure.set_layout_engine("none")
            canvas.draw()
            self.still = np.asarray(canvas.buffer_rgba()).copy()
            #: For each panel, the transformation to pixels, and its left, lower, right and upper
            #: end.
            self.axes = [(ax.transData.frozen(), ax.get_window_extent()) for ax in figure.axes]

    def frame(self, time: float, note: str = "") -> Image:
        """Return the picture at a time, with a line of text; see `SceneDrawing.frame`."""
        raster, histories = self.raster, self.histories
        raster.clear(self.still)
        for panel, (place, box) in zip(histories.panels, self.axes, strict=True):
            across = place.transform((time, 0.0))[0]
            raster.line([(across, box.y0), (across, box.y1)], ROLES["point"], 1.2, alpha=0.6)
            for curve in panel.curves[:_MARKED] if len(panel.curves) <= _MARKED else ():
                value = np.interp(time, histories.time, histories.values[curve.name])
                at = place.transform((time, value))
                if np.isfinite(at).all():
                    raster.dot(np.asarray(at), 3, ROLES["point"], ROLES["paper"])
        raster.text(note, (14, raster.height - self.strip / 2), ROLES["label"])
        return raster.image()
