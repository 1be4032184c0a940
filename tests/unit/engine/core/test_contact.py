"""The core's contact problems and impacts, against problems solved by hand."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest
from core_parts import least_distance, lemke_modes, solve_contacts, solve_impact
from scipy.optimize import linprog, nnls

from lagcli.arrays import Array
from lagcli.engine.core.contact_problem import ContactLaw, ContactProblem

UNILATERAL, LIMITED, FREE = ContactLaw.UNILATERAL, ContactLaw.LIMITED, ContactLaw.FREE
FORWARD, BACKWARD = ContactLaw.FORWARD, ContactLaw.BACKWARD
OPEN, HOLDS, SLIPS_FORWARD, SLIPS_BACKWARD = range(4)
POISSON, NEWTON, SEQUENTIAL = range(3)
G = 9.81


def problem(
    matrix: object,
    offset: object,
    laws: object,
    friction: dict[tuple[int, int], float] | None = None,
    static: dict[tuple[int, int], float] | None = None,
    limits: object = None,
) -> ContactProblem:
    """Return a problem with coefficients of friction {(limited row, normal row): μ}."""
    b = np.array(offset, dtype=float)
    kinetic_slopes = np.zeros((len(b), len(b)))
    for place, mu in (friction or {}).items():
        kinetic_slopes[place] = mu
    static_slopes = kinetic_slopes.copy()
    for place, mu in (static or {}).items():
        static_slopes[place] = mu
    constant = np.zeros(len(b)) if limits is None else np.array(limits, dtype=float)
    return ContactProblem(
        np.array(matrix, dtype=float), b, np.array(laws), constant, constant,
        static_slopes, kinetic_slopes,
    )  # fmt: skip


def solve(given: ContactProblem) -> tuple[Array, Array, list[int]]:
    """Return the only solution."""
    [(force, motion, modes)] = solve_contacts(given)
    size = np.abs(force).max() + np.abs(given.offset).max()
    assert given.violation(force, motion) < 1e-12 * size
    return force, motion, list(modes)


def inverse_inertia(mass: Array, rows: object) -> Array:
    b = np.array(rows, dtype=float)
    out: Array = b @ np.linalg.solve(mass, b.T)
    return out


@pytest.mark.parametrize(
    ("slope", "mode", "acceleration"),
    [(0.3, HOLDS, 0.0), (0.5, SLIPS_FORWARD, G * (math.sin(0.5) - 0.4 * math.cos(0.5)))],
)
def test_block_on_an_incline(slope: float, mode: int, acceleration: float) -> None:
    """Friction 0.4: sticks at 0.3 rad (tan 0.309), slides at 0.5 (tan 0.546)."""
    force, motion, modes = solve(
        problem(
            np.eye(2) / 3.0,
            [-G * math.cos(slope), G * math.sin(slope)],
            [UNILATERAL, LIMITED],
            {(1, 0): 0.4},
        )
    )
    assert modes == [HOLDS, mode]
    assert force[0] == pytest.approx(3.0 * G * math.cos(slope), rel=1e-14)
    assert motion[1] == pytest.approx(acceleration, rel=1e-13)


@pytest.mark.parametrize(("kinetic", "static"), [(0.4, 0.4), (0.0, 0.4), (0.4, 0.5)])
def test_a_block_without_weight_leaves(kinetic: float, static: float) -> None:
    place = (1, 0)
    for present in (None, [HOLDS, HOLDS], [OPEN, SLIPS_BACKWARD]):
        given = problem(
            np.eye(2), [1.0, -3.0], [UNILATERAL, LIMITED], {place: kinetic}, {place: static}
        )
        [(force, motion, modes)] = solve_contacts(given, present)
        assert list(modes) == [OPEN, OPEN]
        assert list(force) == [0.0, 0.0]
        assert list(motion) == [1.0, -3.0]


def test_friction_of_an_open_contact_is_open_beside_other_friction() -> None:
    """Two blocks on a floor, of which one is lifted; friction may have any place in the list."""
    laws = np.array([LIMITED, LIMITED, UNILATERAL, UNILATERAL])
    offset, modes = np.array([3.0, -0.5, -10.0, 5.0]), np.array([HOLDS, OPEN, HOLDS, OPEN])
    for order in itertools.permutations(range(4)):
        place = np.argsort(order)
        static = {(place[0], place[2]): 0.4, (place[1], place[3]): 0.4}
        for kinetic in (0.4, 0.2, 0.0):
            given = problem(
                np.eye(4), offset[[*order]], laws[[*order]], dict.fromkeys(static, kinetic), static
            )
            [(force, motion, found)] = solve_contacts(given)
            assert found.tolist() == modes[[*order]].tolist()
            assert force[place] == pytest.approx([-3.0, 0.0, 10.0, 0.0], rel=1e-14)
            assert motion[place] == pytest.approx([0.0, -0.5, 0.0, 5.0], rel=1e-14)


def test_an_open_contact_without_velocity_stays_open_where_nothing_presses_it() -> None:
    given = problem(np.diag([1.0, 2.0]), [0.0, -1.0], [UNILATERAL] * 2)
    [(force, motion, modes)] = solve_contacts(given, [OPEN, HOLDS])
    assert modes.tolist() == [OPEN, HOLDS]
    assert force.tolist() == [0.0, 0.5]
    assert motion.tolist() == [0.0, 0.0]


def test_a_contact_that_no_force_moves() -> None:
    """It opens by itself, or there is no motion."""
    [(force, motion, modes)] = solve_contacts(problem([[0.0]], [2.0], [UNILATERAL]))
    assert (force[0], motion[0], modes[0]) == (0.0, 2.0, OPEN)
    assert solve_contacts(problem([[0.0]], [-2.0], [UNILATERAL])) == []
    # beside others, too
    for matrix in (np.diag([0.0, 1.0]), np.diag([1.0, 0.0])):
        assert solve_contacts(problem(matrix, [-2.0, -2.0], [UNILATERAL] * 2)) == []
    # rows may have any units
    for matrix in (np.diag([1e-15, 1.0]), np.diag([1.0, 1e15])):
        [(force, motion, _)] = solve_contacts(problem(matrix, [-2.0, -2.0], [UNILATERAL] * 2))
        assert force == pytest.approx(2 / np.diag(matrix), rel=1e-15)
        assert motion.tolist() == [0.0, 0.0]
    # also beside a row that no force moves
    for first in (0.0, 1e-30):
        given = problem(np.diag([first, 1e-30 - first]), [2.0, 2.0], [UNILATERAL] * 2)
        moved = int(first == 0.0)
        given.offset[moved] = -3.0
        [(force, motion, _)] = solve_contacts(given)
        assert force[moved] == pytest.approx(3e30, rel=1e-15)
        assert force[1 - moved] == 0.0
        assert motion[moved] == 0.0
        assert motion[1 - moved] == 2.0


def test_a_block_without_forces_stays() -> None:
    """All is zero, also the tolerance, and rows may depend on each other."""
    for n in (1, 2):
        given = problem(
            np.kron(np.eye(2), np.ones((n, n))),
            np.zeros(2 * n),
            [UNILATERAL] * n + [LIMITED] * n,
            {(n + k, k): 0.4 for k in range(n)},
        )
        [(force, motion, modes)] = solve_contacts(given)
        assert force.tolist() == motion.tolist() == [0.0] * (2 * n)
        assert modes.tolist() == [HOLDS] * (2 * n)


@pytest.mark.parametrize("first", [UNILATERAL, LIMITED])
def test_a_block_sticks_if_it_can(first: ContactLaw) -> None:
    """Static friction 0.4, kinetic 0.3: between them both are solutions, and it sticks."""
    n, t = (0, 1) if first == UNILATERAL else (1, 0)
    laws = [UNILATERAL, LIMITED] if first == UNILATERAL else [LIMITED, UNILATERAL]
    for present in ((HOLDS, SLIPS_FORWARD), (HOLDS, HOLDS), None):
        for load, mode in ((3.5, HOLDS), (4.5, SLIPS_FORWARD)):
            offset = np.empty(2)
            offset[[n, t]] = -10.0, load
            given = problem(np.eye(2), offset, laws, {(t, n): 0.3}, {(t, n): 0.4})
            begin = None if present is None else np.array(present)[[n, t]]
            [(force, motion, modes)] = solve_contacts(given, begin)
            assert modes[[n, t]].tolist() == [HOLDS, mode]
            assert force[n] == pytest.approx(10.0)
            assert force[t] == pytest.approx(-3.5 if mode == HOLDS else -3.0)
            assert motion[t] == pytest.approx(0.0 if mode == HOLDS else 1.5)


def test_many_blocks_stick_if_they_can() -> None:
    """More than can be tried one by one, with constant limits; also where they slip at first."""
    count = 9
    for load, mode in ((3.5, HOLDS), (4.5, SLIPS_FORWARD)):
        given = problem(np.eye(count), np.full(count, load), [LIMITED] * count)
        given = given._replace(static=np.full(count, 4.0), kinetic=np.full(count, 3.0))
        for present in (None, [SLIPS_FORWARD] * count, [HOLDS] * count):
            [(force, _, modes)] = solve_contacts(given, present)
            assert modes.tolist() == [mode] * count
            assert force.tolist() == [-load if mode == HOLDS else -3.0] * count


# --- Painlevé's rod: benchmark painleve_rod -------------------------------------------------------


def rod(rate: float, friction: float, law: ContactLaw) -> ContactProblem:
    """Return the tip's problem: m = 1, half length 0.5, tan θ = 2, g = 9.81; normal, tangent."""
    half, theta = 0.5, math.atan(2.0)
    mass = np.diag([1.0, 1.0, half**2 / 3.0])
    rows = [[0.0, 1.0, -half * math.cos(theta)], [1.0, 0.0, half * math.sin(theta)]]
    # y_A = y − l sin θ, x_A = x − l cos θ
    bias = [half * math.sin(theta) * rate**2 - G, half * math.cos(theta) * rate**2]
    return problem(inverse_inertia(mass, rows), bias, [UNILATERAL, law], {(1, 0): friction})


