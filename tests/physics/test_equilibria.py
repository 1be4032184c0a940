"""Equilibria, steady motions and bifurcations against closed forms and published values."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import sympy
from random_cases import FUZZ_COUNT, seeds
from scipy.linalg import eigh
from scipy.optimize import brentq

import lagcli
from lagcli.errors import NumericalError, UsageError

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"

#: Ziegler's column: two rods with springs k, point masses 2m and m, a follower force P at the end.
ZIEGLER = """
name: ziegler
coordinates: [a, b]
parameters: {m: 1.5, l: 0.7, k: 20, P: 0, c: 0}
T: m*l^2*a'^2 + m/2*l^2*(a'^2 + b'^2 + 2*a'*b'*cos(a - b))
V: k/2*a^2 + k/2*(b - a)^2
D: c/2*a'^2 + c/2*(b' - a')^2
Q: {a: P*l*sin(a - b)}
initial: {a: 0, b: 0, a': 0, b': 0}
"""

#: Two springs under compression that snap through, with a guide as a constraint.
TRUSS = """
name: truss
coordinates: [w, u]
parameters: {k: 1000, b: 1, h: 0.3, P: 0, m: 1}
definitions: {s: sqrt(b^2 + w^2)}
T: m/2*(w'^2 + u'^2)
V: k*(s - sqrt(b^2 + h^2))^2
Q: {w: -P, u: P/2}
constraints: {guide: u = 0}
initial: {w: h, u: 0, w': 0, u': 0}
"""


def test_pendulum_rests_below_and_above() -> None:
    found = lagcli.equilibrium(lagcli.load(MODELS / "pendulum_cartesian.yaml"), all=True, starts=8)
    below, above = found.equilibria
    parameters = lagcli.load(MODELS / "pendulum_cartesian.yaml").parameter_values
    m, g, l = (parameters[name] for name in ("m", "g", "l"))
    for one, sign in ((below, -1), (above, 1)):
        assert one.operating_point.point.q == pytest.approx([0, sign * l], abs=1e-12)
        # V = m g y, constraint x² + y² = l²: λ = ±m g/(2 l)
        assert one.operating_point.point.multipliers == pytest.approx([sign * m * g / (2 * l)])
        assert one.constraint_forces[0] == pytest.approx([0, m * g], abs=1e-12)
        assert one.stability.stiffness == pytest.approx([-sign * g / l], rel=1e-12)
        assert one.dimension == 0
    assert [below.stability.verdict, above.stability.verdict] == ["stable", "unstable"]


def test_all_four_configurations_of_a_double_pendulum_are_found() -> None:
    found = lagcli.equilibrium(
        lagcli.load(MODELS / "double_pendulum_cartesian.yaml"), all=True, starts=24
    )
    heights = {tuple(np.round(x.operating_point.point.q[[1, 3]], 9)) for x in found.equilibria}
    assert heights == {(-0.6, -1.0), (-0.6, -0.2), (0.6, 0.2), (0.6, 1.0)}
    assert [x.stability.verdict for x in found.equilibria] == ["stable", *["unstable"] * 3]


@pytest.mark.parametrize("name", ["slider_crank", "four_bar", "parallelogram"])
def test_forces_balance_and_the_hessian_is_that_of_differences(name: str) -> None:
    model = lagcli.load(MODELS / f"{name}.yaml")
    (one,) = lagcli.equilibrium(model).equilibria
    start = {
        q: f"{x!r}*1"
        for q, x in zip(model.coordinate_names, one.operating_point.point.q.tolist(), strict=True)
    }
    rates = {f"{q}'": "0" for q in model.coordinate_names}
    moved = lagcli.load(MODELS / f"{name}.yaml", set_initial=start | rates)
    run = lagcli.simulate(moved, t_end=1e-9, samples=2)
    # at rest there, the engine finds no acceleration and the same forces
    assert np.abs(run.a[0]).max() < 1e-8
    forces = one.constraint_forces.sum(axis=0)
    assert run.constraint_force[0] == pytest.approx(forces, abs=1e-9 * np.abs(forces).max())
    (stiffness,) = one.stability.stiffness
    assert one.stability.verdict == ("stable" if stiffness > 0 else "unstable")


def test_sets_of_equilibria_have_their_dimension() -> None:
    # a sleigh may stand anywhere; a disk upright anywhere with any heading and spin
    (sleigh,) = lagcli.equilibrium(lagcli.load(MODELS / "chaplygin_sleigh.yaml")).equilibria
    assert (sleigh.dimension, sleigh.neutral_coordinates) == (3, (0, 1, 2))
    (disk,) = lagcli.equilibrium(lagcli.load(MODELS / "rolling_disk.yaml")).equilibria
    model = lagcli.load(MODELS / "rolling_disk.yaml")
    assert [model.coordinate_names[i] for i in disk.neutral_coordinates] == ["x", "y", "psi", "phi"]
    assert disk.operating_point.point.multipliers == pytest.approx([2 * 9.81, 0, 0], abs=1e-9)


def test_disk_rolls_in_the_circle_of_the_closed_form() -> None:
    model = lagcli.load(MODELS / "rolling_disk.yaml")
    values = model.parameter_values
    spin = -values["S"] - values["Omega"] * math.sin(values["theta_0"])
    found = lagcli.equilibrium(model, steady={"psi'": values["Omega"], "phi'": spin})
    (one,) = found.equilibria
    theta = one.operating_point.point.q[model.coordinate_names.index("theta")]
    assert theta == pytest.approx(values["theta_0"], rel=1e-10)


def test_held_velocity_gives_the_angle_of_a_governor() -> None:
    # a conical pendulum: cos θ = g/(l φ'²)
    text = (
        "coordinates: [theta, phi]\nparameters: {m: 2, l: 0.5, g: 9.81}\n"
        "T: m*l^2/2*(theta'^2 + sin(theta)^2*phi'^2)\nV: -m*g*l*cos(theta)\n"
        "initial: {theta: 1, phi: 0, theta': 0, phi': 6}\n"
    )
    (one,) = lagcli.equilibrium(lagcli.load_text(text), steady={"phi'": 6.0}).equilibria
    cosine = 9.81 / (0.5 * 36)
    assert one.operating_point.point.q[0] == pytest.approx(math.acos(cosine), rel=1e-12)
    assert one.neutral_coordinates == (1,)
    # frequency of nutation: ω² = φ'² (1 + 3 cos²θ)
    largest = np.abs(one.stability.eigenvalues).max()
    assert largest == pytest.approx(6 * math.sqrt(1 + 3 * cosine**2), rel=1e-9)


def test_bead_on_a_hoop_has_a_pitchfork() -> None:
    values = {"theta_0": "0 rad", "Omega": "1 rad/s"}
    model = lagcli.load(MODELS / "bead_on_rotating_hoop.yaml", set=values)
    diagram = lagcli.follow_equilibria(model, "Omega", 1.0, 6.0, branches=True)
    (pitchfork,) = diagram.special
    assert (pitchfork.kind, pitchfork.crossing) == ("branch point", "pitchfork")
    assert pitchfork.parameter**2 == pytest.approx(9.81, rel=1e-12)
    main, *others = diagram.branches
    assert (main.stable == (main.parameter < math.sqrt(9.81))).all()
    assert [branch.origin for branch in others] == [0, 0]
    assert {np.sign(branch.q[-1, 1]) for branch in others} == {1.0, -1.0}
    for branch in others:
        assert branch.stable.all()
        assert branch.parameter[-1] == pytest.approx(6.0, rel=1e-12)
        # cos θ = g/(R Ω²), and the hoop carries λ = −m R Ω²
        assert np.cos(branch.q[:, 1]) == pytest.approx(9.81 / branch.parameter**2, rel=1e-9)
        assert branch.multipliers[:, 0] == pytest.approx(-(branch.parameter**2), rel=1e-9)


def test_column_of_ziegler_flutters() -> None:
    # P = (7/2 − √2) k/l for masses 2m, m: Ziegler 1952; Bolotin 1963
    model = lagcli.load_text(ZIEGLER)
    diagram = lagcli.follow_equilibria(model, "P", 0.0, 4 * 20 / 0.7)
    (flutter,) = diagram.special
    assert flutter.kind == "flutter"
    assert flutter.parameter == pytest.approx((3.5 - math.sqrt(2)) * 20 / 0.7, rel=1e-9)
    assert flutter.parameter == pytest.approx(2.085786 * 20 / 0.7, rel=1e-6)
    (branch,) = diagram.branches
    assert (branch.stable == (branch.parameter < flutter.parameter)).all()


def test_damping_lowers_the_load_of_the_column_of_ziegler() -> None:
    # equal damping: P l/k = 41/28 + c²/(2 k m l²): Herrmann, Jong, J. Appl. Mech. 32 (1965) 592
    model = lagcli.load_text(ZIEGLER, set={"c": "0.3"})
    diagram = lagcli.follow_equilibria(model, "P", 0.0, 60.0)
    (hopf,) = diagram.special
    assert hopf.kind == "Hopf point"
    expected = 41 / 28 + 0.3**2 / (2 * 20 * 1.5 * 0.7**2)
    assert hopf.parameter * 0.7 / 20 == pytest.approx(expected, rel=1e-7)
    assert hopf.frequency is not None
    assert hopf.frequency > 0


def test_truss_snaps_through_at_a_fold() -> None:
    diagram = lagcli.follow_equilibria(lagcli.load_text(TRUSS), "P", 0.0, 20.0)
    (fold,) = diagram.special
    # P = 2 k w (s0/s − 1) is largest where s³ = s0 b²
    s0 = math.hypot(1, 0.3)
    s = s0 ** (1 / 3)
    w = math.sqrt(s**2 - 1)
    assert fold.kind == "fold"
    assert fold.parameter == pytest.approx(2 * 1000 * w * (s0 / s - 1), rel=1e-12)
    assert fold.q[0] == pytest.approx(w, rel=1e-6)
    assert fold.multipliers[0] == pytest.approx(-fold.parameter / 2, rel=1e-12)
    (branch,) = diagram.branches
    assert (branch.stable == (branch.q[:, 0] > w)).all()
    # it goes on past the fold, down to no load
    assert branch.parameter[-1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_whipple_bicycle_is_stable_between_its_weave_and_its_capsize_speed() -> None:
    # Meijaard, Papadopoulos, Ruina, Schwab 2007, sec. 4: 4.29238253634111 and 6.02426201538837 m/s
    model = lagcli.load(ROOT / "tests" / "found" / "whipple_bicycle.yaml", set={"eps": "0"})
    diagram = lagcli.follow_equilibria(model, "x'", 3.0, 8.0)
    # to either side, the bicycle leans and turns alike
    assert diagram.special[1].crossing == "pitchfork"
    weave, capsize = diagram.special
    assert (weave.kind, capsize.kind) == ("Hopf point", "branch point")
    # 15 digits are published; 2e-15 is reached
    assert weave.parameter == pytest.approx(4.29238253634111, rel=1e-12)
    assert capsize.parameter == pytest.approx(6.02426201538837, rel=1e-12)
    (branch,) = diagram.branches
    between = (branch.parameter > weave.parameter) & (branch.parameter < capsize.parameter)
    assert (branch.stable == between).all()


@pytest.mark.slow
def test_turning_bicycles_beside_the_capsize_speed_are_unstable_by_a_real_eigenvalue() -> None:
    """The pitchfork is subcritical: turning bicycles are slower than the capsize speed.

    Beside it, their growth is proportional to the distance from it, as the capsize eigenvalue is;
    in axes that do not turn, it would be that of an oscillation, and proportional to the rate of
    turn.
    """
    model = lagcli.load(ROOT / "tests" / "found" / "whipple_bicycle.yaml", set={"eps": "0"})
    diagram = lagcli.follow_equilibria(model, "x'", 5.9, 6.1, branches=True)
    capsize = diagram.special[0].parameter
    for branch in diagram.branches[1:]:
        assert (branch.parameter[1:] < capsize).all()
        assert not branch.stable.any()
        near = (branch.parameter < capsize - 1e-3) & (branch.parameter > capsize - 2e-2)
        slope = branch.growth[near] / (capsize - branch.parameter[near])
        assert len(slope) > 2
        np.testing.assert_allclose(slope, slope[0], rtol=0.02)


def test_stability_of_a_disk_that_turns_is_that_of_the_closed_form() -> None:
    """x' is held, and turns with the disk: the axes of the linear model must not.

    Neimark, Fufaev 1972, ch. III: with the rolling rate s and ψ' as functions of the tilt θ,
    (A + m r²) θ'' = m g r sin θ + (C + m r²) s ψ' cos θ − A ψ'² sin θ cos θ,
    ds/dθ = −m r² ψ' cos θ/(C + m r²), cos θ dψ'/dθ = 2 ψ' sin θ − C s/A.
    """
    model = lagcli.load(MODELS / "rolling_disk.yaml")
    diagram = lagcli.follow_equilibria(model, "x'", -2.2, -0.3, steady={"psi'": 1.5})
    (branch,) = diagram.branches
    m, g, r, a, c = (model.parameter_values[name] for name in ("m", "g", "r", "A", "C"))
    turn, tilt = 1.5, branch.q[:, 4]
    sin, cos = np.sin(tilt), np.cos(tilt)
    roll = branch.v[:, 5] + turn * sin
    by_roll = -m * r**2 * turn * cos / (c + m * r**2)
    by_turn = (2 * turn * sin - c * roll / a) / cos
    slope = m * g * r * cos - a * (2 * turn * by_turn * sin * cos + turn**2 * (cos**2 - sin**2))
    slope += (c + m * r**2) * (by_roll * turn * cos + roll * by_turn * cos - roll * turn * sin)
    growing = slope > 0
    assert 0 < growing.sum() < len(growing)
    assert (branch.stable == ~growing).all()
    expected = np.sqrt(slope[growing] / (a + m * r**2))
    np.testing.assert_allclose(branch.growth[growing], expected, rtol=1e-6)
    assert branch.growth[~growing].max() < 1e-9


BUCKLE = """
coordinates: [theta]
parameters: {m: 1, l: 0.5, k: 10, P: 5}
T: m/6*l^2*theta'^2
V: k/2*theta^2 - P*l*(1 - cos(theta))
initial: {theta: 0.01, theta': 0}
"""


def test_rods_on_a_torsion_spring_buckle_from_a_small_deviation() -> None:
    # P l/k = θ/sin θ: the start says nothing of how far an angle on a spring turns
    diagram = lagcli.follow_equilibria(lagcli.load_text(BUCKLE), "P", 5.0, 40.0, branches=True)
    (point,) = diagram.special
    assert point.crossing == "pitchfork"
    assert point.parameter == pytest.approx(20.0, rel=1e-12)
    _, *buckled = diagram.branches
    for branch in buckled:
        angle = branch.q[:, 0]
        assert branch.parameter[-1] == pytest.approx(40.0, rel=1e-12)
        np.testing.assert_allclose(branch.parameter * np.sin(angle), 20 * angle, rtol=1e-9)
    found = lagcli.equilibrium(lagcli.load_text(BUCKLE, set={"P": "30"}), all=True, starts=16)
    assert len(found.equilibria) == 3


def test_exchange_of_stability_is_transcritical_and_its_branches_are_followed() -> None:
    # V = x³/3 − s x²/2: x = 0 and x = s exchange their stability at s = 0
    text = (
        "coordinates: [x]\nparameters: {s: -1}\nT: x'^2/2\nV: x^3/3 - s*x^2/2\n"
        "initial: {x: 0, x': 0}\n"
    )
    diagram = lagcli.follow_equilibria(lagcli.load_text(text), "s", -1.0, 0.9, branches=True)
    (point,) = diagram.special
    assert (point.kind, point.crossing) == ("branch point", "transcritical")
    assert abs(point.parameter) < 1e-12
    assert abs(point.q[0]) < 1e-12
    _, one, other = diagram.branches
    for branch in (one, other):
        np.testing.assert_allclose(branch.q[:, 0], branch.parameter, rtol=1e-9)
        assert (branch.stable == (branch.parameter > 0)).all()


@pytest.mark.parametrize(
    ("first", "last"), [(0.8, 1.2), pytest.param(0.3, 1.7, marks=pytest.mark.slow)]
)
def test_branch_point_on_a_curved_branch_is_located_to_rounding_errors(
    first: float, last: float
) -> None:
    # x = s² with y = 0, and y² = s − 1 with x between
    text = (
        f"coordinates: [x, y]\nparameters: {{s: {first}}}\nT: (x'^2 + y'^2)/2\n"
        "V: (x - s^2)^2/2 + (1 + 0.1*x)*(y^4/4 - (s - 1)*y^2/2)\n"
        f"initial: {{x: {first**2}, y: 0, x': 0, y': 0}}\n"
    )
    diagram = lagcli.follow_equilibria(lagcli.load_text(text), "s", first, last)
    (point,) = diagram.special
    assert (point.kind, point.crossing) == ("branch point", "pitchfork")
    assert point.parameter == pytest.approx(1.0, rel=1e-12)
    assert point.q == pytest.approx([1.0, 0.0], abs=1e-10)


@pytest.mark.parametrize("slope", [0, 0.3])
def test_a_coordinate_that_is_neutral_on_one_branch_alone_does_not_hide_a_pitchfork(
    slope: float,
) -> None:
    # with z = u − slope·sin(s): any w is an equilibrium with z = 0; z² = s − 1 holds w at 0
    text = (
        f"coordinates: [u, w]\nparameters: {{s: 0.5}}\ndefinitions: {{z: u - {slope}*sin(s)}}\n"
        "T: (u'^2 + w'^2)/2\nV: 0\nQ: {u: (s - 1)*z - z^3 - z*w^2, w: -z*w}\n"
        f"initial: {{u: {slope}*sin(0.5), w: 0, u': 0, w': 0}}\n"
    )
    diagram = lagcli.follow_equilibria(lagcli.load_text(text), "s", 0.5, 1.5, branches=True)
    (point,) = diagram.special
    assert (point.kind, point.crossing) == ("branch point", "pitchfork")
    assert point.parameter == pytest.approx(1.0, rel=1e-10)
    _, *others = diagram.branches
    signs = []
    for branch in others:
        z = branch.q[:, 0] - slope * np.sin(branch.parameter)
        assert branch.parameter[-1] == pytest.approx(1.5, rel=1e-12)
        np.testing.assert_allclose(z**2, branch.parameter - 1, rtol=1e-7)
        np.testing.assert_allclose(branch.q[:, 1], 0.0, atol=1e-7)
        # the force on w is −z w: it holds w where z > 0
        assert (branch.stable == (z > 0)).all()
        signs.append(np.sign(z[-1]))
    assert sorted(signs) == [-1.0, 1.0]


def check_pitchfork_beside_a_neutral_motion(size: float, stiffness: float) -> None:
    """On the branch z = 0 the stiffness of u is `stiffness` (1 - s), that of w is z.

    Rounding errors of z are no changes of stability; next to s = 1 they exceed the stiffness of u.
    """
    text = (
        f"coordinates: [u, w]\nparameters: {{s: 0.5}}\ndefinitions: {{z: u - {size}*sin(s)}}\n"
        f"T: (u'^2 + w'^2)/2\nV: 0\nQ: {{u: {stiffness}*((s - 1)*z - z^3) - z*w^2, w: -z*w}}\n"
        f"initial: {{u: {size}*sin(0.5), w: 0, u': 0, w': 0}}\n"
    )
    diagram = lagcli.follow_equilibria(lagcli.load_text(text), "s", 0.5, 1.5)
    assert [point.kind for point in diagram.special] == ["branch point"]
    assert diagram.special[0].crossing == "pitchfork"
    assert diagram.special[0].parameter == pytest.approx(1.0, rel=1e-7)


@pytest.mark.parametrize("size", [0.3, 0.41, 0.996311839, 2.7, 17.660410748])
def test_a_branch_point_beside_a_neutral_motion(size: float) -> None:
    check_pitchfork_beside_a_neutral_motion(size, 0.001)


@pytest.mark.fuzz
def test_branch_points_beside_a_neutral_motion() -> None:
    for seed in range(FUZZ_COUNT // 10):
        rng = np.random.default_rng(seed)
        size, stiffness = np.exp(rng.uniform(-3, 3.4)), rng.choice([1e-3, 1e-2, 0.1, 1])
        check_pitchfork_beside_a_neutral_motion(float(size), float(stiffness))


@pytest.mark.parametrize("seed", seeds(3, 60))
def test_buckling_loads_of_columns_of_rigid_links(seed: int) -> None:
    """V = Σ k_i/2 (a_i − a_{i−1})² + Σ P L_i cos a_i: P is an eigenvalue of K x = P L x."""
    rng = np.random.default_rng(seed)
    n = 2 + seed % 2
    stiffness, length, mass = (np.exp(rng.uniform(-s, s, n)).tolist() for s in (2, 1, 1))
    matrix = np.diag(stiffness) + np.diag([*stiffness[1:], 0.0])
    for i in range(1, n):
        matrix[i, i - 1] = matrix[i - 1, i] = -stiffness[i]
    loads = eigh(matrix, np.diag(length), eigvals_only=True)
    end = 1.3 * loads[0]
    names = [f"a{i}" for i in range(n)]
    turns = ["a0", *(f"(a{i} - a{i - 1})" for i in range(1, n))]
    kinetic = " + ".join(f"{m!r}/2*{a}'^2" for m, a in zip(mass, names, strict=True))
    potential = " + ".join(
        f"{k!r}/2*{turn}^2 + P*{x!r}*cos({a})"
        for k, turn, x, a in zip(stiffness, turns, length, names, strict=True)
    )
    start = ", ".join(f"{a}: 0, {a}': 0" for a in names)
    text = (
        f"coordinates: [{', '.join(names)}]\nparameters: {{P: {0.5 * float(loads[0])!r}}}\n"
        f"T: {kinetic}\nV: {potential}\n"
        f"initial: {{{start}}}\n"
    )
    diagram = lagcli.follow_equilibria(lagcli.load_text(text), "P", 0.5 * loads[0], end)
    found = [x for x in diagram.special if x.branch == 0]
    assert {x.kind for x in found} == {"branch point"}
    expected = loads[loads < end]
    assert [x.parameter for x in found] == pytest.approx(expected.tolist(), rel=1e-9)


def test_velocity_is_a_parameter_of_steady_motions() -> None:
    text = (
        "coordinates: [theta, phi]\nparameters: {l: 0.5, g: 9.81}\n"
        "T: l^2/2*(theta'^2 + sin(theta)^2*phi'^2)\nV: -g*l*cos(theta)\n"
        "initial: {theta: 1, phi: 0, theta': 0, phi': 8}\n"
    )
    model = lagcli.load_text(text)
    diagram = lagcli.follow_equilibria(model, "phi'", 8.0, 5.0)
    (branch,) = diagram.branches
    assert branch.parameter[-1] == pytest.approx(5.0, rel=1e-12)
    assert np.cos(branch.q[:, 0]) == pytest.approx(9.81 / (0.5 * branch.parameter**2), rel=1e-8)


def test_dependent_parameters_follow() -> None:
    text = (
        "coordinates: [x]\nparameters: {m: 1, g: 10, k: 100*m^2, c: k/2}\n"
        "T: m/2*x'^2\nV: (k + c)/2*x^2 - m*g*x\ninitial: {x: 0, x': 0}\n"
    )
    diagram = lagcli.follow_equilibria(lagcli.load_text(text), "m", 1.0, 3.0)
    (branch,) = diagram.branches
    assert branch.q[:, 0] == pytest.approx(10 / (150 * branch.parameter), rel=1e-10)


def test_motion_without_equilibrium_is_an_error() -> None:
    text = "coordinates: [x]\nparameters: {m: 1}\nT: m/2*x'^2\nV: x\ninitial: {x: 0, x': 0}\n"
    with pytest.raises(NumericalError, match="forces on x remain"):
        lagcli.equilibrium(lagcli.load_text(text))
    forced = "coordinates: [x]\nT: x'^2/2\nV: x^2/2 - x*sin(t)\ninitial: {x: 0, x': 0}\n"
    with pytest.raises(NumericalError, match="depend on the time"):
        lagcli.equilibrium(lagcli.load_text(forced))
    crank = lagcli.load(MODELS / "bead_on_rotating_hoop.yaml")
    with pytest.raises(UsageError, match="the constraints determine phi'"):
        lagcli.equilibrium(crank, steady={"phi'": 1.0})


#: A bead on a parabola that rotates about its vertical axis (Greenwood).
ROTATING_PARABOLA = """
coordinates: {x: m, y: m}
parameters: {m: 1 kg, k: 0.8 1/m, g: 9.81 m/s^2, Omega: 3 rad/s}
T: m/2*(x'^2 + y'^2 + Omega^2*x^2)
V: m*g*y
constraints: {wire: y = k*x^2}
initial: {x: {guess: 0.1}, y: {guess: 0}, x': 0, y': {guess: 0}}
"""


def test_a_line_of_equilibria_is_named_and_ends_after_some_points() -> None:
    # at Ω² = 2 g k every point of the wire is an equilibrium
    model = lagcli.load_text(ROTATING_PARABOLA)
    diagram = lagcli.follow_equilibria(model, "Omega", 3.0, 5.0, branches=True)
    (point,) = diagram.special
    assert (point.kind, point.crossing) == ("branch point", "line of equilibria")
    assert point.stability == ("stable", "unstable")
    assert point.parameter == pytest.approx(math.sqrt(2 * 9.81 * 0.8), rel=1e-12)
    main, *lines = diagram.branches
    assert not main.line
    assert len(lines) == 2
    for line in lines:
        assert line.line
        assert len(line.parameter) < 100
        np.testing.assert_allclose(line.parameter, point.parameter, rtol=1e-12)
        np.testing.assert_allclose(line.q[:, 1], 0.8 * line.q[:, 0] ** 2, rtol=1e-9)
        assert set(line.stability) == {"undecided"}
    # and if the branch begins there
    begun = lagcli.follow_equilibria(model, "Omega", point.parameter, 5.0)
    assert [branch.line for branch in begun.branches] == [True]
    assert not begun.special


@pytest.mark.parametrize("shape", ["x^2", "1 - cos(x)", "x^2 + x^3", "exp(x) - x"])
def test_lines_of_equilibria_of_other_potentials(shape: str) -> None:
    # V = (s − 2) f(x): at s = 2 every x is an equilibrium
    text = (
        f"coordinates: [x, y]\nparameters: {{s: 1}}\nT: (x'^2 + y'^2)/2\n"
        f"V: (s - 2)*({shape}) + (y - x/2)^2\ninitial: {{x: 0, y: 0, x': 0, y': 0}}\n"
    )
    diagram = lagcli.follow_equilibria(lagcli.load_text(text), "s", 1.0, 3.3, branches=True)
    (point,) = diagram.special
    assert (point.kind, point.crossing) == ("branch point", "line of equilibria")
    assert point.parameter == pytest.approx(2.0, rel=1e-12)
    assert [branch.line for branch in diagram.branches] == [False, True, True]


@pytest.mark.parametrize(("mass", "length"), [(1.0, 7e3), (6e3, 500.0), (1e5, 20.0)])
def test_a_pitchfork_of_coordinates_of_any_size_is_no_line_of_equilibria(
    mass: float, length: float
) -> None:
    # at x = 0 nothing shows the size: x = ±length √(s − 0.2)
    text = (
        f"coordinates: [x]\nparameters: {{s: 0}}\nT: {mass!r}*x'^2/2\n"
        f"V: {mass!r}*((x/{length!r})^4/4 - (s - 0.2)*(x/{length!r})^2/2)\nQ: {{x: -x'}}\n"
        "initial: {x: 0, x': 0}\n"
    )
    diagram = lagcli.follow_equilibria(lagcli.load_text(text), "s", -1.0, 1.0)
    assert [(x.kind, x.crossing) for x in diagram.special] == [("branch point", "pitchfork")]
    assert diagram.special[0].parameter == pytest.approx(0.2, rel=1e-9)


def test_a_high_order_pitchfork_is_no_line_of_equilibria() -> None:
    # x = 0 and x⁴ = s − 1
    text = (
        "coordinates: [x]\nparameters: {s: 0.5}\nT: x'^2/2\nV: x^6/6 - (s - 1)*x^2/2\n"
        "initial: {x: 0, x': 0}\n"
    )
    diagram = lagcli.follow_equilibria(lagcli.load_text(text), "s", 0.5, 1.5, branches=True)
    (point,) = diagram.special
    assert point.crossing == "pitchfork"
    assert not any(branch.line for branch in diagram.branches)


@pytest.mark.parametrize("seed", seeds(3, 6))
def test_upright_disks_roll_stably_above_the_speed_of_the_closed_form(seed: int) -> None:
    # C (C + m r²) φ'² = m g r A: Neimark, Fufaev 1972, ch. III; φ'² = g/(3r) for a thin disk
    random = np.random.default_rng(seed)
    m, r, g = random.uniform(0.1, 5), random.uniform(0.05, 1), random.uniform(1, 20)
    a, c = (0.25, 0.5) if seed == 0 else (random.uniform(0.1, 0.5), random.uniform(0.2, 1.0))
    a, c = a * m * r**2, c * m * r**2
    critical = math.sqrt(m * g * r * a / (c * (c + m * r**2)))
    if seed == 0:
        assert critical == pytest.approx(math.sqrt(g / (3 * r)))
    values = {"m": f"{m} kg", "r": f"{r} m", "g": f"{g} m/s^2"}
    values |= {"A": f"{a} kg*m^2", "C": f"{c} kg*m^2"}
    model = lagcli.load(MODELS / "rolling_disk.yaml", set=values, set_initial={"theta": "0 rad"})
    limits = critical * random.uniform(0.2, 0.8), critical * random.uniform(1.2, 3)
    diagram = lagcli.follow_equilibria(model, "phi'", *limits, steady={"psi'": 0.0})
    (point,) = diagram.special
    assert (point.kind, point.stability) == ("divergence", ("unstable", "linearly stable"))
    assert point.parameter == pytest.approx(critical, rel=1e-10)
    (branch,) = diagram.branches
    for value, verdict in zip(branch.parameter[::13], branch.stability[::13], strict=True):
        (one,) = lagcli.equilibrium(model, steady={"phi'": value, "psi'": 0.0}).equilibria
        assert one.stability.verdict == verdict


@pytest.mark.parametrize("c", [0.3, 1.0, 7.0])
def test_gyroscopic_stabilization_ends_at_a_located_point(c: float) -> None:
    # x'' − s y' = c x, y'' + s x' = c y: stable for s² > 4 c
    text = (
        f"coordinates: [x, y]\nparameters: {{s: 1, c: {c}}}\n"
        "T: (x'^2 + y'^2)/2 + s/2*(x*y' - y*x')\nV: -c/2*(x^2 + y^2)\n"
        "initial: {x: 0, y: 0, x': 0, y': 0}\n"
    )
    model, critical = lagcli.load_text(text), 2 * math.sqrt(c)
    diagram = lagcli.follow_equilibria(model, "s", 2.1 * critical, 0.3 * critical)
    (point,) = diagram.special
    assert (point.kind, point.stability) == ("flutter", ("linearly stable", "unstable"))
    assert point.parameter == pytest.approx(critical, rel=1e-10)
    # with gyroscopic forces, the verdict also changes where the potential loses its minimum
    diagram = lagcli.follow_equilibria(lagcli.load_text(text, set={"s": "9"}), "c", -1.0, 2.0)
    (point,) = diagram.special
    assert (point.kind, point.stability) == ("stability change", ("stable", "linearly stable"))
    assert abs(point.parameter) < 1e-9


#: The circular restricted three-body problem in axes that turn with both masses.
THREE_BODIES = """
coordinates: [x, y]
parameters: {mu: 0.0121505856}
definitions:
  r1: sqrt((x + mu)^2 + y^2)
  r2: sqrt((x - 1 + mu)^2 + y^2)
T: ((x' - y)^2 + (y' + x)^2)/2
V: -(1 - mu)/r1 - mu/r2
"""


@pytest.mark.parametrize(
    ("mu", "x", "y"),
    [
        (0.0121505856, 0.8, 0.1),  # next to the first point, beside the small mass
        pytest.param(0.0121505856, 0.5, 0.5, marks=pytest.mark.slow),
        pytest.param(0.0121505856, 0.0, 1.0, marks=pytest.mark.slow),
        pytest.param(0.1, 1.2, 0.0, marks=pytest.mark.slow),
        pytest.param(0.3, 0.48785, 0.866, marks=pytest.mark.slow),
    ],
)
def test_all_five_points_of_lagrange_are_found(mu: float, x: float, y: float) -> None:
    text = THREE_BODIES + f"initial: {{x: {x}, y: {y}, x': 0, y': 0}}\n"
    found = lagcli.equilibrium(lagcli.load_text(text, set={"mu": str(mu)}), all=True)

    def force(x: float) -> float:
        far, near = x + mu, x - 1 + mu
        return x - (1 - mu) * far / abs(far) ** 3 - mu * near / abs(near) ** 3

    ranges = (-2, -mu - 1e-3), (-mu + 1e-3, 1 - mu - 1e-3), (1 - mu + 1e-3, 2)
    collinear = [(brentq(force, *ends, xtol=1e-14), 0.0) for ends in ranges]
    triangular = [(0.5 - mu, sign * math.sqrt(3) / 2) for sign in (1, -1)]
    points = sorted(tuple(one.operating_point.point.q.round(9)) for one in found.equilibria)
    expected = sorted(tuple(np.round(point, 9)) for point in [*collinear, *triangular])
    np.testing.assert_allclose(points, expected, atol=2e-9)
    # linearly stable: the triangular ones for small masses (Gascheau: 27 μ (1 − μ) < 1)
    for one in found.equilibria:
        away = abs(one.operating_point.point.q[1]) > 0.1
        stable = away and 27 * mu * (1 - mu) < 1
        assert one.stability.verdict == ("linearly stable" if stable else "unstable")


def test_multipliers_without_forces_are_zero() -> None:
    # springs at rest, whose constraint is not along a coordinate: λ was −1.9e-32
    text = (
        "coordinates: [x, y]\nT: (x'^2 + y'^2)/2\nV: 3/2*x^2 + 5/2*y^2\n"
        "constraints: {line: x + 2*y + x^3 = 0}\n"
        "initial: {x: 0.4, y: {guess: 0}, x': 0, y': {guess: 0}}\n"
    )
    (found,) = lagcli.equilibrium(lagcli.load_text(text)).equilibria
    point = found.operating_point.point
    assert [*point.q.tolist(), *point.multipliers.tolist()] == [0, 0, 0]


@pytest.mark.parametrize(
    ("force", "expected"),
    [
        ("(x - 0.9)^3", {0.9: "undecided"}),
        pytest.param("-(x - 0.9)^3", {0.9: "undecided"}, marks=pytest.mark.slow),
        pytest.param(
            "(x - 1)^2*(x + 2)", {1.0: "undecided", -2.0: "stable"}, marks=pytest.mark.slow
        ),
        pytest.param(
            "(x + 1.4)^3*(x - 2)", {-1.4: "undecided", 2.0: "stable"}, marks=pytest.mark.slow
        ),
        ("(x - 1)*(x - 1.001)", {1.0: "unstable", 1.001: "stable"}),
    ],
)
@pytest.mark.parametrize("rail", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_degenerate_equilibrium_is_one_and_undecided(
    force: str, expected: dict[float, str], rail: bool
) -> None:
    """V' with known roots, in expanded form; perhaps of a bead on the curve y = sin x."""
    x = sympy.Symbol("x")
    slope = sympy.sympify(force.replace("^", "**"), rational=True)
    potential = str(sympy.integrate(sympy.expand(slope), x)).replace("**", "^")
    y = "y = sin(x)" if rail else "y = 0"
    model = lagcli.load_text(f"""\
coordinates: [x, y]
T: x'^2 + y'^2
V: {potential}
constraints: {{rail: {y}}}
initial: {{x: 2, x': 0, y: {{guess: 0}}, y': {{guess: 0}}}}
""")
    found = {
        float(e.operating_point.point.q[0]): e.stability.verdict
        for e in lagcli.equilibrium(model, all=True).equilibria
    }
    # a triple root is found where the force is a rounding error, 1e-15 of its terms
    assert sorted(found) == pytest.approx(sorted(expected), abs=2e-4)
    assert [found[k] for k in sorted(found)] == [expected[k] for k in sorted(expected)]


@pytest.mark.parametrize("x", [-0.8, 0.3, 0.6])
def test_no_force_balances_constraints_that_depend_on_each_other(x: float) -> None:
    """A bead on y = x²/2, given twice, held by a spring at its lowest point: λ = 0, ω² = k.

    The λ of the iterations cancel each other, and are no forces.
    """
    model = lagcli.load_text(f"""\
coordinates: [x, y]
parameters: {{k: 3}}
T: (x'^2 + y'^2)/2
V: k/2*(x^2 + y^2)
constraints: {{bowl: y = x^2/2, again: (2*y - x^2)*(1 + y^2) = 0}}
initial: {{x: {x}, y: {{guess: 0}}, x': 0, y': {{guess: 0}}}}
""")
    (found,) = lagcli.equilibrium(model).equilibria
    point = found.operating_point.point
    np.testing.assert_allclose(np.concatenate([point.q, point.multipliers]), 0, atol=1e-12)
    assert found.stability.verdict == "stable"
    np.testing.assert_allclose(np.abs(found.stability.eigenvalues), np.sqrt(3), rtol=1e-9)


@pytest.mark.parametrize("k", [0.5, 2.0])
def test_a_set_along_which_the_multiplier_varies_is_found(k: float) -> None:
    """V = k/2 (x + y)² and x' + (1 + x - y) y' = 0: x = y = s/2 with λ = k s, and ω² = k s."""
    model = lagcli.load_text(f"""\
coordinates: [x, y]
parameters: {{k: {k}}}
T: (x'^2 + y'^2)/2
V: k/2*(x + y)^2
constraints: {{skate: x' + (1 + x - y)*y' = 0}}
initial: {{x: 0.5, y: 0.4, x': {{guess: 0}}, y': {{guess: 0}}}}
""")
    (found,) = lagcli.equilibrium(model).equilibria
    (x, y), (multiplier,) = found.operating_point.point.q, found.operating_point.point.multipliers
    assert (found.dimension, found.stability.verdict) == (1, "linearly stable")
    np.testing.assert_allclose([y, multiplier], [x, 2 * k * x], rtol=1e-12)
    rates = np.unique(np.abs(found.stability.eigenvalues))
    np.testing.assert_allclose(rates, [0, np.sqrt(2 * k * x)], atol=1e-9)
