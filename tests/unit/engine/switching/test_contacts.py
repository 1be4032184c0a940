"""The solver of contact problems: every answer obeys the laws, and all motions are found."""

import numpy as np
import pytest

from lagcli.arrays import Array
from lagcli.engine.core.contact_problem import ContactLaw, ContactProblem
from lagcli.engine.switching.switching import RowMode
from tests.support.contact_problems import contact_motions, solve_contacts

U, L, F = ContactLaw.UNILATERAL, ContactLaw.LIMITED, ContactLaw.FREE


def problem(
    matrix: object, offset: object, laws: list[ContactLaw], friction: dict[tuple[int, int], float]
) -> ContactProblem:
    """Return a problem whose limits have no constant parts."""
    n = len(laws)
    slopes = np.zeros((n, n))
    for place, mu in friction.items():
        slopes[place] = mu
    zero = np.zeros(n)
    a, b = np.array(matrix, dtype=float), np.array(offset, dtype=float)
    return ContactProblem(a, b, np.array(laws), zero, zero, slopes, slopes)


def painleve(theta: float, mu: float, spin: float) -> ContactProblem:
    """Return the problem of Painlevé's rod (m = 1 kg, half length 0.5 m) that slides backwards."""
    l, g, s, c = 0.5, 9.81, np.sin(theta), np.cos(theta)
    normal, tangent = np.array([0.0, 1.0, -l * c]), np.array([1.0, 0.0, l * s])
    inertia = np.diag([1.0, 1.0, 1 / 3 * l**2])
    rows = np.array([normal, tangent])
    matrix = rows @ np.linalg.inv(inertia) @ rows.T
    offset = np.array([-g + l * s * spin**2, l * c * spin**2])
    return problem(matrix, offset, [U, ContactLaw.BACKWARD], {(1, 0): mu})


def test_painleve_s_rod_slides_or_opens() -> None:
    """Values of tests/benchmark/contact/painleve_rod.yaml, to the digits given there."""
    motions = contact_motions(painleve(np.arctan(2), 1.6, 6.0))
    assert len(motions) == 2
    slides, opens = sorted(motions, key=lambda x: -x.force[0])
    assert slides.force[0] == pytest.approx(19.65527949374526816920641, rel=1e-12)
    assert opens.motion[0] == pytest.approx(6.289689437998485814146050, rel=1e-12)
    assert list(opens.modes) == [RowMode.OPEN, RowMode.OPEN]


def test_painleve_s_rod_has_no_motion() -> None:
    assert contact_motions(painleve(np.arctan(2), 1.6, 0.0)) == ()
    assert len(contact_motions(painleve(np.arctan(2), 1.3, 0.0))) == 1


def klein(mu: float, load: float) -> ContactProblem:
    """Return Klein's problem: two masses of 1 kg on a rod at 60° that move to the right.

    Coordinates are x_1 and y_1 of the mass in the rough guide y_1 = 0; the load pulls the other
    one, x_2' = x_1' + y_1' tan 60°. See tests/benchmark/contact/painleve_klein.yaml.
    """
    tan = np.tan(np.pi / 3)
    inverse = np.linalg.inv([[2.0, tan], [tan, 1 + tan**2]])
    rows = np.array([[0.0, 1.0], [1.0, 0.0]])
    offset = rows @ inverse @ np.array([load, tan * load])
    return problem(rows @ inverse @ rows.T, offset, [F, ContactLaw.FORWARD], {(1, 0): mu})


def test_force_of_klein_s_rough_guide() -> None:
    (found,) = contact_motions(klein(0.8, 6.0))
    assert found.force[0] == pytest.approx(-16.91567773597429207804296, rel=1e-12)
    assert found.motion[1] == pytest.approx(-3.766271094389716831217184, rel=1e-12)


@pytest.mark.parametrize(
    ("mu", "load", "motions"),
    [(1.15, 6, 1), (1.15, -6, 1), (1.16, 6, 0), (1.16, -6, 2), (2.0, 6, 0), (2.0, -6, 2)],
)
def test_beyond_its_bound_friction_of_a_guide_has_two_answers_or_none(
    mu: float, load: float, motions: int
) -> None:
    """The bound is 2/tan 60° = 1.1547."""
    assert len(contact_motions(klein(mu, load))) == motions