def test_painleve_no_motion() -> None:
    assert solve_contacts(rod(0.0, 1.6, BACKWARD)) == []


def test_painleve_two_motions() -> None:
    """The references of benchmark painleve_rod: it slides, or it opens."""
    given = rod(6.0, 1.6, BACKWARD)
    solutions = solve_contacts(given)
    assert len(solutions) == 2
    by_mode = {int(modes[0]): (force, motion) for force, motion, modes in solutions}
    assert by_mode[HOLDS][0][0] == pytest.approx(19.65527949374526816920641, rel=1e-13)
    assert by_mode[OPEN][1][0] == pytest.approx(6.289689437998485814146050, rel=1e-13)
    for force, motion in by_mode.values():
        assert given.violation(force, motion) < 1e-12
    for present in ([HOLDS, SLIPS_BACKWARD], [OPEN, OPEN]):
        first = solve_contacts(given, present)[0]
        assert list(first[2]) == present  # the present mode goes first


def test_below_the_bound_of_painleve_one_motion() -> None:
    """At tan θ = 2, the bound is 4/3."""
    force, _, modes = solve(rod(0.0, 1.33, BACKWARD))
    assert modes == [HOLDS, SLIPS_BACKWARD]
    assert force[0] > 1000.0
    assert solve_contacts(rod(0.0, 1.34, BACKWARD)) == []


# --- redundant contacts: benchmark box_on_two_corners ---------------------------------------------


def box(degrees: float, friction: float) -> ContactProblem:
    """Return the problem of the box at rest: left, right, left slip, right slip."""
    m, b, h, slope = 10.0, 0.2, 0.3, math.radians(degrees)
    mass = np.diag([m, m, m * (b * b + h * h) / 3.0])
    rows = [[0.0, 1.0, -b], [0.0, 1.0, b], [1.0, 0.0, h], [1.0, 0.0, h]]
    free = [G * math.sin(slope), -G * math.cos(slope), 0.0]
    return problem(
        inverse_inertia(mass, rows),
        np.array(rows) @ free,
        [UNILATERAL, UNILATERAL, LIMITED, LIMITED],
        {(2, 0): friction, (3, 1): friction},
    )


def test_box_at_rest_shares_friction_within_the_cones() -> None:
    """Equal shares, 8.52 N, are within both cones at friction 0.4; at 0.2 not on the left."""
    force, _, modes = solve(box(10.0, 0.4))
    assert modes == [HOLDS] * 4
    assert force[:2] == pytest.approx([35.52865561340440489517369, 61.08098495709320572870380])
    assert force[2] + force[3] == pytest.approx(-17.03488622912586722235340, rel=1e-12)
    assert force[2] == pytest.approx(force[3], rel=1e-12)
    force, _, modes = solve(box(10.0, 0.2))
    assert modes == [HOLDS] * 4
    assert force[2] + force[3] == pytest.approx(-17.03488622912586722235340, rel=1e-12)
    assert force[2] == pytest.approx(-0.2 * force[0], rel=1e-8)


@pytest.mark.parametrize("row", range(4))
@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_shares_within_the_cones_do_not_depend_on_the_unit_of_a_row(row: int, unit: float) -> None:
    given, units = box(10.0, 0.2), np.ones(4)
    units[row] = unit
    for order in itertools.permutations(range(4)):
        every = np.ix_(order, order)
        slopes = (given.kinetic_slopes * units / units[:, None])[every]
        scaled = ContactProblem(
            (given.matrix * np.outer(units, units))[every],
            (given.offset * units)[[*order]],
            given.laws[[*order]],
            *[np.zeros(4)] * 2,
            *[slopes] * 2,
        )
        [(found, motion, modes)] = solve_contacts(scaled)
        force = np.empty(4)
        force[[*order]] = found
        force *= units
        assert modes.tolist() == [HOLDS] * 4
        assert motion.tolist() == [0.0] * 4
        assert force[:2] == pytest.approx([35.52865561340440489517369, 61.08098495709320572870380])
        assert force[2] + force[3] == pytest.approx(-17.03488622912586722235340, rel=1e-12)


def test_box_slides() -> None:
    force, motion, modes = solve(box(25.0, 0.4))
    assert modes == [HOLDS, HOLDS, SLIPS_FORWARD, SLIPS_FORWARD]
    assert motion[2] == pytest.approx(0.5895333913444470132304824, rel=1e-12)
    assert force[0] == pytest.approx(17.78175878165907227881888, rel=1e-12)
    assert force[1] == pytest.approx(71.12703512663628911527553, rel=1e-12)


def test_box_tips() -> None:
    _, motion, modes = solve(box(36.0, 0.9))
    assert modes == [OPEN, HOLDS, OPEN, HOLDS]
    # φ″ about the right corner; the left corner rises with 2 b φ″
    assert motion[0] == pytest.approx(2 * 0.2 * 0.8224653146140475368546266, rel=1e-12)


