"""Films: frames to GIF by Pillow, to MP4 by ffmpeg."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from lagcli.arrays import Image
from lagcli.errors import FileError, UsageError

#: Function that draws the frame at a time, s: (height, width, 3).
Draw = Callable[[float], Image]
Reached = Callable[[float], object]

#: The highest frame rate at which browsers play a GIF.
GIF_FASTEST = 50.0
#: Limit of the size of a GIF, which Pillow keeps in memory: half a gigabyte.
_MOST_PIXELS = 500_000_000
_COLORS = 128  # a dozen colours of lines, with antialiasing
_TYPICAL = 12  # number of frames from which the palette is chosen


def check_film(suffix: str, frames: int, size: tuple[int, int], fps: float) -> None:
    """Raise an error, before the first frame is drawn, if the film cannot be made.

    Parameters
    ----------
    suffix : str
        ``.gif`` or ``.mp4``.
    frames : int
    size : (width, height)
        Pixels.
    fps : float
        Frames per second.

    Raises
    ------
    UsageError
        matplotlib or ffmpeg is not installed, or the format does not support as many frames or
        pixels.
    """
    width, height = size
    if find_spec("matplotlib") is None:
        raise UsageError(
            "films are drawn by matplotlib, which is not installed: pip install 'lagcli[pictures]';"
            " a page needs nothing more: -o run.html"
        )
    if suffix == ".mp4":
        if width % 2 or height % 2:
            raise UsageError(
                f"MP4 needs even numbers of pixels, not {width}x{height};"
                f" give --size {width + width % 2}x{height + height % 2}"
            )
        _ffmpeg()
        return
    if fps > GIF_FASTEST:
        raise UsageError(
            f"GIF shows no more than {GIF_FASTEST:g} frames per second, not {fps:g};"
            " give a lower --fps, or write MP4"
        )
    if frames * width * height > _MOST_PIXELS:
        raise UsageError(
            f"a GIF of {frames} frames of {width}x{height} pixels is too large to be made; give a"
            " higher --speed, a lower --fps or a smaller --size, or write MP4"
        )


def write_gif(
    draw: Draw, times: Sequence[float], fps: float, file: BinaryIO, reached: Reached
) -> None:
    """Write an animated GIF that repeats.

    Parameters
    ----------
    draw : callable
    times : sequence of float
        Times of the frames, s.
    fps : float
        Frames per second. GIF has a resolution of hundredths of a second: single frames are
        rounded, the whole film is not.
    file : binary file
    reached : callable
        Called with the time of each frame.
    """
    from PIL import Image as Picture

    typical = [draw(times[i]) for i in np.linspace(0, len(times) - 1, _TYPICAL).astype(int)]
    palette = _Palette(np.concatenate(typical))

    def picture(time: float) -> Any:
        reached(time)
        image = Picture.fromarray(palette.places(draw(time)))
        image.putpalette(palette.colors.ravel().tolist())
        return image

    ends = np.round(100 * np.arange(len(times) + 1) / fps).astype(int)
    picture(times[0]).save(
        file,
        format="GIF",
        save_all=True,
        append_images=map(picture, times[1:]),
        duration=(10 * np.diff(ends)).tolist(),
        loop=0,
        optimize=True,
    )


class _Palette:
    """One palette for all frames, to avoid flicker: the most frequent colours.

    Colours of lines are preserved, and white stays white; quantizers would choose averages.
    """

    def __init__(self, image: Image):
        colors, counts = np.unique(_packed(image), return_counts=True)
        often = colors[np.argsort(-counts, kind="stable")[:_COLORS]]
        self.colors = np.stack([often >> 16, often >> 8 & 255, often & 255], 1).astype(np.uint8)
        # other colours are mapped to the nearest one, for the centre of each cube of eight levels
        # per channel
        steps = np.arange(4, 256, 8)
        cubes = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1)[..., None, :]
        nearest = np.abs(cubes - self.colors.astype(int)).sum(-1).argmin(-1).astype(np.uint8)
        self._places = nearest.repeat(8, 0).repeat(8, 1).repeat(8, 2).ravel()
        self._places[often] = np.arange(len(often))

    def places(self, image: Image) -> Image:
        """Return the palette index of each pixel: (height, width)."""
        return self._places[_packed(image)].reshape(image.shape[:2])


def _packed(image: Image) -> NDArray[np.uint32]:
    """Return the colour of each pixel as one number."""
    return image.reshape(-1, 3).astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)


def write_mp4(
    draw: Draw, times: Sequence[float], fps: float, file: BinaryIO, reached: Reached
) -> None:
    """Write MP4 (H.264), which every browser plays.

    Parameters
    ----------
    draw : callable
        Size of the frames, even numbers.
    times : sequence of float
        Times of the frames, s.
    fps : float
    file : binary file
    reached : callable
        Called with the time of each frame.

    Raises
    ------
    UsageError
        ffmpeg is not installed.
    FileError
        ffmpeg failed.
    """
    first = draw(times[0])
    height, width, _ = first.shape
    # the encoder rewrites the beginning of the file at the end, so ffmpeg needs a regular file
    with tempfile.TemporaryDirectory(prefix="lagcli-") as folder:
        target = Path(folder) / "film.mp4"
        command = [
            *(_ffmpeg(), "-loglevel", "error", "-nostdin"),
            *("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:g}"),
            *("-i", "pipe:0", "-an", "-c:v", "libx264", "-preset", "medium", "-crf", "20"),
            *("-pix_fmt", "yuv420p", "-movflags", "+faststart", str(target)),
        ]
        with (
            tempfile.TemporaryFile() as messages,
            subprocess.Popen(command, stdin=subprocess.PIPE, stderr=messages) as ffmpeg,
        ):
            assert ffmpeg.stdin is not None
            try:
                ffmpeg.stdin.write(first.tobytes())
                for time in times[1:]:
                    reached(time)
                    ffmpeg.stdin.write(draw(time).tobytes())
                ffmpeg.stdin.close()
                ffmpeg.wait()
            except BrokenPipeError:
                ffmpeg.wait()
            except BaseException:  # including Ctrl-C
                ffmpeg.kill()
                raise
            if ffmpeg.returncode:
                messages.seek(0)
                lines = messages.read().decode(errors="replace").strip().splitlines()
                raise FileError(
                    f"ffmpeg failed ({lines[-1] if lines else f'status {ffmpeg.returncode}'});"
                    " write GIF or HTML instead"
                )
        with target.open("rb") as film:
            shutil.copyfileobj(film, file, 1 << 20)


def _ffmpeg() -> str:
    """Return the path of ffmpeg."""
    path = shutil.which("ffmpeg")
    if path is None:
        raise UsageError(
            "MP4 is made by ffmpeg, which is not installed (Debian: apt install ffmpeg);"
            " GIF and HTML need nothing more: -o run.gif, -o run.html"
        )
    return path
