"""Animations of a run: an interactive page, GIF, or MP4."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, NamedTuple, Protocol

import numpy as np

from lagcli.arrays import Array
from lagcli.errors import UsageError
from lagcli.pictures.animation.film import Image, check_film, write_gif, write_mp4
from lagcli.pictures.animation.histories import Histories, HistoriesDrawing
from lagcli.pictures.animation.player_page import animation_page
from lagcli.pictures.plots.thinning import evenly
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.drawing import SceneDrawing
from lagcli.pictures.scene.timing import Timing, timing
from lagcli.pictures.scene.view_evaluator import scene_of
from lagcli.results.atomic import check_writable, whole_file
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
    output = os.fspath(output)
    suffix = _suffix(output)
    _check_film_options(suffix, fps, size)
    check_writable(output, force)
    run = RunFile(source, model)
    if not run.count:
        raise UsageError(f"{run.name} contains no samples to animate")
    times = run.columns(["time"])["time"]
    when = timing(times[0], times[-1], start=start, end=end, speed=speed, duration=duration)
    known = bool(model or run.record.model)
    view = known and run.model.view is not None
    notes = _notes(run, times[-1], known, view)
    title = model_title(run.record.model) or os.path.basename(run.name)
    if suffix == ".html":
        inside = _within(times, when, len(times))
        text, samples = animation_page(
            run, inside, when, title=title, view=view, forces=forces, notes=notes
        )
        with whole_file(output, force) as file:
            file.write(text.encode())
        return Animation(output, *when, samples, notes)
    rate = FPS[suffix] if fps is None else fps
    wide, high = SIZE if size is None else size
    moments = when.frames(rate)
    check_film(suffix, len(moments), (wide, high), rate)
    inside = _within(times, when, _FILMED)
    scene = scene_of(run, inside) if view else None
    drawing: Drawing
    if scene is not None:
        drawing = SceneDrawing(scene, wide, high, forces=forces, trail=when.trail)
    else:
        drawing = HistoriesDrawing(Histories(run, inside), wide, high)
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


def _notes(run: RunFile, last: float, known: bool, view: bool) -> tuple[str, ...]:
    """Return notes on the run for the reader."""
    status, message = run.record.status, run.record.message
    notes: tuple[str, ...] = ()
    if status not in ("completed", ""):
        what = _ENDINGS.get(status, f"is marked {status}")
        # the message of an event states its time, which is after the last sample
        at = "" if status == "stopped-by-event" and message else f" at t = {last:.6g} s"
        notes = (f"the run {what}{at}{f': {message}' if message else ''}",)
    if view:
        if run.written_model.view is None and run.model.view is not None:
            drawn = run.model.view
            edges = [s for s in drawn.segments if s.kind == "edge"]
            corners = {end for s in edges for end in (s.start, s.end)}
            names = [name for name in drawn.points if name not in corners]
            more = ", …" if len(names) > _NAMED else ""
            notes += (
                "the model has no view; the points recognized by their names are drawn:"
                f" {', '.join(names[:_NAMED])}{more}",
            )
        return notes
    why = (
        "its model has no view, and no point is recognized"
        if known
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
