"""Scene: the view of a model at the samples of a run, as numbers.

As JSON, for programs that draw (`Scene.to_json`)::

    {"dimension": 2 | 3,
     "bounds": [[low, high], …],                    one pair by axis
     "reach": …,                                    of anything from the vertical in their middle
     "unit": "m" | "",                              of the points
     "time": [nt],                                  s
     "points": {NAME: [[x…], [y…], ([z…])]},        each axis nt values, or 1 where it is constant
     "shapes": [
       {"kind": "rod" | "rope" | "spring" | "damper" | "belt" | "guide" | "wall" | "edge",
        "name": …, "from": POINT, "to": POINT},
       {"kind": "plate", "name": …, "points": [POINT, …]},         a filled outline
       {"kind": "disc", "name": …, "center": POINT, "radius": [nt | 1],
        "angle": [nt | 1] | null, "normal": [[…], […], […]] | null},
       {"kind": "ground", "at": POINT}, {"kind": "trail", "of": POINT},
       {"kind": "slider", "at": POINT}, {"kind": "mass", "at": POINT}, {"kind": "pin", "at": POINT},
       {"kind": "label", "at": POINT, "text": …},
       {"kind": "vector", "name": …, "quantity": "velocity" | "force" | "vector", "at": POINT,
        "components": [[…], […], …], "unit": "N", "scale": s,
        "constraint": CONSTRAINT | null, "parts": [CONSTRAINT, …]},
       {"kind": "flash", "name": CONSTRAINT, "times": [n], "at": [[n], [n], …],
        "strengths": [n], "life": s}]}         impacts: where, up to 1, and how long they are seen

A vector is drawn from its point to the point plus ``scale`` times its components; all vectors of
one unit have one scale. A value that is not finite is null. In three dimensions z points up; the
spoke of a disc turns by ``angle`` about ``normal`` from z × normal (from x where the normal is
vertical): see `frames`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.model.model import Plate, Segment
from lagcli.pictures.selection import evenly
from lagcli.trajectory.event_log import MODES, EventLog

#: Margin of the picture, relative to its size, and relative length of a long vector.
MARGIN, LONG = 0.05, 0.22
#: Vectors below this part of the longest one of their unit are 0 except for rounding.
ROUNDED = 1e-12
#: Number of samples at which points are compared, and largest distance in one place, relative.
_COMPARED, _TOGETHER = 5, 1e-4
#: Minimum extent of an axis, relative to the largest one.
LEAST = 0.3


class DrawnDisc(NamedTuple):
    """A disc: arrays of nt values, or of 1 if constant."""

    name: str
    center: str
    radius: Array
    angle: Array | None
    normal: tuple[Array, ...] | None


class DrawnVector(NamedTuple):
    """A vector at a point, drawn as ``scale`` times its components.

    The force of a constraint has the constraint's name. ``parts`` are the constraints whose
    multipliers it shows: several for a vector constraint.
    """

    name: str
    quantity: str
    at: str
    components: tuple[Array, ...]
    unit: str
    scale: float = 1.0
    constraint: str | None = None
    parts: tuple[str, ...] = ()

    def drawn(self) -> tuple[Array, ...]:
        """Return the components in the units of the points."""
        return tuple(self.scale * x for x in self.components)


class DrawnFlashes(NamedTuple):
    """The n impacts of a contact.

    Parameters
    ----------
    name : str
        Name of the constraint.
    times : (n,) array
        s.
    at : tuple of (n,) arrays
        Positions, by axis.
    strengths : (n,) array
        Impulses relative to the largest one of all contacts.
    life : float
        Duration of each flash, s.
    """

    name: str
    times: Array
    at: tuple[Array, ...]
    strengths: Array
    life: float


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene at nt samples; see the module for its JSON.

    Parameters
    ----------
    dimension : int
        2 or 3.
    time : (nt,) array
        s.
    points : dict of str to arrays
        By axis, of nt values, or of 1 if constant.
    segments : tuple of Segment
    plates : tuple of Plate
    discs : tuple of DrawnDisc
    vectors : tuple of DrawnVector
        Scaled.
    grounds, trails, sliders, masses : tuples of str
        Names of points.
    labels : dict of str to str
        Texts by points.
    unit : str
        Unit of the points; empty if the model has no units.
    flashes : tuple of DrawnFlashes
    """

    dimension: int
    time: Array
    points: dict[str, tuple[Array, ...]]
    segments: tuple[Segment, ...] = ()
    discs: tuple[DrawnDisc, ...] = ()
    vectors: tuple[DrawnVector, ...] = ()
    grounds: tuple[str, ...] = ()
    trails: tuple[str, ...] = ()
    labels: dict[str, str] | None = None
    unit: str = ""
    flashes: tuple[DrawnFlashes, ...] = ()
    plates: tuple[Plate, ...] = ()
    sliders: tuple[str, ...] = ()
    masses: tuple[str, ...] = ()

    def at(self, point: str, sample: int) -> tuple[float, ...]:
        """Return a point at a sample."""
        return tuple(float(x[sample if len(x) > 1 else 0]) for x in self.points[point])

    @cached_property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """The smallest and the largest value of each axis, over all samples.

        To be drawn with equal scales.
        """
        extent = extent_of(self.points, self.discs)
        for tip in self._tips():
            extent = [_joined(pair, _range(axis)) for pair, axis in zip(extent, tip, strict=True)]
        size = max((high - low for low, high in extent), default=0.0) or 1.0
        bounds = []
        for low, high in extent:
            middle, half = (low + high) / 2, max(high - low, LEAST * size) / 2 + MARGIN * size
            bounds.append((middle - half, middle + half))
        return tuple(bounds)

    def _tips(self) -> Iterator[tuple[Array, ...]]:
        """Yield the ends of the vectors, by axis."""
        for vector in self.vectors:
            foot = self.points[vector.at]
            yield tuple(a + b for a, b in zip(foot, vector.drawn(), strict=True))

    @property
    def reach(self) -> float:
        """The largest horizontal distance of anything from the middle of the bounds."""
        middle = [(low + high) / 2 for low, high in self.bounds]
        size = max(high - low for low, high in self.bounds)
        places = [(place, 0.0) for place in self.points.values()]
        places += [(tip, 0.0) for tip in self._tips()]
        places += [(self.points[d.center], _range(np.abs(d.radius))[1]) for d in self.discs]
        reach = 0.0
        for (x, y, *_), around in places:
            away = _range(np.hypot(x - middle[0], y - middle[1]))[1]
            reach = max(reach, away + around)
        return float(reach if np.isfinite(reach) else 0.0) + MARGIN * size

    @cached_property
    def pins(self) -> tuple[str, ...]:
        """Points where bodies meet, without masses.

        These are ends of rods, springs and dampers in one place at all samples, sliders, and points
        fixed to the ground; of several points in one place, the first.
        """
        bodies: dict[str, int] = {}
        for segment in self.segments:
            if segment.kind in ("rod", "spring", "damper"):
                for name in (segment.start, segment.end):
                    bodies[name] = bodies.get(name, 0) + 1
        for names, count in ((self.grounds, 2), (self.sliders, 1)):
            for name in names:
                bodies[name] = bodies.get(name, 0) + count
        if not bodies:
            return ()
        size = max(high - low for low, high in self.bounds)
        few = evenly(len(self.time), _COMPARED)
        at = np.array(
            [
                np.concatenate(
                    [np.broadcast_to(x, self.time.shape)[few] for x in self.points[name]]
                )
                for name in bodies
            ]
        )
        masses = np.array([name in self.masses for name in bodies])
        counts = np.array(list(bodies.values()))
        pins = []
        for i, name in enumerate(bodies):
            with np.errstate(invalid="ignore"):  # infinite places
                together = np.abs(at - at[i]).max(axis=1, initial=0.0) <= _TOGETHER * size
            together[i] = True  # also if it is nowhere
            meeting = counts[together].sum() > 1 and not masses[together].any()
            if meeting and not together[:i].any():
                pins.append(name)
        return tuple(pins)

    def to_json(self, numbers: Callable[[Array], Any] | None = None) -> dict[str, Any]:
        """Return JSON values, as the module says.

        Parameters
        ----------
        numbers : callable, optional
            Function that converts an array; by default to a list.
        """
        numbers = numbers or _numbers

        def fields(shape: Plate | DrawnDisc | DrawnVector | DrawnFlashes) -> dict[str, Any]:
            return {name: of(value) for name, value in shape._asdict().items()}

        def of(value: Any) -> Any:
            if isinstance(value, tuple):
                return [of(x) for x in value]
            return numbers(value) if isinstance(value, np.ndarray) else value

        shapes: list[dict[str, Any]] = [
            {"kind": s.kind, "name": s.name, "from": s.start, "to": s.end} for s in self.segments
        ]
        shapes += [{"kind": "plate", **fields(p)} for p in self.plates]
        shapes += [{"kind": "disc", **fields(d)} for d in self.discs]
        shapes += [{"kind": "ground", "at": name} for name in self.grounds]
        shapes += [{"kind": "trail", "of": name} for name in self.trails]
        shapes += [{"kind": "slider", "at": name} for name in self.sliders]
        shapes += [{"kind": "mass", "at": name} for name in self.masses]
        shapes += [{"kind": "pin", "at": name} for name in self.pins]
        shapes += [
            {"kind": "label", "at": at, "text": text} for at, text in (self.labels or {}).items()
        ]
        shapes += [{"kind": "vector", **fields(v)} for v in self.vectors]
        shapes += [{"kind": "flash", **fields(f)} for f in self.flashes]
        return {
            "dimension": self.dimension,
            "bounds": [list(pair) for pair in self.bounds],
            "reach": self.reach,
            "unit": self.unit,
            "time": numbers(self.time),
            "points": {name: [numbers(x) for x in p] for name, p in self.points.items()},
            "shapes": shapes,
        }


