"""Blocks of samples and their record as one trajectory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.simulations.simulation import prepare
from lagcli.trajectory.samples import Record, Samples
from lagcli.trajectory.trajectory import complete, joined

PENDULUM = lagcli.load_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1}
outputs: {height: y + 1}
initial: {x: 1, y: 0, x': 0, y': 0}
simulation: {t_end: 0.5, samples: 6}
""")


def test_objects_describe_themselves_in_one_line() -> None:
    simulation = prepare(PENDULUM)
    samples, _, record = parts()
    assert repr(PENDULUM) == "<Model <text>: 2 coordinates, 1 constraint>"
    assert repr(simulation.equations) == f"<Equations of {PENDULUM!r}>"
    assert repr(simulation.system) == "<System: 2 coordinates, 1 constraint>"
    assert repr(samples) == "<Samples: 6 samples from 0 s to 0.5 s>"
    run = complete(samples, record)
    assert repr(run) == "<Trajectory: 6 samples from 0 s to 0.5 s, completed>"
    empty = replace(samples, time=np.empty(0))
    assert repr(empty) == "<Samples: 0 samples>"


def parts() -> tuple[Samples, list[Samples], Record]:
    """A run's samples, the same in blocks, and its record."""
    blocks: list[Samples] = []
    record = prepare(PENDULUM).run(blocks.append)
    whole = joined(blocks)

    def cut(rows: slice) -> Samples:
        arrays = {name: x[rows] for name, x in vars(whole).items() if isinstance(x, np.ndarray)}
        outputs = {name: x[rows] for name, x in whole.outputs.items()}
        return replace(whole, **arrays, outputs=outputs)

    return whole, [cut(slice(0, 4)), cut(slice(4, 4)), cut(slice(4, None))], record


def test_blocks_are_joined_in_order() -> None:
    whole, blocks, _ = parts()
    again = joined(blocks)
    for name in ("time", "q", "multipliers", "constraint_force_by", "energy_balance"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    np.testing.assert_array_equal(again.outputs["height"], whole.outputs["height"])
    assert joined(blocks[:1]) is blocks[0]


def test_a_trajectory_has_samples_and_record() -> None:
    whole, _, record = parts()
    run = complete(whole, record)
    assert (run.status, len(run.time)) == ("completed", 6)
    assert run.modes is None  # nothing switches
    assert run.nbytes >= run.q.nbytes + run.outputs["height"].nbytes
    # rod alone acts: its force is the whole constraint force
    np.testing.assert_array_equal(run.constraint_force_of("rod"), run.constraint_force)
    with pytest.raises(UsageError, match="no constraint 'bar'; the constraints are rod"):
        run.constraint_force_of("bar")
