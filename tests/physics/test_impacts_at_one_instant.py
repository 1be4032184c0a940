"""Thousands of impacts at one instant: a light ball on the floor under a heavy one."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli

#: M/m; π √(M/m) impacts, as G. Galperin counts them, more than 100 for each contact.
RATIO = 1e5
MODEL = """\
coordinates: [y, z]
T: y'^2/2 + {ratio}*z'^2/2
constraints:
{contacts}
initial: {{y: 0, z: 0, y': 0, z': 0}}
events: {{push: {{when: t >= 1, impulse: {{y: 0.5, z: -{ratio}}}}}}}
simulation: {{t_end: 1.5, samples: 2}}
"""


def velocities(floor: float, above: float) -> tuple[float, float, int]:
    """Return the velocities after impacts in turn, and their number; above strikes first."""
    y, z, count = 0.5, -1.0, 0
    while True:
        if z < y:
            impulse = (1 + above) * (y - z) / (1 + 1 / RATIO)
            y, z = y - impulse, z + impulse / RATIO
        elif y < 0:
            y = -floor * y
        else:
            return y, z, count
        count += 1


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("e", [(1.0, 1.0), (0.9999, 1.0), (1.0, 0.9999), (0.9999, 0.9999)])
def test_sequences_that_lose_energy_end_with_rest(e: tuple[float, float], order: list[int]) -> None:
    """All contacts together stop what is left after 100 impacts of each; with e = 1, none does."""
    contacts = [
        f"  floor: {{expr: y >= 0, restitution: {e[0]}}}",
        f"  above: {{expr: z >= y, restitution: {e[1]}}}",
    ]
    text = MODEL.format(ratio=RATIO, contacts="\n".join(contacts[i] for i in order))
    run = lagcli.simulate(lagcli.load_text(text))
    y, z, count = velocities(*e)
    assert count > 900
    assert run.events is not None
    impacts = run.events.kinds.count("impact")
    loss = float(np.sum(run.events.loss))
    if max(e) < 1.0:
        assert 200 < impacts < 210
        # the light ball was √(M/m) times as fast
        assert run.v[-1] == pytest.approx([0.0, 0.0], abs=1e-12 * RATIO**0.5)
        assert loss == pytest.approx(RATIO / 2 + 0.5**2 / 2, rel=1e-9)
        return
    assert impacts == count
    assert run.v[-1] == pytest.approx([y, z], rel=1e-9)
    assert loss == pytest.approx(
        RATIO / 2 * (1 - z * z) + (0.25 - y * y) / 2, rel=1e-9, abs=1e-9 * RATIO
    )


@pytest.mark.parametrize(
    ("e", "law", "unique"),
    [
        ((0.2, 0.6, 0.2), "poisson", False),
        ((0.0, 0.6, 0.6), "poisson", False),
        ((0.2, 0.2, 0.9), "poisson", True),
        ((0.2, 0.6, 0.2), "newton", True),
    ],
)
def test_redundant_contacts_that_return_different_parts(
    e: tuple[float, float, float], law: str, *, unique: bool
) -> None:
    """Two stops of one slider share its impulse in any way; another slider has its own stop."""
    text = f"""
coordinates: [x, y]
T: x'^2/2 + y'^2/2
constraints:
  left: {{expr: x >= 0, restitution: {e[0]}}}
  right: {{expr: 2*x >= 0, restitution: {e[1]}}}
  other: {{expr: y >= 0, restitution: {e[2]}}}
initial: {{x: 0, y: 0, x': -1, y': -1}}
simulation: {{t_end: 0.5, samples: 2, impacts: {law}}}
"""
    run = lagcli.simulate(lagcli.load_text(text))
    assert run.events is not None
    assert ("not unique" not in run.events.kinds) == unique
    assert e[0] - 1e-12 <= run.v[-1, 0] <= e[1] + 1e-12
    assert run.v[-1, 1] == pytest.approx(e[2])


@pytest.mark.parametrize(("e", "why"), [(0.8, "with different coefficients of"), (0.1, "")])
def test_an_impact_that_gains_energy_names_the_coefficients(e: float, why: str) -> None:
    """With one coefficient for both contacts, Poisson's law gains none."""
    run = lagcli.simulate(
        lagcli.load_text(f"""
coordinates: [x, y, z]
T: 0.77*x'^2 + 0.7*x'*y' - 0.98*x'*z' + 1.81*y'^2 - 1.89*y'*z' + 0.725*z'^2
constraints:
  left: {{expr: x >= 0, restitution: 0.1, friction: 1, slip: z'}}
  right: {{expr: y >= 0, restitution: {e}}}
initial: {{x: 0, y: 0, z: 0, x': -0.4, y': -0.4, z': -0.4}}
simulation: {{t_end: 0.1, samples: 2}}
""")
    )
    assert run.status == ("failed" if why else "completed")
    assert why in run.message
