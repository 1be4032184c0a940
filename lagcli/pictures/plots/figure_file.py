"""A matplotlib figure, from its style to its file."""

from __future__ import annotations

import io
import os
import re
import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, NamedTuple, Protocol

from lagcli.errors import UsageError
from lagcli.pictures.plots import style
from lagcli.results.atomic import check_writable, whole_file
from lagcli.simulations.memory import check_fits

FORMATS = ("png", "svg", "pdf")
#: Pixels of a side of a picture, which is what other programs open.
_MOST = 32_767
_LEAST = 1.5  # inches
#: Address space that importing matplotlib and drawing take, bytes.
_MATPLOTLIB = 110_000_000


def check_picture(path: str, force: bool) -> str:
    """Return the format that a name stands for; raise if it could not be written.

    Raises
    ------
    UsageError
        The suffix is none of `FORMATS`.
    FileError
        As `check_writable`.
    """
    stem, suffix = os.path.splitext(path)
    kind = suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise UsageError(
            f"{path}: the suffix {suffix or '(none)'} is not a plot format; use {stem}.png,"
            f" {stem}.svg or {stem}.pdf"
        )
    check_writable(path, force)
    return kind


def size_of(text: str) -> tuple[float, float]:
    """Return the width and height that a text such as 7x4 gives, in inches.

    Raises
    ------
    UsageError
        It is none, or too small for a plot.
    """
    match = re.fullmatch(r"\s*([0-9.]+)\s*[xX×,]\s*([0-9.]+)\s*", text)
    try:
        width, height = (float(x) for x in match.groups()) if match else (0.0, 0.0)
    except ValueError:
        width = height = 0.0
    if not (width and height):
        raise UsageError(f"--size {text!r} is not a size; give width and height in inches: 7x4")
    if min(width, height) < _LEAST or max(width, height) > 200:
        raise UsageError(f"--size {text}: a side of a plot has {_LEAST} to 200 inches, as in 7x4")
    return width, height


def check_resolution(size: tuple[float, float], dpi: float) -> None:
    """Raise unless a picture of this size, in inches, can have so many dots per inch."""
    if not 10 <= dpi <= 2400:
        raise UsageError(f"--dpi {dpi:g} is out of range: 100 suits screens, 300 print")
    if max(size) * dpi > _MOST:
        raise UsageError(
            f"{size[0]:g} by {size[1]:g} inches at {dpi:g} dpi are more than {_MOST} pixels;"
            " choose a smaller --size or --dpi, or write svg or pdf"
        )


@contextmanager
def new_figure(size: tuple[float, float], dpi: float) -> Iterator[Any]:
    """Make a figure in the style of all plots, which holds inside the block.

    Yields
    ------
    matplotlib.figure.Figure

    Raises
    ------
    UsageError
        matplotlib is not installed.
    NumericalError
        There is too little memory for it; it would end the process without a message.
    """
    check_fits(
        _MATPLOTLIB, "drawing a plot", "close other programs, or raise the limit (ulimit -v)"
    )
    try:
        import matplotlib
        from matplotlib.figure import Figure
    except ImportError:
        raise UsageError(
            "plots are drawn by matplotlib, which is not installed: pip install 'lagcli[pictures]'"
        ) from None
    with matplotlib.rc_context(style.settings()), warnings.catch_warnings():
        # a letter that no font has is drawn as a box, which says enough
        warnings.filterwarnings("ignore", r"Glyph .* missing from")
        yield Figure(figsize=size, dpi=dpi)


class FigureTarget(Protocol):
    """What a plot is drawn to: a format, one of `FORMATS`, and its dots per inch."""

    @property
    def kind(self) -> str:
        """The format."""

    @property
    def dpi(self) -> float:
        """Dots per inch."""

    def figure(self, size: tuple[float, float], title: str) -> AbstractContextManager[Any]:
        """Make a figure, which is kept when the block ends well."""


class FigureFile(NamedTuple):
    """The file of a plot, and how it is to look.

    Parameters
    ----------
    path, kind : str
        The file, and its format: one of `FORMATS`.
    title : str, optional
    size : (float, float), optional
        Width and height, inches.
    dpi : float
        Dots per inch.
    force : bool
        Replace an existing file.
    """

    path: str
    kind: str
    title: str | None = None
    size: tuple[float, float] | None = None
    dpi: float = 150
    force: bool = False

    @contextmanager
    def figure(self, size: tuple[float, float], title: str) -> Iterator[Any]:
        """Make a figure, which is written when the block ends well.

        Parameters
        ----------
        size : (float, float)
            Width and height, inches, where none is given.
        title : str
            Likewise.
        """
        size = self.size or size
        title = title if self.title is None else self.title
        check_resolution(size, self.dpi if self.kind == "png" else 10)
        with new_figure(size, self.dpi) as figure:
            yield figure
            if title:
                figure.suptitle(title.replace("$", r"\$"), fontsize=10)
            write_figure(figure, self.path, self.kind, title, self.force)


def write_figure(figure: Any, path: str, kind: str, title: str, force: bool) -> None:
    """Write a figure whole, the same bytes each time.

    Raises
    ------
    FileError
        As `whole_file`.
    """
    when = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind, {})
    metadata = {"Title": title, **when, **({"Software": None} if kind == "png" else {})}
    held = io.BytesIO()
    figure.savefig(held, format=kind, metadata=metadata)
    with whole_file(path, force) as file:
        file.write(held.getvalue())
