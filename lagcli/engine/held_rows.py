"""Active constraints at the samples of a run that switches."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array, Flags
from lagcli.engine.contract import Block
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import run_arrays

#: Relative difference of a force from the kinetic limit below which the row slips.
_AT_LIMIT = 1e-9


def held_rows(system: System, p: tuple[float, ...], block: Block) -> Flags:
    """Return which constraints are active at each sample, (nt, nc).

    A row without force is open, and one with its kinetic limit slips: both have no residual. An
    active row without force counts as open.

    Parameters
    ----------
    system : System
    p : tuple of float
        Values of its parameters.
    block : Block
    """
    held = np.ones(block.multipliers.shape, dtype=bool)
    if system.switching is None:
        return held
    rows, size = system.switching.rows, np.abs(block.multipliers)
    for row in rows:
        held[:, row.row] = size[:, row.row] != 0
    limited = [row for row in rows if row.limit is not None]
    if limited:
        limits = run_arrays(system.switching.limits, _inputs(block, p), len(block.time))
        for row in limited:
            assert row.limit is not None
            kinetic = limits[len(limited) + row.limit]
            away = np.abs(size[:, row.row] - kinetic) > _AT_LIMIT * np.abs(kinetic)
            held[:, row.row] &= away
    return held


def reactive_forces(system: System, p: tuple[float, ...], block: Block) -> Array:
    """Return the generalized forces that depend on λ, (nq, nt)."""
    found = np.zeros((len(system.coordinates), len(block.time)))
    if system.switching is not None and system.switching.forces is not None:
        tape, places = system.switching.forces, system.switching.force_coordinates
        found[list(places)] = run_arrays(tape, _inputs(block, p), len(block.time))[: len(places)]
    return found


def _inputs(block: Block, p: tuple[float, ...]) -> list[Array | float]:
    return [block.time, *block.q.T, *block.v.T, *block.a.T, *block.multipliers.T, *p]
