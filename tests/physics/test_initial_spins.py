"""Initial angular velocities: fixed components hold, among guesses and at guessed orientations."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import lagcli
from lagcli.arrays import Array
from lagcli.engine.constraints.initial import free_directions, with_given_spins
from lagcli.engine.evaluator import Evaluator
from lagcli.errors import ModelError
from lagcli.simulations import simulation
from lagcli.simulations.start import spins_of

ROLLING = """
coordinates: {e: quaternion}
T: body(1, diag(1, 1, 1), [0, 0, 0], e)
definitions: {w: e*omega(e)}
constraints: {roll: 0.5*w.x + w.z = 20}
initial:
  e: ORIENTATION
  e': SPIN
"""


def rolling(orientation: str, spin: str) -> simulation.Simulation:
    text = ROLLING.replace("ORIENTATION", orientation).replace("SPIN", spin)
    return simulation.prepare(lagcli.load_text(text))


def product(a: Array, b: Array) -> Array:
    """Return the product of two quaternions, by scalar and vector parts."""
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], vector])


def spin(e: Array, rates: Array) -> Array:
    """Return ω = 2 ē e' of a unit quaternion."""
    return 2 * product(e * [1, -1, -1, -1], rates)[1:]


@pytest.mark.parametrize("orientation", ["1", "{guess: 1}"])
def test_a_fixed_component_holds_among_guesses(orientation: str) -> None:
    """The rate e.3' = ω.z/2 was freed with the others: ω.z = 16.6 in place of 3."""
    start = rolling(orientation, "[{guess: 0}, {guess: 0}, 3]").start
    found = spin(start.state.q, start.state.v)
    assert found == pytest.approx([34, 0, 3], abs=1e-12)
    assert start.moved == {"omega(e).x": pytest.approx((0.0, 34.0), abs=1e-12)}
    both = rolling(orientation, "{guess: [0, 0, 3]}").start
    # the nearest: 20 - 3 = 17 along (1/2, 1)
    expected = np.array([0.5, 0, 1]) * 17 / 1.25 + np.array([0, 0, 3])
    assert spin(both.state.q, both.state.v) == pytest.approx(expected, abs=1e-12)
    assert set(both.moved) == {"omega(e).x", "omega(e).z"}


def test_fixed_components_that_contradict_are_named() -> None:
    with pytest.raises(ModelError) as found:
        rolling("{guess: 1}", "[1, {guess: 0}, 3]")
    (one,) = found.value.diagnostics
    assert "the fixed initial values violate the constraint `roll`" in one.message
    assert one.help is not None
    assert one.help.startswith("free one of omega(e).x, omega(e).z, for instance write that")


def test_an_angular_velocity_holds_where_the_orientation_is_adjusted() -> None:
    """e' stayed that of the guess: ω was another one at the adjusted orientation."""
    text = """
    coordinates: {e: quaternion, r: point}
    T: body(1, diag(1, 2, 3), r, e)
    definitions: {a: "e*[0, 0, 1]"}
    constraints: {tilt: a.z = 0.5, pin: "r - e*[0, 0, 1] = [0, 0, 0]"}
    initial:
      e: {guess: rot_x(0.4)}
      e': [0, 0, 2]
      r: {guess: [0, 0, 1]}
      r': {guess: 0}
    """
    start = simulation.prepare(lagcli.load_text(text)).start
    assert spin(start.state.q[:4], start.state.v[:4]) == pytest.approx([0, 0, 2], abs=1e-14)
    assert not any(name.endswith("'") or "omega" in name for name in start.moved)
    scaled = text.replace("rot_x(0.4)", "[2, 0.4, 0, 0]")  # a guess of any length
    start = simulation.prepare(lagcli.load_text(scaled)).start
    assert spin(start.state.q[:4], start.state.v[:4]) == pytest.approx([0, 0, 2], abs=1e-14)


