"""Branches in the reference engine: their sides at an instant, and sliding on surfaces.

If the motion on both sides of a surface approaches it, the motion slides along it by Filippov's
rule: with the combination of both accelerations that keeps it on the surface.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import Stop
from lagcli.engine.core.status import Status
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.switching.kinks import FrozenSystem, side_of
from lagcli.engine.switching.stops import at_surfaces
from lagcli.engine.tape.interpreter import ScalarTape

#: Function values at their surface below this part of the terms count as zero; accelerations below
#: this part of theirs are rounding errors.
_ON, _CONTINUOUS = 1e-9, 1e-10
#: Look-ahead time, relative to the run; time step of difference quotients, s.
_AHEAD, _AROUND = 1e-9, 1e-5
_MOST = 10
#: Changes of velocities by a projection above this part are jumps.
_TURNS = 1e-5

#: (t, q, v) → a, λ and the power on the current branches.
Accelerations = Callable[[float, Array, Array], tuple[Array, Array, float]]


class Branches:
    """The branches of a frozen System along a run.

    Parameters
    ----------
    frozen : FrozenSystem
    full : Evaluator
        Evaluator of the frozen System; its last parameters are the branches, which are set here.
    span : float
        Span of the run, s.

    Attributes
    ----------
    slides : int or None
        The kink on whose surface the motion slides.
    weight : float
        Weight of the upper side in the combination at the last state.
    reached : set of int
        Kinks whose branches have ended at the instant, before new ones are chosen.
    surfaces : list of int
        Kinks whose functions vanish at the last instant.
    crossed : int
        Number of changes of branches.
    acceleration_terms : (nq,) array or float
        Magnitude of the terms of the accelerations, as in `Sizes`.
    """

    def __init__(self, frozen: FrozenSystem, full: Evaluator, span: float):
        self.kinks, self.full, self.span = frozen.kinks, full, span
        self._tape = ScalarTape(frozen.functions)
        self.first = len(full.p) - len(self.kinks)
        self.slides: int | None = None
        self.weight = 0.5
        self.reached: set[int] = set()
        self._known: set[int] = set()
        self._bounds = np.zeros(len(self.kinks))
        self._sizes = np.zeros(len(self.kinks))
        self.surfaces: list[int] = []
        self._jump, self._rates = np.zeros(0), 0.0
        self.crossed = 0
        self.acceleration_terms: Array | float = 0.0

    @property
    def given(self) -> tuple[float, ...]:
        """The parameters of the model, without branches."""
        return self.full.p[: self.first]

    @property
    def sides(self) -> tuple[float, ...]:
        """The branches."""
        return self.full.p[self.first :]

    def _take(self, sides: dict[int, float]) -> None:
        p = list(self.full.p)
        for k, side in sides.items():
            p[self.first + k] = side
        self.full.p = tuple(p)

    def _functions(self, t: float, q: Array, v: Array) -> Array:
        count = len(self.kinks)
        out = np.array(self._tape((t, *q.tolist(), *v.tolist(), *self.full.p)))
        sizes = np.abs(out[count:]) + np.array([kink.whole != 0 for kink in self.kinks])
        self._sizes = np.fmax(self._sizes, sizes)
        return out[:count]

    def _beside(self, k: int, upper: bool) -> float:
        """Return the branch above or below the surface of a kink."""
        whole = self.kinks[k].whole
        if not whole:
            return 1.0 if upper else -1.0
        return float(self._bounds[k]) - (not upper) + (whole < 0)

    def take_side(self, k: int, upper: bool) -> None:
        """Set the branch above or below the surface of a kink."""
        self._take({k: self._beside(k, upper)})

    # what is watched

    def watched(self) -> list[tuple[int, bool]]:
        """Return the kinks to monitor, and the direction: upwards or downwards."""
        return [
            (k, upwards)
            for k, kink in enumerate(self.kinks)
            for upwards in (False, True)
            if kink.whole or k == self.slides or upwards == (self.sides[k] < 0)
        ]

    def distance(self, values: Array, k: int, upwards: bool) -> float:
        """Return the function that falls through zero when a branch ends in a direction.

        Parameters
        ----------
        values : (nk,) array
            Result of `values`.
        k : int
        upwards : bool
        """
        if k == self.slides:
            return 1 - self.weight if upwards else self.weight
        whole = self.kinks[k].whole
        bound = self.sides[k] + upwards - (whole < 0) if whole else 0.0
        return float(bound - values[k] if upwards else values[k] - bound)

    def values(self, t: float, q: Array, v: Array) -> Array:
        """Return the functions of the kinks."""
        return self._functions(t, q, v)

    def noise(self, k: int) -> float:
        """Return the rounding error of a kink's function, relative to its size."""
        return 1.0 if k == self.slides else float(self._sizes[k])

    # instants

    def reach(self, k: int, upwards: bool) -> None:
        """Record that a branch has ended in a direction."""
        if k == self.slides:
            self.slides = None
            self._take({k: self._beside(k, upwards)})
            self._known.add(k)
        else:
            self.reached.add(k)
            self.crossed += 1

    def choose(self, t: float, q: Array, v: Array, accelerations: Accelerations) -> None:
        """Determine the branches at a state.

        Raises
        ------
        Stop
            The motion does not continue, or not uniquely.
        """
        crossed = bool(self.reached or self._known or self.slides is not None)
        on = self._clear(t, q, v)
        self.reached, self._known, self.surfaces = set(), set(), on
        if not on:
            return
        if len(on) > _MOST:
            raise self._stop(Status.SURFACES, t, on)
        from_above = [crossed and self.sides[k] == self._beside(k, True) for k in on]
        consistent: list[dict[int, float]] = []
        for flips in product((False, True), repeat=len(on)):
            upper = [above == flip for above, flip in zip(from_above, flips, strict=True)]
            sides = {k: self._beside(k, up) for k, up in zip(on, upper, strict=True)}
            growth = self._growth(t, q, v, sides, accelerations)
            away = [growth[k] if up else -growth[k] for k, up in zip(on, upper, strict=True)]
            if not all(x >= 0 for x in away):
                continue
            if consistent and not crossed and all(x > 0 for x in away):
                raise self._stop(Status.FORKED, t, on)
            consistent.append(sides)
            if crossed:
                break
        if consistent:
            self._take(consistent[0])
        else:
            self._choose_surface(t, q, v, on, from_above, accelerations)

    def _clear(self, t: float, q: Array, v: Array) -> list[int]:
        """Set the branches of functions that do not vanish; return those that do."""
        surfaces = self.reached | ({self.slides} if self.slides is not None else set())
        self.slides = None
        on: list[int] = []
        for _ in range(len(self.kinks) + 1):
            before, on = self.sides, []
            values = self._functions(t, q, v)
            for k, kink in enumerate(self.kinks):
                if k in self._known:
                    continue
                nearest = round(values[k]) if kink.whole else 0
                if abs(values[k] - nearest) <= (_ON * self._sizes[k] if k in surfaces else 0):
                    self._bounds[k] = nearest
                    on.append(k)
                else:
                    self._take({k: side_of(kink, float(values[k]))})
            if self.sides == before:
                break
        return on

    def _growth(
        self, t: float, q: Array, v: Array, sides: dict[int, float], accelerations: Accelerations
    ) -> Array:
        """Return the growth of the functions in a short time on some branches."""
        self._take(sides)
        return self._ahead(t, q, v, accelerations(t, q, v)[0])

    def _ahead(self, t: float, q: Array, v: Array, a: Array) -> Array:
        """Return the directions in which the functions leave their surfaces; 0 for rounding
        errors."""
        d, sizes = _AHEAD * self.span, self._sizes
        now = self._functions(t, q, v)
        later, beside = (
            self._functions(t + d, q + d * (v + d / 2 * x), v + d * x)
            for x in (a, a + self.acceleration_terms)
        )
        self._sizes = sizes
        growth = later - now
        growth[np.abs(growth) <= _CONTINUOUS * np.abs(beside - later)] = 0.0
        # another branch may have moved a surface
        off = now - self._bounds
        return np.where(np.abs(off) > _ON * sizes, off, growth)

    def _choose_surface(
        self,
        t: float,
        q: Array,
        v: Array,
        on: list[int],
        from_above: list[bool],
        accelerations: Accelerations,
    ) -> None:
        """Find the surface on which the motion slides."""
        jumps = False
        for which in on:
            others = [k for k in on if k != which]
            for upper in product((True, False), repeat=len(others)):
                self._take({k: self._beside(k, x) for k, x in zip(others, upper, strict=True)})
                off = self._functions(t, q, v)[which] - self._bounds[which]
                if abs(off) > _ON * self._sizes[which]:
                    continue
                a, _, _ = self.combined(which, t, q, v, accelerations)
                terms = np.abs(a) + np.abs(accelerations(t, q, v)[0]) + self.acceleration_terms
                if not (np.abs(self._jump) > _CONTINUOUS * terms).any():
                    continue
                jumps = True
                growth = self._ahead(t, q, v, a)
                away = [growth[k] if x else -growth[k] for k, x in zip(others, upper, strict=True)]
                if 0 <= self.weight <= 1 and all(x >= 0 for x in away):
                    self.slides = which
                    return
        if jumps:
            raise self._stop(Status.SURFACES, t, on)
        # continuous except for rounding: the motion crosses
        self._take({k: self._beside(k, not x) for k, x in zip(on, from_above, strict=True)})

    def check_corner(self, t: float, before: Array, v: Array) -> None:
        """Stop if the constraints on a new branch change the velocities."""
        if self.surfaces and np.abs(v - before).max() > _TURNS * np.abs(before).max():
            raise self._stop(Status.CORNER, t, self.surfaces)

    def _stop(self, status: Status, t: float, on: list[int]) -> Stop:
        return at_surfaces(status, t, [self.kinks[k].names for k in on])

    # motions on a surface

    def combined(
        self, k: int, t: float, q: Array, v: Array, accelerations: Accelerations
    ) -> tuple[Array, Array, float]:
        """Return a, λ and the power of the motion that remains on a surface."""
        found, rates = [], []
        for upper in (True, False):
            self._take({k: self._beside(k, upper)})
            found.append(accelerations(t, q, v))
            rates.append(self._rate(k, t, q, v, found[-1][0]))
        (a, multipliers, power), (a0, multipliers0, power0) = found
        self._jump, self._rates = a - a0, rates[0] - rates[1]
        with np.errstate(all="ignore"):
            self.weight = float(np.float64(-rates[1]) / self._rates)
        x = self.weight
        return (
            a0 + x * (a - a0),
            multipliers0 + x * (multipliers - multipliers0),
            power0 + x * (power - power0),
        )

    def _rate(self, k: int, t: float, q: Array, v: Array, a: Array) -> float:
        d, sizes = _AROUND * min(self.span, 1.0), self._sizes
        ends = [self._functions(t + s * d, q + s * d * v, v + s * d * a)[k] for s in (-1, 1)]
        self._sizes = sizes
        return float(ends[1] - ends[0]) / (2 * d)

    def held(self, t: float, q: Array, v: Array, accelerations: Accelerations) -> Array:
        """Return velocities projected onto the sliding surface."""
        k = self.slides
        assert k is not None
        for _ in range(2):
            bound = self._bounds[k] if self.kinks[k].whole else 0.0
            gap = self._functions(t, q, v)[k] - bound
            if gap == 0:
                break
            self.combined(k, t, q, v, accelerations)
            v = v - gap / self._rates * self._jump
        return v
