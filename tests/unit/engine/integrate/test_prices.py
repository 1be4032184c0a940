"""The prices of methods: counted operations."""

from __future__ import annotations

import math

import pytest
from pendulum_by_hand import pendulum_system
from shipped import PATHS

import lagcli
from lagcli.engine.integrate.prepared import prepare
from lagcli.engine.integrate.prepared import unrolled as unrolled_of
from lagcli.engine.integrate.prices import Prices
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare as prepared_simulation


def prices(name: str, set: dict[str, float] | None = None, **settings: object) -> Prices:
    model = lagcli.load(PATHS[name], set=set)
    simulation = prepared_simulation(model, SettingsOverrides(**settings))
    request = simulation.request
    return Prices(simulation.system, prepare(simulation.system, request.elimination), 17)


def test_products_and_sums_are_those_of_changing_values() -> None:
    dense = prepare(pendulum_system(), None)
    # u², v², and the entries 2 x and 2 y of B times λ; their factors, the sum of the squares and
    # its factor, and the power
    assert Prices(pendulum_system(), dense, 17)._counts == (4, 5)


def test_prices_grow_with_the_model() -> None:
    small, large = prices("pendulum_cartesian"), prices("andrews_squeezer")
    for name in ("evaluation", "explicit", "taylor", "expanding", "implicit", "differentiating"):
        assert 3 * getattr(small, name) < getattr(large, name), name
    for found in (small, large):
        assert found.least_expanding < found.expanding
        assert found.usual == 3
    assert prices("pendulum_chain").usual == 2  # without constraints


def test_a_higher_order_costs_more() -> None:
    system = pendulum_system()
    found = [Prices(system, prepare(system, None), order) for order in (10, 20)]
    assert found[1].taylor > found[0].taylor
    assert found[1].explicit == pytest.approx(found[0].explicit)


def test_long_models_are_priced_as_they_run_later() -> None:
    long = prices("chain", {"N": 100})
    # examined by factors, whose number is proportional to that of the bodies
    assert long.examining < 10 * long.evaluation
    # the elimination is unrolled at some time; until then, each step costs the same
    change = long.steps_to_unroll
    assert long.steps(change) == pytest.approx(change * long.explicit)
    assert long.steps(1e6) < 0.5 * 1e6 * long.explicit


def test_unrolling_waits_until_as_much_is_spent_in_the_loop_as_it_costs() -> None:
    long = prices("chain", {"N": 100})
    unrolled = Prices(long.system, unrolled_of(long.system, long.prepared), 17)
    saved = long.explicit - unrolled.explicit
    # the program itself is known then: its price is that which was foreseen, within a half
    assert 0.5 * saved < long.unrolling / long.steps_to_unroll < 2 * saved
    # a family of three times as many members gains three times as much, for three times the price
    longer = prices("chain", {"N": 300})
    assert longer.unrolling == pytest.approx(3 * long.unrolling, rel=0.05)
    assert longer.steps_to_unroll == pytest.approx(long.steps_to_unroll, rel=0.05)


def test_what_is_unrolled_or_solved_densely_is_never_unrolled() -> None:
    short = prices("slider_crank")
    dense = Prices(short.system, prepare(short.system, None), 17)
    for found in (short, dense):
        assert found.steps_to_unroll == math.inf
        assert found.steps(1e6) == pytest.approx(1e6 * found.explicit)


def test_dense_solutions_are_examined_by_orthogonalizing() -> None:
    system = prices("chain", {"N": 100}).system
    assert Prices(system, prepare(system, None), 17).examining > 100**2 * 200
