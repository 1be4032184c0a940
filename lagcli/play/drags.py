"""Drags: initial values that follow from moving a body on the page."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lagcli.model.model import Model
from lagcli.pictures.scene.drag import Drag, places
from lagcli.pictures.scene.view_evaluator import ViewEvaluator
from lagcli.simulations.simulation import Simulation
from lagcli.trajectory.samples import Samples

#: Digits of initial values; fixed ones must satisfy the constraints within the accepted residual.
_DIGITS = 13
#: Values below this part of the largest are 0 except for rounding.
_ZERO = 1e-14


@dataclass(frozen=True)
class DragRequest:
    """A request to move a body.

    Parameters
    ----------
    gesture : int
        Identifier of the gesture, from grasp to release.
    time : float
        Time of the configuration at the beginning, s.
    weights : mapping of str to float
        The grasped point: a weighted mean of points of the view.
    target : tuple of float
        Target in two or three dimensions.
    eye : tuple of float or None
        Viewing direction, in three dimensions.
    length : float
        Size of the drawing.
    """

    gesture: int
    time: float
    weights: Mapping[str, float]
    target: tuple[float, ...]
    eye: tuple[float, ...] | None
    length: float

    @classmethod
    def parsed(cls, value: Any) -> DragRequest | None:
        """Return the drag in a message of the page; None if there is none.

        Raises
        ------
        ValueError
            The drag is invalid.
        """
        if value is None:
            return None
        if not isinstance(value, dict):
            raise ValueError("a drag is an object")
        weights: Any = value.get("weights")
        if not isinstance(weights, dict) or not weights or not _numbers([*weights.values()]):
            raise ValueError("weights are points with numbers")
        target: Any = value.get("target")
        if not _numbers(target) or len(target) not in (2, 3):
            raise ValueError("a target has two or three numbers")
        eye: Any = value.get("eye")
        if eye is not None and not (_numbers(eye) and len(eye) == len(target) and eye != target):
            raise ValueError("an eye is another point")
        rest: list[Any] = [value.get(key) for key in ("gesture", "time", "length")]
        if not _numbers(rest) or rest[2] <= 0:
            raise ValueError("a drag has a gesture, a time and a length")
        gesture, time, length = rest
        seen = None if eye is None else (*eye,)
        return cls(int(gesture), time, weights, (*target,), seen, length)


class Drags:
    """The drags of one client; each gesture continues from the previous place.

    Parameters
    ----------
    model : Model
        Model with a view.
    evaluator : ViewEvaluator
        Evaluator of its view.
    """

    def __init__(self, model: Model, evaluator: ViewEvaluator):
        self._model, self._evaluator = model, evaluator
        self._time, self._q = np.zeros(0), np.zeros((0, len(model.coordinates)))
        self._gesture: int | None = None

    def take(self, samples: Samples) -> None:
        """Set the run that the page shows: a drag begins in one of its configurations."""
        self._time, self._q = samples.time, samples.q
        self._gesture = None

    def fits(self, request: DragRequest) -> bool:
        """Return whether a request is valid for this model's view."""
        view = self._model.view
        assert view is not None
        known = request.weights.keys() <= set(places(self._model, view))
        return known and len(request.target) == view.dimension

    def drag(self, request: DragRequest, simulation: Callable[[], Simulation]) -> dict[str, Any]:
        """Move a body.

        Parameters
        ----------
        request : DragRequest
            A valid request.
        simulation : callable
            Returns the simulation with the page's values; called when a gesture begins.

        Returns
        -------
        dict
            ``gesture``, ``initial``: the changed initial values, in SI; ``scene``: only at the
            initial time.

        Raises
        ------
        ModelError, UsageError, NumericalError
            The values are invalid.
        """
        if request.gesture != self._gesture:
            self._simulation = simulation()
            self._drag = self._begun(request)
            self._gesture = request.gesture
        moved = self._drag.to(request.target, request.eye, request.length)
        changes = self._changes(moved)
        return {"gesture": request.gesture, "initial": changes, "scene": self._scene(moved)}

    def _begun(self, request: DragRequest) -> Drag:
        view, q = self._model.view, self._simulation.start.state.q
        assert view is not None
        if len(self._time):
            q = np.array([np.interp(request.time, self._time, x) for x in self._q.T])
        return Drag(self._simulation, view, request.weights, q)

    def _changes(self, moved: Simulation) -> dict[str, float]:
        """Return the initial values that differ from those of the page."""
        before, after = self._simulation.initial, moved.initial
        coordinates = [name for name in after if not name.endswith("'")]
        velocities = [name for name in after if name.endswith("'")]
        changes = {}
        for names in (coordinates, velocities):
            zero = _ZERO * max(abs(after[name]) for name in names)
            for name in names:
                value = _rounded(after[name], zero)
                if value != _rounded(before[name], zero):
                    changes[name] = value
        return changes

    def _scene(self, moved: Simulation) -> dict[str, Any]:
        settings = moved.settings
        settings = settings.replace(times=(settings.t_start,), samples=None, dt=None)
        run = dataclasses.replace(moved, settings=settings).trajectory()
        values = moved.model.parameter_values
        return self._evaluator.scene(vars(run), run.terms, values).to_json(lambda x: x)


def _rounded(value: float, zero: float) -> float:
    return float(f"{value:.{_DIGITS}g}") if abs(value) > zero else 0.0


def _numbers(values: Any) -> bool:
    return isinstance(values, list) and all(
        isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) for x in values
    )
