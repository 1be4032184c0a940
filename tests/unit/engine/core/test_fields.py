"""Fields of structures of the core: what a System and its order of elimination become."""

from __future__ import annotations

import numpy as np
import pytest
from lowered import lowered

import lagcli
from lagcli.engine.core.fields import elimination_fields, equations_fields
from lagcli.engine.core.program import assemble
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.elimination import order_at

MODELS = ("slider_crank", "four_bar", "andrews_squeezer", "rolling_disk")


@pytest.mark.parametrize("name", MODELS)
def test_entries_go_where_the_order_of_elimination_has_them(name: str) -> None:
    """M and B, put in place, are the permuted matrix [[M, Bᵀ], [B, 0]]."""
    what = lowered(lagcli.load(f"models/{name}.yaml"))
    system = what.system
    draw = np.random.default_rng(1)
    q, v = draw.uniform(0.2, 1.0, (2, len(system.coordinates)))
    plan = order_at(system, [Evaluator(system, what.p).entries(0.0, q, v)])
    fields = elimination_fields(system, plan)
    nq, nc, n = len(system.coordinates), len(system.constraints), fields["n"]
    matrix = np.zeros((nq + nc, nq + nc))
    stored = np.zeros(2 * n + len(fields["row"]))
    for offset, pattern, targets in (
        (0, system.mass_pattern, fields["mass_targets"]),
        (nq, system.jacobian_pattern, fields["jacobian_targets"]),
    ):
        for (i, j), target in zip(pattern, targets, strict=True):
            value = matrix[min(i, j), max(i, j)] if not offset else 0.0
            matrix[offset + i, j] = matrix[j, offset + i] = value or draw.uniform(1.0, 2.0)
            if target >= 0:
                stored[target] = matrix[offset + i, j]
    placed = np.diag(stored[:n])
    for k in np.flatnonzero(fields["paired"]):
        placed[k + 1, k] = placed[k, k + 1] = stored[n + k]
    start = fields["start"]
    for k in range(n):
        for entry in range(start[k], start[k + 1]):
            i = fields["row"][entry]
            placed[i, k] = placed[k, i] = placed[i, k] + stored[2 * n + entry]
    np.testing.assert_array_equal(placed, matrix[np.ix_(fields["order"], fields["order"])])


def test_coordinates_of_one_unit_have_the_number_of_the_first() -> None:
    system = lowered(lagcli.load("models/chain.yaml", set={"N": 4})).system
    groups = system.same_unit
    unit = equations_fields(system, assemble(system.constraint))["unit"]
    assert groups
    assert unit == [min((g for g in groups if j in g), default=[j])[0] for j in range(len(unit))]
