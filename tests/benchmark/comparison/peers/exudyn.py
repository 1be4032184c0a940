"""Exudyn: the same mechanisms from its mass points, rigid bodies, joints and connectors.

Implicit integrators with constraints, at fixed step sizes; and open chains as a kinematic tree in
minimal coordinates, with its explicit Runge-Kutta method of order 6(7).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison import mechanisms
from comparison.cases import SAMPLES, Case
from comparison.methods import Method

Array = NDArray[np.float64]
Point = Sequence[float]


class _Assembly:
    """An Exudyn system under construction, planar."""

    def __init__(self) -> None:
        import exudyn
        import exudyn.itemInterface as items

        self.exudyn, self.items = exudyn, items
        self.container = exudyn.SystemContainer()
        self.system = self.container.AddSystem()
        self.ground = self.system.AddObject(items.ObjectGround())
        self.sensors: list[int] = []
        self.output = exudyn.OutputVariableType.Coordinates

    def watch(self, node: int) -> None:
        sensor = self.items.SensorNode(
            nodeNumber=node, storeInternal=True, writeToFile=False, outputVariableType=self.output
        )
        self.sensors.append(self.system.AddSensor(sensor))

    def mass(self, mass: float, at: Point, velocity: Point, gravity: float) -> int:
        """Add a mass point; return a marker at it."""
        node = self.system.AddNode(
            self.items.NodePoint2D(initialCoordinates=list(at), initialVelocities=list(velocity))
        )
        self.system.AddObject(self.items.ObjectMassPoint2D(mass=mass, nodeNumber=node))
        self.watch(node)
        marker = self.system.AddMarker(self.items.MarkerNodePosition(nodeNumber=node))
        if gravity:
            load = self.items.LoadForceVector(
                markerNumber=marker, loadVector=[0, -mass * gravity, 0]
            )
            self.system.AddLoad(load)
        return marker

    def body(self, mass: float, inertia: float, centre: Point, angle: float) -> int:
        """Add a rigid body at rest."""
        node = self.system.AddNode(self.items.NodeRigidBody2D(initialCoordinates=[*centre, angle]))
        self.watch(node)
        return self.system.AddObject(
            self.items.ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node)
        )

    def on(self, body: int, local: Point) -> int:
        """Return a marker on a body."""
        return self.system.AddMarker(
            self.items.MarkerBodyPosition(bodyNumber=body, localPosition=[*local, 0.0])
        )

    def rod(self, a: int, b: int, length: float) -> None:
        self.system.AddObject(
            self.items.ObjectConnectorDistance(markerNumbers=[a, b], distance=length)
        )

    def spring(self, a: int, b: int, length: float, stiffness: float, damping: float) -> None:
        self.system.AddObject(
            self.items.ObjectConnectorSpringDamper(
                markerNumbers=[a, b], referenceLength=length, stiffness=stiffness, damping=damping
            )
        )

    def joint(self, a: int, b: int) -> None:
        self.system.AddObject(self.items.ObjectJointRevolute2D(markerNumbers=[a, b]))


def _chain(case: Case, add: _Assembly) -> None:
    p, q, v = case.start.parameters, case.start.q, case.start.v
    before = add.on(add.ground, (0, 0))
    for i in range(len(q) // 2):
        place = slice(2 * i, 2 * i + 2)
        marker = add.mass(p["m"], q[place], v[place], p["g"])
        if case.stiff and i % 2:
            add.spring(before, marker, p["l"], p["k"], p["c"])
        else:
            add.rod(before, marker, p["l"])
        before = marker


def _slider_crank(case: Case, add: _Assembly) -> None:
    p, (phi, psi), (phi_t, psi_t) = case.start.parameters, case.start.q, case.start.v
    a = p["r"] * np.array([np.cos(phi), np.sin(phi)])
    a_t = p["r"] * phi_t * np.array([-np.sin(phi), np.cos(phi)])
    b = np.array([a[0] + p["l"] * np.cos(psi), 0.0])
    b_t = np.array([a_t[0] - p["l"] * psi_t * np.sin(psi), 0.0])
    at_a = add.mass(p["m"], a, a_t, p["g"])
    at_b = add.mass(p["m"], b, b_t, 0.0)
    add.rod(add.on(add.ground, (0, 0)), at_a, p["r"])
    add.rod(at_a, at_b, p["l"])
    node = add.system.GetSensor(add.sensors[1])["nodeNumber"]
    height = add.system.AddMarker(add.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=1))
    point = add.system.AddNode(add.items.NodePointGround())
    fixed = add.system.AddMarker(add.items.MarkerNodeCoordinate(nodeNumber=point, coordinate=0))
    add.system.AddObject(add.items.ObjectConnectorCoordinate(markerNumbers=[fixed, height]))


def _slider_crank_angles(states: Array) -> Array:
    x_a, y_a, x_b, y_b = states.T
    phi = np.unwrap(np.arctan2(y_a, x_a))
    return np.column_stack([phi, np.arctan2(y_a - y_b, x_b - x_a)])


def _andrews(case: Case, add: _Assembly) -> None:
    p = case.start.parameters
    beta, theta, gamma, phi, delta, omega, epsilon = case.start.q
    angles = [beta, beta + theta, gamma, phi + delta, delta, omega + epsilon, epsilon]
    geometry = mechanisms.andrews(np, case.start.q, p)
    centres = [np.array(x.coordinates) for x in geometry.inertias[:7]]
    bodies = [add.body(p[f"m_{i + 1}"], p[f"J_{i + 1}"], centres[i], angles[i]) for i in range(7)]

    def on(number: int, point: Point) -> int:
        if number == 0:
            return add.on(add.ground, point)
        c, s = np.cos(angles[number - 1]), np.sin(angles[number - 1])
        x, y = np.array(point) - centres[number - 1]
        return add.on(bodies[number - 1], (c * x + s * y, c * y - s * x))

    crank = (p["rr"] * np.cos(beta), p["rr"] * np.sin(beta))
    pin = (
        crank[0] - p["d"] * np.cos(beta + theta),
        crank[1] - p["d"] * np.sin(beta + theta),
    )
    a, b = (p["x_a"], p["y_a"]), (p["x_b"], p["y_b"])
    at_e = (a[0] + p["z_t"] * np.cos(delta), a[1] + p["z_t"] * np.sin(delta))
    at_h = (a[0] + p["u"] * np.sin(epsilon), a[1] - p["u"] * np.cos(epsilon))
    joints = [
        *((0, 1, (0.0, 0.0)), (1, 2, crank), (2, 3, pin), (2, 4, pin), (2, 6, pin)),
        *((0, 3, b), (0, 5, a), (0, 7, a), (4, 5, at_e), (6, 7, at_h)),
    ]
    for one, other, point in joints:
        add.joint(on(one, point), on(other, point))
    at_d = (
        b[0] + p["s_c"] * np.sin(gamma) + p["s_d"] * np.cos(gamma),
        b[1] - p["s_c"] * np.cos(gamma) + p["s_d"] * np.sin(gamma),
    )
    add.spring(on(0, (p["x_c"], p["y_c"])), on(3, at_d), p["l_0"], p["k"], 0.0)
    rigid = add.system.AddMarker(
        add.items.MarkerBodyRigid(bodyNumber=bodies[0], localPosition=[0, 0, 0])
    )
    add.system.AddLoad(
        add.items.LoadTorqueVector(markerNumber=rigid, loadVector=[0, 0, p["torque"]])
    )


def _andrews_angles(states: Array) -> Array:
    turn = states[:, 2::3]
    return np.column_stack(
        [
            *(turn[:, 0], turn[:, 1] - turn[:, 0], turn[:, 2], turn[:, 3] - turn[:, 4]),
            *(turn[:, 4], turn[:, 5] - turn[:, 6], turn[:, 6]),
        ]
    )


def _tree(case: Case, add: _Assembly) -> None:
    """Add rods of a chain at rest as links; angles are relative to the link before."""
    exudyn, items, p = add.exudyn, add.items, case.start.parameters
    n, length = len(case.start.q) // 2, p["l"]
    rods = np.diff(np.vstack([np.zeros(2), case.start.q.reshape(-1, 2)]), axis=0)
    absolute = np.unwrap(np.arctan2(rods[:, 1], rods[:, 0]))
    angles = np.diff(absolute, prepend=0.0)
    node = add.system.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=[0.0] * n,
            initialCoordinates=list(angles),
            initialCoordinates_t=[0.0] * n,
            numberOfODE2Coordinates=n,
        )
    )
    vectors = [[0.0, 0.0, 0.0]] + [[length, 0.0, 0.0]] * (n - 1)
    add.system.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[exudyn.JointType.RevoluteZ] * n,
            linkParents=list(range(-1, n - 1)),
            jointTransformations=exudyn.Matrix3DList([np.eye(3)] * n),
            jointOffsets=exudyn.Vector3DList(vectors),
            linkInertiasCOM=exudyn.Matrix3DList([np.zeros((3, 3))] * n),
            linkCOMs=exudyn.Vector3DList([[length, 0.0, 0.0]] * n),
            linkMasses=[p["m"]] * n,
            gravity=[0.0, -p["g"], 0.0],
        )
    )
    add.watch(node)


class Exudyn:
    """A case in Exudyn."""

    def __init__(self, case: Case, method: str):
        self.case, self.method = case, method
        self.convert: Callable[[Array], Array] = lambda states: states
        self.add = _Assembly()
        if method in _EXPLICIT:
            _tree(case, self.add)
            self.convert = self._from_tree
        elif case.geometry is mechanisms.slider_crank:
            _slider_crank(case, self.add)
            self.convert = _slider_crank_angles
        elif case.geometry is mechanisms.andrews:
            _andrews(case, self.add)
            self.convert = _andrews_angles
        else:
            _chain(case, self.add)
        self.add.system.Assemble()

    def _from_tree(self, states: Array) -> Array:
        turn = np.cumsum(states, axis=1)
        rods = self.case.start.parameters["l"] * np.stack([np.cos(turn), np.sin(turn)], axis=2)
        return rods.cumsum(axis=1).reshape(len(states), -1)

    def at(self, setting: float) -> Callable[[], Any]:
        """Prepare a run at a step size."""
        exudyn, case = self.add.exudyn, self.case
        settings = exudyn.SimulationSettings()
        settings.timeIntegration.endTime = case.t_end
        settings.timeIntegration.numberOfSteps = round(case.t_end / setting)
        settings.timeIntegration.automaticStepSize = False
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.newton.relativeTolerance = 1e-10
        settings.timeIntegration.newton.absoluteTolerance = 1e-12
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = case.t_end / (SAMPLES - 1)
        settings.linearSolverType = exudyn.LinearSolverType.EigenSparse
        if case.bodies <= 5:
            settings.linearSolverType = exudyn.LinearSolverType.EXUdense
        solver = getattr(exudyn.DynamicSolverType, self.method)
        return lambda: self.add.system.SolveDynamic(settings, solverType=solver, showHints=False)

    def positions(self, result: Any) -> Array:
        """Return q from what the sensors stored."""
        stored = [self.add.system.GetSensorStoredData(sensor) for sensor in self.add.sensors]
        return self.convert(np.column_stack([data[:, 1:] for data in stored]))


def _steps(case: Case, explicit: bool) -> tuple[float, ...]:
    factors = (1, 2, 4, 8, 16) if explicit else (20, 80, 320, 1280, 5120)
    return tuple(case.t_end / (SAMPLES - 1) / k for k in factors)


def _unfit_for_tree(case: Case) -> str:
    if case.geometry not in (mechanisms.pendulum, mechanisms.chain):
        return "not an open chain of rods"
    return "its mass matrix is full" if case.bodies > 20 else ""


_EXPLICIT = {"RK67": "kinematic tree, RK67"}
_IMPLICIT = {"GeneralizedAlpha": "generalized-α", "TrapezoidalIndex2": "trapezoidal, index 2"}


def _method(name: str, title: str) -> Method:
    return Method(
        "Exudyn",
        title,
        lambda case: Exudyn(case, name),
        lambda case: _steps(case, name in _EXPLICIT),
        _unfit_for_tree if name in _EXPLICIT else lambda case: "",
        unit="h",
        packages=("exudyn",),
    )


METHODS = tuple(_method(name, title) for name, title in (_IMPLICIT | _EXPLICIT).items())
