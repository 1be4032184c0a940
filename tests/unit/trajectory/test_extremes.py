"""Extremes gathered block by block are those of the whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from trajectories import make

from lagcli.trajectory.extremes import Extreme, Extremes, widen
from lagcli.trajectory.trajectory import Trajectory


def _run() -> Trajectory:
    run = make(50, constraints=("rod", "knife", "none"))
    run.residual_position[:, 1] = np.nan
    run.multipliers[:, 2] = np.nan
    run.multipliers[7, 0] = np.nan
    run.multipliers[[3, 30], 1] = 1e12  # of equal ones the first counts
    return run


@pytest.mark.parametrize("rows", [1, 7, 25, 50, 51])
def test_blocks_do_not_matter(rows: int) -> None:
    run = _run()
    extremes = Extremes(run.constraints, run.conserved_names)
    for start in range(0, 50, rows):
        block = {name: getattr(run, name)[start : start + rows] for name in Extremes.COLUMNS}
        extremes.add(block)
    assert extremes.samples == 50
    assert (extremes.first, extremes.last) == (run.time[0], run.time[-1])
    rod, knife, none = (extremes.multipliers[name] for name in run.constraints)
    assert rod.low == np.nanmin(run.multipliers[:, 0])
    assert rod.low_time == run.time[np.nanargmin(run.multipliers[:, 0])]
    assert rod.high_time == run.time[np.nanargmax(run.multipliers[:, 0])]
    assert (knife.high, knife.high_time) == (1e12, run.time[3])
    assert math.isnan(none.low)
    assert math.isnan(none.high_time)
    assert extremes.residual_position[0] == np.abs(run.residual_position[:, 0]).max()
    assert np.isnan(extremes.residual_position[1])
    np.testing.assert_array_equal(
        extremes.residual_velocity, np.abs(run.residual_velocity).max(axis=0)
    )
    assert extremes.residual_equation == np.abs(run.residual_equation).max()
    assert extremes.energy_balance == np.abs(run.energy_balance).max()
    values = run.conserved[:, 0]
    assert extremes.conserved["p_phi"].first == values[0]
    assert extremes.conserved["p_phi"].drift == np.abs(values - values[0]).max()
    assert extremes.energy_scale == max(
        np.abs(run.energy_kinetic).max(),
        np.abs(run.energy_total).max(),
        run.energy_potential.max() - run.energy_potential.min(),
    )


def test_without_samples_there_are_none() -> None:
    extremes = Extremes(("rod",), ("p_phi",))
    extremes.add({name: getattr(make(0), name) for name in Extremes.COLUMNS})
    assert extremes.samples == 0
    assert math.isnan(extremes.first)
    assert math.isnan(extremes.energy_balance)
    assert np.isnan(extremes.residual_velocity).all()
    assert math.isnan(extremes.conserved["p_phi"].drift)
    assert extremes.energy_scale == 0.0


@pytest.mark.parametrize("seed", range(20))
def test_columns_together_are_those_one_by_one(seed: int) -> None:
    random = np.random.default_rng(seed)
    together = [Extreme() for _ in range(7)]
    alone = [Extreme() for _ in range(7)]
    for block in range(4):
        time = block + np.arange(3.0)
        values = random.integers(-3, 4, (3, 7)).astype(float)  # some are equal
        values[random.random((3, 7)) < 0.4] = np.nan
        values[:, random.integers(7)] = np.nan
        widen(together, time, values)
        for extreme, column in zip(alone, values.T, strict=True):
            for t, x in zip(time.tolist(), column.tolist(), strict=True):
                if x < extreme.low or (x == x and extreme.low != extreme.low):
                    extreme.low, extreme.low_time = x, t
                if x > extreme.high or (x == x and extreme.high != extreme.high):
                    extreme.high, extreme.high_time = x, t
    np.testing.assert_equal([vars(x) for x in together], [vars(x) for x in alone])
