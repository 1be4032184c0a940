"""Known functions of time, as polynomials between knots.

A tape does not look a function up: its inputs after the parameters hold the *piece* at t of each
function, the time from which it counts and its coefficients in ascending order,

    u(t) = c_0 + (t − origin) (c_1 + (t − origin) (c_2 + …)).

They are constant during a step, including its end at a knot. Thus the right side is smooth within
each step, a power series of u is the polynomial itself, and derivatives are those of a polynomial.
At a knot, the piece that begins there is used.

Slopes of cubic splines: with h_i = t_{i+1} − t_i and d_i = (y_{i+1} − y_i)/h_i, continuity of the
second derivative is

    h_i s_{i−1} + 2 (h_{i−1} + h_i) s_i + h_{i−1} s_{i+1} = 3 (h_i d_{i−1} + h_{i−1} d_i)

(de Boor, A Practical Guide to Splines, IV). The end conditions complete the tridiagonal system.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.tape.ticks import simplest

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
        slack = self._slack(t)
        shift = np.zeros(len(t))
        if self.period:
            shift = np.floor((t + slack - self.knots[0]) / self.period) * self.period
        at = np.searchsorted(self.knots, t - shift + slack, side="right") - 1
        at = np.maximum(at, 0)
        pieces = np.column_stack([self.origins[at] + shift, self.coefficients[at]])
        pieces[(t < self.first - slack) | (t > self.last + slack)] = np.nan
        return pieces

    def _slack(self, t: Array) -> Array:
        """Return how far from times knots coincide with them.

        Knots of later periods are rounded like sums.
        """
        return RESOLUTION * np.maximum(np.abs(t), np.abs(t - self.knots[0]) if self.period else 0.0)

    def breaks(self, start: float, end: float) -> Array:
        """Return the knots after a time, up to another."""
        knots = self.knots
        if self.period:
            low = math.floor((start - knots[0]) / self.period)
            high = math.ceil((end - knots[0]) / self.period)
            shifts = np.arange(low, high + 1) * self.period
            knots = (shifts[:, None] + knots).reshape(-1)
            at_end = np.abs(knots - end) <= self._slack(knots)
            knots = np.where(at_end, end, knots)
            return knots[(knots > start + self._slack(np.array([start]))) & (knots <= end)]
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
        first, last, period = -math.inf, math.inf, float(simplest(last) - simplest(first))
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
        places, at = {}, 0
        for f in self.functions:
            places[f.name] = at, f.degree
            at += f.size
        return places

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
        breaks = np.sort(np.concatenate([np.asarray(others, dtype=float), *every]))
        apart = np.diff(breaks, prepend=-math.inf) > RESOLUTION * np.abs(breaks)
        return breaks[apart]


#: For a System without inputs.
NO_FUNCTIONS = InputFunctions()


Ends = Literal["not-a-knot", "clamped", "periodic"]


def spline_slopes(times: Array, values: Array, ends: Ends) -> Array:
    """Return the slopes of the spline at its knots.

    Parameters
    ----------
    times : (n,) array
        Increasing; n ≥ 2.
    values : (n,) array
    ends : str
        "not-a-knot": the third derivative is continuous at the second and the last but one knot
        (three knots give a parabola, two a line). "clamped": the slopes at the ends are zero.
        "periodic": the last value equals the first.

    Returns
    -------
    (n,) array
    """
    h = np.diff(times)
    d = np.diff(values) / h
    if ends == "periodic":
        return _periodic(h, d)
    n = len(times)
    if ends == "not-a-knot" and n == 2:
        return np.array([d[0], d[0]])
    if ends == "not-a-knot" and n == 3:
        bend = (d[1] - d[0]) / (h[0] + h[1])
        return np.array([d[0] - bend * h[0], d[0] + bend * h[0], d[1] + bend * h[1]])
    lower, diagonal, upper, right = (np.zeros(n) for _ in range(4))
    lower[1:-1], upper[1:-1] = h[1:], h[:-1]
    diagonal[1:-1] = 2 * (h[:-1] + h[1:])
    right[1:-1] = 3 * (h[1:] * d[:-1] + h[:-1] * d[1:])
    if ends == "clamped":
        diagonal[0] = diagonal[-1] = 1.0
    else:
        diagonal[0], upper[0] = h[1], h[0] + h[1]
        right[0] = ((h[0] + 2 * upper[0]) * h[1] * d[0] + h[0] ** 2 * d[1]) / upper[0]
        diagonal[-1], lower[-1] = h[-2], h[-1] + h[-2]
        right[-1] = (h[-1] ** 2 * d[-2] + (2 * lower[-1] + h[-1]) * h[-2] * d[-1]) / lower[-1]
    return _tridiagonal(lower, diagonal, upper, right)


def _periodic(h: Array, d: Array) -> Array:
    """Return the slopes of a periodic spline: a cyclic system, by the Sherman–Morrison formula."""
    if len(h) == 1:
        return np.zeros(2)
    before, h_before = np.roll(d, 1), np.roll(h, 1)
    lower, upper, diagonal = h.copy(), h_before.copy(), 2 * (h + h_before)
    right = 3 * (h * before + h_before * d)
    if len(h) == 2:  # both neighbours of a knot are the same
        matrix = np.array([[diagonal[0], lower[0] + upper[0]], [lower[1] + upper[1], diagonal[1]]])
        solution = np.linalg.solve(matrix, right)
        return np.append(solution, solution[0])
    corner_low, corner_high = upper[-1], lower[0]  # row n − 1, column 0; row 0, column n − 1
    gamma = -diagonal[0]
    diagonal[0] -= gamma
    diagonal[-1] -= corner_low * corner_high / gamma
    u = np.zeros(len(h))
    u[0], u[-1] = gamma, corner_low
    x, z = _tridiagonal(lower, diagonal, upper, right), _tridiagonal(lower, diagonal, upper, u)
    ratio = corner_high / gamma
    solution = x - z * (x[0] + ratio * x[-1]) / (1.0 + z[0] + ratio * z[-1])
    return np.append(solution, solution[0])


def _tridiagonal(lower: Array, diagonal: Array, upper: Array, right: Array) -> Array:
    """Solve a tridiagonal system by elimination without pivoting.

    The rows of splines are diagonally dominant, including those at the ends.
    """
    a, b, c, r = lower.tolist(), diagonal.tolist(), upper.tolist(), right.tolist()
    for i in range(1, len(b)):
        factor = a[i] / b[i - 1]
        b[i] -= factor * c[i - 1]
        r[i] -= factor * r[i - 1]
    r[-1] /= b[-1]
    for i in range(len(b) - 2, -1, -1):
        r[i] = (r[i] - c[i] * r[i + 1]) / b[i]
    return np.array(r)
