"""Mechanisms in one model that do not touch: each moves and comes to rest as it does alone."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from random_cases import seeds

import lagcli
from lagcli.trajectory.event_log import EventLog
from lagcli.trajectory.trajectory import Trajectory

LAWS = ("poisson", "newton", "sequential")
G = 9.81


class Mechanism(NamedTuple):
    """A part of a model, with its own coordinates and constraints."""

    coordinates: str
    kinetic: str
    potential: str
    constraints: str
    initial: str


def contact(rng: random.Random, name: str, gap: str, slip: str, e: float) -> str:
    """Return a contact with a coefficient of restitution, with or without friction."""
    friction = f", friction: {rng.uniform(0.1, 0.9)!r}, slip: {slip}" if rng.random() < 0.7 else ""
    return f"  {name}: {{expr: {gap} >= 0, restitution: {e!r}{friction}}}\n"


def ball(rng: random.Random, k: int) -> Mechanism:
    """A ball that bounces and slides, or lies, on the floor."""
    floor = contact(rng, f"a{k}", f"y{k}", f"x{k}'", rng.choice([0.0, 0.3, 0.6]))
    y, v = rng.choice([0.0, rng.uniform(0.1, 1)]), rng.uniform(-3, 3)
    initial = f"x{k}: 0, y{k}: {y!r}, x{k}': {v!r}, y{k}': 0"
    return Mechanism(f"x{k}, y{k}", f"(x{k}'^2 + y{k}'^2)/2", f"{G}*y{k}", floor, initial)


def dragging(rng: random.Random, k: int) -> Mechanism:
    """A ball that drags a block along, which slides with friction of a constant limit."""
    rows = f"  a{k}: {{expr: y{k} >= 0, restitution: {rng.choice([0, 0.5])}}}\n"
    rows += f"  b{k}: {{expr: x{k}' = 0, limit: {rng.uniform(1, 4)!r}}}\n"
    kinetic = f"(x{k}'^2 + y{k}'^2)/2 + {rng.uniform(-0.8, 0.8)!r}*x{k}'*y{k}'"
    y, v = rng.uniform(0.1, 1), rng.uniform(-9, 9)
    initial = f"x{k}: 0, y{k}: {y!r}, x{k}': {v!r}, y{k}': 0"
    return Mechanism(f"x{k}, y{k}", kinetic, f"{G}*y{k}", rows, initial)


def box(rng: random.Random, k: int) -> Mechanism:
    """A box on two corners."""
    w, h, tilt = rng.uniform(0.1, 0.4), rng.uniform(0.2, 0.4), rng.uniform(-0.3, 0.3)
    rows = ""
    for name, side in (("a", -w), ("b", w)):
        gap = f"y{k} + {side!r}*sin(p{k}) - {h!r}*cos(p{k})"
        slip = f"x{k}' + ({h!r}*cos(p{k}) - {side!r}*sin(p{k}))*p{k}'"
        rows += contact(rng, f"{name}{k}", gap, slip, rng.choice([0.0, 0.3]))
    kinetic = f"(x{k}'^2 + y{k}'^2)/2 + {(w * w + h * h) / 6!r}*p{k}'^2"
    y = w * abs(math.sin(tilt)) + h * math.cos(tilt) + rng.choice([0.0, rng.uniform(0, 0.3)])
    initial = f"x{k}: 0, y{k}: {y!r}, p{k}: {tilt!r}"
    initial += f", x{k}': {rng.uniform(-1, 1)!r}, y{k}': 0, p{k}': 0"
    return Mechanism(f"x{k}, y{k}, p{k}", kinetic, f"{G}*y{k}", rows, initial)


def groove(rng: random.Random, k: int) -> Mechanism:
    """A ball between two slopes."""
    rows = ""
    for name, side in (("a", 1), ("b", -1)):
        slope = rng.uniform(0.3, 1.2)
        c, s = math.cos(slope), side * math.sin(slope)
        gap, slip = f"{c!r}*y{k} + {s!r}*x{k}", f"{c!r}*x{k}' - {s!r}*y{k}'"
        rows += contact(rng, f"{name}{k}", gap, slip, rng.choice([0.0, 0.4, 0.6]))
    initial = f"x{k}: 0, y{k}: {rng.uniform(0.1, 1)!r}, x{k}': {rng.uniform(-1, 1)!r}, y{k}': 0"
    return Mechanism(f"x{k}, y{k}", f"(x{k}'^2 + y{k}'^2)/2", f"{G}*y{k}", rows, initial)


KINDS: tuple[Callable[[random.Random, int], Mechanism], ...] = (ball, dragging, box, groove)


def simulate(mechanisms: list[Mechanism], law: str) -> tuple[Trajectory, EventLog]:
    coordinates, kinetic, potential, constraints, initial = zip(*mechanisms, strict=True)
    run = lagcli.simulate(
        lagcli.load_text(
            f"coordinates: [{', '.join(coordinates)}]\n"
            f"T: {' + '.join(kinetic)}\nV: {' + '.join(potential)}\n"
            f"constraints:\n{''.join(constraints)}initial: {{{', '.join(initial)}}}\n"
            f"simulation: {{t_end: 3, samples: 4, rtol: 1e-11, impacts: {law}}}\n"
        )
    )
    assert run.status == "completed"
    assert run.events is not None
    return run, run.events


@pytest.mark.parametrize("seed", seeds(5, 16))
def test_each_moves_as_it_does_alone(seed: int) -> None:
    """Which includes that an impact of one is none of the others."""
    rng = random.Random(seed)
    law = rng.choice(LAWS)
    mechanisms = [rng.choice(KINDS)(rng, k) for k in range(3)]
    run, log = simulate(mechanisms, law)
    for mechanism in mechanisms:
        alone, expected = simulate([mechanism], law)
        for name, kind in set(zip(expected.names, expected.kinds, strict=True)):
            found, times = log.instants(name, kind), expected.instants(name, kind)
            if kind != "impact":
                assert len(found) == len(times), (name, kind)
            # the number of impacts that are resolved before a rest depends on the steps
            n = min(len(found), len(times), 8)
            # integration errors, which impacts of boxes make some 100 times as large
            np.testing.assert_allclose(found[:n], times[:n], rtol=0, atol=1e-8, err_msg=name)
        places = [run.coordinates.index(name) for name in alone.coordinates]
        np.testing.assert_allclose(run.q[:, places], alone.q, rtol=0, atol=1e-7)
        np.testing.assert_allclose(run.v[-1, places], alone.v[-1], rtol=0, atol=1e-7)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("slope", [0.1, 0.3, 0.6, 0.9])
def test_a_stop_across_an_incline_does_not_strike_the_incline(slope: float, law: str) -> None:
    """Their normals are at a right angle, but for rounding."""
    c, s = math.cos(slope), math.sin(slope)
    model = lagcli.load_text(
        "coordinates: [x, y]\nparameters: {n: 0}\nT: (x'^2 + y'^2)/2\n"
        f"V: {G}*y\noutputs: {{count: n}}\nconstraints:\n"
        f"  incline: {{expr: '{c!r}*y - {s!r}*x >= 0'}}\n"
        f"  stop: {{expr: '{c!r}*x + {s!r}*y >= 0', restitution: 0.5}}\n"
        "events: {strikes: {when: incline impacts, set: {n: n + 1}}}\n"
        f"initial: {{x: {0.1 * c!r}, y: {0.1 * s!r}, x': 0, y': 0}}\n"
    )
    run = lagcli.simulate(model, t_end=2.0, impacts=law)  # type: ignore[arg-type]
    assert run.events is not None
    times = run.events.instants("stop", "impact")
    assert times[:2] == pytest.approx(np.array([1, 2]) * math.sqrt(0.2 / G / s), rel=1e-9)
    assert len(run.events.instants("incline", "impact")) == 0
    assert run.outputs["count"][-1] == 0