def test_a_plank_on_three_supports() -> None:
    """Three equal supports under the centre and the ends bear a third each: the least norm."""
    mass = np.diag([2.0, 0.5])
    rows = [[1.0, -1.0], [1.0, 0.0], [1.0, 1.0]]
    free = np.array([-G, 0.0])
    given = problem(inverse_inertia(mass, rows), np.array(rows) @ free, [UNILATERAL] * 3)
    force, _, _ = solve(given)
    assert force == pytest.approx([2 * G / 3] * 3, rel=1e-13)
    # beyond x = 2/3 of the half length, least norm would pull at the far support
    moment = np.array([-G, -0.8 * 2.0 * G / 0.5])
    off = given._replace(offset=np.array(rows) @ moment)
    force, _, _ = solve(off)
    assert force[0] == pytest.approx(0.0, abs=1e-9)
    assert force[1:] == pytest.approx([0.2 * 2 * G, 0.8 * 2 * G], rel=1e-9)


@pytest.mark.parametrize("ratio", [1.0, 1e3, 2e5])
def test_a_sled_shares_its_weight_whatever_its_friction(ratio: float) -> None:
    """A_tt is ratio² times 1/m. Shares of least norm are linear: those of four equal springs."""
    place, count = np.array([-0.7, -0.31, 0.23, 0.59]), 4
    matrix = np.diag([0.0] * count + [ratio**2 / 3.0])
    matrix[:count, :count] = 1 / 3.0 + np.outer(place, place) / 0.7
    given = problem(
        matrix, [-G] * count + [1.0], [UNILATERAL] * count + [FORWARD],
        {(count, k): 1.0 for k in range(count)},
    )  # fmt: skip
    [(force, motion, modes)] = solve_contacts(given)
    balance = [[count, place.sum()], [place.sum(), place @ place]]
    mean, slope = np.linalg.solve(balance, [3.0 * G, 0.0])
    assert modes.tolist() == [HOLDS] * count + [SLIPS_FORWARD]
    assert force[:count] == pytest.approx(mean + slope * place, rel=1e-9)
    assert force[count] == pytest.approx(-3.0 * G, rel=1e-9)
    assert motion[:count].tolist() == [0.0] * count


@pytest.mark.parametrize("law", [LIMITED, FORWARD])
@pytest.mark.parametrize("mass", [1e-20, 1.0, 1e20])
def test_friction_that_moves_nothing_beside_bodies_of_other_mass(
    mass: float, law: ContactLaw
) -> None:
    """A belt moves past a block that rests with a force of sqrt(mass); another block is lifted."""
    offset = np.array([-1.0, 0.01 * math.sqrt(mass), 1.0]) / math.sqrt(mass)
    given = problem(
        np.diag([1.0 / mass, 1.0, 0.0]), offset, [UNILATERAL, UNILATERAL, law], {(2, 0): 0.5}
    )
    [(force, motion, modes)] = solve_contacts(given)
    assert modes.tolist() == [HOLDS, OPEN, SLIPS_FORWARD]
    assert force == pytest.approx(math.sqrt(mass) * np.array([1.0, 0.0, -0.5]), rel=1e-14, abs=0)
    assert motion.tolist() == [0.0, *offset[1:]]


def test_forces_that_exceed_their_cones_have_no_share() -> None:
    """A contradiction between redundant bilateral rows has no solution."""
    assert solve_contacts(problem(np.ones((2, 2)), [1.0, 2.0], [FREE, FREE])) == []


# --- limits that depend on bilateral rows, and constant ones --------------------------------------


def test_guide_with_friction() -> None:
    """A slider that a force presses against its guide, from either side."""
    for press in (-5.0, 5.0):
        given = problem(np.eye(2), [press, 3.0], [FREE, LIMITED], {(1, 0): 0.5})
        force, motion, modes = solve(given)
        assert modes == [HOLDS, SLIPS_FORWARD]
        assert force == pytest.approx([-press, -2.5])
        assert motion[1] == pytest.approx(0.5)


def test_jamming_in_a_guide() -> None:
    """A rod in a guide whose friction turns it harder into the guide has two answers."""
    matrix = [[1.0, 0.9], [0.9, 1.0]]
    solutions = solve_contacts(problem(matrix, [-1.0, 0.0], [FREE, FORWARD], {(1, 0): 1.5}))
    # y0 = x0 − 0.9·1.5|x0| − 1 = 0 has no answer; with an offset of the other sign, two
    assert solutions == []
    for static in (1.5, 0.0):  # which a row that slips does not have
        given = problem(matrix, [1.0, 0.0], [FREE, FORWARD], {(1, 0): 1.5}, {(1, 0): static})
        solutions = solve_contacts(given)
        assert sorted(s[0][0] for s in solutions) == pytest.approx([-1 / 2.35, 1 / 0.35])


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("error", [1e-16, 1e-3])
def test_a_contact_that_leaves_within_rounding_stays(error: float, unit: float) -> None:
    """Alone, and beside another that is pressed."""
    for part in (-3, -0.5, 0.5, 0.9, 1.1, 3):
        mode = HOLDS if part < 1 else OPEN
        b = part * error * unit
        alone = solve_contacts(problem([[unit]], [b], [UNILATERAL]), rounding=[error * unit])
        [(force, motion, modes)] = alone
        assert list(modes) == [mode]
        assert force == pytest.approx([max(0.0, -b / unit)], rel=1e-14, abs=0.0)
        assert motion.tolist() == [b if mode == OPEN else 0.0]
        two = problem(np.diag([1, 4]) * unit, [b, -20 * error * unit], [UNILATERAL, UNILATERAL])
        [(force, motion, modes)] = solve_contacts(two, rounding=[error * unit, 0.0])
        assert list(modes) == [mode, HOLDS]
        assert force == pytest.approx([max(0.0, -b / unit), 5 * error], rel=1e-14, abs=0.0)


@pytest.mark.parametrize("laws", [[FREE, FREE], [FREE, UNILATERAL], [UNILATERAL, FREE]])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_redundant_rows_may_contradict_each_other_within_rounding(
    unit: float, laws: list[ContactLaw]
) -> None:
    """One body on two rows, the second in another unit: where it must not move, and would."""
    rows, error = np.array([1.0, unit]), 1e-9
    for part in (0.1, 0.4, 0.6, 30.0):
        given = problem(np.outer(rows, rows), part * error * np.array([1, -1]) * rows, laws)
        found = solve_contacts(given, rounding=error * rows)
        assert len(found) == (part < 0.5 or laws[0] == UNILATERAL)  # which leaves
        assert len(solve_contacts(given)) == (laws[0] == UNILATERAL)
        for force, motion, _ in found:
            off = given.matrix @ force + given.offset - motion
            assert np.abs(off / rows).max() <= error * (1 + 1e-9)


def test_constant_limit() -> None:
    force, motion, modes = solve(problem([[0.5]], [4.0], [LIMITED], limits=[6.0]))
    assert (force[0], motion[0], modes) == (-6.0, 1.0, [SLIPS_FORWARD])
    force, motion, modes = solve(problem([[0.5]], [-2.0], [LIMITED], limits=[6.0]))
    assert (force[0], motion[0], modes) == (4.0, 0.0, [HOLDS])


@pytest.mark.parametrize("row", range(3))
def test_a_row_whose_force_is_at_its_limit_but_for_rounding_holds(row: int) -> None:
    """Also where no other row has a force."""
    offset, limits = np.zeros(3), np.ones(3)
    offset[row], limits[row] = -3.0, 6.0 * (1 - 1e-13)
    [(force, motion, modes)] = solve_contacts(
        problem(0.5 * np.eye(3), offset, [LIMITED] * 3, limits=limits)
    )
    assert modes.tolist() == [HOLDS] * 3
    assert motion.tolist() == [0.0] * 3
    assert force[row] == 6.0


def test_no_rows() -> None:
    assert len(solve_contacts(problem(np.zeros((0, 0)), [], []))) == 1


# --- many contacts: Lemke's method ----------------------------------------------------------------


