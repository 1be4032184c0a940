"""Rows of a sweep against the same rows run one by one, as `simulate` runs them."""

from __future__ import annotations

from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import Outcome
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.engine import integrate
from lagcli.engine.system import System
from lagcli.errors import LagcliError
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.variants import Variants
from lagcli.sweeps.rows.group import FinishedRuns, RowGroup

#: Part of the largest value below which a quantity counts as zero.
_SMALL = 1e-3


def rows_together(
    model: Model, columns: list[str], table: Any, **options: Any
) -> tuple[RowGroup, list[tuple[Array, Outcome | LagcliError, int]]]:
    """Return the samples of each row of a sweep, how its run ended, and the rank of B."""
    variants = Variants(model, SettingsOverrides(**{"samples": 21, **options}))
    group = RowGroup(variants, columns, [], False)
    found: dict[int, tuple[Array, Outcome | LagcliError, int]] = {}

    def take(ended: FinishedRuns) -> None:
        assert len(ended.starts) == sum(isinstance(run, Outcome) for run in ended.runs)
        ranks = [start.rank for start in ended.starts] or [0]
        rows = zip(ended.places, ended.samples, ended.runs, ranks, strict=True)
        for place, samples, run, rank in rows:
            assert place not in found
            found[int(place)] = samples, run, rank

    group.run(np.asarray(table, dtype=float), take, lambda: None)
    return group, [found.pop(i) for i in range(len(table))]


def check_equal_alone(
    model: Model, columns: list[str], table: Any, **options: Any
) -> tuple[list[str], list[Outcome | LagcliError]]:
    """Return how each row of a sweep ends, and its run, after comparing it with its single run.

    Samples, log and counts must be equal to the last bit, errors in their text.
    """
    group, together = rows_together(model, columns, table, **options)
    table = np.asarray(table, dtype=float)
    variants, ends = group.variants, []
    values = group.variants.values(group.columns, table)
    for i, (samples, run, rank) in enumerate(together):
        try:
            simulation = group._simulation(i, table[i], values)
        except LagcliError as error:
            expected = type(error), str(error)
        else:
            expected = None
        if expected is not None:
            assert (type(run), str(run)) == expected
            ends.append("no start")
            continue
        assert isinstance(run, Outcome), str(run)
        blocks = [np.empty((0, variants.system.sample_layout.size))]
        request = simulation.request._replace(times=group.grid.all)
        single = integrate(
            simulation.system, request, lambda block, to=blocks: to.append(np.column_stack(block))
        )
        assert (run.status, run.counts, run.modes) == (single.status, single.counts, single.modes)
        assert rank == request.rank
        np.testing.assert_array_equal(samples, np.concatenate(blocks))
        assert len(run.events or ()) == len(single.events or ())
        if single.events:
            for name in ("time", "occurrence", "after", "loss"):
                np.testing.assert_array_equal(run.events.part(name), single.events.part(name))
            one, other = run.events.impulses, single.events.impulses
            np.testing.assert_array_equal(one.dense(), other.dense())
        ends.append(run.status)
    return ends, [run for _, run, _ in together]


def check_like_alone(
    model: Model, columns: list[str], table: Any, tolerance: float, **options: Any
) -> list[str]:
    """Return how each row of a sweep ends, after comparing it with its single run.

    Both must end alike, with the same message; q, v, a and λ may differ by a part of their largest
    values. Redundant λ must be those of least norm: single runs of small systems err there if the
    units of constraints differ by factors of a million.
    """
    group, together = rows_together(model, columns, table, **options)
    table = np.asarray(table, dtype=float)
    values = group.variants.values(group.columns, table)
    return [
        _compared(group, found, group.single(i, table[i], values, lambda: None), tolerance)
        for i, found in enumerate(together)
    ]


def check_least_norm(
    system: System, parameters: Array, samples: Array, rank: int, tolerance: float
) -> None:
    """Check that Bᵀλ = M a − f, and that λ is a combination of the columns of B."""
    evaluator = Evaluator(system, tuple(parameters.tolist()))
    layout, nq = system.sample_layout, len(system.coordinates)
    for row in samples:
        d = evaluator.dynamics(row[0], row[layout.q], row[layout.v])
        multipliers = row[layout.multipliers]
        sizes = evaluator.sizes(row[0], row[layout.q], row[layout.v])
        terms = [
            *(d.mass_matrix * row[layout.a]).T,
            d.forcing,
            *(d.jacobian * multipliers[:, None]),
        ]
        largest = (np.abs(terms).max(axis=0) * sizes).max()
        force = d.mass_matrix @ row[layout.a] - d.forcing - d.jacobian.T @ multipliers
        assert np.abs(force * sizes).max() <= tolerance * largest
        lengths = np.linalg.norm(d.jacobian, axis=1, keepdims=True)
        directions = np.linalg.svd(d.jacobian / lengths)[2][:rank]
        columns = d.jacobian @ directions.T
        assert columns.shape == (len(multipliers), min(rank, nq))
        columns /= np.linalg.norm(columns, axis=0)
        nearest = columns @ np.linalg.lstsq(columns, multipliers, rcond=None)[0]
        assert np.abs(multipliers - nearest).max() <= tolerance * np.abs(multipliers).max(initial=0)


def _compared(
    group: RowGroup,
    found: tuple[Array, Outcome | LagcliError, int],
    alone: FinishedRuns,
    tolerance: float,
) -> str:
    samples, run, rank = found
    [single], [expected] = alone.runs, alone.samples
    if isinstance(single, LagcliError) or isinstance(run, LagcliError):
        assert (type(run), str(run)) == (type(single), str(single))
        return "no start"
    assert (run.status, run.message) == (single.status, single.message)
    assert rank == alone.starts[0].rank
    layout = group.variants.system.sample_layout
    assert samples.shape == expected.shape
    np.testing.assert_array_equal(samples[:, 0], expected[:, 0])
    parts = [layout.q, layout.v, layout.a]
    if rank == expected[:, layout.multipliers].shape[1]:
        parts.append(layout.multipliers)
    else:
        check_least_norm(group.variants.system, alone.parameters[0], samples, rank, tolerance)
    for part in parts:
        one, other = samples[:, part], expected[:, part]
        size = np.abs(other).max(initial=0.0) + _SMALL
        np.testing.assert_allclose(one, other, rtol=0, atol=tolerance * size)
    return run.status
