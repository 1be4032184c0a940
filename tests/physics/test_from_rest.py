"""Starts from rest: coordinates without a size yet, beside others that have one."""

from pathlib import Path

import numpy as np
import pytest

import lagcli

ATWOOD = str(Path(__file__).parents[2] / "models" / "atwood.yaml")


@pytest.mark.parametrize(
    ("formulation", "method"),
    [
        ("baumgarte", "DOP853"),
        ("projection", "Rodas5P"),
        ("projection", "Radau"),
    ],
)
def test_an_atwood_machine_starts_from_rest(formulation: str, method: str) -> None:
    """The first steps are so short that rounding errors of the constraints must not count."""
    run = lagcli.simulate(
        lagcli.load(ATWOOD),
        formulation=formulation,
        method=method,
        max_steps=2000,
        samples=5,
    )
    assert run.status == "completed", run.message
    p = run.parameters
    total = p["m_1"] + p["m_2"] + p["J"] / p["R"] ** 2
    a = (p["m_1"] - p["m_2"]) * p["g"] / total
    np.testing.assert_allclose(run.q[:, 0], a * run.time**2 / 2, atol=1e-9)
    np.testing.assert_allclose(run.multipliers[:, 0], p["m_1"] * (p["g"] - a), rtol=1e-9)


@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Radau", "Rodas5P"])
@pytest.mark.parametrize("force", ["t", "t^2", "sin(3*t)", "1 - cos(2*t)", "exp(t) - 1 - t"])
def test_a_body_that_a_growing_force_moves_leaves_zero_without_events(
    force: str, method: str
) -> None:
    """Conditions hold at the start, or never. Dense outputs of implicit methods are off by more
    than the motion just after it, and had events there.
    """
    conditions = ["x' < 0", "x' > 0", "x < 0", "x > 0", "x = 0", "x' = 0", "x*x' < 0"]
    conditions += ["x > -9 and x' < 0", "x + x' > 0"]
    events = "".join(f'  e{i}: {{when: "{c}"}}\n' for i, c in enumerate(conditions))
    for factor in (4.1, -0.7):
        model = lagcli.load_text(
            "coordinates: [x, z]\nT: 0.8*x'^2 + z'^2/2\nV: z^2\n"
            f'Q: {{x: "{factor}*({force})"}}\nevents:\n{events}'
            "initial: {x: 0, x': 0, z: 1, z': 0}\n"
        )
        for rtol in (1e-7, 1e-9, 1e-11):
            run = lagcli.simulate(model, t_end=1, samples=2, rtol=rtol, method=method)
            assert run.events is not None
            assert run.events.names == (), (factor, rtol, run.events.names, run.events.time)
