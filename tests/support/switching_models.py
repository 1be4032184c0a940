"""Models with contacts, for tests of what switches."""

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


#: A ball between a wall and the floor.
BALL = """\
name: ball
coordinates: {x: m, y: m}
parameters: {m: 2 kg, g: 9.81 m/s^2}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints:
  wall: x = 0
  floor: {expr: y >= 0, restitution: 0.8, friction: 0.1, slip: x'}
events:
  late: {when: t >= 1, stop: true}
initial: {x: 0, y: 1, x': 0, y': 0}
"""

#: The double pendulum of Kane and Levinson that hits the floor, with friction.
KANE = """
coordinates: {q1: rad, q2: rad}
parameters: {m: 1 kg, l: 1 m, g: 9.81 m/s^2, mu: 0.5, e: 0.7, a: 20 deg, b: 30 deg}
definitions:
  x1: l/2*sin(q1)
  y1: -l/2*cos(q1)
  x2: l*sin(q1) + l/2*sin(q2)
  y2: -l*cos(q1) - l/2*cos(q2)
  x_P: l*sin(q1) + l*sin(q2)
  y_P: l*(cos(a) + cos(b)) - l*cos(q1) - l*cos(q2)
T: m/2*(x1'^2 + y1'^2 + x2'^2 + y2'^2) + m*l^2/24*(q1'^2 + q2'^2)
V: m*g*(y1 + y2)
constraints:
  floor: {expr: y_P >= 0, restitution: e, friction: mu, slip: x_P'}
initial: {q1: a, q2: b, q1': -0.1, q2': -0.2}
"""


def prepared(text: str = BLOCK) -> tuple[System, IntegrationRequest, Evaluator]:
    """Return the System of a model, the request of its run, and an evaluator at its parameters."""
    simulation = prepare(load_text(text), SettingsOverrides(method="DOP853"))
    request = simulation.request
    return simulation.system, request, Evaluator(simulation.system, request.state.p)