def scaled(
    vectors: Sequence[DrawnVector], extent: Sequence[tuple[float, float]]
) -> tuple[DrawnVector, ...]:
    """Return vectors with their scales; vectors of one unit share a scale.

    The longest one is `LONG` times the size of the picture; if that is a rare peak, three times the
    root mean square is. Vectors that are rounding errors relative to the longest one are 0.
    """
    size = max((high - low for low, high in extent), default=0.0) or 1.0
    with np.errstate(over="ignore"):  # infinite lengths have no part in a scale
        lengths = [np.sqrt(sum((x * x for x in v.components), np.zeros(1))) for v in vectors]
    groups: dict[str, list[Array]] = {}
    for v, length in zip(vectors, lengths, strict=True):
        groups.setdefault(v.unit or v.quantity, []).append(length[np.isfinite(length)])
    scales, least = {}, {}
    for key, group in groups.items():
        every = np.concatenate(group)
        every = every[every > 0]
        least[key] = ROUNDED * every.max(initial=0.0)
        with np.errstate(over="ignore"):
            long = min(every.max(), 3 * np.sqrt(np.mean(every**2))) if every.size else 0.0
        scales[key] = LONG * size / long if long > 0 else 1.0
    shown = []
    for v, length in zip(vectors, lengths, strict=True):
        key = v.unit or v.quantity
        rounding = (length > 0) & (length < least[key])
        if rounding.any():
            v = v._replace(components=tuple(np.where(rounding, 0.0, x) for x in v.components))
        shown.append(v._replace(scale=float(scales[key])))
    return tuple(shown)


