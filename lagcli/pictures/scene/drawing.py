"""Drawing of scenes, like ``assets/scene.js``, ``shapes.js`` and ``labels.js`` for pages."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array, Image
from lagcli.pictures.scene.camera import OrbitCamera, PlaneCamera
from lagcli.pictures.scene.raster import Raster
from lagcli.pictures.scene.scene import DrawnDisc, DrawnFlashes, DrawnVector, Scene, frames
from lagcli.pictures.scene.timing import TRAIL_PART, round_number
from lagcli.pictures.scene.vector import VectorPicture
from lagcli.pictures.style import ROLES

_LISTED = 6  # largest number of vectors whose magnitudes are written


class SceneDrawing:
    """Draws a scene at any time.

    Parameters
    ----------
    scene : Scene
    width, height : int
        Pixels.
    forces : bool
        Whether the arrows of constraint forces are shown.
    trail : float, optional
        Duration of trails, s; by default 30 % of the run.
    annotated : bool
        Whether there are a scale, or the directions of the axes, and the magnitudes of vectors.
    picture : type
        `Raster` for frames, `VectorPicture` for one picture in SVG.
    """

    def __init__(
        self,
        scene: Scene,
        width: int,
        height: int,
        *,
        forces: bool = True,
        trail: float | None = None,
        annotated: bool = True,
        picture: type[Raster | VectorPicture] = Raster,
    ):
        self.scene, self.annotated = scene, annotated
        span = float(scene.time[-1] - scene.time[0])
        self.trail = TRAIL_PART * span if trail is None else trail
        unit = max(0.6, min(1.6, min(width, height) / 420))
        self.raster = picture(width, height, unit, ROLES["paper"])
        #: Height of the lines of text at the top and at the bottom.
        self.strip = 26 * max(1.0, unit) if annotated else 0.0
        place = width, height, self.strip
        self.camera = (
            PlaneCamera(scene.bounds, *place)
            if scene.dimension == 2
            else OrbitCamera(scene.bounds, scene.reach, *place)
        )
        self.vectors = [v for v in scene.vectors if forces or v.quantity != "force"]
        self._joints = joints(scene)

    def frame(self, time: float, note: str = "") -> Image:
        """Return the picture at a time, of a raster.

        Parameters
        ----------
        time, note
            See `draw`.

        Returns
        -------
        (height, width, 3) array of uint8
        """
        self.draw(time, note)
        assert isinstance(self.raster, Raster)
        return self.raster.image()

    def draw(self, time: float, note: str = "") -> None:
        """Draw the picture at a time.

        Parameters
        ----------
        time : float
            Time, s; samples are interpolated.
        note : str
            Text at the top.
        """
        raster, solid = self.raster, self.scene.dimension == 3
        raster.clear()
        if solid:
            self._floor()
        moment = Moment(self.scene, self.camera, raster, time, self.trail)

        def order(command: DrawCommand) -> tuple[int, float]:
            layer = "rod" if solid and command.layer in BODIES else command.layer
            return LAYERS.index(layer), -command.depth if solid else 0.0

        for command in sorted(commands(moment, self._joints, self.vectors), key=order):
            command.paint()
        if self.annotated:
            self._triad() if solid else self._rule()
            self._magnitudes(moment)
        raster.text(note, (14, raster.height - self.strip / 2), ROLES["label"])

    def _floor(self) -> None:
        """Draw a grid at the bottom of the scene, which makes depth visible."""
        (x_low, x_high), (y_low, y_high), (floor, _) = self.scene.bounds
        step = round_number(max(x_high - x_low, y_high - y_low) / 5)

        def ticks(low: float, high: float) -> Array:
            first, last = math.floor(low / step + 1e-6), math.ceil(high / step - 1e-6)
            return np.arange(first, last + 1, dtype=np.float64) * step

        xs, ys = ticks(x_low, x_high), ticks(y_low, y_high)
        lines = [[(x, ys[0], floor), (x, ys[-1], floor)] for x in xs]
        lines += [[(xs[0], y, floor), (xs[-1], y, floor)] for y in ys]
        for places in self.camera.project(np.array(lines)):
            self.raster.line(places, ROLES["guide"], 1, alpha=0.4)

    def _triad(self) -> None:
        """Draw the directions of x, y and z in a corner."""
        assert isinstance(self.camera, OrbitCamera)
        length = 26 * self.raster.unit
        corner = np.array([1.6 * length, 1.6 * length])
        for name, seen in zip("xyz", self.camera.axes.T, strict=True):
            arrow(self.raster, corner, corner + length * seen[:2], ROLES["ground"])
            self.raster.text(name, corner + 1.35 * length * seen[:2], ROLES["ground"], 12, "center")

    def _rule(self) -> None:
        """Draw a scale bar in a corner."""
        raster = self.raster
        length = round_number(0.2 * raster.width / self.camera.scale)
        pixels, tick = length * self.camera.scale, 4 * raster.unit
        ends = [(14, 12 + tick), (14, 12), (14 + pixels, 12), (14 + pixels, 12 + tick)]
        raster.line(ends, ROLES["ground"], 1.2)
        raster.text(
            f"{length:g} {self.scene.unit}".rstrip(),
            (14 + pixels / 2, 12 + 11 * raster.unit),
            ROLES["ground"],
            11,
            "center",
        )

    def _magnitudes(self, moment: Moment) -> None:
        """List the vectors with their current magnitudes."""
        raster = self.raster
        right, space = raster.width - 14.0, 16 * raster.unit
        for vector in reversed(self.vectors[:_LISTED]):
            value = math.hypot(*moment.vector(vector.components))  # without overflow
            text = (
                f"{named(vector, self.scene.vectors)} {three_digits(value)} {vector.unit}".rstrip()
            )
            if right < 0.4 * raster.width:
                break
            place = (right, self.strip / 2)
            right -= raster.text(text, place, ROLES[vector.quantity], align="right") + space


def named(vector: DrawnVector, among: tuple[DrawnVector, ...]) -> str:
    """Return the name of a vector, with its point if others have the same name."""
    shared = sum(v.name == vector.name for v in among) > 1
    return f"{vector.name} at {vector.at}" if shared else vector.name


def three_digits(value: float) -> str:
    """Format a magnitude with three digits, without an exponent if that is more readable."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if 1000 <= value < 1e6:
        return f"{float(f'{value:.3g}'):.0f}"
    return f"{value:#.3g}".rstrip(".")


