"""Models with vectors, bodies and rotations: the same motion and λ as written out by components."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.trajectory.trajectory import Trajectory

HERE = Path(__file__).parents[1]
#: The six longest models of tests/found, written with vectors in tests/vectors.
REWRITTEN = (
    "bricard_tilted",
    "bricard_a04",
    "whipple_bicycle",
    "door_two_hinges",
    "door_off",
    "door_one_hinge",
)
#: Names of the components, by names in the models with vectors.
_COORDINATE = {
    **{f"r{k}.{x}": f"{x}{k}" for k in ("", "[1]", "[2]", "[3]", "[4]", "[5]") for x in "xyz"},
    **{f"e{k}.{i}": f"e{i}{k}" for k in ("", "[1]", "[2]", "[3]", "[4]", "[5]") for i in "0123"},
}
_CONSTRAINT = (
    (r"e(\[\d\])?\.unit", r"unit\1"),
    (r"pin(\[\d\])\.([xyz])", r"p\2\1"),
    (r"(h\d)\.x", r"\1a"),
    (r"(h\d)\.y", r"\1b"),
    (r"upright_([ab])\.x", r"\g<1>1"),
    (r"upright_([ab])\.y", r"\g<1>2"),
    (r"([ab])\.([xyz])", r"\1\2"),
    (r"(rear|front)\.([xy])", r"\1_\2"),
)


def by_component(constraint: str) -> str:
    """Return the name of a constraint in the model that is written by components."""
    for pattern, name in _CONSTRAINT:
        if re.fullmatch(pattern, constraint):
            return re.sub(pattern, name, constraint)
    return constraint


@cache
def run(folder: str, name: str) -> Trajectory:
    return lagcli.simulate(lagcli.load(HERE / folder / f"{name}.yaml"), t_end=0.1, samples=11)


@pytest.mark.parametrize("name", REWRITTEN)
def test_rewritten_models_are_at_most_half_as_long(name: str) -> None:
    long, short = (
        len((HERE / folder / f"{name}.yaml").read_text().splitlines())
        for folder in ("found", "vectors")
    )
    assert short <= long / 2


@pytest.mark.parametrize("name", REWRITTEN)
def test_rewritten_models_move_alike(name: str) -> None:
    ours, theirs = run("vectors", name), run("found", name)
    for i, q in enumerate(ours.coordinates):
        j = theirs.coordinates.index(_COORDINATE.get(q, q))
        for mine, other in ((ours.q, theirs.q), (ours.v, theirs.v), (ours.a, theirs.a)):
            scale = max(1.0, np.abs(other[:, j]).max())
            assert np.allclose(mine[:, i], other[:, j], rtol=0, atol=1e-10 * scale), q
    assert ours.outputs.keys() == theirs.outputs.keys()
    for output, values in ours.outputs.items():
        scale = max(1.0, np.abs(theirs.outputs[output]).max())
        assert np.allclose(values, theirs.outputs[output], rtol=0, atol=1e-9 * scale), output


# of the tilted mechanism, the pins have their λ along other axes
@pytest.mark.parametrize("name", [name for name in REWRITTEN if name != "bricard_tilted"])
def test_rewritten_models_have_the_same_multipliers(name: str) -> None:
    ours, theirs = run("vectors", name), run("found", name)
    assert {*map(by_component, ours.constraints)} == {*theirs.constraints}
    for i, constraint in enumerate(ours.constraints):
        j = theirs.constraints.index(by_component(constraint))
        scale = max(1.0, np.abs(theirs.multipliers).max())
        mine, other = ours.multipliers[:, i], theirs.multipliers[:, j]
        assert np.allclose(mine, other, rtol=0, atol=1e-9 * scale), constraint


#: A gyroscope: a symmetric top free of forces, started by a rotation and a body-frame ω.
TOP = """
coordinates: {r: point, e: quaternion}
parameters: {m: 2 kg, A: 3 kg*m^2, C: 5 kg*m^2, a: 30 deg, n: 4 rad/s, p: 0.5 rad/s}
T: body(m, diag(A, A, C), r, e)
initial:
  r: [1, 0, 20 cm]
  e: rot_z(a)*rot_x(10 deg)
  r': [0, 0, 1]
  e': [p, 0, n]
