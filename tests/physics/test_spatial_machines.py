"""Machines in space: forces and moments of joints balance what each body's acceleration needs.

The Newton-Euler balance is computed from q, q', a and λ with the geometry of each joint, and with
none of lagcli's equations. λ acts on the second body at its point.
"""

from __future__ import annotations

import json
import math
import random
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.model.loader import expand_text

G = np.array([0.3, 0.0, -9.81])
AXES = {"x": np.eye(3), "y": np.roll(np.eye(3), -1, 0), "z": np.roll(np.eye(3), -2, 0)}


def rotated(axis: Any, angle: float) -> np.ndarray:
    """Return a rotation matrix, by Rodrigues' formula."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def rotation_of(e: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of a quaternion of length 1."""
    w, x, y, z = e
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def body_rate(e: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return 2 × the vector part of conj(e)·rate: ω in the body's frame, or its derivative."""
    return 2 * (e[0] * rate[1:] - rate[0] * e[1:] - np.cross(e[1:], rate[1:]))


def basis(axis: str) -> np.ndarray:
    """Return u, v, w as rows, for an axis as it is written in the model."""
    if axis in AXES:
        return AXES[axis]
    u = np.array(json.loads(axis), float)
    u /= np.linalg.norm(u)
    v = np.cross(u, np.eye(3)[int(np.argmin(abs(u)))])
    v /= np.linalg.norm(v)
    return np.array([u, v, np.cross(u, v)])


def listed(vector: Any) -> str:
    return "[" + ", ".join(repr(float(x)) for x in vector) + "]"


Values = dict[str, float]
NO_AXES = (np.eye(3), np.eye(3))


@dataclass
class Joint:
    kind: str
    one: tuple[str, str]
    two: tuple[str, str]
    keys: dict[str, str]
    axes: tuple[np.ndarray, np.ndarray] = field(default=NO_AXES)
    acting: dict[str, dict[str, str]] = field(default_factory=dict)


@dataclass
class Machine:
    """A random machine: its bodies with their poses, and its joints."""

    random: random.Random
    bodies: dict[str, tuple[float, np.ndarray]] = field(default_factory=dict)  # mass, inertia
    poses: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    points: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    drives: dict[str, tuple[str, str]] = field(default_factory=dict)
    initial: list[str] = field(default_factory=list)

    def vector(self, size: float) -> np.ndarray:
        return np.array([self.random.uniform(-size, size) for _ in range(3)])

    def pose(self, body: str) -> tuple[np.ndarray, np.ndarray]:
        return self.poses.get(body, (np.zeros(3), np.eye(3)))

    def point(self, body: str, local: np.ndarray) -> tuple[str, str]:
        points = self.points.setdefault(body, {})
        name = f"P{len(points)}"
        points[name] = local
        return body, name

    def text(self) -> str:
        lines = ["dimension: 3", f"gravity: {listed(G)}", "bodies:"]
        for body in ("ground", *self.bodies):
            points = ", ".join(f"{p}: {listed(x)}" for p, x in self.points.get(body, {}).items())
            own = f"points: {{{points}}}"
            if body in self.bodies:
                mass, J = self.bodies[body]
                diagonal = np.array_equal(J, np.diag(np.diag(J)))
                rows = listed(np.diag(J)) if diagonal else f"[{', '.join(map(listed, J))}]"
                own = f"mass: {mass!r}, inertia: {rows}, " + own
            lines.append(f"  {body}: {{{own}}}")
        lines.append("joints:")
        for name, j in self.joints.items():
            ends = (".".join(end).removesuffix(".") for end in (j.one, j.two))
            entries = [f"{j.kind}: [{', '.join(ends)}]"]
            entries += [f"{k}: {v}" for k, v in j.keys.items()]
            for quantity, acting in j.acting.items():
                inside = [f"{k}: {v}" for k, v in acting.items()]
                nested = j.kind == "cylindrical"
                entries += [f"{quantity}: {{{', '.join(inside)}}}"] if nested else inside
            lines.append(f"  {name}: {{{', '.join(entries)}}}")
        for name, (joint, motion) in self.drives.items():
            lines.append(f"  {name}: {{drive: {joint}, {motion}}}")
        lines += ["initial:", *(f"  {x}" for x in self.initial)]
        return "\n".join([*lines, "simulation: {t_end: 0.05, samples: 3, rtol: 1e-10}"]) + "\n"


def machine(seed: int) -> Machine:
    """Return a tree of bodies on random joints, with a loop or not, and a drive or not."""
    r = random.Random(seed)
    m = Machine(r)
    kinds = [
        *("spherical", "revolute", "revolute", "cylindrical", "prismatic", "universal"),
        *("planar", "fixed", "screw"),
    ]
    for k in range(r.randint(2, 5)):
        _add(m, k, r.choice(kinds))
    if r.random() < 0.3:  # a disc on the plane z = 0
        e = rotated([0, 0, 1], r.uniform(-3, 3)) @ rotated([1, 0, 0], r.uniform(-0.7, 0.7))
        sine = math.sqrt(1 - e[2, 1] ** 2)
        m.bodies["disc"] = 2.0, np.diag([0.045, 0.09, 0.045])
        m.poses["disc"] = np.array([3, 0, 0.3 * sine]), e
        m.joints["roll"] = Joint(
            "rolling", ("ground", m.point("ground", np.zeros(3))[1]), ("disc", ""), {}
        )
        m.joints["roll"].keys = {"normal": "z", "axis": "y", "radius": "0.3"}
        m.initial += [
            f"disc.r: {{guess: {listed(m.poses['disc'][0])}}}",
            f"disc.e: {quat_text(e)}",
            f"disc.e': {listed(m.vector(3))}",
        ]
    if r.random() < 0.4:
        one, two = r.sample(["ground", *(b for b in m.bodies if b != "disc")], 2)
        ends = [m.point(b, m.vector(0.3)) for b in (one, two)]
        place = [m.pose(b)[0] + m.pose(b)[1] @ m.points[b][p] for b, p in ends]
        length = float(np.linalg.norm(place[1] - place[0]))
        rigid = all(j.kind in ("fixed",) for j in m.joints.values())
        if length > 0.1 and not rigid and not m.drives:
            m.initial = [x for x in m.initial if "': " not in x or x.startswith("disc")]
            m.joints["loop"] = Joint("rod", ends[0], ends[1], {"length": repr(length)})
    return m


def quat_text(R: np.ndarray) -> str:
    """Return a rotation as the product of three, which it equals within rounding."""
    y = math.asin(max(-1.0, min(1.0, R[0, 2])))
    x, z = math.atan2(-R[1, 2], R[2, 2]), math.atan2(-R[0, 1], R[0, 0])
    return f"rot_x({x!r})*rot_y({y!r})*rot_z({z!r})"


def _add(m: Machine, k: int, kind: str) -> None:
    r = m.random
    parent = r.choice(["ground", *m.bodies])
    child, name = f"b{k}", f"J{k}"
    turn = rotated(m.vector(1), r.uniform(0, 1))
    inertia = np.diag([r.uniform(0.02, 0.03) for _ in range(3)])
    m.bodies[child] = r.uniform(0.5, 3), (turn @ inertia @ turn.T if r.random() < 0.4 else inertia)
    axis = r.choice(["x", "y", "z", listed(m.vector(1)), listed(m.vector(1))])
    second = axis
    if kind in ("revolute", "cylindrical", "planar") and r.random() < 0.4:
        second = r.choice(["x", "y", "z", listed(m.vector(1))])
    A, B = basis(axis), basis(second)
    q, x = r.uniform(-4, 4), r.uniform(-0.3, 0.3)
    relative = A.T @ rotated([1, 0, 0], q) @ B
    offset = x * A[0]
    j = Joint(kind, ("", ""), ("", ""), {"axis": axis if axis == second else f"[{axis}, {second}]"})
    m.joints[name] = j
    j.axes = A, B
    joint_names = {"revolute": ["angle"], "screw": ["angle"], "prismatic": ["position"]}
    joint_names["cylindrical"] = ["angle", "position"]
    if kind in ("prismatic", "fixed"):
        relative = np.eye(3)
    if kind in ("spherical", "fixed", "revolute", "universal"):
        offset = np.zeros(3)
    if kind in ("spherical", "fixed"):
        j.keys, j.axes = {}, NO_AXES
    if kind == "planar":
        offset = r.uniform(-0.3, 0.3) * A[1] + r.uniform(-0.3, 0.3) * A[2]
    if kind == "universal":
        other = listed(np.cross(A[0], m.vector(1)))
        B = basis(other)
        j.axes, j.keys = (A, B), {"axis": f"[{axis}, {other}]"}
        relative = rotated(A[0], r.uniform(-1, 1)) @ rotated(B[0], r.uniform(-1, 1))
    if kind == "screw":
        offset = A[0] * 0.07 * q / math.tau
        j.keys["pitch"] = "0.07"
    if kind == "spherical":
        relative = rotated(m.vector(1), r.uniform(-3, 3))
    ra, Ra = m.pose(parent)
    pa, pb = m.vector(0.3), m.vector(0.3)
    Rb = Ra @ relative
    rb = ra + Ra @ (pa + offset) - Rb @ pb
    m.poses[child] = rb, Rb
    j.one, j.two = m.point(parent, pa), m.point(child, pb)
    quantities = joint_names.get(kind, [])
    used = r.random() < 0.7 or kind == "screw"
    for quantity in quantities if used else ():
        acting = {"damping": repr(r.uniform(0.1, 1))}
        if r.random() < 0.5:
            acting |= {"stiffness": repr(r.uniform(1, 20)), "rest": repr(r.uniform(-1, 1))}
        if r.random() < 0.4:
            acting["armature"] = repr(r.uniform(0.01, 0.1))
        if r.random() < 0.5:
            acting["force" if quantity == "position" else "torque"] = "2*cos(t) - 1"
        j.acting[quantity] = acting
        value, rate = (q if quantity == "angle" else x), r.uniform(-2, 2)
        if r.random() < 0.25 and not m.drives and kind != "cylindrical":
            acting.pop("torque", None)
            acting.pop("force", None)
            m.drives["motor"] = name, f"{quantity}: {value!r} + {rate!r}*t + t^2"
        if name not in [d for d, _ in m.drives.values()]:
            if quantity == "angle":
                m.initial.append(f"{name}.angle: {value!r}")
                m.initial.append(f"{name}.angle': {rate!r}")
            else:
                m.initial.append(f"{name}.position: {{guess: {value!r}}}")
    if not used or kind not in joint_names:
        m.initial.append(f"{child}.r: {{guess: {listed(rb)}}}")
        m.initial.append(f"{child}.e: {{guess: {quat_text(Rb)}}}")
    if kind == "spherical":
        m.initial.append(f"{child}.e': {listed(m.vector(3))}")


def imbalance(m: Machine, run: Any, sample: int) -> float:
    """Return the largest force or moment that is not balanced, relative to the largest of all."""
    names = list(run.coordinates)
    q, v, a = (dict(zip(names, x[sample], strict=True)) for x in (run.q, run.v, run.a))
    lam = dict(zip(run.constraints, run.multipliers[sample], strict=True))
    t = float(run.time[sample])

    def part(values: dict[str, float], name: str, parts: str) -> np.ndarray:
        return np.array([values[f"{name}.{p}"] for p in parts])

    state = {"ground": (np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))}  # r, R, v, ω
    needed = {}
    for body, (mass, J) in m.bodies.items():
        e = part(q, f"{body}.e", "0123")
        R = rotation_of(e)
        omega, alpha = (body_rate(e, part(x, f"{body}.e", "0123")) for x in (v, a))
        state[body] = part(q, f"{body}.r", "xyz"), R, part(v, f"{body}.r", "xyz"), R @ omega
        force = mass * (part(a, f"{body}.r", "xyz") - G)
        needed[body] = force, R @ (J @ alpha + np.cross(omega, J @ omega))
    total = {b: [np.zeros(3), np.zeros(3)] for b in m.bodies}
    sizes = [mass * 9.81 for mass, _ in m.bodies.values()]
    sizes += [max(abs(x).max() for x in pair) for pair in needed.values()]
    worst = 0.0
    for name, j in m.joints.items():
        (r1, R1, v1, w1), (r2, R2, v2, w2) = state[j.one[0]], state[j.two[0]]
        s1, s2 = (
            R @ m.points[b][p] if p else np.zeros(3) for R, (b, p) in ((R1, j.one), (R2, j.two))
        )
        d, at = r2 + s2 - r1 - s1, r2 + s2
        force, moment = np.zeros(3), np.zeros(3)
        motor = lam["motor"] if [x for x, _ in m.drives.values()] == [name] else 0.0
        u, vv, w = (R1 @ x for x in j.axes[0])
        if f"{name}.x" in lam and j.kind != "rolling":
            force = part(lam, name, "xyz")
        for row, direction in (("v", vv), ("w", w), ("h", u)):
            force = force + lam.get(f"{name}.{row}", 0.0) * direction
        for row, direction in (("Mv", vv), ("Mw", w), ("Mu", u)):
            moment = moment + lam.get(f"{name}.{row}", 0.0) * direction
        if j.kind == "planar":
            force = lam[f"{name}.n"] * u
        if j.kind in ("fixed", "prismatic"):
            moment = R1 @ part(lam, f"{name}.M", "xyz")
        if j.kind == "universal":
            moment = lam[f"{name}.M"] * np.cross(u, R2 @ j.axes[1][0])
        if j.kind == "rod":
            force = lam[name] * d / np.linalg.norm(d)
        if j.kind == "rolling":
            axle = R2 @ [0, 1, 0]
            down = axle * axle[2] - [0, 0, 1]
            at = r2 + 0.3 * down / np.linalg.norm(down)
            force = np.array([lam[f"{name}.x"], lam[f"{name}.y"], lam[f"{name}.n"]])
            slip = v2 + np.cross(w2, at - r2)
            worst = max(worst, abs(slip).max() * 1e-3, abs(at[2]))
        for quantity, keys in j.acting.items():
            if quantity == "angle":
                x, y, acceleration = (z[f"{name}.angle"] for z in (q, v, a))
            else:
                x = float(u @ d)
                y = float(u @ (v2 + np.cross(w2, s2) - v1 - np.cross(w1, s1)) + np.cross(w1, u) @ d)
                acceleration = second_derivative(m, j, q, v, a, u, d, x)
            acting = motor - float(keys["damping"]) * y
            acting -= float(keys.get("stiffness", 0)) * (x - float(keys.get("rest", 0)))
            acting -= float(keys.get("armature", 0)) * acceleration
            acting += 2 * math.cos(t) - 1 if {"torque", "force"} & keys.keys() else 0
            if quantity == "position":
                force = force + acting * u
                continue
            carried = lam[f"{name}.Mu"] + lam.get(f"{name}.h", 0.0) * 0.07 / math.tau
            sizes += [abs(acting), abs(carried)]
            worst = max(worst, abs(carried - acting))
            turned = R2 @ j.axes[1][1]
            aligned = math.cos(x) * vv + math.sin(x) * w
            assert turned @ aligned == pytest.approx(1, abs=1e-9)
        sizes += [abs(force).max(), abs(moment).max()]
        for body, sign in ((j.two[0], 1), (j.one[0], -1)):
            if body != "ground":
                total[body][0] = total[body][0] + sign * force
                arm = np.cross(at - state[body][0], force)
                total[body][1] = total[body][1] + sign * (moment + arm)
    for body, pair in needed.items():
        for found, wanted in zip(total[body], pair, strict=True):
            worst = max(worst, abs(found - wanted).max())
    return worst / max(sizes)


