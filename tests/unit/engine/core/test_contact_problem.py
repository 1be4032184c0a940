"""Contact problems: what counts as a solution."""

import numpy as np
import pytest

from lagcli.engine.core.contact_problem import ContactLaw, ContactProblem


def block_on_incline(slope: float, friction: float) -> ContactProblem:
    """Return the problem of a block of 1 kg at rest on an incline, g = 10 m/s²: normal, tangent."""
    slopes = np.array([[0.0, 0.0], [friction, 0.0]])
    return ContactProblem(
        matrix=np.eye(2),
        offset=np.array([-10.0 * np.cos(slope), 10.0 * np.sin(slope)]),
        laws=np.array([ContactLaw.UNILATERAL, ContactLaw.LIMITED]),
        static=np.zeros(2),
        kinetic=np.zeros(2),
        static_slopes=slopes,
        kinetic_slopes=slopes,
    )


def test_a_block_sticks_below_the_angle_of_friction() -> None:
    problem = block_on_incline(0.3, 0.4)  # tan 0.3 = 0.309
    assert problem.violation(-problem.offset, np.zeros(2)) < 1e-14
    sliding = np.array([-problem.offset[0], -0.4 * -problem.offset[0]])
    y = problem.matrix @ sliding + problem.offset
    # friction beyond what drives it would push the block uphill, along the force
    assert y[1] < 0
    assert problem.violation(sliding, y) == pytest.approx(-y[1])


def test_a_block_slides_above_the_angle_of_friction() -> None:
    problem = block_on_incline(0.5, 0.4)  # tan 0.5 = 0.546
    assert problem.violation(-problem.offset, np.zeros(2)) == pytest.approx(
        10 * np.sin(0.5) - 0.4 * 10 * np.cos(0.5)
    )
    sliding = np.array([-problem.offset[0], -0.4 * -problem.offset[0]])
    assert problem.violation(sliding, problem.matrix @ sliding + problem.offset) < 1e-14


def test_a_contact_neither_pulls_nor_overlaps() -> None:
    problem = block_on_incline(0.0, 0.0)
    assert problem.violation(np.zeros(2), problem.offset) == pytest.approx(10.0)
    assert problem.violation(np.array([12.0, 0.0]), np.array([2.0, 0.0])) == pytest.approx(2.0)


def test_the_velocity_of_a_row_that_slips_tells_its_force() -> None:
    """A block that slides uphill on an incline where it could stick is braked."""
    problem = block_on_incline(0.3, 0.4)
    normal = -problem.offset[0]
    for law, sign in ((ContactLaw.FORWARD, -1.0), (ContactLaw.BACKWARD, 1.0)):
        slips = problem._replace(laws=np.array([ContactLaw.UNILATERAL, law]))
        x = np.array([normal, sign * 0.4 * normal])
        assert slips.violation(x, x + problem.offset) < 1e-14
        assert slips.violation(-x * [-1, 1], -x * [-1, 1] + problem.offset) > 1.0
