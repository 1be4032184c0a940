"""Momenta that vanish on the constraints are omitted, and no others."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from contextlib import nullcontext

import numpy as np
import pytest
from random_cases import FUZZ_COUNT

from lagcli.analysis.check.check import check
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.constraints.random_states import random_walk
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.symmetry.conserved import ConservedQuantity, named_quantities
from lagcli.equations.symmetry.linear import monitored_symmetries
from lagcli.model.loader import load_text
from lagcli.simulations.momenta import distinct
from lagcli.simulations.simulation import prepare

COUNT = FUZZ_COUNT // 3


class Mechanism:
    """A random system of parts with known momenta; the constraints fix some parts nonlinearly.

    A ``wheel`` is a point on a circle. A ``pinned`` part has coordinates u, w with u c = w s and
    u s = −w c, which is u = w = 0 for c² + s² = 1; its rotation vanishes, and is no linear
    combination of the constraints. A ``twin`` is held to a wheel by products of coordinates, so
    that only their common momentum is conserved. A ``slider`` is free along one direction.
    """

    def __init__(self, seed: int):
        draw = random.Random(seed)
        kinds = draw.choices(["wheel", "pinned", "twin"], k=draw.randint(2, 3))
        kinds += draw.choices(["slider", "wheel"])  # two free directions would have a rotation
        self.names: list[str] = []
        self.momenta: list[dict[str, str]] = []  # fields of the conserved momenta
        constraints: list[str] = []
        radius = {n: draw.choice([0.5, 1.0, 2.0]) for n in range(len(kinds))}
        wheels = [n for n, kind in enumerate(kinds) if kind in ("wheel", "pinned")]
        if not wheels:
            kinds.append("wheel")
            radius[len(kinds) - 1] = 1.0
            wheels = [len(kinds) - 1]
        held: dict[int, list[int]] = {n: [] for n in wheels}
        for n, kind in enumerate(kinds):
            if kind == "twin":
                held[draw.choice(wheels)].append(n)
        self.parts = []
        for n in wheels:
            field = {f"c{n}": f"-s{n}", f"s{n}": f"c{n}"}
            constraints.append(f"circle{n}: c{n}^2 + s{n}^2 = {radius[n] ** 2}")
            members = [f"c{n}", f"s{n}"]
            for k in held[n]:
                constraints.append(f"along{k}: c{n}*s{k} - s{n}*c{k} = 0")
                constraints.append(f"length{k}: c{n}*c{k} + s{n}*s{k} = {radius[n] * radius[k]}")
                members += [f"c{k}", f"s{k}"]
                field |= {f"c{k}": f"-s{k}", f"s{k}": f"c{k}"}
            if kinds[n] == "pinned":
                constraints.append(f"a{n}: u{n}*c{n} - w{n}*s{n} = 0")
                constraints.append(f"b{n}: u{n}*s{n} + w{n}*c{n} = 0")
                members += [f"u{n}", f"w{n}"]
            self.parts.append((n, held[n], kinds[n], members))
            self.momenta.append(field)
        for n, kind in enumerate(kinds):
            if kind == "slider":
                self.parts.append((n, [], kind, [f"x{n}"]))
                self.momenta.append({f"x{n}": "1"})
        self.names = [name for *_, members in self.parts for name in members]
        draw.shuffle(constraints)
        mass = {name: draw.choice([1, 2, 3]) for name in self.names}
        for name in self.names:  # c and s, u and w have one mass, else rotations change T
            partner = {"s": "c", "w": "u"}.get(name[0])
            mass[name] = mass[partner + name[1:]] if partner else mass[name]
        kinetic = " + ".join(f"{mass[n]}/2*{n}'^2" for n in self.names)
        self.mass, self.radius = mass, radius
        start = dict(zip(self.names, self.state(draw)[0], strict=True))
        self.text = "\n".join(
            [
                f"coordinates: [{', '.join(self.names)}]",
                f"T: {kinetic}",
                "constraints:",
                *(f"  {c}" for c in constraints),
                "initial:",
                *(f"  {n}: {{guess: {x!r}}}" for n, x in start.items()),
                *(f"  {n}': {{guess: {draw.uniform(-1, 1)!r}}}" for n in self.names),
            ]
        )

    def state(self, draw: random.Random) -> tuple[list[float], list[float]]:
        """Return a consistent state, in closed form."""
        q, v = [], []
        for n, held, kind, _ in self.parts:
            angle, rate = draw.uniform(0, 6), draw.uniform(-1, 1)
            if kind == "slider":
                q.append(angle)
                v.append(rate)
                continue
            for k in (n, *held):
                c, s = self.radius[k] * math.cos(angle), self.radius[k] * math.sin(angle)
                q += [c, s]
                v += [-rate * s, rate * c]
            if kind == "pinned":
                q += [0.0, 0.0]
                v += [0.0, 0.0]
        return q, v


def monitored_quantities(equations: Equations) -> tuple[ConservedQuantity, ...]:
    """Return the quantities that a run may monitor."""
    return named_quantities(equations, monitored_symmetries(equations))


def assert_distinct(seed: int) -> int:
    """Compare the momenta of a mechanism with the known ones; return the number of the latter."""
    mechanism = Mechanism(seed)
    model = load_text(mechanism.text)
    checked = check(model)
    shown = [q for q in checked.conserved.quantities if q.kind == "momentum"]
    assert len(shown) == len(mechanism.momenta), mechanism.text
    # before a run, the search is cut short in larger models
    found = [q.name for q in monitored_quantities(checked.equations)]
    monitored = [q.name for q in shown if q.name in found]
    assert list(prepare(model).monitor.names) == monitored, mechanism.text
    symbols = [*checked.equations.q, *checked.equations.v]
    draw, rows, known = random.Random(seed + 1), [], []
    for _ in range(24):
        q, v = mechanism.state(draw)
        place = dict(zip(symbols, [*q, *v], strict=True))
        rows.append([float(x.expression.xreplace(place)) for x in shown])
        at = dict(zip(mechanism.names, zip(q, v, strict=True), strict=True))
        known.append(
            [
                sum(mechanism.mass[n] * at[n][1] * _value(text, at) for n, text in field.items())
                for field in mechanism.momenta
            ]
        )
    matrix = np.column_stack([np.array(rows), np.ones(len(rows))])
    assert np.linalg.matrix_rank(matrix, tol=1e-9) == len(shown) + 1  # none vanishes or repeats
    fitted, *_ = np.linalg.lstsq(matrix, np.array(known), rcond=None)
    assert np.abs(matrix @ fitted - known).max() < 1e-9  # none is missing
    return len(shown)


def _value(text: str, at: dict[str, tuple[float, float]]) -> float:
    name = text.removeprefix("-")
    return 1.0 if name == "1" else (-1 if text != name else 1) * at[name][0]


#: At its start, above the origin, the rotation about the vertical axis vanishes.
SPHERICAL = """
coordinates: [x, y, z]
T: (x'^2 + y'^2 + z'^2)/2
V: 9.81*z
constraints: {rod: x^2 + y^2 + z^2 = 1}
initial: {x: 0, y: 0, z: {guess: 1}, x': 1, y': 0.3, z': {guess: 0}}
"""


def test_a_field_that_vanishes_at_the_start_alone_is_kept() -> None:
    model = load_text(SPHERICAL)
    assert len(prepare(model).monitor.names) == 1
    assert [q.kind for q in check(model).conserved.quantities] == ["momentum", "energy"]


def test_states_are_drawn_only_where_the_start_does_not_tell() -> None:
    def refuse() -> list[ConsistentState]:
        raise AssertionError

    for start, drawn in (("x: 0.6, y: 0", False), ("x: 0, y: 0", True)):
        simulation = prepare(load_text(SPHERICAL.replace("x: 0, y: 0", start)))
        equations = simulation.equations
        quantities = monitored_quantities(equations)
        with pytest.raises(AssertionError) if drawn else nullcontext():
            kept = distinct(equations, simulation.system, simulation.start, refuse, quantities)
            assert kept == quantities


def test_no_more_states_are_drawn_than_tell() -> None:
    """At the first state beside the start above the origin, the rotation does not vanish."""
    simulation = prepare(load_text(SPHERICAL))
    equations, system, start = simulation.equations, simulation.system, simulation.start
    drawn: list[ConsistentState] = []

    def states() -> Iterator[ConsistentState]:
        for state in random_walk(system, start):
            drawn.append(state)
            yield state

    quantities = monitored_quantities(equations)
    assert distinct(equations, system, start, states, quantities) == quantities
    assert len(drawn) == 1


@pytest.mark.parametrize("size", [20, 21])
def test_nothing_is_omitted_from_a_large_model_by_its_start_alone(size: int) -> None:
    """More than 60 coordinates have no random states; a chain that hangs down can rotate."""
    text = f"""
coordinates: [x[1..N], y[1..N], z[1..N]]
parameters: {{N: {size}}}
definitions: {{x[0]: 0, y[0]: 0, z[0]: 0}}
T: sum((x[i]'^2 + y[i]'^2 + z[i]'^2)/2, i = 1..N)
V: sum(9.81*z[i], i = 1..N)
constraints: {{rod[i = 1..N]: (x[i] - x[i-1])^2 + (y[i] - y[i-1])^2 + (z[i] - z[i-1])^2 = 1}}
initial: {{x[1..N]: 0, y[1..N]: 0, z[i = 1..N]: -i, x[1..N]': 0, y[1..N]': 0, z[1..N]': 0}}
"""
    assert [q.kind for q in check(load_text(text)).conserved.quantities] == ["momentum", "energy"]


def test_momenta_that_vanish_or_repeat_are_omitted() -> None:
    assert sum(assert_distinct(seed) for seed in range(4)) > 6


@pytest.mark.fuzz
def test_momenta_of_many_mechanisms() -> None:
    for seed in range(4, 4 + COUNT):
        assert_distinct(seed)