@pytest.mark.parametrize("weight", [1e-20, 1.0])
@pytest.mark.parametrize("balls", [11, 40])
def test_a_column_of_balls_under_weight(balls: int, weight: float) -> None:
    """Contact k bears the weight of all above it; the column's A is tridiagonal."""
    matrix = 2.0 * np.eye(balls) - np.eye(balls, k=1) - np.eye(balls, k=-1)
    matrix[0, 0] = 1.0
    offset = np.zeros(balls)
    offset[0] = -weight
    given = problem(matrix, offset, [UNILATERAL] * balls)
    force, _, modes = solve(given)
    assert force == pytest.approx(weight * np.arange(balls, 0, -1), rel=1e-11)
    assert modes == [HOLDS] * balls
    assert lemke_modes(given)[2].tolist() == modes


def test_many_frictional_contacts() -> None:
    """Twelve blocks on inclines coupled by nothing: each as if it were alone."""
    slopes = np.linspace(0.1, 0.9, 12)
    offset = np.concatenate([-np.cos(slopes), np.sin(slopes) * (-1.0) ** np.arange(12)])
    laws = [UNILATERAL] * 12 + [LIMITED] * 12
    given = problem(np.eye(24), offset, laws, {(12 + k, k): 0.5 for k in range(12)})
    _, motion, _ = solve(given)
    expected = np.maximum(np.sin(slopes) - 0.5 * np.cos(slopes), 0.0) * (-1.0) ** np.arange(12)
    assert motion[12:] == pytest.approx(expected, abs=1e-14)


def positive(rng: np.random.Generator, n: int, decades: float) -> Array:
    rows = rng.normal(size=(n, n + 2)) * 10.0 ** rng.uniform(-decades, decades, (n, 1))
    return np.asarray(rows @ rows.T)


@pytest.mark.parametrize("n", [1, 3, 9, 25])
def test_lemkes_method_solves_every_convex_problem(n: int) -> None:
    """Contacts, rows with constant friction, and bilateral ones: the only solution's modes."""
    rng = np.random.default_rng(n)
    for _ in range(30):
        laws = rng.choice([UNILATERAL, LIMITED, FREE], n, p=[0.5, 0.3, 0.2])
        size = 10.0 ** rng.uniform(-20, 20)
        given = problem(
            positive(rng, n, 1.0),
            rng.normal(size=n) * size,
            laws,
            limits=np.where(laws == LIMITED, rng.uniform(0.05, 1.0, n), 0.0) * size,
        )
        solved, right, modes = lemke_modes(given)
        assert solved
        assert right
        if n < 10:
            assert modes.tolist() == solve(given)[2]


@pytest.mark.parametrize("contacts", [1, 3, 8])
def test_lemkes_method_solves_problems_with_little_friction(contacts: int) -> None:
    """Limits by contacts and bilateral rows of either sign; rows slip, or may stick."""
    rng = np.random.default_rng(contacts)
    n, slips = 2 * contacts, 0
    for _ in range(40):
        normal = rng.choice([UNILATERAL, FREE], contacts, p=[0.6, 0.4])
        tangent = rng.choice([LIMITED, FORWARD, BACKWARD], contacts, p=[0.6, 0.2, 0.2])
        given = problem(
            positive(rng, n, 0.0),
            rng.normal(size=n),
            np.concatenate([normal, tangent]),
            {(contacts + k, k): float(rng.uniform(0.0, 0.02)) for k in range(contacts)},
        )
        solved, right, modes = lemke_modes(given)
        assert solved
        assert right
        slips += int(np.isin(modes[contacts:], [SLIPS_FORWARD, SLIPS_BACKWARD]).sum())
    assert slips > 5 * contacts


def test_lemkes_method_ends_on_a_ray_where_there_is_no_solution() -> None:
    for matrix, laws in (([[0.0]], [UNILATERAL]), ([[1.0, -1.0], [-1.0, 1.0]], [UNILATERAL] * 2)):
        offset = [-1.0] * len(laws)
        assert not lemke_modes(problem(matrix, offset, laws))[0]


def chained(rng: np.random.Generator, guides: int) -> ContactProblem:
    """Return contacts and guides with friction, and a row that friction limits; many modes.

    They are coupled little, so that there is one solution.
    """
    contacts = 10
    n = 2 * contacts + 1
    root = rng.normal(size=(n, n))
    scale = 2.0 ** rng.integers(-9, 10, n)
    friction = {(contacts + k, k): float(rng.uniform(0.0, 0.5)) for k in range(contacts)}
    friction[n - 1, n - 2] = 0.5
    unit = np.eye(n) + 0.05 * root @ root.T / n
    slopes = np.zeros((n, n))
    for (i, j), mu in friction.items():
        slopes[i, j] = mu * scale[j] / scale[i]
    laws = np.array([UNILATERAL] * contacts + [LIMITED] * (contacts + 1))
    laws[:guides] = FREE
    none = np.zeros(n)
    return ContactProblem(
        unit * np.outer(scale, scale), rng.normal(size=n) * scale, laws, none, none, slopes, slopes
    )


@pytest.mark.parametrize("guides", [0, 5])
def test_newtons_iteration_over_modes_solves_what_other_methods_cannot(guides: int) -> None:
    rng = np.random.default_rng(11)
    for _ in range(60 if guides == 0 else 20):
        given = chained(rng, guides)
        assert not lemke_modes(given)[0]
        size = np.sqrt(np.diag(given.matrix))
        for present in (None, rng.integers(0, 4, len(size))):
            [(force, motion, _)] = solve_contacts(given, present)
            scaled = given._replace(
                matrix=given.matrix / np.outer(size, size),
                offset=given.offset / size,
                static_slopes=given.static_slopes * size[:, None] / size,
                kinetic_slopes=given.kinetic_slopes * size[:, None] / size,
            )
            assert scaled.violation(force * size, motion / size) < 1e-10


# --- forces within inequalities -------------------------------------------------------------------


def test_least_distances() -> None:
    """Beside SciPy's nonnegative least squares: the nearest point, or that there is none."""
    rng = np.random.default_rng(4)
    feasible = 0
    for _ in range(300):
        n, m = int(rng.integers(1, 6)), int(rng.integers(1, 12))
        rows, bound = rng.normal(size=(m, n)), rng.normal(size=m) - rng.uniform(0.0, 1.5)
        for i in range(1, m):  # equations, inequalities twice, sums of others, and none
            kind, j = rng.integers(8), int(rng.integers(i))
            if kind < 2:
                rows[i], bound[i] = (1 - 2 * kind) * rows[j], (1 - 2 * kind) * bound[j]
            elif kind == 2:
                rows[i], bound[i] = rows[:i].sum(axis=0), bound[:i].sum()
            elif kind == 3:
                rows[i], bound[i] = 0.0, -abs(bound[i])
        length = 10.0 ** rng.uniform(-3, 3, m)
        found = least_distance(rows * length[:, None], bound * length)
        columns = np.vstack([rows.T, bound])
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        target = np.append(np.zeros(n), 1.0)
        weights, residual = nnls(columns, target)
        if residual < 1e-6:
            assert found is None
            continue
        feasible += 1
        r = target - columns @ weights
        assert found == pytest.approx(-r[:n] / r[n], abs=1e-9 / r[n])
    assert 100 < feasible < 250


@pytest.mark.parametrize("first", [0.0, 1.0])
def test_a_row_that_is_nearly_another_leaves_the_nearest_point(first: float) -> None:
    """Also with the rows that are found later, since they ask for less.

    Without the fourth row, which differs by 1e-7 from the second, the corner is the nearest point.
    """
    rows = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 1, -1e-7, 0], [0, 0, 0, 1]])
    for order in itertools.permutations(range(5)):
        bound = np.array([first, 1.0, 1.0, 1.0, 1e-8])
        found = least_distance(rows[[*order]], bound[[*order]])
        assert found == pytest.approx([first, 1.0, 1.0, 1e-8], abs=2e-7)
        assert found is not None
        assert found[3] == pytest.approx(1e-8, rel=1e-6)