#: Layers, in the order of painting.
LAYERS = (
    *("guide", "wall", "belt", "ground", "trail", "plate", "disc", "edge", "slider"),
    *("spring", "damper", "rope", "rod", "joint", "flash", "vector", "label"),
)
#: In three dimensions these are one layer, painted from back to front.
BODIES = frozenset(
    {"trail", "plate", "disc", "edge", "slider", "spring", "damper", "rope", "rod", "joint"}
)

#: Number of pieces of equal shade in a trail, and largest number of points.
_PIECES, _POINTS = 40, 400
_TURNS = 7  # of a spring
#: Distance of an arrow from the line along which it acts, and the sine of the largest angle
#: between them, pixels at scale 1.
_BESIDE, _ALONG = 8.0, 0.25
#: Pixels at scale 1 from a line within which an arrow begins on it.
_ON = 3.0


class DrawCommand(NamedTuple):
    """A drawing command on its layer; larger depth is farther away."""

    layer: str
    depth: float
    paint: Callable[[], object]


class Joint(NamedTuple):
    """A mass, or a pin, and the other ends of the lines that end there."""

    mass: bool
    others: tuple[str, ...]


class Moment:
    """A scene at a time, with a camera and a raster.

    Parameters
    ----------
    scene : Scene
    camera : PlaneCamera or OrbitCamera
    raster : Raster
    now : float
        s.
    trail : float
        Duration of trails, s.
    """

    def __init__(
        self,
        scene: Scene,
        camera: PlaneCamera | OrbitCamera,
        raster: Raster | VectorPicture,
        now: float,
        trail: float,
    ):
        self.scene, self.camera, self.raster = scene, camera, raster
        self.now, self.trail = now, trail
        self.points = {name: self.vector(series) for name, series in scene.points.items()}
        self.places = {name: camera.project(point) for name, point in self.points.items()}

    def value(self, series: Array) -> float:
        """Return a series at the current time, interpolated."""
        if len(series) == 1:
            return float(series[0])
        return float(np.interp(self.now, self.scene.time, series))

    def vector(self, components: Sequence[Array]) -> Array:
        """Return several series at the current time."""
        return np.array([self.value(series) for series in components])

    @cached_property
    def slim(self) -> float:
        """Factor of the widths of rods and joints, below 1 for short rods."""
        rods = [s for s in self.scene.segments if s.kind == "rod"]
        lengths = [math.dist(self.points[s.start], self.points[s.end]) for s in rods]
        usual = 48 * self.raster.unit
        pixels = float(np.median(lengths)) * self.camera.scale if rods else usual
        return min(1.0, max(0.45, pixels / usual))