def bodies(rng: np.random.Generator) -> tuple[str, list[dict[str, Array]]]:
    """Return a random model of one to three bodies, and what is given of each."""
    count, coordinates, kinetic, constraints, initial = int(rng.integers(1, 4)), [], [], [], []
    given = []
    for i in range(count):
        coordinates += [f"r{i}: point", f"e{i}: quaternion"]
        inertia = ", ".join(f"{x:.3f}" for x in rng.uniform(0.5, 3, 3))
        kinetic.append(f"body({rng.uniform(0.5, 3):.3f}, diag({inertia}), r{i}, e{i})")
        turned = rng.random() < 0.6
        e = np.round(rng.normal(size=4), 3)
        if not turned:
            e /= np.linalg.norm(e)
        fixed = rng.random(3) < 0.5
        fixed[0] &= not turned  # for the rate of the tilt
        omega = np.round(3 * rng.normal(size=3), 3)
        direction, sides = np.round(rng.normal(size=(2, 3)), 3)
        level = float(np.round(rng.normal(), 3))
        if turned:
            constraints.append(f"tilt{i}: (e{i}*[0, 0, 1]).z = {0.8 * np.tanh(level):.6f}")
        along = f"dot({listed(direction)}, omega(e{i})) + dot({listed(sides)}, r{i}')"
        constraints.append(f"roll{i}: {along} = {level}")
        if rng.random() < 0.5:
            constraints.append(f"pin{i}: r{i}.z = (e{i}*[1, 0, 0]).z")
        values = [
            repr(float(x)) if f else f"{{guess: {x}}}" for x, f in zip(omega, fixed, strict=True)
        ]
        quaternion = f"[{', '.join(repr(float(x)) for x in e)}]"
        initial += [
            f"e{i}: " + (f"{{guess: {quaternion}}}" if turned else quaternion),
            f"e{i}': [{', '.join(values)}]",
            f"r{i}: {{guess: {listed(rng.normal(size=3))}}}",
            f"r{i}': {{guess: {listed(rng.normal(size=3))}}}",
        ]
        given.append({"omega": omega, "fixed": fixed, "direction": direction, "sides": sides})
        given[-1]["level"] = np.array(level)
    text = "coordinates: {" + ", ".join(coordinates) + "}\n"
    text += f"T: {' + '.join(kinetic)}\nV: 0*r0.x\n"
    text += "constraints:\n" + "".join(f"  {x}\n" for x in constraints)
    text += "initial:\n" + "".join(f"  {x}\n" for x in initial)
    return text, given


def listed(x: Array) -> str:
    return f"[{', '.join(f'{float(y):.3f}' for y in x)}]"


def check_bodies(seed: int) -> None:
    text, given = bodies(np.random.default_rng(seed))
    prepared = simulation.prepare(lagcli.load_text(text))
    names, state = list(prepared.model.coordinate_names), prepared.start.state
    for i, body in enumerate(given):
        e = [names.index(f"e{i}.{k}") for k in range(4)]
        r = [names.index(f"r{i}.{axis}") for axis in "xyz"]
        assert np.linalg.norm(state.q[e]) == pytest.approx(1, abs=1e-14)
        found = spin(state.q[e], state.v[e])
        size = 1 + np.abs(found).max()
        assert found[body["fixed"]] == pytest.approx(body["omega"][body["fixed"]], abs=1e-13 * size)
        rolled = body["direction"] @ found + body["sides"] @ state.v[r]
        assert rolled == pytest.approx(float(body["level"]), abs=1e-12 * size)
        for k, axis in enumerate("xyz"):
            label = f"omega(e{i}).{axis}"
            assert (label in prepared.start.moved) <= (not body["fixed"][k])
            if label in prepared.start.moved:
                before, after = prepared.start.moved[label]
                assert before == pytest.approx(body["omega"][k], abs=1e-13 * size)
                assert after == pytest.approx(found[k], abs=1e-13 * size)
    assert not any(name.startswith("e") and name.endswith("'") for name in prepared.start.moved)
    # the change of the guesses is the least in the metric of M: M Δv does no virtual work
    model, spins = prepared.model, spins_of(prepared.model)
    q, v = (
        np.array([x.value for x in table.values()])
        for table in (model.initial_positions, model.initial_velocities)
    )
    evaluator = Evaluator(prepared.system, state.p)
    change = state.v - with_given_spins(spins, q, v, state.q)
    fixed = np.array([x.fixed for x in model.initial_velocities.values()])
    free = free_directions(spins, fixed, state.q)
    held = evaluator.constraints(0.0, state.q, state.v).jacobian @ free
    _, values, right = np.linalg.svd(held)
    admissible = free @ right[int((values > 1e-9).sum()) :].T
    work = admissible.T @ evaluator.dynamics(0.0, state.q, state.v).mass_matrix @ change
    assert np.abs(work).max(initial=0.0) < 1e-11 * (1 + np.abs(change).max())


