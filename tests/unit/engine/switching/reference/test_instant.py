"""Contact problems of a System at one instant."""

import numpy as np
import pytest

from lagcli.engine.switching.problem import ContactLaw
from lagcli.engine.switching.reference.instant import InstantProblems
from lagcli.engine.switching.reference.tapes import SwitchingTapes
from lagcli.engine.switching.switching import RowMode
from tests.support.switching_models import BLOCK, prepared


def problems(text: str = BLOCK, law: str = "poisson") -> InstantProblems:
    system, _, full = prepared(text)
    found = InstantProblems(full, SwitchingTapes(system), 1e-9, law, 1.0)  # type: ignore[arg-type]
    found.lengths[:] = 1.0
    found.velocity_scale[:] = 1.0
    found.position_scale[:] = 1.0
    return found


def test_gaps_and_rates() -> None:
    p = problems()
    gaps, allowed = p.gaps(0.0, np.array([0, 0.25]), np.array([1, -2.0]))
    assert (gaps[0], allowed[0]) == (0.25, 1e-9)
    assert gaps[1] == np.inf  # friction has none
    rates, _ = p.rates(0.0, np.array([0, 0.25]), np.array([1, -2.0]))
    np.testing.assert_array_equal(rates, [-2, 1])


def test_impact_with_friction() -> None:
    """Restitution 0.5, mu = 0.5: Λ = 1.5 m v, and friction takes mu of it."""
    found = problems().impact(0.0, np.zeros(2), np.array([3.0, -2.0]), [0])
    np.testing.assert_allclose(found.v, [3.0 - 0.5 * 3.0, 1.0])
    np.testing.assert_allclose(found.impulse, [6.0, -3.0])
    energy = 0.5 * 2 * (3.0**2 + 2.0**2 - 1.5**2 - 1.0**2)
    assert found.loss.sum() == pytest.approx(energy)


@pytest.mark.parametrize(
    ("v", "pinned", "mode"),
    [
        (1.0, {}, RowMode.FORWARD),
        (-1.0, {}, RowMode.BACKWARD),
        (0.0, {}, RowMode.HOLDS),
        (0.0, {1: ContactLaw.BACKWARD}, RowMode.BACKWARD),
    ],
)
def test_modes_that_follow(v: float, pinned: dict[int, ContactLaw], mode: RowMode) -> None:
    present = np.array([RowMode.HOLDS, RowMode.HOLDS])
    found = problems().modes(0.0, np.zeros(2), np.array([v, 0]), [0], present, pinned, np.zeros(2))
    assert list(found.modes) == [RowMode.HOLDS, mode]
    assert found.multipliers[0] == pytest.approx(20.0)


def test_friction_of_an_open_contact_is_open() -> None:
    present = np.array([RowMode.HOLDS, RowMode.HOLDS])
    found = problems().modes(0.0, np.zeros(2), np.array([1.0, 1]), [], present, {}, np.zeros(2))
    assert list(found.modes) == [RowMode.OPEN, RowMode.OPEN]
    np.testing.assert_allclose(found.a, [0, -10])


def test_projection_onto_rows_that_hold() -> None:
    p = problems()
    q, v = np.array([0.3, 1e-9]), np.array([1.0, 1e-5])
    q, v = p.projected(0.0, q, v, np.array([RowMode.HOLDS, RowMode.FORWARD]))
    np.testing.assert_allclose([*q, *v], [0.3, 0, 1, 0], atol=1e-16)


def test_an_impact_that_gains_energy_is_rejected() -> None:
    """The double pendulum of Kane and Levinson; Newton's law multiplies its energy by 2.76."""
    from tests.support.contact_cases import contact_model, run_contact

    found = run_contact(contact_model("kane_levinson", simulation={"impacts": "newton"}), "scipy")
    assert found.outcome.status == "failed"
    assert found.outcome.message == (
        "an impact at `floor` would gain 0.04074 J (Newton's law with friction) at t = 0 s:"
        " use `impacts: poisson`"
    )


def test_two_motions_are_rejected() -> None:
    from tests.support.contact_cases import contact_model, run_contact

    model = contact_model("painleve_klein", mu=2.0, P2="-6 N")
    found = run_contact(model, "scipy")
    assert found.outcome.message.startswith("2 solutions for the friction at `rough` at t = 0 s")