def joints(scene: Scene) -> dict[str, Joint]:
    """Return the masses and the pins by point."""
    others: dict[str, tuple[str, ...]] = {}
    for segment in scene.segments:
        for name, other in ((segment.start, segment.end), (segment.end, segment.start)):
            others[name] = (*others.get(name, ()), other)
    return {
        name: Joint(name in scene.masses, others.get(name, ()))
        for name in (*scene.pins, *scene.masses)
    }


def commands(
    moment: Moment, drawn: Mapping[str, Joint], vectors: Sequence[DrawnVector]
) -> Iterator[DrawCommand]:
    """Yield the commands of all shapes that are finite.

    Parameters
    ----------
    moment : Moment
    drawn : mapping of str to Joint
        See `joints`.
    vectors : sequence of DrawnVector
        Shapes of the scene to be shown.
    """
    scene, places, raster = moment.scene, moment.places, moment.raster

    def there(*names: str) -> bool:
        return all(np.isfinite(places[name]).all() for name in names)

    for segment in scene.segments:
        if there(segment.start, segment.end):
            ends = np.array([places[segment.start], places[segment.end]])
            paint = partial(_LINES[segment.kind], moment, ends)
            yield DrawCommand(segment.kind, float(ends[:, 2].mean()), paint)
    for plate in scene.plates:
        if there(*plate.points):
            corners = np.array([places[name] for name in plate.points])
            paint = partial(_plate, raster, corners)
            yield DrawCommand("plate", float(corners[:, 2].mean()), paint)
    for disc in scene.discs:
        yield from _disc(moment, disc)
    for name in filter(there, scene.sliders):
        paint = partial(_slider, moment, places[name][:2])
        yield DrawCommand("slider", places[name][2], paint)
    for name in filter(there, scene.grounds):
        yield DrawCommand("ground", places[name][2], partial(_ground, raster, places[name]))
    for name in scene.trails:
        yield from _trail(moment, name)
    for name, joint in drawn.items():
        if there(name):
            # in front of the rods that end here
            middles = [(places[name][2] + places[o][2]) / 2 for o in joint.others if there(o)]
            depth = min([places[name][2], *middles])
            yield DrawCommand("joint", depth, partial(_joint, moment, places[name], joint))
    for vector in vectors:
        ends = vector_ends(moment, vector)
        if np.isfinite(ends).all():
            paint = partial(arrow, raster, ends[0, :2], ends[1, :2], ROLES[vector.quantity])
            yield DrawCommand("vector", float(ends[:, 2].mean()), paint)
    for flashes in scene.flashes:
        yield from _flashes(moment, flashes)
    lines = _obstacles(moment, vectors)
    for name, text in (scene.labels or {}).items():
        if there(name):
            width, height = label_size(text, raster.unit)
            middle = label_place(places[name][:2], (width, height), np.array(lines), raster.unit)
            side = np.array([width / 2, 0.0])
            lines.append((middle - side, middle + side))  # the next labels avoid this one
            write = partial(
                raster.text, text, middle, ROLES["label"], LABEL_SIZE, "center", halo=True
            )
            yield DrawCommand("label", places[name][2], write)


