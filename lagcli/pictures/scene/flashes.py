"""Contacts in a scene: flashes at impacts, and forces only of closed contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.pictures.scene.scene import DrawnFlashes, DrawnVector, Scene
from lagcli.trajectory.event_log import MODES, EventLog

#: Duration of a flash, relative to the motion.
LIFE = 0.04
#: Smallest impulse with a flash, relative to the largest, and largest number of flashes.
_WEAK, _MOST = 1e-3, 500


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
        if vector.constraint is not None:
            places.setdefault(vector.constraint, []).append(vector.at)
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
    sizes = np.abs(log.impulse[seen, rows])
    order = np.argsort(-sizes, kind="stable")[:_MOST]
    kept = np.sort(order[sizes[order] > _WEAK * sizes.max(initial=0.0)])
    found = []
    for name in dict.fromkeys(log.names[seen[k]] for k in kept):
        mine = np.array([k for k in kept if log.names[seen[k]] == name])
        time = log.time[[seen[k] for k in mine]]
        points = [scene.points[point] for point in places[name]]
        at = tuple(
            np.asarray(np.mean([_at(x, scene.time, time) for x in axis], axis=0))
            for axis in zip(*points, strict=True)
        )
        strength = sizes[mine] / sizes.max()
        found.append(DrawnFlashes(name, time, at, strength, LIFE * (last - first)))
    return tuple(found)


def _at(series: Array, time: Array, times: Array) -> Array:
    """Return a series at other times."""
    if len(series) == 1:
        return np.full(len(times), series[0])
    return np.asarray(np.interp(times, time, series))
