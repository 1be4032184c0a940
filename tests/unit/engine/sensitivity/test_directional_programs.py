"""Programs of directional derivatives: their tapes against differences."""

from __future__ import annotations

import numpy as np

import lagcli
from lagcli.engine.lowering import lower
from lagcli.engine.sensitivity import directional_programs
from lagcli.engine.sensitivity.directional_programs import arranged
from lagcli.engine.switching.splitting import SplitSystem
from lagcli.engine.tape.differentiation import directional
from lagcli.engine.tape.interpreter import ScalarTape
from tests.support.switching_models import BALL


def test_the_parameters_are_the_last_inputs() -> None:
    system = lower(lagcli.derive(lagcli.load_text(BALL)))
    tape, state = system.dynamics, 1 + 2 * len(system.coordinates)
    rng = np.random.default_rng(3)
    x, p = rng.uniform(1, 2, state), rng.uniform(1, 2, tape.inputs - state)
    dx, dp = rng.normal(size=len(x)), rng.normal(size=len(p))
    slopes = ScalarTape(arranged(directional(tape), state))((*x, *dx, *dp, *p))
    run, h = ScalarTape(tape), 1e-6
    above, below = (np.array(run((*(x + side * h * dx), *(p + side * h * dp)))) for side in (1, -1))
    np.testing.assert_allclose(slopes, (above - below) / (2 * h), atol=1e-7)


def test_conditions_of_events_without_actions_do_not_decide() -> None:
    text = BALL.replace("stop: true", "record: x") + "simulation: {t_end: 2}\n"
    for model, decides in ((BALL, True), (text, False)):
        split = SplitSystem(lower(lagcli.derive(lagcli.load_text(model))))
        parameters = np.zeros((1, len(split.system.parameters)))
        found = directional_programs.directional_programs(split, None, parameters)
        assert found.decides == (decides,)