outputs: {wx: omega(e).x, wy: omega(e).y, wz: omega(e).z, axis: "e[3,3]", unit: lambda.e.unit}
"""


def test_free_top_precesses_as_euler_found() -> None:
    # ω_x + i ω_y = p exp(i Ω t) with Ω = (C − A)/A n in the body's frame
    run = lagcli.simulate(lagcli.load_text(TOP), t_end=3, samples=31)
    rate = (5 - 3) / 3 * 4
    assert np.allclose(run.outputs["wx"], 0.5 * np.cos(rate * run.time), atol=1e-8)
    assert np.allclose(run.outputs["wy"], 0.5 * np.sin(rate * run.time), atol=1e-8)
    assert np.allclose(run.outputs["wz"], 4, atol=1e-8)
    assert run.outputs["axis"][0] == pytest.approx(np.cos(np.radians(10)), abs=1e-14)
    assert np.allclose(run.q[:, :3], np.add([1, 0, 0.2], np.outer(run.time, [0, 0, 1])), atol=1e-10)


WELD = """
coordinates: {{r: point, e: quaternion, s: point, f: quaternion}}
parameters: {{m: 20 kg, M: 5 kg, w: 0.8 m, g: 9.81 m/s^2}}
definitions:
  J: m*w^2/12*diag(0.1, 1, 1)
  K: M*w^2/12*diag(0.1, 1, 1)
T: body(m, J, r, e) + body(M, K, s, f)
V: m*g*r.z + M*g*s.z
constraints:
  pin: r = e*[w/2, 0, 0]
  weld: {weld}
  next: s = r + e*[w/2, 0, 0]
  plane: [r.y, e.1, e.3]
initial:
  r: {{guess: [w/2, 0, 0]}}
  s: {{guess: [w, 0, 0]}}
  e: rot_y(0.2)
  f: {{guess: rot_y(0.2)}}
  r': {{guess: 0}}
  s': {{guess: 0}}
  e': [0, 1, 0]
  f': {{guess: 0}}
"""


def test_equation_of_rotations_welds_two_bodies() -> None:
    """Two bodies with equal rotations are a physical pendulum; λ is the torque between them."""
    run = lagcli.simulate(lagcli.load_text(WELD.format(weld="e = f")), t_end=1, samples=21)
    turned = [run.coordinates.index(name) for name in ("e.0", "e.2")]
    angle = 2 * np.arctan2(run.q[:, turned[1]], run.q[:, turned[0]])
    rest = run.q[:, run.coordinates.index("f.0")] - run.q[:, turned[0]]
    assert np.abs(rest).max() < 1e-9
    # I θ'' = (m w/2 + M w) g cos θ, with θ about y downward
    m, other, w, g = 20, 5, 0.8, 9.81
    inertia = m * w**2 / 3 + other * w**2 * (1 + 1 / 12)
    moment = (m * w / 2 + other * w) * g
    square = 1 + 2 * moment / inertia * (np.sin(angle) - np.sin(0.2))
    q, v = run.q, run.v
    omega = 2 * (q[:, turned[0]] * v[:, turned[1]] - q[:, turned[1]] * v[:, turned[0]])
    assert np.allclose(omega**2, square, atol=1e-7)
    # the torque of the weld turns the second body, about its own centre: K θ''
    torque = run.multipliers[:, run.constraints.index("weld.y")]
    second = other * w**2 / 12 * moment / inertia * np.cos(angle)
    assert np.allclose(-torque, second, rtol=1e-7)


def test_equation_of_rotations_is_that_of_three_components() -> None:
    by_rows = "0.5*[(transpose(f)*e)[3,2] - (transpose(f)*e)[2,3], (transpose(f)*e)[1,3]"
    by_rows += " - (transpose(f)*e)[3,1], (transpose(f)*e)[2,1] - (transpose(f)*e)[1,2]] = 0"
    one, two = (
        lagcli.simulate(lagcli.load_text(WELD.format(weld=text)), t_end=0.2, samples=5)
        for text in ("e = f", by_rows)
    )
    assert one.constraints == two.constraints
    assert np.allclose(one.q, two.q, atol=1e-11)
    assert np.allclose(one.multipliers, two.multipliers, rtol=1e-9, atol=1e-9)


TORQUE = """
coordinates: {e: quaternion, f: quaternion, phi: rad}
parameters: {k: 2 kg*m^2, c: 3 kg*m^2, M: 3 N*m, n: 2 rad/s}
definitions:
  R: rot_z(phi)