def test_redundant_friction_stays_within_the_cones() -> None:
    """A box on two corners: least norm alone would ask of one corner more than it bears."""
    # rows: two normals, two tangents of the same direction; only their sum is determined
    rows = np.array([[0, 1, -0.2], [0, 1, 0.2], [1, 0, 0.3], [1, 0, 0.3]], dtype=float)
    load = np.array([4.0, -10.0, 0.0])
    found = solve_contacts(
        problem(rows @ rows.T, rows @ load, [U, U, L, L], {(2, 0): 0.41, (3, 1): 0.41})
    )
    assert found is not None
    n, t = found.force[:2], found.force[2:]
    assert list(found.modes) == [RowMode.HOLDS] * 4
    assert t.sum() == pytest.approx(-4.0, rel=1e-12)
    assert (np.abs(t) <= 0.41 * n * (1 + 1e-8)).all()
    assert abs(t[0]) == pytest.approx(0.41 * n[0], rel=1e-8)  # and it is not equally divided


def test_a_row_sticks_if_it_can() -> None:
    """Between the kinetic and the static limit, rest and motion are possible; rest is taken."""
    sticky = problem(np.eye(1), [2.0], [L], {})._replace(
        static=np.array([3.0]), kinetic=np.array([1.0])
    )
    (found,) = contact_motions(sticky, np.array([RowMode.FORWARD]))
    assert found.modes[0] == RowMode.HOLDS
    (found,) = contact_motions(sticky._replace(offset=np.array([4.0])))
    assert found.modes[0] == RowMode.FORWARD
    assert found.motion[0] == 3.0


def test_present_modes_are_kept_where_several_fit() -> None:
    still = problem(np.eye(1), [0.0], [U], {})
    for mode in (RowMode.OPEN, RowMode.HOLDS):
        (found,) = contact_motions(still, np.array([mode]))
        assert found.modes[0] == mode


def random_problem(rng: np.random.Generator, n: int, friction: bool) -> ContactProblem:
    rank = int(rng.integers(1, n + 1))
    rows = rng.standard_normal((n, rank))
    laws = [L if friction and i % 2 else U for i in range(n)]
    mu = {(i, i - 1): float(rng.uniform(0, 0.4)) for i in range(1, n, 2)} if friction else {}
    return problem(rows @ rows.T, rows @ rng.standard_normal(rank), laws, mu)


def relative_violation(found: object, of: ContactProblem, x: Array, y: Array) -> float:
    size = np.abs(of.matrix) @ np.abs(x) + np.abs(of.offset)
    return of.violation(x, y) / max(1.0, float(size.max()), float(np.abs(x).max()))


@pytest.mark.parametrize("friction", [False, True])
@pytest.mark.parametrize("n", [2, 6, 14, 30])
def test_random_problems_are_solved(n: int, friction: bool) -> None:
    """Beyond the bounds of enumeration too; without friction a motion is unique."""
    rng = np.random.default_rng(n)
    for _ in range(20):
        given = random_problem(rng, n, friction)
        found = solve_contacts(given)
        assert found is not None
        assert relative_violation(found, given, found.force, found.motion) < 1e-8
        if not friction:
            (other,) = contact_motions(given, np.zeros(n, dtype=int))
            np.testing.assert_allclose(other.motion, found.motion, atol=1e-7)


def test_no_rows_no_forces() -> None:
    nothing = solve_contacts(problem(np.zeros((0, 0)), [], [], {}))
    assert nothing is not None
    assert nothing.force.shape == (0,)


def test_a_limited_row_that_was_open_sticks_where_no_force_is_needed() -> None:
    one, none = np.ones((1, 1)), np.zeros((1, 1))
    limits = np.array([8.0]), np.array([4.0]), none, none
    problem = ContactProblem(one, np.zeros(1), np.array([int(ContactLaw.LIMITED)]), *limits)
    (motion,) = contact_motions(problem, np.array([int(RowMode.OPEN)]))
    assert motion.modes.tolist() == [RowMode.HOLDS]


@pytest.mark.parametrize("push", [100.0, -100.0])
def test_a_row_without_friction_slips_where_it_is_pushed(push: float) -> None:
    """Its force is the same both ways: zero."""
    nothing = np.zeros(1)
    problem = ContactProblem(
        np.eye(1),
        np.array([push]),
        np.array([ContactLaw.LIMITED]),
        nothing,
        nothing,
        np.zeros((1, 1)),
        np.zeros((1, 1)),
    )
    for present in RowMode.FORWARD, RowMode.BACKWARD:
        (found,) = contact_motions(problem, np.array([present]))
        assert found.modes.tolist() == [RowMode.FORWARD if push > 0 else RowMode.BACKWARD]
