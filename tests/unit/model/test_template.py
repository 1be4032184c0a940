"""New models load, run and have all keys that people start with."""

import numpy as np
import pytest

import lagcli
from lagcli.model.keys import MACHINE, keys_of
from lagcli.model.loader import MODEL
from lagcli.model.template import new_model


def test_the_new_model_is_a_pendulum():
    model = lagcli.load_text(new_model("swing"))
    assert model.name == "swing"
    run = lagcli.simulate(model, t_end=1)
    # N = m g cos(angle) + m v^2/l, and the energy of a pendulum gives v^2 = 2 g (y_0 - y)
    y = run.q[:, 1]
    expected = 9.81 * -y + 2 * 9.81 * (-0.8 - y)
    tension = run.outputs["tension"]
    assert np.allclose(tension, expected, rtol=1e-7)


@pytest.mark.parametrize("coordinates", [["x"], ["x", "y"], ["phi_1", "phi_2", "s"]])
def test_a_model_of_given_coordinates_oscillates(coordinates):
    run = lagcli.simulate(lagcli.load_text(new_model("springs", coordinates)), t_end=1)
    for x in run.q.T:
        assert np.allclose(x, np.cos(np.sqrt(10) * run.time), atol=1e-7)


def test_all_keys_that_fit_together_are_shown():
    text = new_model("swing") + new_model("springs", ["a", "b"])
    keys = [key for key in keys_of(MODEL) if key not in MACHINE]
    assert [key for key in keys if f"{key}:" not in text] == [
        "functions",
        "inputs",
        "L",
        "D",
        "presets",
        "events",
        "fit",
    ]
