"""The core's search for consistent states, on constraints whose nearest states are known."""

from __future__ import annotations

import numpy as np
import pytest
from lowered import lowered

import lagcli
from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.initial import programs_of_search
from lagcli.engine.core.start_search import CoreSearch
from lagcli.engine.core.status import StartStatus
from lagcli.engine.system import System

NQ, NC = 5, 3


def linear_text(mass: Array, rows: Array, right: Array, kind: str) -> str:
    """Return a model with M and rows of B that are constant; of positions, or of velocities."""
    names = [f"x{i}" for i in range(NQ)]
    kinetic = " + ".join(
        f"({float(mass[i, j])!r})*{a}'*{b}'/2"
        for i, a in enumerate(names)
        for j, b in enumerate(names)
    )
    sides = []
    for row, value in zip(rows, right, strict=True):
        prime = "'" if kind == "velocity" else ""
        terms = [f"({float(x)!r})*{name}{prime}" for x, name in zip(row, names, strict=True)]
        sides.append(f"{' + '.join(terms)} = {float(value)!r}")
    initial = ", ".join(f"{name}{p}: {{guess: 0}}" for name in names for p in ("", "'"))
    constraints = ", ".join(f'c{i}: "{side}"' for i, side in enumerate(sides))
    return f"""
coordinates: [{", ".join(names)}]
T: "{kinetic}"
constraints: {{{constraints}}}
initial: {{{initial}}}
"""


def least_change(mass: Array, rows: Array, gap: Array, free: Flags) -> Array:
    """Return the δ of free entries with rows δ = gap of least δᵀ M δ, by its Lagrangian."""
    part, own = rows[:, free], mass[np.ix_(free, free)]
    compliance = np.linalg.inv(own) @ part.T
    change = np.zeros(len(free))
    change[free] = compliance @ np.linalg.lstsq(part @ compliance, gap, rcond=1e-12)[0]
    return change


def search_of(text: str) -> tuple[System, Array, CoreSearch]:
    system, p = lowered(lagcli.load_text(text))
    return system, np.array([p], dtype=float), CoreSearch(system, *programs_of_search(system))


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_linear_constraints_are_met_by_the_least_change(kind: str) -> None:
    """Light and heavy parts, fixed entries, redundant rows, and rows that do not hold."""
    rng = np.random.default_rng(len(kind))
    for trial in range(40):
        root = rng.normal(size=(NQ, NQ)) * 10 ** rng.uniform(-2, 2, (NQ, 1))
        mass = root @ root.T + 1e-3 * np.diag(np.diag(root @ root.T))
        rows = rng.normal(size=(NC, NQ))
        solution = rng.normal(size=NQ)
        if trial % 3 == 0:
            rows[2] = rows[0] - 2.0 * rows[1]
        right = rows @ solution
        _, p, search = search_of(linear_text(mass, rows, right, kind))
        held = [0, 1, 2] if trial % 2 else [0, 2]
        fixed = rng.random(NQ) < 0.3
        fixed[rng.choice(NQ, 3, replace=False)] = False
        start = rng.normal(size=NQ)
        q, v = (start, np.zeros(NQ)) if kind == "position" else (np.zeros(NQ), start)
        find = search.positions if kind == "position" else search.velocities
        found, moved = find(0.0, p, held, fixed, q[None], v[None])
        assert StartStatus(found[0]) == StartStatus.FOUND, trial
        change = least_change(mass, rows[held], (right - rows @ start)[held], ~fixed)
        size = np.abs(start).max() + np.abs(change).max()
        np.testing.assert_allclose(moved[0], start + change, rtol=0, atol=1e-9 * size)
        np.testing.assert_array_equal(moved[0][fixed], start[fixed])


RING = """
coordinates: [x, y]
parameters: {l: 1}
T: (x'^2 + y'^2)/2
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: 1, y: 0, x': 0, y': {guess: 0}}
"""


def test_rows_are_searched_for_one_by_one() -> None:
    """The point of a circle that is nearest to another, and its velocity along the circle."""
    _, _, search = search_of(RING)
    rng = np.random.default_rng(3)
    q, v, l = rng.normal(size=(300, 2)), rng.normal(size=(300, 2)), rng.uniform(0.1, 9, (300, 1))
    free = np.zeros(2, dtype=bool)
    found, moved = search.positions(0.0, l, [0], free, q, v)
    assert (found == StartStatus.FOUND).all()
    radial = q / np.linalg.norm(q, axis=1)[:, None]
    np.testing.assert_allclose(moved, l * radial, rtol=1e-14)
    found, rates = search.velocities(0.0, l, [0], free, moved, v)
    assert (found == StartStatus.FOUND).all()
    along = v - (v * radial).sum(axis=1)[:, None] * radial
    np.testing.assert_allclose(rates, along, rtol=0, atol=1e-14)
    for i in range(0, 300, 29):  # no row depends on another
        one = slice(i, i + 1)
        alone = search.positions(0.0, l[one], [0], free, q[one], v[one])[1]
        np.testing.assert_array_equal(alone[0], moved[i])


def test_what_cannot_be_met_is_left_nearest_to_it() -> None:
    _, p, search = search_of(RING)
    fixed, at = np.array([True, False]), np.array([[3.0, 0.5]])
    found, moved = search.positions(0.0, p, [0], fixed, at, 0 * at)
    assert found[0] == StartStatus.CONTRADICTED
    assert moved[0].tolist() == pytest.approx([3.0, 0.0], abs=1e-6)
    found, moved = search.positions(0.0, p, [0], fixed, np.array([[np.nan, 1.0]]), 0 * at)
    assert found[0] == StartStatus.UNDEFINED
    # the scale of l² - x² - y² at the guess, of which a hundred-thousandth counts at least
    search.positions(0.0, p, [0], ~fixed, at, 0 * at)
    assert search.least_scales == pytest.approx([1e-5 * 2 * (3.0**2 + 0.5**2)], rel=1e-12)


def test_angular_velocities_are_changed_in_place_of_rates() -> None:
    """ω = (1, 2, 3) of a body that may not turn about its z axis: that component vanishes."""
    text = """
coordinates: {e: quaternion}
T: dot(omega(e), omega(e))/2
constraints: {still: "omega(e).z = 0"}
initial: {e: 1, e': [1, 2, 3]}
"""
    system, p = lowered(lagcli.load_text(text.replace("[1, 2, 3]", "[1, 2, {guess: 3}]")))
    given = [((0, 1, 2, 3), (True, True, False))]
    search = CoreSearch(system, *programs_of_search(system), given)
    q, v = np.array([[1.0, 0, 0, 0]]), np.array([[0.0, 0.5, 1.0, 1.5]])
    held = range(len(system.constraints))
    found, rates = search.velocities(0.0, np.array([p]), held, np.ones(4, dtype=bool), q, v)
    assert found[0] == StartStatus.FOUND
    np.testing.assert_allclose(rates[0], [0, 0.5, 1.0, 0], atol=1e-15)