def _obstacles(moment: Moment, vectors: Sequence[DrawnVector]) -> list[tuple[Array, Array]]:
    """Return the ends of the lines that labels avoid."""
    scene, places = moment.scene, moment.places
    obstacles = [(places[s.start], places[s.end]) for s in scene.segments]
    foot = np.array([0.0, -20 * moment.raster.unit, 0.0])
    obstacles += [(places[name], places[name] + foot) for name in scene.grounds]
    for disc in scene.discs:
        rim = _rim(moment, disc, np.arange(25) * np.pi / 12)
        obstacles += list(pairwise(rim))
    for vector in vectors:
        ends = vector_ends(moment, vector)
        obstacles.append((ends[0], ends[1]))
    flat = [(a[:2], b[:2]) for a, b in obstacles]
    return [(a, b) for a, b in flat if np.isfinite(a).all() and np.isfinite(b).all()]


def vector_ends(moment: Moment, vector: DrawnVector) -> Array:
    """Return the places of both ends of a vector, (2, 3).

    A force along a line through its point is drawn beside this line, which would hide it.
    """
    foot = moment.points[vector.at]
    ends = moment.camera.project(np.array([foot, foot + moment.vector(vector.drawn())]))
    if vector.quantity == "velocity" or not np.isfinite(ends).all():
        return ends
    way = ends[1, :2] - ends[0, :2]
    length = math.hypot(*way)
    if not (math.isfinite(length) and length > 0):
        return ends
    side = np.zeros(2)
    for segment in moment.scene.segments:
        a, b = (moment.places[name][:2] for name in (segment.start, segment.end))
        if not (np.isfinite(a).all() and np.isfinite(b).all()):
            continue
        line = b - a
        size = math.hypot(*line)
        if not (math.isfinite(size) and size > 0):
            continue
        line = line / size
        to_foot, reach = (float((x - a) @ line) for x in (ends[0, :2], ends[1, :2]))
        across = np.array([-line[1], line[0]])
        off = abs(float((ends[0, :2] - a) @ across))
        overlaps = min(max(to_foot, reach), size) - max(min(to_foot, reach), 0.0) > 1.0
        angle = abs(float(across @ way)) / length
        if off < _ON * moment.raster.unit and overlaps and angle < _ALONG:
            shift = (1 - angle / _ALONG) * _BESIDE * moment.raster.unit
            side = max(side, shift * across, key=lambda x: float(x @ x))
    ends[:, :2] += side
    return ends


def arrow(raster: Raster | VectorPicture, start: Array, end: Array, color: str) -> None:
    """Draw an arrow between two places."""
    way = end - start
    length = math.hypot(*way)
    if length < 1.5:
        return
    head = min(11 * raster.unit, 0.6 * length)
    along = way / length
    across = np.array([-along[1], along[0]])
    neck = end - head * along
    raster.line([start, neck], color, 2.6, cap="butt")
    side = 0.42 * head * across
    raster.area(np.array([end, neck + side, neck - side]), color)


def _rod(moment: Moment, ends: Array) -> None:
    moment.raster.line(ends, ROLES["rod"], 5 * moment.slim)


def _rope(moment: Moment, ends: Array) -> None:
    moment.raster.line(ends, ROLES["rod"], 1.4)


