"""Checks of a run: energy balance and residuals against the tolerance, finite columns."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import RESIDUALS, SAMPLED, column_names
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.many_states import Batch
from lagcli.engine.system import KINKS, System
from lagcli.equations.derivation.column_expressions import REPORTED
from lagcli.prose import counted
from lagcli.settings.settings import Settings
from lagcli.simulations.derived import DerivedColumns
from lagcli.trajectory.samples import Samples

#: Relative error of the energy per step, in relative tolerances: errors of coordinates and
#: velocities are limited to rtol (|y| + 0.1 S) together, which changes a quadratic energy by twice
#: that.
_PER_STEP = 3.0
#: Largest error of the energy for any tolerance, relative; rounding errors are smaller.
_LARGEST = 0.01
_ROUNDING = 1e-11
#: An error of the energy that many times larger than explained is hardly one of the tolerance.
_MISSED = 1e3
#: Energies below this part of their terms are rounding errors and errors of the state.
_CANCELLED = 1e-9
#: Rounding errors of accelerations, relative to those by the constraint forces.
_DRIFT = 8 * np.finfo(float).eps
#: Relative change of the state that reveals the size of the energy's terms.
_CHANGE = 1e-7
#: Growth of a coordinate beyond what its start, velocity and acceleration reach in the run: it
#: diverges. Perturbations of an equilibrium by rounding errors grow to its size by less.
_DIVERGED = 1e50
#: Largest residual after projection, relative to a constraint's terms; the target is 1e-14.
_RESIDUAL = 1e-9


class Trust:
    """Monitors the energy balance and the residuals along a run.

    Parameters
    ----------
    system : System
    p : tuple of float
        Values of its parameters.
    """

    def __init__(self, system: System, p: tuple[float, ...]):
        self.p = p
        self.system, self.constraints = system, system.constraints
        self.balance = self.energy = self.flow = self.parts = 0.0
        self._potential = (math.inf, -math.inf)
        self._last: tuple[float, float] | None = None  # time and power of the last sample
        self._first: tuple[float, Array, Array] | None = None  # time, q and v of the first sample
        self._force = np.zeros(len(system.coordinates))  # largest constraint forces
        self._start = np.zeros((3, len(system.coordinates)))  # sizes of q, v and a
        self._largest = np.zeros(len(system.coordinates))  # coordinates
        nc = len(self.constraints)
        self._residuals = {"position": np.zeros(nc), "velocity": np.zeros(nc)}

    def add(self, samples: Samples) -> None:
        """Take the next samples."""
        if not len(samples.time):
            return
        self.balance = _largest(samples.energy_balance, self.balance)
        self.parts = _largest(self._parts(samples), self.parts)
        for energy in (samples.energy_kinetic, samples.energy_total):
            self.energy = _largest(energy, self.energy)
        low, high = self._potential
        potential = samples.energy_potential
        self._potential = np.fmin(low, potential.min()), np.fmax(high, potential.max())
        power = sum(
            np.abs(getattr(samples, f"power_{x}"))
            for x in ("applied", "constraint", "time", "friction")
        )
        time = samples.time
        if self._first is None:
            self._first = float(time[0]), samples.q[0], samples.v[0]
            self._start = np.abs([samples.q[0], samples.v[0], samples.a[0]])
        self._largest = np.fmax(self._largest, np.fmax.reduce(np.abs(samples.q), axis=0))
        forces = np.abs(samples.constraint_force)
        self._force = np.fmax(self._force, np.fmax.reduce(forces, axis=0))
        if self._last is not None:
            time, power = np.append(self._last[0], time), np.append(self._last[1], power)
        self.flow += float(np.nansum(np.diff(time) * (power[1:] + power[:-1])) / 2)
        self._last = float(time[-1]), float(power[-1])
        for level, largest_before in self._residuals.items():
            by_row = np.ascontiguousarray(getattr(samples, f"residual_{level}").T)
            largest = np.fmax.reduce(np.abs(by_row), axis=1)
            self._residuals[level] = np.fmax(largest_before, largest)

    def add_states(self, t: Array, q: Array, v: Array) -> None:
        """Take the energies of states that are no samples, as those before impacts."""
        place, nothing = REPORTED.index("energy_kinetic"), np.zeros((len(t), len(self.constraints)))
        report = Batch(self.system, self.p, t, q, v).report(np.zeros_like(v), nothing)
        self.energy = _largest(report[place], self.energy)

    def _parts(self, samples: Samples) -> Array:
        """Return the sizes of the terms of T and V, which may cancel, at the first and the last
        sample.

        They are the changes of T and V over the relative change of the state.
        """
        some = [0, -1, 0, -1]
        t, q, v, a = (getattr(samples, x)[some] for x in ("time", "q", "v", "a"))
        # all entries differ, so that their changes cannot cancel
        change = _CHANGE * np.cos(1.0 + np.arange(2 * q.shape[1]))
        sign = np.array([[-1], [-1], [1], [1]])
        nq = q.shape[1]
        at, rate = q * (1 + sign * change[:nq]), v * (1 + sign * change[nq:])
        kinetic, potential, *_ = Batch(self.system, self.p, t, at, rate).report(
            a, samples.multipliers[some]
        )
        parts = np.zeros(2)
        with np.errstate(invalid="ignore"):
            for energy, before in (
                (kinetic, samples.energy_kinetic[some]),
                (potential, samples.energy_potential[some]),
            ):
                for both in np.split(np.abs(energy - before) / _CHANGE, 2):
                    parts = np.fmax(parts, both)
        return np.where(np.isfinite(parts), parts, 0.0)

    def _drift(self, steps: int) -> float:
        """Return the work of constraint forces on the drift by their rounding errors in a step.

        Constraints hold at the ends of steps. Of a body at rest, steps have any length.
        """
        if self._first is None or self._last is None or not steps:
            return 0.0
        t, q, v = self._first
        # lengths of equal inertia, 1/√M_jj
        sizes = Evaluator(self.system, self.p).sizes(t, q, v)
        step = (self._last[0] - t) / steps
        return float(_DRIFT * ((self._force * sizes) ** 2).sum() * step**2)

    def _divergence(self) -> list[str]:
        """Return a sentence for the coordinate that diverges most, if one does."""
        if self._first is None or self._last is None:
            return []
        length = self._last[0] - self._first[0]
        reach = np.array([1.0, length, length**2]) @ self._start
        growth = np.divide(self._largest, reach, out=np.zeros_like(reach), where=reach > 0.0)
        most = int(np.argmax(growth))
        if not growth[most] > _DIVERGED:
            return []
        return [
            f"the motion diverges: `{self.system.coordinates[most]}` grows to"
            f" {self._largest[most]:.2g}; check the signs of the forces"
        ]

    def _remedy(self, excess: float) -> str:
        """Return the remedy for an energy error, given its ratio to the explained one."""
        places = [REPORTED.index(name) for name in ("energy_kinetic", "energy_potential")]
        energies = self.system.report.selected(places)
        if any(op in KINKS for op, *_ in energies.code):
            return (
                "T or V has branches, and no force makes up for a jump of them: write them so that"
                " both sides are equal where they meet, or give a smaller --rtol"
            )
        if excess > _MISSED:
            return "give a smaller --rtol, or a --max-step if a force acts for less than a step"
        return "give a smaller --rtol"

    def warnings(self, settings: Settings, steps: int, columns: DerivedColumns) -> tuple[str, ...]:
        """Return the reasons to distrust the result.

        Parameters
        ----------
        settings : Settings
        steps : int
        columns : DerivedColumns
            Samples, with the constraints' scales.
        """
        warnings, rtol = self._divergence(), settings.rtol
        scales = {"position": columns.scale_position, "velocity": columns.scale_velocity}
        explained = max(_PER_STEP * rtol * steps, _ROUNDING)
        allowed = min(_LARGEST, explained)
        scale = float(np.fmax(max(self.energy, self.flow), np.diff(self._potential)[0]))
        if scale < min(rtol, _CANCELLED) * self.parts:
            scale = self.parts
        elif scale < rtol * self.parts:  # smaller than the tolerance resolves, but not zero
            allowed = min(_LARGEST, explained * self.parts / scale)
        if not self.balance <= allowed * scale and not self.balance <= self._drift(steps):
            error = self.balance / scale if scale else 0.0
            share = f", {error:.2g} of the energies involved" if scale else ""
            warnings.append(
                f"the energy balance has an error of {self.balance:.2g} J{share}, more than"
                f" the tolerance explains ({allowed:.1g}): {self._remedy(error / allowed)}"
            )
        for level, largest in self._residuals.items():
            with np.errstate(invalid="ignore"):
                relative = np.nan_to_num(largest / scales[level])
            worst = int(np.argmax(relative)) if len(relative) else 0
            limit = _RESIDUAL if settings.formulation == "projection" else allowed
            if len(relative) and relative[worst] > limit:
                what = "violated" if level == "position" else "violated in the velocities"
                warnings.append(
                    f"the constraint `{self.constraints[worst]}` is {what} by {relative[worst]:.2g}"
                    " of its terms"
                )
        return tuple(warnings)


def _largest(values: Array, before: float) -> float:
    return float(np.fmax(np.fmax.reduce(np.abs(values)), before))


#: Columns that are not checked: the residuals of inactive constraints are NaN, and the constraint
#: force is a sum of others.
_EXCEPT = {"time", "constraint_force", *(x.name for x in RESIDUALS)}
_CHECKED = tuple(x for x in SAMPLED if x.name not in _EXCEPT)
_LISTED = 5  # largest number of columns with a warning each


class _BadColumn:
    """The samples at which a column is not finite."""

    def __init__(self, first: float):
        self.first, self.count, self.infinite = first, 0, True


class FiniteColumns:
    """Finds the columns that are NaN or infinite at some samples of a run, block by block."""

    def __init__(self) -> None:
        self.samples = 0
        self._bad: dict[str, _BadColumn] = {}

    def add(self, samples: Samples) -> None:
        """Take the next samples."""
        self.samples += len(samples.time)
        for name, values in samples.outputs.items():
            self._column(name, samples.time, values)
        for quantity in _CHECKED:
            table: Array = getattr(samples, quantity.name)
            if np.isfinite(table.sum()):
                continue
            names = column_names(
                quantity,
                samples.coordinates,
                samples.constraints,
                samples.terms.names(samples.coordinates, samples.constraints),
                samples.conserved_names,
            )
            columns = table.reshape(len(samples.time), -1).T
            for which, column in zip(names, columns, strict=True):
                self._column(str(which), samples.time, column)

    def _column(self, name: str, time: Array, values: Array) -> None:
        bad = ~np.isfinite(values)
        if not bad.any():
            return
        column = self._bad.setdefault(name, _BadColumn(float(time[np.argmax(bad)])))
        column.count += int(bad.sum())
        column.infinite = column.infinite and not np.isnan(values).any()

    def warnings(self) -> tuple[str, ...]:
        """Return a sentence for each of the first columns, and one for the rest."""
        sentences = [
            undefined_at(name, x.infinite, x.count, self.samples, x.first)
            for name, x in self._bad.items()
        ]
        rest = len(sentences) - _LISTED
        if rest > 1:
            sentences[_LISTED:] = [f"{rest} more columns are not finite at some samples"]
        return tuple(sentences)


def undefined_at(name: str, infinite: bool, count: int, samples: int, first: float) -> str:
    """Return the warning of values that are not finite.

    Parameters
    ----------
    name : str
        A column, or an expression.
    infinite : bool
        Whether all of them are infinite; otherwise some are NaN.
    count, samples : int
        Number of such samples, and of all.
    first : float
        Time of the first one, s.
    """
    what = "infinite" if infinite else "NaN"
    return (
        f"`{name}` is {what} at {count} of {counted(samples, 'sample')}, first at t = {first:.6g}"
    )


def undefined_rows(names: Sequence[str], time: Array, signals: Array) -> dict[int, str]:
    """Return the warnings of runs with signals that are not finite.

    Parameters
    ----------
    names : sequence of n str
    time : (nt,) array
    signals : (runs, n, nt) array

    Returns
    -------
    dict of int to str
        Warning of its first such signal, by the index of a run.
    """
    bad = ~np.isfinite(signals)
    undefined = {}
    for i in np.flatnonzero(bad.any(axis=(1, 2))).tolist():
        k = int(np.argmax(bad[i].any(axis=1)))
        infinite = not np.isnan(signals[i, k]).any()
        at = float(time[np.argmax(bad[i, k])])
        undefined[i] = undefined_at(names[k], infinite, int(bad[i, k].sum()), len(time), at)
    return undefined
