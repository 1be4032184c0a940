"""The inputs of a model as functions."""

from __future__ import annotations

import numpy as np

import lagcli
from lagcli.engine.inputs.tables import input_functions


def test_functions_are_those_of_the_model_in_its_order_and_made_once() -> None:
    model = lagcli.load_text(
        "coordinates: [x]\nT: x'^2/2\ninitial: {x: 0, x': 0}\ninputs:\n"
        "  b: {times: [0, 500 ms], values: [1, 3]}\n"
        "  a: {times: [0, 1], values: [2, 4], interpolation: step, extend: hold}\n"
    )
    found = input_functions(model)
    assert [(f.name, f.degree) for f in found.functions] == [("b", 1), ("a", 0)]
    assert found.places() == {"b": (0, 1), "a": (3, 0)}
    # of b the origin, its value there and its slope; of a the origin and the value
    np.testing.assert_array_equal(found.pieces(np.array([0.25, 0.5])), [[0, 1, 4, 0, 2]] * 2)
    assert input_functions(model) is found
    assert input_functions(lagcli.load("atwood")).size == 0
