"""Cameras: projection of a scene to a picture, like ``assets/camera.js`` for pages."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lagcli.arrays import Array

Bounds = Sequence[tuple[float, float]]


class PlaneCamera:
    """Camera for two dimensions: x to the right, y up, with equal scales.

    Parameters
    ----------
    bounds : two pairs
        Visible range of x and y.
    width, height : float
        Size of the picture, pixels.
    margin : float
        Margins at the bottom and at the top, pixels.

    Attributes
    ----------
    scale : float
        Pixels per unit of length.
    """

    def __init__(self, bounds: Bounds, width: float, height: float, margin: float = 0.0):
        self.middle = np.array([(low + high) / 2 for low, high in bounds])
        spans = [high - low for low, high in bounds]
        sizes = (width, height - 2 * margin)
        room = [size / span for size, span in zip(sizes, spans, strict=True) if span > 0]
        self.scale = min(room, default=1.0)
        self.centre = np.array([width / 2, height / 2])

    def project(self, points: Array) -> Array:
        """Return the positions of (…, 2) points as (…, 3): right, up, depth (0)."""
        places = self.centre + (points - self.middle) * self.scale
        return np.concatenate([places, np.zeros((*places.shape[:-1], 1))], axis=-1)


class OrbitCamera:
    """Camera for three dimensions: z up, with moderate perspective.

    Parameters
    ----------
    bounds : three pairs
    reach : float
        Largest horizontal distance of anything from the middle of the bounds.
    width, height, margin : float
    azimuth, elevation : float
        Position of the eye, rad: azimuth from the x axis, and elevation.
    """

    AZIMUTH, ELEVATION = math.radians(-60), math.radians(20)
    #: Distance of the eye from the centre, in radii of the scene.
    DISTANCE = 6.0

    def __init__(
        self,
        bounds: Bounds,
        reach: float,
        width: float,
        height: float,
        margin: float = 0.0,
        azimuth: float = AZIMUTH,
        elevation: float = ELEVATION,
    ):
        self.middle = np.array([(low + high) / 2 for low, high in bounds])
        half = [(high - low) / 2 for low, high in bounds]
        self.eye = self.DISTANCE * (math.hypot(*half) or 1.0)
        ca, sa = math.cos(azimuth), math.sin(azimuth)
        ce, se = math.cos(elevation), math.sin(elevation)
        #: Rows: unit vectors to the right, up, towards the eye.
        self.axes = np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])
        # the picture contains the whole scene at any rotation about the vertical
        upright = reach * abs(se) + half[2] * ce
        high = height - 2 * margin
        room = [size / span for size, span in ((width, reach), (high, upright)) if span > 0]
        near = 1 + 1 / self.DISTANCE  # objects nearer than the centre appear larger
        self.scale = min(room) / (2 * near) if room else min(width, high) / 2
        self.centre = np.array([width / 2, height / 2])

    def project(self, points: Array) -> Array:
        """Return the positions of (…, 3) points: right, up, depth."""
        seen = (points - self.middle) @ self.axes.T
        near = seen[..., 2:]
        places = self.centre + seen[..., :2] * (self.scale * self.eye / (self.eye - near))
        return np.concatenate([places, -near], axis=-1)
