"""Bands: the spread of curves that follows from spreads of parameters, or from rows of a sweep."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import DERIVATIVES
from lagcli.errors import UsageError
from lagcli.model.expression.tokens import decimal
from lagcli.pictures.curves import Curve
from lagcli.pictures.run_file import RunFile, with_expressions

if TYPE_CHECKING:
    from symengine import Basic

    from lagcli.equations.derivation.lagrange import Equations

#: The fields with derivatives, and the fields of these.
_DERIVED = dict(zip(("q", "v", "multipliers"), (x.name for x in DERIVATIVES), strict=True))
#: Energies and powers that are functions of the state at one time.
_FUNCTIONS = (
    *("energy_kinetic", "energy_potential", "energy_total", "power_applied"),
    *("power_constraint", "power_friction", "power_time"),
)


class Bands(Protocol):
    """The bands of the curves of one run."""

    def over_time(self, name: str) -> tuple[Array, Array] | None:
        """Return the lower and the upper end around a curve, (nt,) each; None if it has none."""

    def portrait(self, over: str, name: str) -> tuple[Array, Array] | None:
        """Return the ends of the band around a pair of curves, (nt, 2) each; None without one."""


class LinearBands:
    """Bands to first order: the root of the sum of squares of the changes by each parameter.

    Parameters
    ----------
    values : mapping of str to (nt,) array
        The curves, by name.
    changes : mapping of str to (nt, n) array
        Their changes by the spreads of n parameters; curves without them have no band.
    """

    def __init__(self, values: Mapping[str, Array], changes: Mapping[str, Array]):
        self._values, self.changes = values, changes

    def over_time(self, name: str) -> tuple[Array, Array] | None:
        """See `Bands`."""
        if name not in self.changes:
            return None
        width = np.linalg.norm(self.changes[name], axis=1)
        return self._values[name] - width, self._values[name] + width

    def portrait(self, over: str, name: str) -> tuple[Array, Array] | None:
        """Return where the ellipses of all pairs touch their envelope."""
        if over not in self.changes or name not in self.changes:
            return None
        middle = np.stack((self._values[over], self._values[name]), axis=1)
        changes = np.stack((self.changes[over], self.changes[name]), axis=1)  # (nt, 2, n)
        way, _ = _across(middle, np.einsum("tin,tjn->tij", changes, changes))
        return middle - way, middle + way


class RowBands:
    """Bands between quantiles of the rows of a sweep, at each time.

    Parameters
    ----------
    rows : mapping of str to (rows, nt) array
        The curves of all rows, by name; NaN where a row has no value.
    part : float
        The part of the rows between the ends, of 1.
    """

    def __init__(self, rows: Mapping[str, Array], part: float):
        self._rows = rows
        low, middle, high = band_quantiles(part)
        self._ends = low, high
        self.medians = {name: _quantiles(x, [middle])[0] for name, x in rows.items()}

    def over_time(self, name: str) -> tuple[Array, Array]:
        """See `Bands`."""
        low, high = _quantiles(self._rows[name], self._ends)
        return low, high

    def portrait(self, over: str, name: str) -> tuple[Array, Array]:
        """Return the quantiles of the distance of the rows across the curve of medians."""
        rows = np.stack((self._rows[over], self._rows[name]), axis=2)  # (rows, nt, 2)
        middle = np.stack((self.medians[over], self.medians[name]), axis=1)
        away = rows - middle
        known = np.where(np.isfinite(away).all(axis=2, keepdims=True), away, 0.0)
        way, size = _across(middle, np.einsum("rti,rtj->tij", known, known))
        distances = np.einsum("rti,ti->rt", away, _normals(middle))
        low, high = (
            middle + way * (x / np.where(size > 0, size, 1.0))[:, None]
            for x in _quantiles(distances, self._ends)
        )
        return low, high


def band_quantiles(part: float) -> tuple[float, float, float]:
    """Return the quantiles at the lower end, the middle and the upper end of a band that contains a
    part of the rows, of 1."""
    return (1 - part) / 2, 0.5, (1 + part) / 2


def _normals(middle: Array) -> Array:
    """Return the linear forms that vanish along a curve in the plane, (nt, 2)."""
    if len(middle) < 2:
        return np.tile([0.0, 1.0], (len(middle), 1))
    along = np.gradient(middle, axis=0)
    return np.stack((-along[:, 1], along[:, 0]), axis=1)


def _across(middle: Array, covariance: Array) -> tuple[Array, Array]:
    """Return S n/√(n·S n) and √(n·S n), for the normals n of a curve.

    It does not depend on the units of the two axes.
    """
    normal = _normals(middle)
    way = np.einsum("tij,tj->ti", covariance, normal)
    size = np.sqrt(np.maximum(np.einsum("ti,ti->t", way, normal), 0.0))
    return way / np.where(size > 0, size, 1.0)[:, None], size


def _quantiles(values: Array, parts: Sequence[float]) -> Array:
    """Return quantiles over the first axis, without values that are not finite."""
    finite = np.isfinite(values)
    if finite.all():
        return np.asarray(np.quantile(values, parts, axis=0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # at some times, no row has a value
        return np.asarray(np.nanquantile(np.where(finite, values, np.nan), parts, axis=0))


def read_bands(run: RunFile, given: Sequence[str]) -> dict[str, float]:
    """Return the spreads of parameters by name, in SI.

    Parameters
    ----------
    run : RunFile
    given : sequence of str
        ``l=0.01`` (in SI) or ``l=5%`` of the parameter's value.

    Raises
    ------
    UsageError
        An entry has another form, or the result has no derivatives with respect to the name.
    """
    spreads: dict[str, float] = {}
    for text in given:
        name, equals, spread = (x.strip() for x in text.partition("="))
        percent = spread.endswith("%")
        value = decimal(spread.removesuffix("%"))
        if not equals and percent:
            raise UsageError(
                f"--band {text}: a part of the rows is for sweeps; of a run, name a parameter and"
                " its spread, as in --band l=5%"
            )
        if not equals or value is None or not 0 <= value < np.inf:
            raise UsageError(
                f"--band {text!r} is not of the form NAME=SPREAD, as in l=0.01 or l=5%"
            )
        if name not in run.sensitivity:
            has = (
                f"it has those by {', '.join(run.sensitivity)}"
                if run.sensitivity
                else (f"simulate with --sensitivity {name or 'NAME'}")
            )
            raise UsageError(f"--band {text}: {run.name} has no derivatives by `{name}`; {has}")
        if percent:
            known = run.values
            if name not in known:
                raise UsageError(
                    f"--band {text}: {run.name} lacks the value of `{name}`, which a CSV file"
                    " without its sidecar (--meta) does not contain; give the spread in SI, as in"
                    f" {name}=0.01"
                )
            value *= abs(known[name]) / 100
        spreads[name] = value
    return spreads


def read_part(given: Sequence[str]) -> float:
    """Return the part of the rows of a sweep between the ends of bands, of 1.

    Raises
    ------
    UsageError
        It is not given once, as ``90%``.
    """
    text = given[0].strip()
    part = (decimal(text.removesuffix("%")) or 0.0) / 100
    if len(given) > 1 or not text.endswith("%") or not 0 < part < 1:
        raise UsageError(
            f"--band {' '.join(given)}: of a sweep, bands contain a part of the rows; give it once,"
            " as in --band 90%"
        )
    return part


def linear_bands(
    run: RunFile,
    curves: Iterable[Curve],
    values: Mapping[str, Array],
    spreads: Mapping[str, float],
) -> LinearBands:
    """Return the bands of curves of a run that follow from spreads of parameters.

    Parameters
    ----------
    run : RunFile
        A run with derivatives.
    curves : iterable of Curve
    values : mapping of str to (nt,) array
        Their values, by name.
    spreads : mapping of str to float
        Result of `read_bands`.

    Raises
    ------
    UsageError
        None of the curves has derivatives.
    """
    if not spreads:
        return LinearBands(values, {})
    weights = np.array([spreads.get(name, 0.0) for name in run.sensitivity])
    chosen = list(dict.fromkeys(curves))
    stored = {c: (_DERIVED[c.field], c.place[0]) for c in chosen if c.field in _DERIVED and c.place}
    fields = run.columns({field for field, _ in stored.values()})
    slopes = {c.name: fields[field][:, place] for c, (field, place) in stored.items()}
    slopes |= _slopes(run, [c for c in chosen if c not in stored])
    if not slopes:
        raise UsageError(
            "--band: bands are drawn around functions of the state at one time, and none of the"
            " curves is one; name coordinates, multipliers, energies or outputs, or omit --band"
        )
    return LinearBands(values, {name: slope * weights for name, slope in slopes.items()})


def _slopes(run: RunFile, curves: Sequence[Curve]) -> dict[str, Array]:
    """Return the derivatives of curves that are functions of the state, (nt, n), by name."""
    if not curves or not run.knows_model:
        return {}
    from lagcli.equations.derivation.lagrange import derive
    from lagcli.model.loader import load_text
    from lagcli.simulations.directions import Directions
    from lagcli.simulations.slopes import slopes_along

    equations = derive(run.model)
    expressions = {c.name: e for c in curves if (e := _expression(equations, c)) is not None}
    if not expressions:
        return {}
    motion = ("time", "q", "v", "a", "multipliers", *_DERIVED.values())
    columns = run.columns(motion)
    written, given = with_expressions(run.model)
    model = load_text(written.text, written.path, given, data=written.data)
    directions = Directions(model, run.sensitivity)
    return slopes_along(equations, directions, columns, expressions)


def _expression(equations: Equations, curve: Curve) -> Basic | None:
    """Return a curve as a function of t, q, v, a, λ and parameters; None if it is none."""
    import symengine as se

    from lagcli.equations.derivation.column_expressions import column_expression
    from lagcli.equations.derivation.lagrange import with_forces

    field, _, output = curve.field.partition("/")
    model = equations.model
    if curve.log or curve.place is None:
        return None
    if field == "a":
        return equations.a[curve.place[0]]
    if field in _FUNCTIONS:
        expression = column_expression(equations, field)
    elif field in ("constraint_force", "constraint_force_by"):
        expression = se.Symbol(curve.name)
    elif output in model.outputs:
        expression = model.outputs[output]
    else:
        return None
    whole = with_forces(model, equations.constraints, {curve.name: expression})[curve.name]
    names = {x.name for x in whole.free_symbols}
    return None if model.changing_parameters & names else whole
