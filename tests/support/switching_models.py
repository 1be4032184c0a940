"""A block on an incline and a box, with contacts, for tests of what switches."""

from __future__ import annotations

from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.system import System
from lagcli.model.loader import load_text
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare

BLOCK = """
coordinates: {s: m, n: m}
parameters: {m: 2 kg, g: 10 m/s^2, mu: 0.5, v0: 1 m/s, k: 1}
T: m/2*(s'^2 + n'^2)
V: m*g*n
constraints:
  floor: {expr: n >= 0, friction: {static: 2*mu, kinetic: mu}, slip: s', restitution: 0.5}
events:
  tick: {when: t >= 0.1, set: {k: 2}}
initial: {s: 0, n: 0, s': v0, n': 0}
simulation: {t_end: 1, times: [0, 1]}
"""


def prepared(text: str = BLOCK) -> tuple[System, IntegrationRequest, Evaluator]:
    """Return the System of a model, the request of its run, and an evaluator at its parameters."""
    simulation = prepare(load_text(text), SettingsOverrides(engine="scipy", method="DOP853"))
    request = simulation.request
    return simulation.system, request, Evaluator(simulation.system, request.state.p)