def second_derivative(
    m: Machine, j: Joint, q: Values, v: Values, a: Values, u: np.ndarray, d: np.ndarray, x: float
) -> float:
    """Return the second derivative of u·d by central differences along q + v t + a t²/2."""

    def position(t: float) -> float:
        def pose(body: str) -> tuple[np.ndarray, np.ndarray]:
            if body == "ground":
                return np.zeros(3), np.eye(3)
            now = {n: q[n] + v[n] * t + a[n] * t * t / 2 for n in q if n.startswith(f"{body}.")}
            e = np.array([now[f"{body}.e.{k}"] for k in "0123"])
            return np.array([now[f"{body}.r.{k}"] for k in "xyz"]), rotation_of(
                e / np.linalg.norm(e)
            )

        (r1, R1), (r2, R2) = pose(j.one[0]), pose(j.two[0])
        gap = r2 + R2 @ m.points[j.two[0]][j.two[1]] - r1 - R1 @ m.points[j.one[0]][j.one[1]]
        return float(R1 @ j.axes[0][0] @ gap)

    h = 1e-3
    wide, narrow = (
        (position(k * h) - 2 * position(0) + position(-k * h)) / (k * h) ** 2 for k in (2, 1)
    )
    return (4 * narrow - wide) / 3


def check(seed: int) -> None:
    m = machine(seed)
    run = lagcli.simulate(lagcli.load_text(m.text()))
    for sample in range(len(run.time)):
        assert imbalance(m, run, sample) < 1e-8, m.text()


@pytest.mark.parametrize("seed", range(6))
def test_forces_of_random_machines_in_space_balance(seed: int) -> None:
    check(seed)


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(100, 400))
def test_forces_of_many_random_machines_in_space_balance(seed: int) -> None:
    check(seed)


def test_a_wrong_sign_is_noticed() -> None:
    m = machine(0)
    run = lagcli.simulate(lagcli.load_text(m.text()))
    run.multipliers[...] *= -1
    assert imbalance(m, run, 0) > 1e-3


@pytest.mark.parametrize("seed", range(2))
def test_the_expanded_file_gives_the_same_numbers(seed: int) -> None:
    text = machine(seed).text()
    one, two = (lagcli.simulate(lagcli.load_text(x)) for x in (text, expand_text(text)))
    for name in ("q", "v", "a", "multipliers"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
