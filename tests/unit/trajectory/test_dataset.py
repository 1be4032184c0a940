"""Trajectories as datasets of xarray."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.trajectory.dataset import to_dataset

xarray = pytest.importorskip("xarray")

MODEL = """
coordinates: {x: m, phi: rad}
parameters: {m: {value: 1, unit: kg}, J: {value: 2, unit: kg*m^2}, r: {value: 0.5, unit: m}}
T: m*x'^2/2 + J*phi'^2/2
constraints: {roll: x' = r*phi'}
outputs: {height: {expr: 2*x, unit: m}}
initial: {x: 0, phi: 0, x': 1, phi': 2}
"""


def test_arrays_are_named_along_their_axes_with_units() -> None:
    run = lagcli.simulate(lagcli.load_text(MODEL), t_end=1, samples=5)
    found = to_dataset(run)
    np.testing.assert_array_equal(found["q"].sel(coordinate="phi"), run.q[:, 1])
    np.testing.assert_array_equal(
        found["multipliers"].sel(constraint="roll"), run.multipliers[:, 0]
    )
    assert found["time"].attrs["units"] == "s"
    assert found["coordinate_unit"].values.tolist() == ["m", "rad"]
    # one unit for all columns is the array's; different ones are not
    assert "units" not in found["q"].attrs
    assert found["energy_kinetic"].attrs["units"] == "J"
    np.testing.assert_array_equal(found["height"], run.outputs["height"])
    assert found["height"].attrs["units"] == "m"
    assert found["term"].values.tolist() == ["roll.x", "roll.phi"]
    assert found.attrs["status"] == "completed"
    assert "mode" not in found