@pytest.mark.parametrize(
    ("rows", "bound", "corner"),
    [
        ([[-2, 1], [2.00001, -1], [-2, 3]], [2, -2, 0], [0, 2]),
        ([[1, 3], [-1.00001, -2.99998], [-2, 0]], [-2, 2.00002, 0], [-2, 0]),
        ([[-1, -3], [-1, -2], [0.99998, 2]], [-3, 2, -1.99998], [-1, -0.5]),
    ],
)
def test_the_corner_of_a_thin_wedge_is_its_nearest_point(
    rows: list[list[float]], bound: list[float], corner: list[float]
) -> None:
    """Two rows are nearly opposite, and the wedge leads away from zero; the third row holds."""
    for order in itertools.permutations(range(3)):
        found = least_distance([rows[i] for i in order], [bound[i] for i in order])
        assert found == pytest.approx(corner, abs=1e-4)


# --- impacts --------------------------------------------------------------------------------------


def kane_levinson(friction: float, restitution: float) -> tuple[Array, Array, object, Array, Array]:
    """Return A, velocities, laws, restitution and friction of benchmark kane_levinson; B, M, v."""
    a, b = math.radians(20.0), math.radians(30.0)
    mass = np.array([[1 / 4 + 1 + 1 / 12, math.cos(a - b) / 2],
                     [math.cos(a - b) / 2, 1 / 4 + 1 / 12]])  # fmt: skip
    rows = np.array([[math.sin(a), math.sin(b)], [math.cos(a), math.cos(b)]])
    coefficients = np.array([[0.0, 0.0], [friction, 0.0]])
    v = np.array([-0.1, -0.2])
    inverse = inverse_inertia(mass, rows)
    return inverse, rows @ v, [UNILATERAL, LIMITED], np.array([restitution, 0.0]), coefficients


ENERGY = 0.5 * np.array([-0.1, -0.2]) @ np.array(
    [[4 / 3, math.cos(math.radians(10)) / 2], [math.cos(math.radians(10)) / 2, 1 / 3]]
) @ [-0.1, -0.2]  # fmt: skip


def test_kane_levinson_under_poissons_law() -> None:
    found, impulse, after, loss = solve_impact(*kane_levinson(0.5, 0.7), POISSON)
    assert found == 1
    expected = [0.1288789629522897144735343, 0.02913926649880179502501691]
    assert impulse == pytest.approx(expected, rel=1e-12)
    assert loss.sum() == pytest.approx((1 - 0.5708817108903888226773073) * ENERGY, rel=1e-11)
    assert after[0] > 0.0


@pytest.mark.parametrize(
    ("friction", "restitution", "ratio"),
    [
        (0.5, 0.7, 2.757611078697391955669194),
        (0.1, 0.9, 1.013),
        (0.3, 0.7, 1.199),
        (1.0, 0.9, 5.14),
    ],
)
def test_kane_levinson_gains_energy_under_newtons_law(
    friction: float, restitution: float, ratio: float
) -> None:
    """The last three ratios have the digits that the benchmark gives."""
    given = kane_levinson(friction, restitution)
    found, _, after, loss = solve_impact(*given, NEWTON)
    assert found == 1
    assert after[0] == pytest.approx(-restitution * given[1][0], rel=1e-13)
    tolerance = 1e-12 if friction == 0.5 else 1e-3
    assert 1.0 - loss.sum() / ENERGY == pytest.approx(ratio, rel=tolerance)


@pytest.mark.parametrize("law", [POISSON, NEWTON, SEQUENTIAL])
def test_a_ball_on_the_floor(law: int) -> None:
    """Mass 2: impulse m (1 + e) v; the loss m v² (1 − e²) / 2."""
    found, impulse, after, loss = solve_impact([[0.5]], [-3.0], [UNILATERAL], [0.8], [[0.0]], law)
    assert found == 1
    assert (impulse[0], after[0], loss[0]) == pytest.approx((2 * 1.8 * 3, 2.4, 9 * (1 - 0.64)))


def test_a_contact_that_opens_is_not_moved_back_by_newtons_law() -> None:
    """A = 4/3 of [[1, -1/2], [-1/2, 1]]: the first pushes the second, which stays in contact."""
    matrix, none = np.array([[4.0, -2.0], [-2.0, 4.0]]) / 3, np.zeros((2, 2))
    for leaves in (0.0, 0.1, 2.0):
        found, impulse, after, _ = solve_impact(
            matrix, [-1.0, leaves], [UNILATERAL] * 2, [0.5, 0.5], none, NEWTON
        )
        alone = leaves - 0.75
        second = max(0.0, -alone)
        assert found == 1
        assert after == pytest.approx([0.5, max(alone, 0.0)], abs=1e-15)
        assert impulse == pytest.approx([1.125 + second / 2, second], rel=1e-14)


def cradle(balls: int, struck: int, restitution: float) -> tuple[object, ...]:
    """Return an impact of `struck` balls of mass 1 and velocity 1 on the others, all in contact."""
    matrix = 2.0 * np.eye(balls - 1) - np.eye(balls - 1, k=1) - np.eye(balls - 1, k=-1)
    v = (np.arange(balls) < struck).astype(float)
    n = balls - 1
    return matrix, np.diff(v), [UNILATERAL] * n, [restitution] * n, np.zeros((n, n))


@pytest.mark.parametrize("struck", [1, 2, 3])
def test_newtons_cradle_sends_as_many_balls_as_it_is_struck_by(struck: int) -> None:
    found, _, after, loss = solve_impact(*cradle(5, struck, 1.0), SEQUENTIAL)
    assert found == 1
    expected = np.diff((np.arange(5) >= 5 - struck).astype(float))
    assert after == pytest.approx(expected, abs=1e-12)
    assert loss == pytest.approx(np.zeros(4), abs=1e-12)


def test_bilateral_rows_meet_their_equation_by_each_law() -> None:
    """Without a contact that strikes, as where an event engages a constraint: Λ = −A⁻¹ b."""
    matrix = np.array([[2.0, 0.5], [0.5, 1.0]])
    for law, other in itertools.product((POISSON, NEWTON, SEQUENTIAL), (0.8, 0.1, 0.0)):
        sign = 1.0 if other else -1.0
        found, impulse, after, loss = solve_impact(
            matrix, [0.3 * sign, other], [FREE, UNILATERAL], [0.0, 0.0], np.zeros((2, 2)), law
        )
        assert found == 1
        assert impulse == pytest.approx([-0.15 * sign, 0.0], rel=1e-14)
        assert after == pytest.approx([0.0, other - 0.075 * sign], rel=1e-14)
        assert loss.sum() == pytest.approx(0.3**2 / 2.0 / 2.0)


