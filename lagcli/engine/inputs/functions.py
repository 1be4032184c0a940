"""Known functions of time, as polynomials between knots.

A tape does not look a function up: its inputs after the parameters hold the *piece* at t of each
function, the time from which it counts and its coefficients in ascending order,

    u(t) = c_0 + (t − origin) (c_1 + (t − origin) (c_2 + …)).

They are constant during a step, including its end at a knot. Thus the right side is smooth within
each step, a power series of u is the polynomial itself, and derivatives are those of a polynomial.
At a knot, the piece that begins there is used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array

#: Times closer than this, relative to |t|, coincide; core/step.h has the same value.
RESOLUTION = 16 * float(np.finfo(float).eps)


class PiecewiseFunction(NamedTuple):
    """A piecewise polynomial function of time.

    Parameters
    ----------
    name : str
    knots : (n,) array
        Start of each piece, s; the first piece is also used before its knot.
    origins : (n,) array
        Origin of each piece, s.
    coefficients : (n, degree + 1) array
        Coefficients, ascending.
    first, last : float
        Interval on which the function is defined; infinite if it is defined everywhere.
    period : float
        Period, s; 0 if there is none.
    """

    name: str
    knots: Array
    origins: Array
    coefficients: Array
    first: float
    last: float
    period: float = 0.0

    @property
    def degree(self) -> int:
        """The degree of the pieces."""
        return self.coefficients.shape[1] - 1

    @property
    def size(self) -> int:
        """Number of inputs of a tape for one piece."""
        return self.degree + 2

    def pieces(self, t: Array) -> Array:
        """Return the pieces at times, (len(t), size); NaN where the function is undefined."""
        slack = RESOLUTION * np.abs(t)
        shift = np.zeros(len(t))
        if self.period:
            shift = np.floor((t + slack - self.knots[0]) / self.period) * self.period
        at = np.searchsorted(self.knots, t - shift + slack, side="right") - 1
        at = np.maximum(at, 0)
        found = np.column_stack([self.origins[at] + shift, self.coefficients[at]])
        found[(t < self.first - slack) | (t > self.last + slack)] = np.nan
        return found

    def breaks(self, start: float, end: float) -> Array:
        """Return the knots after a time, up to another."""
        knots = self.knots
        if self.period:
            low = math.floor((start - knots[0]) / self.period)
            high = math.ceil((end - knots[0]) / self.period)
            shifts = np.arange(low, high + 1) * self.period
            knots = (shifts[:, None] + knots).reshape(-1)
        return knots[(knots > start) & (knots <= end)]


def interpolated(
    name: str, times: Array, values: Array, interpolation: str, extend: str | None
) -> PiecewiseFunction:
    """Return the function that interpolates a table.

    Parameters
    ----------
    name : str
    times, values : (n,) arrays
        Increasing times, s; n ≥ 2.
    interpolation : str
        "step": each value holds from its time on; "linear"; or "cubic", a spline. Its slopes at the
        ends are zero with "hold", periodic with "periodic"; otherwise its third derivative is
        continuous next to the ends (not-a-knot).
    extend : str or None
        "hold": constant outside the table; "periodic"; None: undefined outside.
    """
    h = np.diff(times)
    columns = [values[:-1]]
    if interpolation != "step":
        slope = np.diff(values) / h
        if interpolation == "linear":
            columns.append(slope)
        else:
            from lagcli.engine.inputs.spline import spline_slopes

            ends = {"hold": "clamped", "periodic": "periodic"}.get(extend or "", "not-a-knot")
            s = spline_slopes(times, values, ends)  # type: ignore[arg-type]
            bend = (s[:-1] + s[1:] - 2 * slope) / h
            columns += [s[:-1], (slope - s[:-1]) / h - bend, bend / h]
    coefficients = np.column_stack(columns)
    knots = origins = times[:-1]
    first, last, period = float(times[0]), float(times[-1]), 0.0
    if extend == "hold":
        ends_ = np.zeros((2, coefficients.shape[1]))
        ends_[:, 0] = values[0], values[-1]
        # before the first knot, and from the last on
        coefficients = np.vstack([ends_[:1], coefficients, ends_[1:]])
        origins = np.concatenate([times[:1], times])
        knots = np.concatenate([[-math.inf], times])
        first, last = -math.inf, math.inf
    elif extend == "periodic":
        first, last, period = -math.inf, math.inf, last - first
    elif interpolation == "step":  # the last value holds at its time
        knots = origins = times
        coefficients = values[:, None]
    return PiecewiseFunction(
        name, knots, origins, np.ascontiguousarray(coefficients), first, last, period
    )


class InputFunctions(NamedTuple):
    """The known functions of time of a System.

    Parameters
    ----------
    functions : tuple of PiecewiseFunction
    """

    functions: tuple[PiecewiseFunction, ...] = ()

    @property
    def size(self) -> int:
        """Number of inputs of a tape for their pieces."""
        return sum(f.size for f in self.functions)

    def places(self) -> dict[str, tuple[int, int]]:
        """Return the index of each function's piece among those inputs, and its degree."""
        found, at = {}, 0
        for f in self.functions:
            found[f.name] = at, f.degree
            at += f.size
        return found

    def pieces(self, t: Array) -> Array:
        """Return the pieces at n times, (n, size)."""
        return np.hstack([np.empty((len(t), 0)), *(f.pieces(t) for f in self.functions)])

    def pieces_at(self, t: float) -> list[float]:
        """Return the pieces at a time."""
        return list(self.pieces(np.array([t]))[0].tolist()) if self.functions else []

    def breaks(self, start: float, end: float, others: Sequence[float] | Array = ()) -> Array:
        """Return the knots and other times between two times, without repetitions."""
        every = [f.breaks(start, end) for f in self.functions]
        # not np.unique, which imports masked arrays: a tenth of the start-up of a short run
        found = np.sort(np.concatenate([np.asarray(others, dtype=float), *every]))
        apart = np.diff(found, prepend=-math.inf) > RESOLUTION * np.abs(found)
        return found[apart]


#: For a System without inputs.
NO_FUNCTIONS = InputFunctions()
