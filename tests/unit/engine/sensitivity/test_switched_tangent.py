"""The steps of runs that carry derivatives: samples, orders of methods, ends."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.sensitivity import switched_tangent

MODEL = """
coordinates: [x]
parameters: {k: 9, e: 0.5, c: 0.3}
T: x'^2/2
V: k*x^2/2
Q: {x: -c*x'}
constraints: {wall: {expr: x >= -0.5, restitution: e}}
initial: {x: 1, x': 0}
"""


@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "LSODA"])
def test_every_method_of_the_reference_engine(method: str) -> None:
    model = lagcli.load_text(MODEL)
    names = ("k", "e", "c")
    exact = lagcli.simulate(model, t_end=1, samples=5, sensitivity=names, rtol=1e-12)
    found = lagcli.simulate(
        model, t_end=1, samples=5, sensitivity=names, engine="scipy", method=method, rtol=1e-8
    )
    assert found.options["method"] == method
    assert found.events is not None
    assert "impact" in found.events.kinds
    scale = np.abs(exact.dq).max()
    np.testing.assert_allclose(found.dq, exact.dq, atol=1e-5 * scale)


def test_derivatives_may_take_several_steps_within_one(monkeypatch: pytest.MonkeyPatch) -> None:
    model = lagcli.load_text(MODEL)
    expected = lagcli.simulate(model, t_end=1, samples=51, sensitivity=("k",), rtol=1e-6)
    monkeypatch.setattr(switched_tangent, "_LOOSER", 1e-4)
    found = lagcli.simulate(model, t_end=1, samples=51, sensitivity=("k",), rtol=1e-6)
    np.testing.assert_array_equal(found.q, expected.q)
    assert (found.dq != expected.dq).any()
    np.testing.assert_allclose(found.dq, expected.dq, atol=1e-5)


def test_samples_of_several_blocks_have_their_own_derivatives() -> None:
    model = lagcli.load_text(MODEL)
    many = lagcli.simulate(model, t_end=1, samples=5001, sensitivity=("k",))
    few = lagcli.simulate(model, t_end=1, samples=11, sensitivity=("k",))
    assert many.dq is not None
    assert few.dq is not None
    np.testing.assert_allclose(many.dq[::500], few.dq, atol=1e-9)


def test_sample_at_an_instant_is_that_of_afterwards() -> None:
    model = lagcli.load_text(MODEL.replace("Q: {x: -c*x'}", "Q: {x: 'if(t < c, 0, 20)'}"))
    found = lagcli.simulate(model, times=[0, 0.3, 0.35], sensitivity=("c",))
    assert found.dv is not None
    # the later the force begins, the slower: −20
    assert found.dv[0, 0, 0] == 0.0
    assert found.dv[1, 0, 0] == pytest.approx(-20.0)


def test_motion_that_slides_on_a_surface() -> None:
    model = lagcli.load_text("""
coordinates: [x]
parameters: {F: 4, c: 1}
T: x'^2/2
V: 0
Q: {x: "-F*(2*step(x' + c*x) - 1)"}
initial: {x: 1, x': 1}
""")
    found = lagcli.simulate(model, t_end=3, samples=8, sensitivity=("F",), rtol=1e-11)
    assert found.warnings == ()
    assert found.dq is not None
    assert found.dv is not None
    # x = 1 + t − F t²/2 reaches x' + x = 0 at t = 1/2, and goes on as x = exp(1/2 − t)
    t = found.time[2:]
    np.testing.assert_allclose(found.q[2:, 0], np.exp(0.5 - t), rtol=1e-10)
    np.testing.assert_allclose(found.dq[2:, 0, 0], -np.exp(0.5 - t) / 8, rtol=1e-9)
    np.testing.assert_allclose(found.dv[2:, 0, 0], np.exp(0.5 - t) / 8, rtol=1e-9)


def test_motion_that_leaves_a_surface() -> None:
    # x' = 0 as long as |w t| < F; the force of the other side is w t − F afterwards
    model = lagcli.load_text("""
coordinates: [x, y]
parameters: {F: 2, w: 3}
T: (x'^2 + y'^2)/2
V: 0
Q: {x: "w*t - F*(2*step(x' + y) - 1)"}
initial: {x: 0, y: 0, x': -1, y': 0}
""")
    found = lagcli.simulate(model, t_end=2, samples=2, sensitivity=("F", "w"), rtol=1e-12)
    assert found.warnings == ()
    # −1 + F t + w t²/2 = 0 at t*, then rest up to F/w, then w s³/6 with s = t − F/w
    F, w = 2.0, 3.0
    stop = (-F + np.sqrt(F**2 + 2 * w)) / w
    s = 2 - F / w
    assert found.dq is not None
    by_F = stop**2 / 2 - s**2 / 2
    by_w = stop**3 / 6 + s**3 / 6 + F / w * s**2 / 2
    np.testing.assert_allclose(found.dq[-1, 0], [by_F, by_w], rtol=1e-8)
