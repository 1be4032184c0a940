"""Drawing of scenes, like ``assets/scene.js`` for pages."""

from __future__ import annotations

import math

import numpy as np

from lagcli.arrays import Array, Image
from lagcli.pictures.plots.style import ROLES
from lagcli.pictures.scene.camera import OrbitCamera, PlaneCamera
from lagcli.pictures.scene.raster import Raster
from lagcli.pictures.scene.scene import DrawnVector, Scene
from lagcli.pictures.scene.shapes import (
    BODIES,
    LAYERS,
    DrawCommand,
    Moment,
    arrow,
    commands,
    joints,
)
from lagcli.pictures.scene.timing import TRAIL_PART, round_number

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
    """

    def __init__(
        self,
        scene: Scene,
        width: int,
        height: int,
        *,
        forces: bool = True,
        trail: float | None = None,
    ):
        self.scene = scene
        span = float(scene.time[-1] - scene.time[0])
        self.trail = TRAIL_PART * span if trail is None else trail
        unit = max(0.6, min(1.6, min(width, height) / 420))
        self.raster = Raster(width, height, unit, ROLES["paper"])
        #: Height of the lines of text at the top and at the bottom.
        self.strip = 26 * max(1.0, unit)
        camera = PlaneCamera if scene.dimension == 2 else OrbitCamera
        self.camera = camera(scene.bounds, width, height, self.strip)
        self.vectors = [v for v in scene.vectors if forces or v.quantity != "force"]
        self._joints = joints(scene)

    def frame(self, time: float, note: str = "") -> Image:
        """Return the picture at a time.

        Parameters
        ----------
        time : float
            Time, s; samples are interpolated.
        note : str
            Text at the top.

        Returns
        -------
        (height, width, 3) array of uint8
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
        if solid:
            self._triad()
        else:
            self._rule()
        self._magnitudes(moment)
        raster.text(note, (14, raster.height - self.strip / 2), ROLES["label"])
        return raster.image()

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
            value = float(np.linalg.norm(moment.vector(vector.components)))
            text = (
                f"{named(vector, self.scene.vectors)} {three_digits(value)} {vector.unit}".rstrip()
            )
            if right < 0.4 * raster.width:
                break
            place = (right, self.strip / 2)
            right -= raster.text(text, place, ROLES[vector.quantity], align="right") + space


def named(vector: DrawnVector, among: tuple[DrawnVector, ...]) -> str:
    """Return the name of a vector, with its point if others have the same name."""
    alike = sum(v.name == vector.name for v in among) > 1
    return f"{vector.name} at {vector.at}" if alike else vector.name


def three_digits(value: float) -> str:
    """Format a magnitude with three digits, without an exponent if that is more readable."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if 1000 <= value < 1e6:
        return f"{float(f'{value:.3g}'):.0f}"
    return f"{value:#.3g}".rstrip(".")