def extent_of(
    points: dict[str, tuple[Array, ...]], discs: Sequence[DrawnDisc]
) -> list[tuple[float, float]]:
    """Return the smallest and the largest value of points and discs on each axis."""
    dimension = len(next(iter(points.values())))
    extent = [
        _joined(*(_range(place[axis]) for place in points.values())) for axis in range(dimension)
    ]
    for disc in discs:
        center = points[disc.center]
        for axis in range(dimension):
            reach = np.abs(disc.radius)
            if disc.normal is not None:
                length = np.sqrt(sum((x * x for x in disc.normal), np.zeros(1)))
                with np.errstate(all="ignore"):
                    tilt = 1 - (disc.normal[axis] / length) ** 2
                reach = reach * np.sqrt(np.clip(tilt, 0, 1))
            around = (_range(center[axis] - reach), _range(center[axis] + reach))
            extent[axis] = _joined(extent[axis], *around)
    return extent


def frames(normal: Sequence[Array]) -> tuple[Array, Array]:
    """Return two unit vectors in the planes of discs with given normals.

    Parameters
    ----------
    normal : three (n,) arrays

    Returns
    -------
    first, second : (n, 3) arrays
        Unit vectors: z × normal, or x where the normal is vertical, and normal × first. The spoke
        of a disc is first cos(angle) + second sin(angle).
    """
    n = np.stack(np.broadcast_arrays(*normal), axis=-1).astype(np.float64)
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)
    first = np.cross([0.0, 0.0, 1.0], n)
    length = np.linalg.norm(first, axis=-1, keepdims=True)
    first = np.where(length > 1e-9, first / np.where(length > 1e-9, length, 1.0), [1.0, 0.0, 0.0])
    return first, np.cross(n, first)


