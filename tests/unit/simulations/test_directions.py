"""Parameters and initial values by which a motion is differentiated."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.simulations.directions import Directions, direction_names

MODEL = lagcli.load_text("""
coordinates: [x, "p[1..N]"]
parameters: {m: 2, k: 3*m^2, N: 2, w: -4}
T: m*x'^2/2 + sum(p[i]'^2, i = 1..N)
V: k*x^2
initial: {x: k/w, x': {guess: 5}, "p[i = 1..N]": i, "p[i = 1..N]'": 0}
""")


def test_names_are_read_as_people_write_them() -> None:
    found = direction_names(MODEL, ["m", " x ", "x_dot", "p[1]'"], "--sensitivity")
    assert found == ("m", "x", "x'", "p[1]'")


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["mm"], "no parameter or initial value `mm`; did you mean `m`"),
        (["N"], "`N` determines the number of coordinates"),
        (["x'", "x_dot"], "names `x'` twice"),
    ],
)
def test_other_names_are_errors(names: list[str], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        direction_names(MODEL, names, "fit")


def test_what_depends_on_a_direction_follows_it() -> None:
    directions = Directions(MODEL, ("m", "w", "x'"))
    assert directions.values.tolist() == [2, -4, 5]
    assert directions.scales.tolist() == [2, 4, 5]
    state = directions.state(1.0, [3.0, -1.0, 7.0])
    assert state.t == 1.0
    assert dict(zip(MODEL.parameters, state.p, strict=True)) == {"m": 3, "k": 27, "N": 2, "w": -1}
    assert state.q.tolist() == [-27, 1, 2]
    assert state.v.tolist() == [7, 0, 0]


def test_derivatives_of_the_start_are_those_of_the_expressions() -> None:
    directions = Directions(MODEL, ("m", "w", "x'"))
    found = directions.given(directions.values.tolist())
    # x = 3 m²/w at m = 2, w = −4, with respect to θ / scale
    np.testing.assert_allclose(found.q[:, 0], [2 * (6 * 2 / -4), 4 * (-12 / 16), 0])
    np.testing.assert_allclose(found.v[:, 0], [0, 0, 5])
    assert not found.q[:, 1:].any()
    rates = [{k: float(x.subs({"m": 2})) for k, x in r.items()} for r in directions.rates]
    assert rates == [{"m": 2, "k": 2 * 12}, {"w": 4}, {}]


def test_an_initial_value_that_is_named_is_fixed() -> None:
    assert Directions(MODEL, ("m",)).fixed[1].tolist() == [False, True, True]
    assert Directions(MODEL, ("x'",)).fixed[1].tolist() == [True, True, True]
