"""matplotlib figures: style, ticks and output."""

from __future__ import annotations

import io
import math
import os
import re
import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Any, NamedTuple, Protocol

import numpy as np

from lagcli.arrays import Array
from lagcli.equations.typesetting.notation import SUPERSCRIPTS
from lagcli.errors import UsageError
from lagcli.pictures import style
from lagcli.results.atomic import check_writable, write_file
from lagcli.simulations.memory import check_fits

FORMATS = ("png", "svg", "pdf")
#: Largest number of pixels of a side of a picture that other programs can open.
_MOST = 32_767
_LEAST = 1.5  # inches
#: Address space needed by importing matplotlib and drawing, bytes.
_MATPLOTLIB = 110_000_000


def check_picture(path: str, force: bool) -> str:
    """Return the format of a file name; raise an error if it could not be written.

    Raises
    ------
    UsageError
        The suffix is none of `FORMATS`.
    FileError
        As `check_writable`.
    """
    stem, suffix = os.path.splitext(path)
    if path == "-":
        raise UsageError("a plot is written to a file; name one: -o plot.png")
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
        The text is invalid, or the size is too small for a plot.
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


def check_resolution(size: tuple[float, float], dpi: float, in_pixels: bool) -> None:
    """Raise an error unless a picture of this size, in inches, can have this resolution.

    The number of pixels is limited only for formats that consist of them.
    """
    if not 10 <= dpi <= 2400:
        raise UsageError(f"--dpi {dpi:g} is out of range: 100 suits screens, 300 print")
    if in_pixels and max(size) * dpi > _MOST:
        raise UsageError(
            f"{size[0]:g} by {size[1]:g} inches at {dpi:g} dpi are more than {_MOST} pixels;"
            " choose a smaller --size or --dpi, or write svg or pdf"
        )


@contextmanager
def new_figure(size: tuple[float, float], dpi: float) -> Iterator[Any]:
    """Create a figure in the common style, which applies inside the block.

    Yields
    ------
    matplotlib.figure.Figure

    Raises
    ------
    UsageError
        matplotlib is not installed.
    NumericalError
        There is not enough memory; matplotlib would crash the process without a message.
    """
    check_fits(
        _MATPLOTLIB, "drawing a plot", "close other programs, or raise the limit (ulimit -v)"
    )
    try:
        import matplotlib
        from matplotlib.figure import Figure as LaidOutFigure
        from matplotlib.layout_engine import ConstrainedLayoutEngine
    except ImportError:
        raise UsageError(
            "plots are drawn by matplotlib, which is not installed: pip install 'lagcli[pictures]'"
        ) from None

    class Figure(LaidOutFigure):
        def draw(self, renderer: Any) -> None:
            # to save it, matplotlib draws it twice, the first time for its layout alone
            layout = self.get_layout_engine()
            if not isinstance(layout, ConstrainedLayoutEngine):
                super().draw(renderer)
            elif self.axes:
                with suppress(ValueError):  # as there
                    layout.execute(self)

    with matplotlib.rc_context(style.settings()), warnings.catch_warnings():
        # a missing letter is drawn as a box, so the warning is redundant
        warnings.filterwarnings("ignore", r"Glyph .* missing from")
        # an axis of values near the largest double
        warnings.filterwarnings("ignore", "overflow encountered", RuntimeWarning)
        yield Figure(figsize=size, dpi=dpi)


class FigureTarget(Protocol):
    """The target of a plot: a format, one of `FORMATS`, and a resolution."""

    @property
    def kind(self) -> str:
        """The format."""

    @property
    def dpi(self) -> float:
        """Dots per inch."""

    def figure(self, size: tuple[float, float], title: str) -> AbstractContextManager[Any]:
        """Create a figure, which is kept if the block succeeds."""


class HeldFigure:
    """A figure in memory, for a page or a document, which writes the title itself.

    Parameters
    ----------
    kind : str
        One of `FORMATS`.
    dpi : float
        Dots per inch.

    Attributes
    ----------
    content : bytes
        The figure, once it is drawn.
    """

    def __init__(self, kind: str, dpi: float = 150):
        self.kind, self.dpi, self.content = kind, dpi, b""

    @contextmanager
    def figure(self, size: tuple[float, float], title: str) -> Iterator[Any]:
        """Create a figure, which is held if the block succeeds."""
        with new_figure(size, self.dpi) as figure:
            yield figure
            self.content = _saved(figure, self.kind, title)


class FigureFile(NamedTuple):
    """The file of a plot, and its appearance.

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
        """Create a figure, which is written if the block succeeds.

        Parameters
        ----------
        size : (float, float)
            Default width and height, inches.
        title : str
            Default title.
        """
        size = self.size or size
        title = title if self.title is None else self.title
        check_resolution(size, self.dpi, in_pixels=self.kind == "png")
        with new_figure(size, self.dpi) as figure:
            yield figure
            if title:
                figure.suptitle(title.replace("$", r"\$"), fontsize=10)
            write_figure(figure, self.path, self.kind, title, self.force)


def write_figure(figure: Any, path: str, kind: str, title: str, force: bool) -> None:
    """Write a figure atomically and reproducibly.

    Raises
    ------
    FileError
        As `lagcli.results.atomic.whole_file`.
    """
    write_file(path, _saved(figure, kind, title), force)


def _saved(figure: Any, kind: str, title: str) -> bytes:
    """Return a figure as a file, the same for the same figure: without a date."""
    dated = {"svg": "Date", "pdf": "CreationDate", "png": "Software"}[kind]
    held = io.BytesIO()
    figure.savefig(held, format=kind, metadata={"Title": title, dated: None})
    return held.getvalue()


def power(exponent: int) -> str:
    """Return a power of ten: 10⁻⁹."""
    return f"10{str(exponent).translate(SUPERSCRIPTS)}"


#: Powers of ten that are adjacent in double precision: ticks lie one beyond the limits.
_MOST_DECADES = 305


def plain_ticks(axis: Any) -> None:
    """Label an axis; a common power of ten is placed at its end."""
    from matplotlib.ticker import ScalarFormatter

    class Formatter(ScalarFormatter):
        def get_offset(self) -> str:
            text = str(super().get_offset())
            return re.sub(r"^1e([-−+]?\d+)$", lambda m: f"×{power(int(_ascii(m[1])))}", text)

    axis.set_major_formatter(Formatter(useOffset=False, useMathText=False))


def decades(ax: Any, values: list[Array]) -> None:
    """Extend the vertical axis of a panel to whole decades around positive values."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    finite = np.concatenate([v[np.isfinite(v) & (v > 0)] for v in values] or [np.empty(0)])
    low, high = (finite.min(), finite.max()) if finite.size else (1e-16, 1e-15)
    first = min(max(math.floor(math.log10(low)), -_MOST_DECADES), _MOST_DECADES - 1)
    last = min(math.ceil(math.log10(high)), _MOST_DECADES)
    ax.set_yscale("log")
    ax.set_ylim(10.0**first, 10.0 ** max(last, first + 1))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: power(round(math.log10(y)))))
    ax.yaxis.set_minor_formatter(NullFormatter())


def _ascii(text: str) -> str:
    return text.replace("−", "-")
