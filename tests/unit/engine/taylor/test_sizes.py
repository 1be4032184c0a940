"""The order of power series."""

from __future__ import annotations

from lagcli.engine.tape.operations import MAX_ORDER
from lagcli.engine.taylor.sizes import order_for


def test_a_program_is_short_enough_for_its_highest_order() -> None:
    # a tolerance of 1e-13 asks for order 21 by Jorba and Zou's rule
    assert MAX_ORDER >= 21


def test_tighter_tolerances_have_higher_orders() -> None:
    assert [order_for(x) for x in (1e-3, 1e-9, 1e-13)] == [10, 17, 21]
    assert order_for(1e-30) == MAX_ORDER
