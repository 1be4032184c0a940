"""Chains of N bodies: statics, the published reference, and two descriptions of one motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

import lagcli

MODELS = Path(__file__).parents[2] / "models"
CASES = Path(__file__).parents[1] / "benchmark" / "cases"


@pytest.mark.parametrize("n", [1, 2, 20, 100])
def test_tensions_of_a_hanging_chain(n: int) -> None:
    """Each rod carries what hangs below it."""
    model = lagcli.load(MODELS / "chain.yaml", set={"N": n, "theta_0": "0 deg"})
    run = lagcli.simulate(model, t_end=0.01, samples=2)
    weights = 9.81 * np.arange(n, 0, -1) / n
    tensions = np.array([run.outputs[f"tension[{i}]"] for i in range(1, n + 1)])
    np.testing.assert_allclose(tensions[:, 0], weights, rtol=1e-11)
    np.testing.assert_allclose(tensions[:, 1], weights, rtol=1e-8)


def test_reference_of_ten_masses() -> None:
    """Let go horizontally: computed in quadruple precision from the equations in angles."""
    case = yaml.load((CASES / "pendulum_chain_n10.yaml").read_text(), yaml.CSafeLoader)
    reference = next(r for r in case["reference"] if float(r["t"]) == 0.5)
    model = lagcli.load(MODELS / "chain.yaml", set={"N": 10, "theta_0": "90 deg"})
    run = lagcli.simulate(model, t_end=0.5, samples=2, rtol=1e-11, atol=1e-12)
    for table, found in (("q", run.q), ("qd", run.v)):
        for name, value in reference[table].items():
            i = run.coordinates.index(f"{name[0]}[{name[1:]}]")
            assert found[-1, i] == pytest.approx(float(value), abs=2e-8)
    for i, value in enumerate(reference["lam"].values()):
        # there masses of 1 kg, not 0.1, and half of the constraint
        assert 20 * run.multipliers[-1, i] == pytest.approx(float(value), rel=1e-6)


def test_in_angles_it_moves_as_in_positions() -> None:
    n = 6
    options = {"t_end": 1.0, "samples": 11, "rtol": 1e-11, "atol": 1e-12}
    chain = lagcli.simulate(lagcli.load(MODELS / "chain.yaml", set={"N": n}), **options)
    angles = lagcli.simulate(lagcli.load(MODELS / "pendulum_chain.yaml", set={"N": n}), **options)
    x = np.cumsum(np.sin(angles.q) / n, axis=1)
    y = -np.cumsum(np.cos(angles.q) / n, axis=1)
    np.testing.assert_allclose(chain.q, np.hstack([x, y]), atol=1e-9)
    np.testing.assert_allclose(chain.energy_kinetic, angles.energy_kinetic, atol=1e-9)


def test_results_have_the_members(tmp_path: Path) -> None:
    model = lagcli.load(MODELS / "chain.yaml", set={"N": 3}, set_initial={"x[3]'": 0})
    run = lagcli.simulate(model, t_end=0.1, samples=3)
    for suffix in ("h5", "csv"):
        path = tmp_path / f"run.{suffix}"
        lagcli.write(run, path)
        back = lagcli.read(path)
        assert back.coordinates == ("x[1]", "x[2]", "x[3]", "y[1]", "y[2]", "y[3]")
        assert back.constraints == ("rod[1]", "rod[2]", "rod[3]")
        np.testing.assert_allclose(back.outputs["tension[2]"], run.outputs["tension[2]"])
    head = (tmp_path / "run.csv").read_text().split("\n")[0].split(",")
    assert {"x[3]", "x[3]_dot", "lambda.rod[2]", "Qc.y[1]", "Qc.rod[2].y[1]"} <= set(head)