T: body(0, diag(k, k, k), [0, 0, 0], e) + body(0, diag(k, k, c), [0, 0, 0], f) + k/2*phi'^2
Q: {e: [0, 0, M], R: [0, M, 2*M], f: [M, 0, 0]}
initial: {e: rot_x(20 deg), f: rot_y(1), phi: 0, e': 0, f': [0, 0, n], phi': 0}
outputs: {w: "omega(e).z", a: "omega(f).x", b: "omega(f).y"}
"""


def test_torques_turn_bodies_by_eulers_equations() -> None:
    run = lagcli.simulate(lagcli.load_text(TORQUE), t_end=1, samples=11)
    assert np.allclose(run.outputs["w"], 3 / 2 * run.time, atol=1e-9)
    assert np.allclose(run.q[:, 8], 6 / 2 * run.time**2 / 2, atol=1e-9)
    # a' + s b = M/k and b' − s a = 0 with s = (c − k)/k n
    s = (3 - 2) / 2 * 2
    assert np.allclose(run.outputs["a"], 1.5 / s * np.sin(s * run.time), atol=1e-9)
    assert np.allclose(run.outputs["b"], 1.5 / s * (1 - np.cos(s * run.time)), atol=1e-9)


NET = """
coordinates: [{coordinates}]
parameters: {{m: 0.1 kg, k: 40 N/m, g: 9.81 m/s^2, N: 3}}
T: {kinetic}
V: {potential}
initial: {{{initial}}}
simulation: {{t_end: 1, samples: 11}}
"""


def test_families_with_two_indices_are_a_net_of_masses() -> None:
    """A net of 3 × 4 masses on springs, and the same with one index: p = 4 (i − 1) + j."""
    two = NET.format(
        coordinates="u[1..N, 1..N+1]",
        kinetic="sum(sum(m/2*u[i,j]'^2, j = 1..N+1), i = 1..N)",
        potential="sum(sum(k/2*(u[i,j+1] - u[i,j])^2, j = 1..N), i = 1..N)"
        " + sum(sum(k/2*(u[i+1,j] - u[i,j])^2, j = 1..N+1), i = 1..N-1) + k/2*u[1,1]^2",
        initial="'u[i = 1..N, j = 1..N+1]': 'i*0.1 - j/20', 'u[1..N, 1..N+1]''': 0, 'u[2,3]': 1",
    )
    one = NET.format(
        coordinates="u[1..12]",
        kinetic="sum(m/2*u[p]'^2, p = 1..12)",
        potential="sum(sum(k/2*(u[4*i + j - 3] - u[4*i + j - 4])^2, j = 1..3), i = 1..N)"
        " + sum(sum(k/2*(u[4*i + j] - u[4*i + j - 4])^2, j = 1..4), i = 1..2) + k/2*u[1]^2",
        initial="'u[p = 1..12]': '(1 + floor((p - 1)/4))*0.1 - (p - 4*floor((p - 1)/4))/20',"
        " 'u[1..12]''': 0, 'u[7]': 1",
    )
    a, b = (lagcli.simulate(lagcli.load_text(text)) for text in (two, one))
    assert a.coordinates[:5] == ("u[1,1]", "u[1,2]", "u[1,3]", "u[1,4]", "u[2,1]")
    assert np.allclose(a.q, b.q, atol=1e-12)
