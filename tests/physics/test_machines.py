"""Machines: forces and moments of joints balance what each body's acceleration needs.

The balance is computed from q, q', a and λ with the geometry of each joint, and with none of
lagcli's equations: λ is a force on the second body at its point, or a moment.
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

G = np.array([0.0, -9.81])


def turn(angle: float, vector: Any) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]]) @ np.asarray(vector, float)


def cross(one: np.ndarray, two: np.ndarray) -> float:
    return float(one[0] * two[1] - one[1] * two[0])


@dataclass
class Machine:
    """A random machine: its bodies with their poses, the text of its file, and its joints."""

    random: random.Random
    bodies: dict[str, tuple[float, float]] = field(default_factory=dict)  # mass, inertia
    poses: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    points: dict[str, dict[str, tuple[float, float]]] = field(default_factory=dict)
    joints: dict[str, tuple[str, Any, Any, dict[str, Any]]] = field(default_factory=dict)
    forces: dict[str, tuple[str, Any, Any, dict[str, Any]]] = field(default_factory=dict)
    fixed: dict[str, float] = field(default_factory=dict)

    def body(self, x: float, y: float, angle: float) -> str:
        name = f"b{len(self.bodies)}"
        self.bodies[name] = self.random.uniform(0.5, 3), self.random.uniform(0.01, 0.1)
        self.poses[name] = float(x), float(y), angle
        return name

    def point(self, body: str, place: np.ndarray) -> tuple[str, str]:
        """Return a new point of a body, at a place in the fixed frame."""
        x, y, angle = self.poses.get(body, (0, 0, 0))
        local = turn(-angle, place - np.array([x, y]))
        points = self.points.setdefault(body, {})
        name = f"P{len(points)}"
        points[name] = float(local[0]), float(local[1])
        return body, name

    def text(self) -> str:
        lines = ["gravity: [0, -9.81]", "bodies:"]
        for body in ("ground", *self.bodies):
            points = ", ".join(
                f"{p}: [{x!r}, {y!r}]" for p, (x, y) in self.points.get(body, {}).items()
            )
            own = f"points: {{{points}}}"
            if body in self.bodies:
                own = "mass: {!r}, inertia: {!r}, ".format(*self.bodies[body]) + own
            lines.append(f"  {body}: {{{own}}}")
        for block, entries in (("joints", self.joints), ("forces", self.forces)):
            lines += [f"{block}:"] if entries else []
            for name, (kind, one, two, keys) in entries.items():
                if kind == "drive":
                    lines.append(f"  {name}: {{drive: {one}, {two}: {keys['motion']}}}")
                    continue
                values = "".join(f", {k}={v}" for k, v in keys.items())
                lines.append(f"  {name}: {kind}({'.'.join(one)}, {'.'.join(two)}{values})")
        lines.append("initial:")
        for body, pose in self.poses.items():
            for coordinate, value in zip(("x", "y", "phi"), pose, strict=True):
                lines.append(f"  {body}.{coordinate}: {{guess: {value!r}}}")
        lines += [f"  {name}: {{guess: {value!r}}}" for name, value in self.fixed.items()]
        return "\n".join([*lines, "simulation: {t_end: 0.05, samples: 3, rtol: 1e-10}"]) + "\n"


def machine(seed: int) -> Machine:
    """Return a tree of bodies on random joints, with loops, springs, dampers and a drive."""
    r = random.Random(seed)
    m = Machine(r)
    count = r.randint(2, 6)
    for k in range(count):
        parent = r.choice(["ground", *m.bodies])
        x, y, _ = m.poses.get(parent, (0, 0, 0))
        at = np.array([x + r.uniform(-0.4, 0.4), y + r.uniform(-0.4, 0.4)])
        kind = r.choice(["revolute", "revolute", "prismatic", "slot", "rod", "revolute"])
        angle = r.uniform(-3, 3)
        before = m.poses.get(parent, (0, 0, 0))[2]
        keys: dict[str, Any] = {}
        arm = turn(r.uniform(-3, 3), [r.uniform(0.1, 0.4), 0])
        body = m.body(*(at + arm), angle)
        two = at
        if kind in ("prismatic", "slot"):
            way = r.uniform(-3, 3)
            keys["along"] = r.choice([f"{way!r}", f"[{math.cos(way)!r}, {2 * math.sin(way)!r}]"])
            if keys["along"][0] == "[":
                way = math.atan2(2 * math.sin(way), math.cos(way))
            two = at + turn(before + way, [r.uniform(-0.2, 0.2), 0])
            if kind == "prismatic":
                keys["angle"] = repr(angle - before)
        if kind == "rod":
            two = at + turn(r.uniform(-3, 3), [0.3, 0])
            keys["length"] = repr(float(np.hypot(*(two - at))))
        elif r.random() < 0.5:
            keys["damping"] = repr(r.uniform(0.1, 1))
            if r.random() < 0.5:
                keys |= {"stiffness": repr(r.uniform(1, 20)), "rest": repr(r.uniform(-1, 1))}
            if r.random() < 0.5:
                keys["force" if kind in ("prismatic", "slot") else "torque"] = "2*cos(t) - 1"
        m.joints[f"J{k}"] = (kind, m.point(parent, at), m.point(body, two), keys)
    if r.random() < 0.5:  # a loop
        one, two = r.sample(["ground", *m.bodies], 2)
        aside = np.array([0.05, 0.02])
        place = [aside + m.poses.get(b, (0, 0, 0))[:2] for b in (one, two)]
        length = float(np.hypot(*(place[1] - place[0])))
        if length > 0.05:
            ends = (m.point(one, place[0]), m.point(two, place[1]))
            m.joints["loop"] = ("rod", *ends, {"length": repr(length)})
    one, two = r.sample(["ground", *m.bodies], 2)
    ends = (m.point(one, np.array([0.7, 0.3])), m.point(two, np.array([-0.5, 0.4])))
    m.forces["s"] = ("spring", *ends, {"stiffness": "30", "length": "0.4", "damping": "2"})
    return m


def imbalance(m: Machine, run: Any, sample: int) -> float:
    """Return the largest force or moment that is not balanced, relative to the largest of all."""
    names, rows = list(run.coordinates), list(run.constraints)
    q, v, a, lam = (x[sample] for x in (run.q, run.v, run.a, run.multipliers))
    value = dict(zip(names, q, strict=True))
    rate = dict(zip(names, v, strict=True))
    acceleration = dict(zip(names, a, strict=True))
    force_of = dict(zip(rows, lam, strict=True))
    t = float(run.time[sample])

    def pose(body: str) -> tuple[np.ndarray, float, np.ndarray, float]:
        if body == "ground":
            return np.zeros(2), 0.0, np.zeros(2), 0.0
        x, y, phi = (f"{body}.{c}" for c in ("x", "y", "phi"))
        place, speed = np.array([value[x], value[y]]), np.array([rate[x], rate[y]])
        return place, value[phi], speed, rate[phi]

    def at(end: tuple[str, str]) -> tuple[np.ndarray, np.ndarray]:
        place, phi, speed, omega = pose(end[0])
        arm = turn(phi, m.points[end[0]][end[1]])
        return place + arm, speed + omega * np.array([-arm[1], arm[0]])

    total = {b: np.zeros(3) for b in m.bodies}
    largest = 0.0

    def act(body: str, force: np.ndarray, place: np.ndarray, moment: float = 0.0) -> None:
        nonlocal largest
        largest = max(largest, float(np.abs(force).max()), abs(moment))
        if body != "ground":
            arm = place - pose(body)[0]
            total[body] += [*force, cross(arm, force) + moment]

    for name, (kind, one, two, keys) in m.joints.items():
        if kind in ("drive", "gear", "rack", "belt"):
            continue
        (p, vp), (r, vr) = at(one), at(two)
        frame, omega = pose(one[0])[1], pose(one[0])[3]
        force, moment = np.zeros(2), 0.0
        driving = force_of.get("motor", 0.0) if m.joints.get("motor", ("", ""))[1] == name else 0.0
        if kind == "revolute":
            force = np.array([force_of[f"{name}.x"], force_of[f"{name}.y"]])
            moment += driving
        elif kind == "rod":
            force = force_of[name] * (r - p) / np.hypot(*(r - p))
        else:
            text = keys["along"]
            way = float(text) if text[0] != "[" else math.atan2(*json.loads(text)[::-1])
            along, normal = turn(frame + way, [1, 0]), turn(frame + way, [0, 1])
            force = force_of[f"{name}.n"] * normal + driving * along
            moment = force_of.get(f"{name}.M", 0.0)
        if kind == "revolute":
            x, y = pose(two[0])[1] - frame, pose(two[0])[3] - omega
        elif kind != "rod":
            x = float(along @ (r - p))
            y = float(along @ (vr - vp) + omega * normal @ (r - p))
        if kind != "rod":
            acting = -float(keys.get("damping", 0)) * y
            acting -= float(keys.get("stiffness", 0)) * (x - float(keys.get("rest", 0)))
            acting += 2 * math.cos(t) - 1 if {"torque", "force"} & keys.keys() else 0
            if kind == "revolute":
                moment += acting
            else:
                force = force + acting * along
        act(two[0], force, r, moment)
        act(one[0], -force, r, -moment)
    for _, one, two, keys in m.forces.values():
        (p, vp), (r, vr) = at(one), at(two)
        length = float(np.hypot(*(r - p)))
        e = (r - p) / length
        tension = float(keys["stiffness"]) * (length - float(keys["length"]))
        tension += float(keys["damping"]) * float(e @ (vr - vp))
        act(two[0], -tension * e, r)
        act(one[0], tension * e, p)
    worst = 0.0
    for body, (mass, inertia) in m.bodies.items():
        needed = [*(mass * (np.array([acceleration[f"{body}.x"], acceleration[f"{body}.y"]]) - G))]
        needed.append(inertia * acceleration[f"{body}.phi"])
        largest = max(largest, *np.abs(needed))
        worst = max(worst, *np.abs(total[body] - needed))
    return worst / largest


def check(seed: int) -> None:
    m = machine(seed)
    run = lagcli.simulate(lagcli.load_text(m.text()))
    for sample in range(len(run.time)):
        assert imbalance(m, run, sample) < 1e-9, m.text()


@pytest.mark.parametrize("seed", range(6))
def test_forces_of_random_machines_balance(seed: int) -> None:
    check(seed)


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(100, 400))
def test_forces_of_many_random_machines_balance(seed: int) -> None:
    check(seed)


def test_a_wrong_sign_is_noticed() -> None:
    m = machine(0)
    run = lagcli.simulate(lagcli.load_text(m.text()))
    run.multipliers[...] *= -1
    assert imbalance(m, run, 0) > 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_the_expanded_file_gives_the_same_numbers(seed: int) -> None:
    text = machine(seed).text()
    one, two = (lagcli.simulate(lagcli.load_text(x)) for x in (text, expand_text(text)))
    for name in ("q", "v", "a", "multipliers"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
