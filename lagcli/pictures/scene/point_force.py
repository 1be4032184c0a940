"""The force of a constraint at points: F with Jᵀ F = λ b, J = ∂P/∂q."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from symengine import Basic

from lagcli.arrays import Array
from lagcli.errors import Diagnostic, UsageError
from lagcli.model.expression.functions import derivative
from lagcli.model.locations import ExpressionLocations
from lagcli.model.model import Arrow, Model, coordinate

#: Largest residual of Jᵀ F − λ b, relative to the largest λ b along the run.
_LEFT = 1e-6
#: Directions in which the points move less than this, relatively, count as fixed.
_SINGULAR, _NEVER = 1e-9, 1e-6


@dataclass(frozen=True, eq=False)
class PointForce:
    """The force of a constraint at points, from their derivatives with respect to the coordinates.

    Parameters
    ----------
    model : Model
    arrow : Arrow
        A force.
    rows : list of (str, int)
        Point and axis of each row of J: the directions in which the points can move.
    columns : list of int
        Coordinates of the columns of J: those on which the points depend.
    entries : list of expressions
        Entries of J, by rows.
    """

    model: Model
    arrow: Arrow
    rows: list[tuple[str, int]]
    columns: list[int]
    entries: list[Basic]

    def at(self, work: Array, entries: Sequence[Array]) -> Iterator[tuple[str, tuple[Array, ...]]]:
        """Yield the points and the components of the force at each.

        Parameters
        ----------
        work : (nt, nq) array
            λ b of the constraint.
        entries : sequence of (nt,) or (1,) arrays
            Values of ``entries``.

        Raises
        ------
        UsageError
            No force at these points, or more than one, does the work of the constraint.
        """
        count, shape = len(work), (len(self.columns), len(self.rows))
        jacobian = np.empty((count, *shape))  # transposed
        for place, values in enumerate(entries):
            row, column = divmod(place, len(self.columns))
            jacobian[:, column, row] = values
        finite = np.isfinite(jacobian).all(axis=(1, 2)) & np.isfinite(work).all(axis=1)
        force = np.full((count, len(self.rows)), np.nan)
        force[finite] = self._solved(jacobian[finite], work[finite])
        dimension = len(self.model.view.points[self.arrow.points[0]]) if self.model.view else 0
        for point in dict.fromkeys(name for name, _ in self.rows):
            components = [np.zeros(1)] * dimension
            for place, (name, axis) in enumerate(self.rows):
                if name == point:
                    components[axis] = force[:, place]
            yield point, tuple(components)

    def _solved(self, jacobian: Array, work: Array) -> Array:
        """Return F with Jᵀ F = λ b, of least norm if J is singular."""
        q = work[:, self.columns]
        if not len(q):
            return np.empty((0, len(self.rows)))
        u, s, vt = np.linalg.svd(jacobian, full_matrices=False)
        largest = s[:, :1]
        if len(self.rows) > len(self.columns) or not (s[:, -1:] > _NEVER * largest).any():
            raise self._error(
                "is not unique there: the points cannot move in every direction, and components of"
                " the force along the other directions do not appear in λ b"
            )
        inverse = np.divide(1.0, s, out=np.zeros_like(s), where=s > _SINGULAR * largest)
        force = np.einsum("nji,nj->ni", vt, inverse * np.einsum("nij,ni->nj", u, q))
        left = np.einsum("nij,nj->ni", jacobian, force) - q
        if np.abs(left).max(initial=0.0) > _LEFT * np.abs(work).max(initial=0.0):
            raise self._error(
                "cannot produce λ b (no F satisfies Jᵀ F = λ b): the points are written using the"
                " constraint, or the constraint also acts at other points"
            )
        return np.asarray(force)

    def _error(self, why: str) -> UsageError:
        at = " and ".join(f"`{name}`" for name in self.arrow.points)
        places = ExpressionLocations(self.model)
        return UsageError(
            Diagnostic(
                "force-at-point",
                f"vector `{self.arrow.name}` of the view: the force of `{self.arrow.constraint}` at"
                f" {at} {why}",
                places.location(places.inside("view", "vectors", self.arrow.name)),
                f"give the vector by `components`, for instance [lambda.{self.arrow.constraint}, 0]"
                " (docs/view.md),\nand draw the result with the corrected model file: --model FILE",
            )
        )


def point_force(model: Model, arrow: Arrow) -> PointForce:
    """Return the force of an arrow, with the derivatives of its points."""
    assert model.view is not None
    points = [(name, model.view.points[name]) for name in dict.fromkeys(arrow.points)]
    names = model.coordinate_names
    free = {s.name for _, place in points for x in place for s in x.free_symbols}
    columns = [j for j, name in enumerate(names) if name in free]
    symbols = [coordinate(names[j]) for j in columns]
    rows: list[tuple[str, int]] = []
    entries: list[Basic] = []
    for name, place in points:
        for axis, x in enumerate(place):
            if not x.free_symbols.isdisjoint(symbols):
                rows.append((name, axis))
                entries += [derivative(x, s) for s in symbols]
    return PointForce(model, arrow, rows, columns, entries)
