"""`lagcli animate`: a page that plays the motion, GIF, MP4."""

import re
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli import completion
from lagcli.cli.operating_point import At, Equilibrium, Steady, load_steady
from lagcli.cli.options import (
    Force,
    NoColor,
    PresetName,
    Quiet,
    SetInitial,
    SetParameter,
    ViewModel,
)
from lagcli.cli.quantities import NumberIn
from lagcli.cli.streams import print_notes, tell
from lagcli.errors import UsageError
from lagcli.results.formats import SUFFIX_NAMES

if TYPE_CHECKING:
    from lagcli.model.model import Model
    from lagcli.trajectory.trajectory import Trajectory


def animate(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            autocompletion=completion.results,
            help=f"Result file, {SUFFIX_NAMES}; with --mode, a model file or a file of modes, .h5.",
        ),
    ],
    output: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Animation to write: .html is a page for any browser, .gif and .mp4 are videos.",
        ),
    ],
    model: ViewModel = None,
    start: Annotated[
        float | None,
        typer.Option(
            "--from",
            metavar="TIME",
            parser=NumberIn("s"),
            help="Start time of the animated part, s.",
        ),
    ] = None,
    end: Annotated[
        float | None,
        typer.Option(
            "--to", metavar="TIME", parser=NumberIn("s"), help="End time of the animated part, s."
        ),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Simulated seconds per second. [default: 1, real time; slower for motions"
            " under a second, faster for those over a minute]"
        ),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(
            metavar="TIME",
            parser=NumberIn("s"),
            help="Duration of the animation, s, instead of --speed.",
        ),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(help="Frames per second of a video. [default: 25 for GIF, 50 for MP4]"),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Size of a video in pixels. [default: 640x480]"),
    ] = None,
    no_forces: Annotated[
        bool,
        typer.Option("--no-forces", help="Hide force arrows; a page can show them again."),
    ] = False,
    mode: Annotated[
        int | None,
        typer.Option(
            "--mode", metavar="N", help="Animate mode N of a model, as lagcli modes numbers it."
        ),
    ] = None,
    amplitude: Annotated[
        float | None,
        typer.Option(
            help="With --mode: amplitude of the coordinate whose shape is 1. [default: visible]"
        ),
    ] = None,
    equilibrium: Equilibrium = False,
    steady: Steady = None,
    at: At = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    force: Force = False,
    quiet: Quiet = False,
    no_color: NoColor = False,
) -> None:
    """Animate a run, or a mode of small motions.

    The animation shows the view of the model; without a view, its coordinates over time. A run
    that failed is shown up to its last sample. --equilibrium, --steady, --at, --set, --set-initial
    and --preset choose the operating point of --mode, as for lagcli modes.
    """
    from lagcli.cli.progress import Progress
    from lagcli.pictures.animation.animate import animate as make

    source: str | Trajectory = file
    of_modes = {
        "--amplitude": amplitude,
        "--equilibrium": equilibrium or None,
        "--steady": steady,
        "--at": at,
        "--set": set,
        "--set-initial": set_initial,
        "--preset": preset,
    }
    stored = file.lower().endswith((".h5", ".hdf5"))
    if mode is not None and stored:
        from lagcli.analysis.linear.mode_motion import stored_mode_motion

        given = [name for name, value in of_modes.items() if value is not None]
        if chosen := [name for name in given if name != "--amplitude"]:
            raise UsageError(
                f"{chosen[0]} is for a model; {file} has modes about one point: give the model"
                " file, or make another file with lagcli modes"
            )
        source = stored_mode_motion(file, mode, amplitude=amplitude)
    elif mode is not None:
        source = _mode_motion(
            mode, amplitude, at, equilibrium, load_steady(file, set, set_initial, steady, preset)
        )
    elif given := [name for name, value in of_modes.items() if value is not None]:
        raise UsageError(f"{given[0]} is for --mode N, which animates a mode of a model")
    elif stored:
        from lagcli.results.formats import kind_of

        if kind_of(file) == "modes":
            from lagcli.analysis.linear.mode_motion import no_mode_chosen

            raise no_mode_chosen(file)
    made = make(
        source,
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


def _mode_motion(
    mode: int,
    amplitude: float | None,
    at: float | None,
    equilibrium: bool,
    loaded: "tuple[Model, dict[str, float | None]]",
) -> "Trajectory":
    """Return the motion of a mode of a model."""
    from lagcli.analysis.linear.mode_motion import mode_motion

    model, held = loaded
    return mode_motion(
        model, mode, amplitude=amplitude, at=at, equilibrium=equilibrium, steady=held
    )


def _size(text: str) -> tuple[int, int]:
    """Return the width and height that a text such as 640x480 gives."""
    match = re.fullmatch(r"\s*([0-9]{1,6})\s*[xX×]\s*([0-9]{1,6})\s*", text)
    if match is None:
        raise UsageError(f"--size {text!r} is not a size; give width and height in pixels: 640x480")
    return int(match[1]), int(match[2])
