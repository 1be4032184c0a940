"""Contacts that stay open and events that do not happen leave a run as it is without them."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.simulations.simulation import prepare

#: Bodies of the chain: more unknowns than are solved for densely at the start.
N = 25
MODELS = {
    "pendulum": ("models/pendulum_cartesian.yaml", {}, "y + 1000*l >= 0"),
    "chain": ("models/chain.yaml", {"N": N}, "y[N] + 1000*l >= 0"),
}


def text_of(model: str, constraint: str = "", event: str = "") -> str:
    """Return a shipped model with one more constraint, or event."""
    with open(MODELS[model][0], encoding="utf-8") as file:
        text = file.read()
    events = f"events:\n  idle: {event}\n" if event else ""
    constraint = f"  idle: {constraint}\n" if constraint else ""
    return text.replace("constraints:\n", f"{events}constraints:\n{constraint}", 1)


def loaded(model: str, **more: str) -> lagcli.Model:
    return lagcli.load_text(text_of(model, **more), set=MODELS[model][1])


@pytest.mark.parametrize("method", ["DOP853", "Taylor", "auto", "Radau"])
@pytest.mark.parametrize("model", MODELS)
def test_an_idle_contact_changes_no_bits(model: str, method: str) -> None:
    options = {"method": method, "t_end": 0.3}
    plain = lagcli.simulate(loaded(model), **options)
    gap = MODELS[model][2]
    event = f"{{when: {gap.replace('>=', '<=')}, stop: true}}"
    for switched in (loaded(model, constraint=gap), loaded(model, event=event)):
        found = lagcli.simulate(switched, **options)
        assert found.status == plain.status == "completed"
        assert found.counts == plain.counts
        np.testing.assert_array_equal(found.q, plain.q)
        np.testing.assert_array_equal(found.v, plain.v)


def test_the_order_of_elimination_is_that_without_the_contact() -> None:
    plain = prepare(loaded("chain")).start
    contact = prepare(loaded("chain", constraint=MODELS["chain"][2])).start
    assert plain.elimination is not None
    assert contact.elimination == plain.elimination
    assert contact.rank == N


def test_a_contact_that_closes_on_a_long_chain() -> None:
    """Against values of an independent engine on SciPy (lagcli 80096f2), with rtol 1e-11."""
    model = loaded("chain", constraint="x[N] >= 0.2*l")
    found = lagcli.simulate(model, t_end=0.4)
    assert found.events is not None
    assert found.events.kinds == ("impact", "closes")
    np.testing.assert_allclose(found.events.time, 0.3547920124817245, rtol=1e-9)
    q = {0: 1.0792697402076919e-04, 24: 2.0e-01, 48: -8.5658275472361289e-01}
    np.testing.assert_allclose(found.q[-1, [*q]], [*q.values()], atol=1e-9)
    forces = {0: 3.534985184828926, 12: -96.92958820099538, 25: -44.19769681374012}
    assert np.abs(found.energy_balance).max() < 1e-9
    # the chain's contact is the first constraint
    np.testing.assert_allclose(found.multipliers[-1, [*forces]], [*forces.values()], atol=1e-5)