def test_a_guide_rubs_in_the_impacts_of_a_sequence() -> None:
    """With one contact, beside a guide with friction, they are those of Poisson's law."""
    rng, slips = np.random.default_rng(0), 0
    for _ in range(30):
        rows = rng.normal(size=(3, 4))
        before = np.array([-1.0, 0.0, rng.uniform(-1, 1)])
        friction = np.zeros((3, 3))
        friction[2, 1] = 0.4
        given = rows @ rows.T, before, [UNILATERAL, FREE, LIMITED], [0.5, 0.0, 0.0], friction
        found, *expected = solve_impact(*given, POISSON)
        if found != 1:
            continue
        count, *made = solve_impact(*given, SEQUENTIAL)
        assert count == 1
        np.testing.assert_allclose(made[0], expected[0], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(made[1], expected[1], rtol=1e-9, atol=1e-12)
        slips += abs(made[0][2]) > 1e-3
    assert slips > 10


@pytest.mark.parametrize("law", [POISSON, NEWTON, SEQUENTIAL])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_velocities_before_impacts_are_known_within_rounding(law: int, unit: float) -> None:
    """Two bilateral rows for one velocity; alone, a row meets its equation beyond rounding."""
    rows, none, error = np.array([1.0, unit]), np.zeros((2, 2)), 1e-9
    for part in (0.1, 0.4, 0.6, 30.0):
        before = part * error * np.array([1, -1]) * rows
        given = np.outer(rows, rows), before, [FREE, FREE], [0.0, 0.0], none, law
        found, impulse, after, _ = solve_impact(*given, rounding=error * rows)
        if law == SEQUENTIAL and part < 1:  # nothing is to be met
            assert found == 1
            assert impulse.tolist() == [0.0, 0.0]
            assert after == pytest.approx(before)
        else:
            assert found == (part < 0.5)
        if law == SEQUENTIAL:
            alone = [[unit]], [part * error * unit], [FREE], [0.0], [[0.0]], law
            found, impulse, after, _ = solve_impact(*alone, rounding=[error * unit])
            met = part > 1
            assert impulse == pytest.approx([-part * error if met else 0.0], rel=1e-14, abs=0.0)
    assert not solve_impact(*given)[0]


@pytest.mark.parametrize("law", [POISSON, NEWTON, SEQUENTIAL])
def test_slow_contacts_beside_fast_friction_stop(law: int) -> None:
    """A velocity is small next to those of its own row, not to those of friction."""
    for slow in 10.0 ** -np.arange(1, 14):
        found, impulse, after, _ = solve_impact(
            np.diag([1.6, 0.7]), [-slow, 2.5], [UNILATERAL, LIMITED], [0.0, 0.0],
            [[0.0, 0.0], [0.02, 0.0]], law,
        )  # fmt: skip
        assert found == 1
        assert impulse == pytest.approx([slow / 1.6, -0.02 * slow / 1.6], rel=1e-12)
        assert abs(after[0]) <= 1e-12 * slow


def test_simultaneous_laws_do_not_describe_a_cradle() -> None:
    """Poisson's law at e = 1: the struck ball rebounds, and the energy stays."""
    for law in (POISSON, NEWTON):
        found, impulse, _, loss = solve_impact(*cradle(3, 1, 1.0), law)
        assert found == 1
        assert loss.sum() == pytest.approx(0.0, abs=1e-14)
        assert 1.0 - impulse[0] < -0.3  # velocity of the struck ball, 1 − Λ₁


def test_a_box_lands_on_two_corners() -> None:
    """It lands flat and without restitution: both corners take half of momentum and energy."""
    given = box(0.0, 0.4)
    found, impulse, after, loss = solve_impact(
        given.matrix, [-1.0, -1.0, 0.0, 0.0], given.laws, np.zeros(4), given.kinetic_slopes, POISSON
    )
    assert found == 1
    assert after == pytest.approx(np.zeros(4), abs=1e-13)
    assert impulse == pytest.approx([5.0, 5.0, 0.0, 0.0], abs=1e-12)
    assert loss == pytest.approx([2.5, 2.5, 0.0, 0.0], abs=1e-12)


def test_a_redundant_contact_ends_a_sequence_of_many_impacts() -> None:
    """Two contacts in one place, whose velocities differ by the rounding of many impacts' sums."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        rows = rng.normal(size=(3, 2))
        rows[2] = rows[0]
        before = rows @ rng.normal(size=2)
        signs = np.where(before > 0.0, -1.0, 1.0)
        rows, before = rows * signs[:, None], before * signs
        found, _, after, _ = solve_impact(
            rows @ rows.T, before, [UNILATERAL] * 3, [0.9] * 3, np.zeros((3, 3)), SEQUENTIAL
        )
        assert found == 1
        assert after.min() > -1e-9


def depends_on_shares(rows: Array, before: Array, restitution: Array) -> bool:
    """Return whether impulses of the compression of a unit mass return different velocities.

    All of them have the velocity u after it; a random part of what they return is constant or not.
    """
    if not len(rows):
        return False
    impulse, _ = nnls(rows.T, -before)
    u = before + rows.T @ impulse
    closed = np.abs(rows @ u) < 1e-9
    pressed = rows[closed]
    if not len(pressed):
        return False
    part = np.random.default_rng(0).normal(size=rows.shape[1]) @ (pressed.T * restitution[closed])
    ends = [
        linprog(side * part, A_eq=pressed.T, b_eq=u - before, bounds=(0, None)) for side in (1, -1)
    ]
    if any(x.status == 3 for x in ends):  # unbounded
        return True
    return bool(-ends[1].fun - ends[0].fun > 1e-7)


#: Contacts of a unit mass, among them some that stay in place although others bear all the force:
#: their directions, the mass's velocity or the force on it.
DIRECTIONS = [
    ([[0, 1, 1], [2, 1, -1], [1, -1, -2], [1, 1, 1]], [-1, -2, 1]),
    ([[2, 0, 1], [1, -1, -1], [2, -1, 0], [1, 0, 1], [2, 0, 0], [1, 1, 1]], [-2, 1, -2]),
    ([[1, -2, -2], [1, 0, 1], [0, -1, -1], [1, 1, 1]], [-1, 0, 0]),
    ([[0, 0, -1], [0, 2, -1], [1, 2, 1], [1, 2, 2], [0, 2, 2], [1, 1, 1]], [1, -1, 0]),
    ([[2, -1, 0], [0, 2, 2], [1, 0, 0], [1, 0, 0], [1, 2, 2], [1, 1, 1]], [-1, -2, 0]),
]


def directions(rng: np.random.Generator, count: int) -> Iterator[tuple[Array, Array]]:
    """Yield contacts in directions of small integers, and velocities or forces."""
    for rows, load in DIRECTIONS:
        yield np.array(rows, dtype=float), np.array(load, dtype=float)
    for _ in range(count):
        dimension = int(rng.integers(1, 4))
        rows = rng.integers(-1, 3, (int(rng.integers(1, 8)), dimension)) + 0.0
        rows = np.vstack([rows[rows.any(axis=1)], np.ones(dimension)])
        load = rng.integers(-2, 2, dimension) * rng.choice([0.0, 1.0], p=[0.2, 0.8])
        yield np.where((rows @ load > 0)[:, None], -rows, rows), load


def test_motions_that_depend_on_shares_of_impulses() -> None:
    """Beside SciPy's linear program."""
    rng, counts = np.random.default_rng(2), np.zeros(2, dtype=int)
    given = [[0.5, 0.0, 0.5, 0.5], [0.5, 0.5, 0.25, 0.0, 0.0, 0.25], [0.0, 0.5, 0.5, 0.5]]
    for k, (rows, before) in enumerate(directions(rng, 300)):
        n = len(rows)
        parts = np.array(given[k]) if k < len(given) else rng.choice([0.0, 0.25, 0.5, 0.5], n)
        scaled, speed = rows * 2.0 ** rng.integers(-5, 6, (n, 1)), 2.0 ** rng.integers(-50, 51)
        start, none = speed * scaled @ before, np.zeros((n, n))
        found, *_ = solve_impact(scaled @ scaled.T, start, [UNILATERAL] * n, parts, none, POISSON)
        expected = depends_on_shares(rows, before, parts)
        assert found == 1 + expected, (rows, before, parts)
        counts[int(expected)] += 1
    assert counts.min() > 50


def test_motions_with_guides_that_depend_on_shares_of_impulses() -> None:
    """They are those of a mass that moves within its guides."""
    rng, counts = np.random.default_rng(3), np.zeros(2, dtype=int)
    for rows, before in directions(rng, 80):
        guide = rng.integers(-1, 2, (int(rng.integers(1, 3)), rows.shape[1])) + 0.0
        guide = guide[guide.any(axis=1)]
        every = np.vstack([guide, rows])
        n, guides = len(every), len(guide)
        parts = np.append(np.zeros(guides), rng.choice([0.0, 0.25, 0.5, 0.5], len(rows)))
        laws = np.array([FREE] * guides + [UNILATERAL] * len(rows))
        order = rng.permutation(n)
        scaled = (every * 2.0 ** rng.integers(-5, 6, (n, 1)))[order]
        found, *_ = solve_impact(
            scaled @ scaled.T, scaled @ before, laws[order], parts[order], np.zeros((n, n)), POISSON
        )
        along = np.eye(rows.shape[1]) - np.linalg.pinv(guide) @ guide
        moved = np.abs(rows @ along).max(axis=1) > 1e-9
        expected = depends_on_shares((rows @ along)[moved], before, parts[guides:][moved])
        assert found == 1 + expected, (guide, rows, before, parts)
        counts[int(expected)] += 1
    assert counts.min() > 15


def test_contacts_that_are_nearly_parallel_are_not_redundant() -> None:
    """Their directions differ by 1e-5, which shows in the velocity of the third row alone."""
    rows = np.array([[0, 1, 0], [1e-5, 1, 0], [1, 0, 0], [0, 0, 1]])
    impulse = np.array([0.5, 0.5, 0.0, 1.0])
    found, made, after, _ = solve_impact(
        rows @ rows.T,
        -rows @ rows.T @ impulse,
        [UNILATERAL, UNILATERAL, LIMITED, UNILATERAL],
        [0.5, 0.1, 0.0, 0.2],
        np.zeros((4, 4)),
        POISSON,
    )
    assert found == 1
    assert made == pytest.approx(impulse * [1.5, 1.1, 0.0, 1.2], rel=1e-5)
    assert after == pytest.approx([0.3, 0.3, 0.0, 0.2], abs=1e-5)


def test_equal_contacts_of_a_guided_box_have_one_motion() -> None:
    """A guide keeps its angle, so that it does not matter which corner takes the impulse."""
    rows = np.array([[0, 1, 0], [1, -1, 0], [1, 1, 0], [0, 0, 1]]) + 0.0
    laws, none = [FREE, UNILATERAL, UNILATERAL, UNILATERAL], np.zeros((4, 4))
    found, _, after, _ = solve_impact(
        rows @ rows.T, rows @ [-1, 0, -1], laws, [0.0, 0.5, 0.5, 0.2], none, POISSON
    )
    assert found == 1
    assert after == pytest.approx([0.0, 0.5, 0.5, 0.2], abs=1e-14)


def test_a_contact_that_nothing_moves_has_no_part_in_shares_of_impulses() -> None:
    """Two contacts in one place with equal restitution, one with another, and one that is inert."""
    rows = np.array([[1, 0], [1, 0], [0, 1], [0, 0]]) + 0.0
    found, _, after, _ = solve_impact(
        rows @ rows.T,
        rows @ [-1, -1],
        [UNILATERAL] * 4,
        [0.5, 0.5, 0.2, 0.1],
        np.zeros((4, 4)),
        POISSON,
    )
    assert found == 1
    assert after == pytest.approx([0.5, 0.5, 0.2, 0.0], abs=1e-14)


def least_forces(rows: Array, total: Array) -> Array:
    """Return the pushing forces of least norm with a sum, by trial of those that are not zero."""
    best = np.full(len(rows), np.inf)
    for pushes in itertools.product([0.0, 1.0], repeat=len(rows)):
        some = rows * np.array(pushes)[:, None]
        force = np.linalg.lstsq(some.T, total, rcond=None)[0]
        if force.min() < -1e-12 or not force @ force < best @ best - 1e-12:
            continue
        if np.abs(some.T @ force - total).max() < 1e-9:
            best = force
    return best


def test_all_contacts_that_do_not_move_share_the_forces() -> None:
    for rows, load in directions(np.random.default_rng(5), 40):
        n = len(rows)
        [(force, motion, _)] = solve_contacts(problem(rows @ rows.T, rows @ load, [UNILATERAL] * n))
        closed = np.abs(motion) < 1e-12
        expected = least_forces(rows * closed[:, None], rows.T @ force)
        assert force == pytest.approx(expected, abs=1e-9), (rows, load)


def test_lemkes_method_solves_problems_of_redundant_contacts() -> None:
    """The contacts that it finds bear the load; zeros of its tableau are so but for rounding."""
    rng = np.random.default_rng(2)
    for decades in (0, 1):
        for rows, load in directions(rng, 100):
            scaled = rows * 10.0 ** (decades * rng.uniform(-1, 1, (len(rows), 1)))
            given = problem(scaled @ scaled.T, scaled @ load, [UNILATERAL] * len(rows))
            solved, _, modes = lemke_modes(given)
            assert solved, (rows, load)
            pressed = np.vstack([rows[modes == HOLDS], np.zeros(len(load))])
            force, _ = nnls(pressed.T, -load)
            assert (rows @ (load + pressed.T @ force)).min() > -1e-9, (rows, load)


def test_a_sequence_without_end_ends() -> None:
    """In a narrow wedge with restitution 0.9, no energy is gained."""
    angle = math.pi / 20
    rows = np.array([[math.sin(angle), math.cos(angle)], [-math.sin(angle), math.cos(angle)]])
    found, _, after, loss = solve_impact(
        rows @ rows.T, rows @ [0.3, -1.0], [UNILATERAL] * 2, [0.9] * 2, np.zeros((2, 2)), SEQUENTIAL
    )
    assert found == 1
    assert after.min() > -1e-12
    assert 0.0 < loss.sum() <= 0.5 * (0.3**2 + 1.0) * (1 + 1e-12)


# --- random problems ------------------------------------------------------------------------------


def random_impact(rng: np.random.Generator) -> tuple[Array, Array, Array, Array, Array]:
    """Return A, velocities, laws, restitution, friction of an impact of 1 to 4 contacts."""
    contacts = int(rng.integers(1, 5))
    frictional = rng.random() < 0.8
    n, size = contacts * (2 if frictional else 1), int(rng.integers(2, 8))
    root = rng.normal(size=(size, size))
    mass = root @ root.T + 0.1 * np.eye(size)
    rows = rng.normal(size=(n, size))
    if rng.random() < 0.3 and contacts > 1:  # a redundant contact
        rows[contacts - 1] = rows[0]
    v = rng.normal(size=size)
    before = rows @ v
    away = before[:contacts] > 0.0
    rows[:contacts][away] *= -1.0
    before[:contacts][away] *= -1.0
    friction = np.zeros((n, n))
    laws = np.zeros(n, dtype=int)
    if frictional:
        laws[contacts:] = LIMITED
        for k in range(contacts):
            friction[contacts + k, k] = rng.uniform(0.0, 1.0)
    restitution = np.where(laws == UNILATERAL, rng.uniform(0.0, 1.0), 0.0)
    return inverse_inertia(mass, rows), before, laws, restitution, friction


def assert_lawful(given: tuple[Array, Array, Array, Array, Array], law: int) -> bool:
    """Check an impact's kinematics and its contacts; return whether its motion is unique.

    Newton's law with friction has no solution at times.
    """
    matrix, before, laws, _, _ = given
    found, impulse, after, loss = solve_impact(*given, law)
    if law == NEWTON and found == 0:
        return False
    assert found > 0
    size = np.abs(before).max() + np.abs(matrix @ impulse).max()
    # impulses of nearly redundant contacts are large, and their effects cancel
    rounding = 1e-12 * (np.abs(matrix) @ np.abs(impulse)).max()
    assert np.abs(matrix @ impulse + before - after).max() < 1e-8 * size + rounding
    energy = size * np.abs(impulse).max()
    unilateral = laws == UNILATERAL
    assert impulse[unilateral].min() >= -1e-9 * np.abs(impulse).max()
    total = -impulse @ (before + after) / 2.0
    assert loss.sum() == pytest.approx(total, abs=1e-8 * energy)
    if law != NEWTON:
        assert after[unilateral].min() >= -1e-9 * size
        assert loss.sum() >= -1e-8 * energy
    return bool(found == 1)


def check_random(count: int, seed: int, laws: tuple[int, ...] = (0, 1, 2)) -> None:
    rng = np.random.default_rng(seed)
    unique = [assert_lawful(random_impact(rng), laws[k % len(laws)]) for k in range(count)]
    assert np.mean(unique) > 0.8


def test_random_problems_obey_their_laws() -> None:
    """All that is called a solution is one, of problems with any offset."""
    rng = np.random.default_rng(3)
    counts = np.zeros(3, dtype=int)
    for _ in range(1000):
        matrix, before, laws, _, friction = random_impact(rng)
        offset = before + 0.3 * matrix @ rng.normal(size=len(before))
        slips = (laws == LIMITED) & (rng.random(len(laws)) < 0.3)
        laws = np.where(slips, rng.choice([FORWARD, BACKWARD], len(laws)), laws)
        given = problem(matrix, offset, laws)
        given = given._replace(static_slopes=friction, kinetic_slopes=friction)
        solutions = solve_contacts(given)
        counts[len(solutions)] += 1
        for force, motion, _ in solutions:
            size = np.abs(offset).max() + np.abs(matrix).max() * np.abs(force).max()
            scale = max(size, np.abs(force).max())
            assert given.violation(force, motion) < 1e-8 * scale
    assert counts.min() > 10


def test_random_impacts() -> None:
    check_random(1000, 20261122)


@pytest.mark.slow
@pytest.mark.parametrize("law", [0, 1, 2])
def test_many_random_impacts(law: int) -> None:
    check_random(100_000, 15, (law,))


@pytest.mark.parametrize("present", list(itertools.product(range(4), repeat=3)))
def test_the_modes_that_are_tried_first_change_nothing(present: tuple[int, ...]) -> None:
    """A contact, its friction and a bilateral row: also where this one is open at first."""
    rows = [[0.0, 1.0, 0.3], [1.0, 0.0, 0.2], [0.4, 0.1, 1.0]]
    given = problem(
        inverse_inertia(np.eye(3), rows),
        [-5.0, 3.0, 2.0],
        [UNILATERAL, LIMITED, FREE],
        {(1, 0): 0.4},
    )
    force, motion, modes = solve(given)
    [(again, moves, found)] = solve_contacts(given, present)
    assert list(found) == modes
    np.testing.assert_allclose(again, force, rtol=1e-13)
    np.testing.assert_allclose(moves, motion, atol=1e-13)


# --- units ----------------------------------------------------------------------------------------


def any_problem(rng: np.random.Generator) -> ContactProblem:
    """Return a problem with rows of all laws, which may be redundant."""
    n = int(rng.integers(1, 7))
    rows = rng.normal(size=(n, int(rng.integers(1, n + 3))))
    if n > 2 and rng.random() < 0.4:
        rows[1] = rows[0] * rng.choice([-1.0, 0.5, 2.0])
    laws = rng.choice([UNILATERAL, UNILATERAL, LIMITED, LIMITED, FREE, FORWARD, BACKWARD], n)
    rubs = ~np.isin(laws, (UNILATERAL, FREE))
    kinetic = np.where(rubs & (rng.random(n) < 0.5), rng.uniform(0.1, 2.0, n), 0.0)
    slopes = np.zeros((n, n))
    for k, j in itertools.product(np.flatnonzero(rubs), np.flatnonzero(~rubs)):
        slopes[k, j] = rng.choice([0.0, 0.0, 0.2, 0.7])
    more = rng.choice([1.0, 1.0, 1.4])
    offset = rows @ rng.normal(size=rows.shape[1])
    matrix = rows @ rows.T
    return ContactProblem(
        (matrix + matrix.T) / 2, offset, laws, more * kinetic, kinetic, more * slopes, slopes
    )


def in_units(given: ContactProblem, force: float, motion: float) -> ContactProblem:
    """Return the same problem with numbers of forces and of motions that are so much larger."""
    return given._replace(
        matrix=given.matrix * (motion / force),
        offset=given.offset * motion,
        static=given.static * force,
        kinetic=given.kinetic * force,
    )


UNITS = [(2.0**-60, 1.0), (2.0**60, 1.0), (1.0, 2.0**40), (2.0**20, 2.0**-40)]


def test_solutions_are_the_same_in_all_units() -> None:
    """To the last bit, where units differ by powers of 2 and A by powers of 4.

    What is zero by the mode of its row is exactly zero.
    """
    rng, counts = np.random.default_rng(0), np.zeros(3, dtype=int)
    for _ in range(250):
        given = any_problem(rng)
        expected = solve_contacts(given)
        counts[len(expected)] += 1
        for force, motion, modes in expected:
            pushes = given.laws == UNILATERAL
            assert (motion[modes == HOLDS] == 0.0).all()
            assert (force[modes == OPEN] == 0.0).all()
            assert (np.concatenate([force[pushes], motion[pushes]]) >= 0.0).all()
        for force, motion in UNITS:
            found = solve_contacts(in_units(given, force, motion))
            assert len(found) == len(expected)
            for (x, y, modes), (u, v, others) in zip(found, expected, strict=True):
                np.testing.assert_array_equal(x, force * u)
                np.testing.assert_array_equal(y, motion * v)
                np.testing.assert_array_equal(modes, others)
    assert (counts[1:] >= [100, 5]).all()


@pytest.mark.parametrize("law", [POISSON, NEWTON, SEQUENTIAL])
def test_impacts_are_the_same_in_all_units(law: int) -> None:
    rng = np.random.default_rng(law)
    for _ in range(40):
        matrix, before, *laws = random_impact(rng)
        count, *expected = solve_impact(matrix, before, *laws, law)
        for force, motion in UNITS:
            found = solve_impact(matrix * (motion / force), before * motion, *laws, law)
            assert found[0] == count
            if count:
                units = (force, motion, force * motion)
                for x, y, unit in zip(found[1:], expected, units, strict=True):
                    np.testing.assert_array_equal(x, unit * y)


def test_lemkes_method_solves_problems_of_friction_alone() -> None:
    """Rows that move each other little stick or slip as each does alone."""
    rng, modes = np.random.default_rng(3), set()
    for _ in range(60):
        n = int(rng.integers(1, 5))
        scale = 10.0 ** rng.uniform(-3, 3, n)
        matrix = (np.eye(n) + 1e-3 * rng.uniform(-1, 1)) * np.outer(scale, scale)
        load = rng.choice([-1.5, -0.6, 0.6, 1.5], n)
        given = problem(matrix, load * scale, [LIMITED] * n, limits=1.0 / scale)
        expected = np.where(abs(load) < 1, HOLDS, np.where(load > 0, SLIPS_FORWARD, SLIPS_BACKWARD))
        solved, right, found = lemke_modes(given)
        assert solved
        assert right
        assert found.tolist() == expected.tolist()
        modes.update(found.tolist())
    assert modes == {HOLDS, SLIPS_FORWARD, SLIPS_BACKWARD}