def test_fixed_components_of_random_bodies_hold() -> None:
    for seed in range(20):
        check_bodies(seed)


@pytest.mark.slow
def test_fixed_components_of_many_random_bodies_hold() -> None:
    for seed in range(1000, 1300):
        check_bodies(seed)


SPUN = """
coordinates: {e: quaternion, r: point}
parameters: {w0: 2, c: 0.5, tilted: 0.4}
T: body(1, diag(1, 2, 3), r, e)
V: 9.81*r.z
definitions: {a: "e*[0, 0, 1]"}
constraints: {tilt: a.z = c, pin: "r - e*[0, 0, 1] = [0, 0, 0]", level: r.x = 0}
outputs: {wz: omega(e).z}
initial:
  e: {guess: rot_x(tilted)}
  e': [{guess: 0}, {guess: 0}, 1 + w0]
  r: {guess: [0, 0, 1]}
  r': {guess: 0}
simulation: {t_end: 0.5, samples: 6}
"""


def test_derivatives_with_spins() -> None:
    names = ("w0", "c", "tilted")
    text = SPUN
    run = lagcli.simulate(lagcli.load_text(text), sensitivity=names)
    values = {"w0": 2.0, "c": 0.5, "tilted": 0.4}
    for k, name in enumerate(names):
        q = v = 0.0
        for step, weight in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60)):
            for side in (1, -1):
                beside = {name: values[name] + side * step * 1e-3}
                found = lagcli.simulate(lagcli.load_text(text, set=beside), rtol=1e-11)
                q = q + side * weight * found.q / 1e-3
                v = v + side * weight * found.v / 1e-3
        assert run.dq[..., k] == pytest.approx(q, abs=1e-6)
        assert run.dv[..., k] == pytest.approx(v, abs=1e-5)


@pytest.mark.parametrize(
    ("spun", "z"),
    [
        ("[{guess: 0}, {guess: 0}, 1 + w0]", 3.5),
        ("[0, 0, 1 + w0]", 3.5),
        ("{guess: [0, 0, w0]}", 2.5),
    ],
)
def test_rows_of_a_sweep_start_as_single_runs(spun: str, z: float, tmp_path: Path) -> None:
    text = SPUN.replace("[{guess: 0}, {guess: 0}, 1 + w0]", spun)
    single = simulation.prepare(lagcli.load_text(text, set={"w0": 2.5})).start.state
    assert spin(single.q[:4], single.v[:4])[2] == pytest.approx(z, abs=1e-12)
    out = tmp_path / "rows.h5"
    lagcli.sweep(
        lagcli.load_text(text), ["w0=1.5:2.5:0.5"], out, measures={"z": "final(wz)"}, jobs=1
    )
    with h5py.File(out) as file:
        measured = file["z"][-1]
    run = lagcli.simulate(lagcli.load_text(text, set={"w0": 2.5}))
    assert measured == pytest.approx(run.outputs["wz"][-1], abs=1e-8)


@pytest.mark.parametrize("velocity", ["[0, 0.5, 3]", "{guess: [0, 0.5, 3]}"])
def test_a_guess_of_zeros_is_no_orientation(velocity: str) -> None:
    """The rates of any ω are 0 there: the body started at rest, without a word."""
    with pytest.raises(ModelError) as found:
        _ = rolling("{guess: [0, 0, 0, 0]}", velocity).start
    (one,) = found.value.diagnostics
    assert "the guess of the quaternion `e` is 0" in one.message
    assert one.location is not None
    assert (one.location.line, one.help) == (7, "give a rotation: `e: {guess: 1}`")
