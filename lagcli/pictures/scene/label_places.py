"""Placement of labels away from lines, like ``assets/labels.js`` for pages."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array

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
    found: Array = np.linalg.norm(from_start - part[..., None] * way, axis=2).min(axis=1)
    return found
