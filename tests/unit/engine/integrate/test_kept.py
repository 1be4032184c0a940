"""The core that runs one after the other share: when it may be used again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.engine.integrate.engine import integrate
from lagcli.engine.integrate.kept import KeptCore
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.variants import Variants

MODEL = Path(__file__).parents[4] / "models" / "contact" / "bouncing_ball.yaml"


def samples(simulation, kept, **changes):
    """Return the samples of a run."""
    blocks = []
    request = simulation.request._replace(kept=kept, **changes)
    run = integrate(simulation.system, request, lambda b: blocks.append(np.column_stack(b)))
    return np.concatenate(blocks), run


@pytest.fixture
def variants():
    return Variants(lagcli.load(MODEL), SettingsOverrides(t_end=1.0, samples=5))


def test_a_kept_core_gives_the_results_of_a_new_one(variants):
    kept, runs = KeptCore(), [variants.varied({"h": h, "e": e}) for h, e in [(1, 0.5), (2, 0.9)]]
    for simulation in [*runs, *runs]:
        found, run = samples(simulation, kept)
        expected, single = samples(simulation, None)
        np.testing.assert_array_equal(found, expected)
        assert run.counts == single.counts
        assert len(run.events) == len(single.events) > 0


@pytest.mark.parametrize("changes", [{"times": np.linspace(0, 1, 7)}, {"atol": 1e-6}])
def test_another_problem_has_a_core_of_its_own(variants, changes):
    kept, simulation = KeptCore(), variants.varied({})
    samples(simulation, kept)
    found, _ = samples(simulation, kept, **changes)
    np.testing.assert_array_equal(found, samples(simulation, None, **changes)[0])


def test_a_core_with_other_equations_is_given_up(variants):
    """As where a run finds another order of elimination on its way."""
    kept, simulation = KeptCore(), variants.varied({})
    samples(simulation, kept)
    ready = kept._ready
    ready.core.use_dense(ready.prepared.plain or ready.prepared.whole)
    assert kept.take(ready.prepared, ready.problem, ready.clocks) is None
    found, _ = samples(simulation, kept)
    np.testing.assert_array_equal(found, samples(simulation, None)[0])