def _range(values: Array) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (np.inf, -np.inf)


def _joined(*ranges: tuple[float, float]) -> tuple[float, float]:
    low, high = min(r[0] for r in ranges), max(r[1] for r in ranges)
    return (low, high) if low <= high else (0.0, 0.0)


def _numbers(values: Array) -> list[float | None]:
    """Return values for JSON, with nine digits, which exceeds the resolution of screens."""
    return [float(f"{x:.9g}") if np.isfinite(x) else None for x in values.tolist()]


#: Duration of a flash, relative to the motion.
LIFE = 0.04
#: Smallest impulse with a flash, relative to the largest, and largest number of flashes.
WEAK, MOST_FLASHES = 1e-3, 500


def with_contacts(scene: Scene, log: EventLog | None, constraints: Sequence[str]) -> Scene:
    """Return a scene with flashes at impacts, and without forces of open contacts.

    Flashes are at the points of the contact forces in the view; of several points, at their mean.

    Parameters
    ----------
    scene : Scene
    log : EventLog or None
        Log of the run; without it, the scene is unchanged.
    constraints : sequence of str
        Names of all constraints, in the model's order.
    """
    if log is None or not len(scene.time):
        return scene
    modes = log.modes_at(scene.time)
    vectors = tuple(_of_closed(vector, log, modes) for vector in scene.vectors)
    return replace(scene, vectors=vectors, flashes=_flashes(scene, log, constraints))


def _of_closed(vector: DrawnVector, log: EventLog, modes: Indices) -> DrawnVector:
    """Return the force of a constraint, 0 while it is open."""
    if vector.constraint not in log.rows:
        return vector
    is_open = modes[:, log.rows.index(vector.constraint)] == MODES.index("open")
    components = tuple(np.where(is_open, 0.0, x) for x in vector.components)
    return vector._replace(components=components)


def _flashes(scene: Scene, log: EventLog, constraints: Sequence[str]) -> tuple[DrawnFlashes, ...]:
    first, last = float(scene.time[0]), float(scene.time[-1])
    places: dict[str, list[str]] = {}
    for vector in scene.vectors:
        for constraint in vector.parts:
            places.setdefault(constraint, []).append(vector.at)
    seen = [
        i
        for i, (name, kind, t) in enumerate(
            zip(log.names, log.kinds, log.time.tolist(), strict=True)
        )
        if kind == "impact" and name in places and first <= t <= last
    ]
    if not seen:
        return ()
    rows = [constraints.index(log.names[i]) for i in seen]
    sizes = np.abs(log.nonzero_impulses.at(seen, rows))
    order = np.argsort(-sizes, kind="stable")[:MOST_FLASHES]
    kept = np.sort(order[sizes[order] > WEAK * sizes.max(initial=0.0)])
    flashes = []
    for name in dict.fromkeys(log.names[seen[k]] for k in kept):
        mine = np.array([k for k in kept if log.names[seen[k]] == name])
        time = log.time[[seen[k] for k in mine]]
        points = [scene.points[point] for point in places[name]]
        at = tuple(
            np.asarray(np.mean([_at(x, scene.time, time) for x in axis], axis=0))
            for axis in zip(*points, strict=True)
        )
        strength = sizes[mine] / sizes.max()
        flashes.append(DrawnFlashes(name, time, at, strength, LIFE * (last - first)))
    return tuple(flashes)


def _at(series: Array, time: Array, times: Array) -> Array:
    """Return a series at other times."""
    if len(series) == 1:
        return np.full(len(times), series[0])
    return np.asarray(np.interp(times, time, series))
