"""Dragging: a point of a view is moved, and the initial state follows on the constraints."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
import symengine as se

from lagcli.arrays import Array
from lagcli.engine.constraints.adjustment import nearest_position
from lagcli.engine.constraints.initial import (
    ConsistentState,
    NoStart,
    consistent_state,
    with_given_spins,
)
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.system import State
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.engine.tape.tape import Tape
from lagcli.model.expression.functions import derivative
from lagcli.model.model import TIME, Model, View, coordinate
from lagcli.simulations.simulation import Simulation
from lagcli.simulations.start import spins_of

#: Units of coordinates that may return to the same configuration after a turn.
_ANGLES = ("rad", "deg", "°")
_SAME = 1e-9  # relative: rounding errors of whole turns


def places(model: Model, view: View) -> dict[str, bool]:
    """Return the points of a view that depend only on the configuration, and whether they move."""
    coordinates = {coordinate(q) for q in model.coordinate_names}
    known = coordinates | {TIME} | {se.Symbol(name) for name in model.parameters}
    free = {
        name: set().union(*(x.free_symbols for x in place)) for name, place in view.points.items()
    }
    return {name: not s.isdisjoint(coordinates) for name, s in free.items() if s <= known}


def draggable(model: Model) -> list[str]:
    """Return the points of a model's view that move with its coordinates alone."""
    view = model.view
    return [] if view is None else [name for name, moves in places(model, view).items() if moves]


def with_rims(model: Model) -> Model:
    """Return a model whose view has two points on each rotating disc, named after it.

    Every point of the disc is a weighted mean of its centre and these, ``NAME rim 0`` along its
    spoke and ``NAME rim 1`` at a right angle to it.

    Parameters
    ----------
    model : Model
        Model with a plane view; others are unchanged.
    """
    view = model.view
    if view is None or view.dimension != 2:
        return model
    rims: dict[str, tuple[se.Basic, ...]] = {}
    for disc in view.discs:
        if disc.angle is not None:
            x, y = view.points[disc.center]
            cos, sin = disc.radius * se.cos(disc.angle), disc.radius * se.sin(disc.angle)
            rims |= {f"{disc.name} rim 0": (x + cos, y + sin)}
            rims |= {f"{disc.name} rim 1": (x - sin, y + cos)}
    return dataclasses.replace(model, view=view._replace(points={**view.points, **rims}))


class Drag:
    """Moves a point that is fixed to points of the view.

    Parameters
    ----------
    simulation : Simulation
        The simulation whose initial state is changed.
    view : View
        View of its model.
    weights : mapping of str to float
        The point: a weighted mean of points of the view, such as a place on a rod.
    q : (nq,) array
        The configuration at the beginning of the drag.
    """

    def __init__(self, simulation: Simulation, view: View, weights: Mapping[str, float], q: Array):
        self._simulation, self._state = simulation, simulation.start.state
        self._evaluator = Evaluator(simulation.system, self._state.p)
        model = simulation.model
        coordinates = [coordinate(name) for name in model.coordinate_names]
        grasped = [
            sum(weight * view.points[name][axis] for name, weight in weights.items())
            for axis in range(view.dimension)
        ]
        slopes = [derivative(x, q) for x in grasped for q in coordinates]
        variables = [TIME, *coordinates]
        parameters = [se.Symbol(name) for name in model.parameters]
        functions = input_functions(model)
        self._tape = compile_tape([*grasped, *slopes], variables, parameters, functions)
        drawn = [x for name in places(model, view) for x in view.points[name]]
        self._drawn = compile_tape(drawn, variables, parameters, functions)
        self._dimension = view.dimension
        self._q = self._unwound(q)

    def to(self, target: Sequence[float], eye: Sequence[float] | None, length: float) -> Simulation:
        """Move the point to a target, or as close as the constraints allow.

        Fixed velocities that no longer satisfy the constraints are changed minimally.

        Parameters
        ----------
        target : sequence of float
            As many components as the view has dimensions.
        eye : sequence of float, optional
            Viewing direction: the point may be anywhere on the line through the target.
        length : float
            Size of the drawing, the scale of distances.

        Returns
        -------
        Simulation
            The same simulation with another initial state.
        """
        across = np.eye(self._dimension)
        if eye is not None:
            sight = np.subtract(target, eye)
            sight = sight / np.linalg.norm(sight)
            across -= np.outer(sight, sight)

        def deviation(q: Array) -> tuple[Array, Array]:
            point, slopes = self._point(q)
            return across @ (point - np.asarray(target)), across @ slopes

        t, v = self._state.t, self._state.v
        for begin in (self._q, self._state.q):
            nearest = nearest_position(
                self._evaluator, t, begin, v, deviation, self._places, length
            )
            if nearest is not None:
                self._q = nearest
                break
        return dataclasses.replace(self._simulation, start=self._start())

    def _point(self, q: Array) -> tuple[Array, Array]:
        """Return the point (d,) and its derivatives with respect to the coordinates (d, nq)."""
        out = self._values(self._tape, q)
        return out[: self._dimension], out[self._dimension :].reshape(self._dimension, len(q))

    def _places(self, q: Array) -> Array:
        """Return all points of the drawing."""
        return self._values(self._drawn, q)

    def _values(self, tape: Tape, q: Array) -> Array:
        inputs = [self._state.t, *q.tolist(), *self._state.p]
        return np.asarray(run_arrays(tape, inputs, 1)[:, 0])

    def _start(self) -> ConsistentState:
        """Return the initial state with the current configuration, and consistent velocities."""
        model, state = self._simulation.model, self._state
        entries = model.initial_velocities.values()
        spins, q = spins_of(model), np.array([x.value for x in model.initial_positions.values()])
        v = np.array([x.value for x in entries])
        fixed, free = np.ones(len(self._q), bool), np.zeros(len(self._q), bool)
        as_given = np.array([x.fixed for x in entries])
        system = self._simulation.system
        given = State(state.t, self._q, v, state.p)
        try:
            given = given._replace(v=with_given_spins(spins, q, v, self._q))
            start = consistent_state(system, given, fixed, as_given, self._evaluator, spins)
        except NoStart:
            start = consistent_state(system, given, fixed, free, self._evaluator)
        return start

    def _unwound(self, q: Array) -> Array:
        """Remove whole turns since the initial state that change neither the equations nor the
        point."""
        model, start = self._simulation.model, self._state
        angles = np.array([c.unit in _ANGLES for c in model.coordinates])
        turns = 2 * math.pi * np.round((q - start.q) / (2 * math.pi)) * angles
        if turns.any() and self._same(q, q - turns):
            return q - turns
        for i in np.flatnonzero(turns):
            other = q.copy()
            other[i] -= turns[i]
            q = other if self._same(q, other) else q
        return q

    def _same(self, one: Array, other: Array) -> bool:
        def numbers(q: Array) -> tuple[Array, ...]:
            t, v = self._state.t, self._state.v
            d, c = self._evaluator.dynamics(t, q, v), self._evaluator.constraints(t, q, v)
            residual = 1 + c.position / np.where(c.position_scale > 0, c.position_scale, 1.0)
            return d.mass_matrix, d.forcing, d.jacobian, residual, *self._point(q)

        return all(
            np.allclose(x, y, rtol=_SAME, atol=_SAME * np.abs(x).max(initial=0.0))
            for x, y in zip(numbers(one), numbers(other), strict=True)
        )
