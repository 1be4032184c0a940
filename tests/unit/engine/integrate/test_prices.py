"""The prices of methods: counted operations."""

from __future__ import annotations

import pytest
from pendulum_by_hand import pendulum_system
from shipped import PATHS

import lagcli
from lagcli.engine.integrate.prepared import prepare
from lagcli.engine.integrate.prices import Prices
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare as prepared_simulation


def prices(name: str, **settings: object) -> Prices:
    simulation = prepared_simulation(lagcli.load(PATHS[name]), SettingsOverrides(**settings))
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
