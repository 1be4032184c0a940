"""Tick labels of plots as plain text, because TeX labels take half of the time of a plot."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from lagcli.arrays import Array

_RAISED = str.maketrans("-−0123456789", "⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


#: Larger values would overflow the differences and margins of an axis.
_LARGEST = 1e300


def drawable(values: Array) -> Array:
    """Return values with NaN, which leaves a gap, for those too large for an axis."""
    with np.errstate(invalid="ignore"):
        large = np.abs(values) > _LARGEST
    return np.where(large, np.nan, values) if large.any() else values


def power(exponent: int) -> str:
    """Return a power of ten: 10⁻⁹."""
    return f"10{str(exponent).translate(_RAISED)}"


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