def _damper(moment: Moment, ends: Array) -> None:
    """Draw a cylinder, open at one end, and its piston."""
    raster = moment.raster
    along, across = _axes(ends)
    middle, unit = ends[:, :2].mean(axis=0), raster.unit

    def at(forward: float, aside: float) -> Array:
        place: Array = middle + unit * (forward * along + aside * across)
        return place

    color = ROLES["spring"]
    raster.line([ends[0, :2], at(-10, 0)], color, 2, cap="butt")
    raster.line([at(10, 7), at(-10, 7), at(-10, -7), at(10, -7)], color, 2)
    raster.line([at(0, 5), at(0, -5)], color, 2)
    raster.line([at(0, 0), ends[1, :2]], color, 2, cap="butt")


def _belt(moment: Moment, ends: Array) -> None:
    """Draw a belt around two rollers, on whose upper run things lie."""
    raster = moment.raster
    along, across = _axes(ends)
    radius = 8 * raster.unit
    hubs = [ends[i, :2] - radius * across + radius * s * along for i, s in ((0, 1), (1, -1))]
    turns = np.linspace(0.5 * np.pi, 1.5 * np.pi, 13)
    half = np.outer(np.cos(turns), along) + np.outer(np.sin(turns), across)
    loop = np.vstack([hubs[0] + radius * half, hubs[1] - radius * half])
    raster.area(loop, ROLES["guide"], 0.18, edge=ROLES["ground"], width=2)
    for hub in hubs:
        raster.dot(hub, 4.5, ROLES["paper"], ROLES["ground"])


def _wall(moment: Moment, ends: Array) -> None:
    """Draw a line that is hatched on its right."""
    raster = moment.raster
    along, across = _axes(ends)
    color, step = ROLES["ground"], 7 * raster.unit
    start, end = ends[:, :2]
    raster.line([start, end], color, 1.8, cap="butt")
    for s in np.arange(step, math.dist(start, end), step):
        foot = start + s * along
        raster.line([foot, foot - step * (along + across)], color, 1)


def _axes(ends: Array) -> tuple[Array, Array]:
    """Return the unit vectors along a line and to its left."""
    way = ends[1, :2] - ends[0, :2]
    along: Array = way / (math.hypot(*way) or 1.0)
    return along, np.array([-along[1], along[0]])


def _plate(raster: Raster | VectorPicture, corners: Array) -> None:
    raster.area(corners[:, :2], ROLES["disc"], 0.2, edge=ROLES["disc"], width=1.8)


