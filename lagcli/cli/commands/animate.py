"""`lagcli animate`: a page that plays the motion, GIF, MP4."""

import re
from functools import partial
from typing import Annotated

import typer

from lagcli.cli.options import Force, NoColor, Quiet, ResultFile, ViewModel
from lagcli.cli.streams import print_notes, tell
from lagcli.errors import UsageError


def animate(
    file: ResultFile,
    output: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The animation: .html plays by itself in a browser, .gif and .mp4 are films.",
        ),
    ],
    model: ViewModel = None,
    start: Annotated[
        float | None, typer.Option("--from", help="Begin at this time of the motion, s.")
    ] = None,
    end: Annotated[
        float | None, typer.Option("--to", help="End at this time of the motion, s.")
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Seconds of the motion per second. [default: 1, real time; slower for motions"
            " under a second, faster for those over a minute]"
        ),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="How long the animation lasts, s, in place of --speed.")
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(help="Frames per second of a film. [default: 25 for GIF, 50 for MP4]"),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Pixels of a film. [default: 640x480]"),
    ] = None,
    no_forces: Annotated[
        bool,
        typer.Option("--no-forces", help="Without arrows of forces; in a page, at first."),
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
    no_color: NoColor = False,
) -> None:
    """Animate a run: the view of its model, or its coordinates over the time.

    A run that failed is shown up to its last sample.
    """
    from lagcli.cli.progress import Progress
    from lagcli.pictures.animation.animate import animate as make

    made = make(
        file,
        output,
        model=model,
        start=start,
        end=end,
        speed=speed,
        duration=duration,
        fps=fps,
        size=None if size is None else _size(size),
        forces=not no_forces,
        force=force,
        progress=partial(Progress, enabled=not quiet, color=not no_color, doing="drawing"),
    )
    print_notes(made.notes)
    if not quiet:
        tell(made.summary)


def _size(text: str) -> tuple[int, int]:
    """Return the width and height that a text such as 640x480 gives."""
    found = re.fullmatch(r"\s*(\d{1,6})\s*[xX×]\s*(\d{1,6})\s*", text)
    if found is None:
        raise UsageError(f"--size {text!r} is no size; give width and height in pixels: 640x480")
    return int(found[1]), int(found[2])
