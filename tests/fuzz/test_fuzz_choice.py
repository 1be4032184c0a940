"""Random chains of rods, springs and dampers: a change of the method in mid-run costs no accuracy.

The reference is a run of Taylor's method at the tightest tolerance, which never changes.
"""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.engine.integrate import methods

SEEDS = 100


def chain(rng: random.Random) -> str:
    """Return the model of one to four masses, each on a rod or a spring with a damper."""
    masses = range(1, rng.randint(1, 4) + 1)
    stiffness, damping = 10 ** rng.uniform(0, 8), rng.choice([0, 10 ** rng.uniform(-1, 4)])
    definitions, constraints, initial = ["definitions:"], ["constraints:"], ["initial:"]
    potential, dissipation = [f"9.81*y_{i}" for i in masses], ["0*x_1'^2"]
    x = y = 0.0
    for i in masses:
        angle, length = rng.uniform(-2, 2), rng.uniform(0.5, 1.5)
        x, y = x + length * np.sin(angle), y - length * np.cos(angle)
        before_x, before_y = (f"x_{i - 1}", f"y_{i - 1}") if i > 1 else ("0", "0")
        distance = f"(x_{i} - {before_x})^2 + (y_{i} - {before_y})^2"
        definitions.append(f"  s_{i}: sqrt({distance})")
        if rng.random() < 0.5:
            constraints.append(f"  rod_{i}: {distance} = {length**2}")
        else:
            rest = length * rng.choice([1, 1.01])
            potential.append(f"{stiffness}/2*(s_{i} - {rest})^2")
            dissipation.append(f"{damping}/2*s_{i}'^2")
        for name, value in ((f"x_{i}", x), (f"y_{i}", y), (f"x_{i}'", 0), (f"y_{i}'", 0)):
            initial.append(f"  {name}: {{guess: {float(value)}}}")
    kinetic = " + ".join(f"x_{i}'^2 + y_{i}'^2" for i in masses)
    lines = [
        f"coordinates: [{', '.join(f'x_{i}, y_{i}' for i in masses)}]",
        f"T: ({kinetic})/2",
        f"V: {' + '.join(potential)}",
        f"D: {' + '.join(dissipation)}",
        *definitions,
        *(constraints if len(constraints) > 1 else ()),
        *initial,
    ]
    if rng.random() < 0.3:
        lines.append(f"Q: {{x_1: 5*sin({rng.uniform(1, 40)}*t)}}")
    return "\n".join(lines) + "\n"


@pytest.mark.fuzz
@pytest.mark.parametrize("eager", [False, True])
@pytest.mark.parametrize("seed", range(SEEDS))
def test_a_change_costs_no_accuracy(
    seed: int, eager: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if eager:  # changes to an implicit method whenever it can
        monkeypatch.setattr(methods, "_PREPARATION", 0)
    rng = random.Random(seed)
    model, rtol = lagcli.load_text(chain(rng)), 10 ** -rng.uniform(4, 10)
    options: dict[str, Any] = {"t_end": rng.uniform(0.2, 2), "samples": rng.randint(5, 300)}
    exact = lagcli.simulate(model, method="Taylor", rtol=1e-13, max_steps=200_000, **options)
    plain = lagcli.simulate(model, method="DOP853", rtol=rtol, max_steps=200_000, **options)
    if exact.status != "completed" or plain.status != "completed":
        pytest.skip("there is nothing to compare with")
    found = lagcli.simulate(model, rtol=rtol, **options)
    assert found.status == "completed", found.message
    for column in ("q", "v", "multipliers"):
        should = getattr(exact, column)
        scale = np.abs(should).max(initial=1e-9)
        error, before = (
            np.abs(getattr(run, column) - should).max(initial=0.0) for run in (found, plain)
        )
        # Radau at a tolerance is as accurate as DOP853 within two orders; rounding, of λ too
        assert error <= 30 * before + 1e3 * rtol * scale, (column, found.options["choice"])