def _slider(moment: Moment, place: Array) -> None:
    """Draw a block along the nearest guide."""
    raster, along = moment.raster, np.array([1.0, 0.0])
    nearest = math.inf
    for segment in moment.scene.segments:
        if segment.kind in ("guide", "wall", "belt"):
            ends = np.array([moment.places[segment.start], moment.places[segment.end]])
            away = float(distances(place[None], ends[None, :, :2])[0])
            if away < nearest:
                nearest, along = away, _axes(ends)[0]
    across = np.array([-along[1], along[0]])
    corners = [
        place + raster.unit * (13 * i * along + 8 * j * across)
        for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    raster.area(np.array(corners), ROLES["paper"])
    raster.area(np.array(corners), ROLES["disc"], 0.3, edge=ROLES["disc"], width=1.8)


def _edge(moment: Moment, ends: Array) -> None:
    moment.raster.line(ends, ROLES["disc"], 2)


def _spring(moment: Moment, ends: Array) -> None:
    """Draw a coil with a fixed number of turns, between two straight ends."""
    raster = moment.raster
    start, end = ends[:, :2]
    length = math.dist(start, end) or 1.0
    along, across = _axes(ends)
    radius, lead = 6 * raster.unit, 0.15 * length
    phase = np.linspace(0, 2 * np.pi * _TURNS, 16 * _TURNS + 1)
    # slightly from the side: the turns are slanted
    forward = np.linspace(lead, length - lead, len(phase)) + 0.4 * radius * (1 - np.cos(phase))
    coil = start + np.outer(forward, along) + np.outer(radius * np.sin(phase), across)
    raster.line(np.vstack([start, coil, end]), ROLES["spring"], 2)


def _guide(moment: Moment, ends: Array) -> None:
    moment.raster.line(ends, ROLES["guide"], 14, alpha=0.18, cap="butt")
    moment.raster.line(ends, ROLES["guide"], 1, dash=(9, 4, 2, 4))


_LINES = {
    **{"rod": _rod, "rope": _rope, "spring": _spring, "damper": _damper, "belt": _belt},
    **{"guide": _guide, "wall": _wall, "edge": _edge},
}


def _ground(raster: Raster | VectorPicture, place: Array) -> None:
    """Draw a bearing on hatched ground."""
    x, y = place[:2]
    color, height, half = ROLES["ground"], 15 * raster.unit, 17 * raster.unit
    foot = y - height
    bearing = np.array([(x, y), (x - 0.6 * half, foot), (x + 0.6 * half, foot)])
    raster.area(bearing, ROLES["paper"], edge=color, width=1.5)
    raster.line([(x - half, foot), (x + half, foot)], color, 1.5)
    for i in range(-2, 4):
        right = x + i * half / 3
        raster.line([(right, foot), (right - half / 3, foot - half / 3)], color, 1)


def _disc(moment: Moment, disc: DrawnDisc) -> Iterator[DrawCommand]:
    """Yield a disc with a line from its centre to its rim, which shows the angle."""
    around, at = _rim(moment, disc, np.arange(60) * np.pi / 30), moment.places[disc.center]
    angle = None if disc.angle is None else np.array([moment.value(disc.angle)])
    mark = None if angle is None else _rim(moment, disc, angle)[0]
    if not (np.isfinite(around).all() and np.isfinite(at).all()):
        return

    def paint() -> None:
        color = ROLES["disc"]
        moment.raster.area(around, color, 0.2, edge=color, width=2)
        if mark is not None:
            moment.raster.line([at, mark], color, 2.5)

    yield DrawCommand("disc", at[2], paint)


def _rim(moment: Moment, disc: DrawnDisc, angles: Array) -> Array:
    """Return the places on the rim of a disc at some angles."""
    centre = moment.points[disc.center]
    if disc.normal is not None:
        spans = frames([np.array([x]) for x in moment.vector(disc.normal)])
        first, second = spans[0][0], spans[1][0]
    else:
        first, second = np.eye(len(centre))[:2]
    turned = np.outer(np.cos(angles), first) + np.outer(np.sin(angles), second)
    return moment.camera.project(centre + moment.value(disc.radius) * turned)


def _trail(moment: Moment, name: str) -> Iterator[DrawCommand]:
    """Yield the recent path of a point, fading."""
    scene, now, length = moment.scene, moment.now, moment.trail
    if not 0.0 < length < math.inf:  # all samples are at one time, or infinitely far apart
        return
    first = int(np.searchsorted(scene.time, now - length))
    last = int(np.searchsorted(scene.time, now, side="right"))
    stride = max(1, math.ceil((last - first) / _POINTS))
    # samples are numbered from the first, so that the same ones are shown as time advances
    samples = np.arange(math.ceil(first / stride) * stride, last, stride)
    times = np.append(scene.time[samples], now)
    past = [np.broadcast_to(x, len(scene.time))[samples] for x in scene.points[name]]
    path = np.vstack([np.stack(past, axis=-1), moment.points[name]])
    places = moment.camera.project(path)
    step = max(1, math.ceil(len(times) / _PIECES))
    for start in range(0, len(times) - 1, step):
        piece = places[start : start + step + 1]
        if not np.isfinite(piece).all():
            continue
        age = (now - times[min(start + step, len(times) - 1)]) / length
        paint = partial(
            moment.raster.line, piece, ROLES["trail"], 2.5, alpha=0.9 * (1 - age), cap="butt"
        )
        yield DrawCommand("trail", float(piece[[0, -1], 2].mean()), paint)


def _flashes(moment: Moment, flashes: DrawnFlashes) -> Iterator[DrawCommand]:
    """Yield a ring at each recent impact, growing and fading."""
    ages = (moment.now - flashes.times) / flashes.life
    for i in np.flatnonzero((ages >= 0) & (ages < 1)):
        place = moment.camera.project(np.array([x[i] for x in flashes.at]))
        if not np.isfinite(place).all():
            continue
        size = 0.4 + 0.6 * math.sqrt(flashes.strengths[i])
        radius = (8 + 16 * float(ages[i])) * size * moment.raster.unit
        angles = np.arange(41) * np.pi / 20
        ring = place[:2] + radius * np.column_stack([np.cos(angles), np.sin(angles)])
        alpha = 1 - float(ages[i])
        paint = partial(moment.raster.line, ring, ROLES["force"], 3, alpha=alpha)
        yield DrawCommand("flash", float(place[2]), paint)


def _joint(moment: Moment, place: Array, joint: Joint) -> None:
    """Draw a mass (filled), or a pin (open)."""
    radius = (6 if joint.mass else 4.5) * moment.slim
    color = ROLES["point"]
    moment.raster.dot(place[:2], radius, color if joint.mass else ROLES["paper"], color)


#: Height of the letters of a label, pixels at scale 1.
LABEL_SIZE = 13
#: Number of candidate directions, and clearance in pixels beyond which all are equally good.
_DIRECTIONS, _CLEAR = 16, 10.0
#: Distance of a text from its point, pixels at scale 1: larger than the radius of a body's dot.
_AWAY = 10.0
#: Average ratio of width to height of a letter.
_LETTER = 0.62


def label_size(text: str, unit: float) -> tuple[float, float]:
    """Return the approximate width and height of a label in pixels."""
    size = LABEL_SIZE * max(1.0, unit)
    return _LETTER * size * len(text), size


def label_place(at: Array, size: tuple[float, float], lines: Array, unit: float) -> Array:
    """Return the centre of a text near a point, where it is farthest from the lines.

    Parameters
    ----------
    at : (2,) array
        The point, in pixels upwards.
    size : tuple of float
        Width and height of the text.
    lines : (n, 2, 2) array
        Ends of the lines.
    unit : float
        Scale of the drawing.
    """
    angles = np.arange(_DIRECTIONS) * 2 * np.pi / _DIRECTIONS
    along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    # the nearest edge or corner of the text has the same distance from the point in all directions
    middles = at + along * _AWAY * unit + np.sign(np.round(along, 9)) * np.array(size) / 2
    grid = np.array([(i, j) for j in (-1, 0, 1) for i in (-1, 0, 1)]) * np.array(size) / 2
    clear = np.full(_DIRECTIONS, _CLEAR)
    if len(lines):
        places = middles[:, None] + grid
        clear = np.minimum(clear, distances(places.reshape(-1, 2), lines).reshape(16, -1).min(1))
    # prefer above and to the right
    score = clear + 1.5 * np.cos(angles - np.pi / 4)
    place: Array = middles[int(np.argmax(np.round(score, 9)))]
    return place


def distances(places: Array, lines: Array) -> Array:
    """Return the distance of each place from the nearest of some lines.

    Parameters
    ----------
    places : (m, 2) array
    lines : (n, 2, 2) array

    Returns
    -------
    (m,) array
    """
    start, way = lines[:, 0], lines[:, 1] - lines[:, 0]
    length = np.maximum((way**2).sum(axis=1), 1e-300)
    from_start = places[:, None] - start
    part = np.clip((from_start * way).sum(axis=2) / length, 0, 1)
    nearest: Array = np.linalg.norm(from_start - part[..., None] * way, axis=2).min(axis=1)
    return nearest
