"""Models that the language rejected, got wrong or read too slowly."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

import mpmath
import numpy as np
import pytest
import symengine as se
from growth import assert_growth
from random_cases import some

from lagcli.cli.app import run
from lagcli.engine.lowering.lower import lower
from lagcli.equations.derivation.lagrange import derive
from lagcli.errors import ModelError
from lagcli.model.diagnostics import MAX_DIAGNOSTICS
from lagcli.model.expression.tensors import Tensor
from lagcli.model.loader import load, load_text
from lagcli.model.model import Model
from lagcli.simulations.simulation import simulate

FOUND = Path(__file__).parents[2] / "found"
PLANE = """
coordinates: [x, y]
parameters: {{m: 1.5}}
T: m/2*(x'^2 + y'^2)
{key}: {text}
initial: {{x: 0.3, y: -0.4, x': {{guess: -1}}, y': {{guess: 0}}}}
"""


def plane(key: str, text: str) -> Model:
    return load_text(PLANE.format(key=key, text=text))


def help_of(text: str) -> list[str]:
    with pytest.raises(ModelError) as caught:
        load_text(text, "f")
    return [d.help or "" for d in caught.value.diagnostics]


# what is affine in the velocities


AFFINE = [
    "y' = x'*abs(x)",
    "y' = if(x > 0, x'*x, x'*y) + sign(x)*x' - cbrt(y)*y' + max(x, y)*x'",
    "y'*abs(t) = floor(t)*x' + ceil(x)",
    "if(x > 0, (x' + 1)^2 - x'^2, y') = x",
    "(x'/(1 + abs(y)) + y)^2 - (x'/(1 + abs(y)))^2 = y'",
    "if(x > 0, x', x') = y'",
    "(norm([x, 1, 2]) + acos(0.5*cos(x - m)))*y' + x' = m*(norm([x, 1, 2]) + min(x, t))",
]
NOT_AFFINE = [
    *("y' = abs(x')", "y' = floor(x')", "y' = if(x' > 0, 1, 2)"),
    *("y' + sign(x') = 0", "y' = max(x', 0)", "y' = step(x')*x"),
]


@pytest.mark.parametrize("text", AFFINE)
def test_coefficients_of_velocities_may_be_any_function_of_the_position(text: str) -> None:
    (constraint,) = derive(plane("constraints", f'{{c: "{text}"}}')).constraints
    assert constraint.constraint.kind == "nonholonomic"
    # ψ is what the constraint says, at any velocity
    chance = np.random.default_rng(2)
    for _ in range(5):
        at = {
            se.Symbol(n): se.RealDouble(chance.uniform(-1, 1)) for n in ("x", "y", "x'", "y'", "t")
        }
        at[se.Symbol("m")] = se.RealDouble(1.5)
        expected = float(constraint.constraint.expression.subs(at).n(53, real=True))
        found = float(constraint.velocity.subs(at).n(53, real=True))
        assert math.isclose(found, expected, rel_tol=1e-12, abs_tol=1e-14)


@pytest.mark.parametrize("text", AFFINE)
def test_the_linear_part_of_v_may_have_them_too(text: str) -> None:
    left, right = text.split(" = ")
    derive(plane("V", f'"{left} - ({right})"'))


@pytest.mark.parametrize("text", NOT_AFFINE)
def test_functions_of_velocities_are_not_affine(text: str) -> None:
    with pytest.raises(ModelError, match="is not affine in the velocity `x'`"):
        plane("constraints", f'{{c: "{text}"}}')


def test_a_constraint_that_is_zero_in_places_constrains_elsewhere() -> None:
    assert plane("constraints", '{c: "y*max(x - 5, 0) = 0"}').constraints


@pytest.mark.parametrize("name", ["absnh", "hostile/affine-with-abs"])
def test_affine_models_run(name: str) -> None:
    trajectory = simulate(load(FOUND / f"{name}.yaml"), t_end=0.5)
    assert trajectory.status == "completed"


def test_abs_in_a_velocity_constraint_against_its_closed_form() -> None:
    """y' = x' |x| integrates to y = x |x|/2 + c; the motion has constant speed along the curve."""
    trajectory = simulate(load(FOUND / "absnh.yaml"), t_end=1.0, rtol=1e-10)
    x, y = trajectory.q.T
    np.testing.assert_allclose(y - y[0], x * abs(x) / 2 - x[0] * abs(x[0]) / 2, atol=1e-9)
    speed = np.hypot(*trajectory.v.T)
    np.testing.assert_allclose(speed, speed[0], rtol=1e-8)


# jumps and constants


def test_jumps_in_a_constraint() -> None:
    model = load(FOUND / "floor_constraint.yaml")
    system = lower(derive(model))
    assert system.variation is not None
    system.variation()
    trajectory = simulate(model, t_end=0.05)  # slides on y = x² without a step
    assert trajectory.status == "completed"
    x, y = trajectory.q.T
    np.testing.assert_allclose(y, x**2, atol=1e-9)


def test_a_constraint_that_jumps_ends_the_run() -> None:
    """At x = 0 the stairs go down by 1 m: nothing after that belongs to the motion before."""
    trajectory = simulate(load(FOUND / "floor_constraint.yaml"))
    assert trajectory.status == "failed"
    assert "the constraints jump at" in trajectory.message
    assert "differs by 1 in `y`" in trajectory.message
    assert (trajectory.q[:, 0] >= 0).all()
    energy = trajectory.energy_total
    np.testing.assert_allclose(energy, energy[0], rtol=1e-6)


def test_floor_and_ceil_of_constants_are_numbers() -> None:
    model = load(FOUND / "hostile" / "ceil-of-constants.yaml")
    found = {name: float(x) for name, x in model.outputs.items()}
    c = math.sin(1 / 3)
    assert found == {
        **{"a": math.ceil(3.3 + 0.1 * c), "b": math.floor(3.3 + 0.1 * c), "c": 4, "d": 1},
        **{"e": 0, "f": 3, "g": 4, "h": 1, "i": 2, "j": pytest.approx(max(c, 0.2)), "k": 7},
        **{"l": 2, "m": 1},
    }


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *[("floor(log(8)/log(2))", 3), ("ceil(log(8, 2))", 3), ("floor(tanh(40))", 0)],
        *[("floor((sqrt(2) + sqrt(3))^2 - 2*sqrt(6))", 5), ("ceil(-2*pi)", -6)],
        *[("floor(10^14*pi)", 314159265358979), ("ceil(0.1*30)", 3), ("floor(-1/2)", -1)],
    ],
)
def test_floor_and_ceil_near_whole_numbers(text: str, value: int) -> None:
    assert plane("outputs", f'{{o: "{text}"}}').outputs["o"] == value


def test_constants_count_members() -> None:
    model = load_text("""
coordinates: [x[1..N]]
parameters: {N: ceil(2*pi)}
T: sum(x[i]'^2, i = 1..N)
V: sum(x[i]^2, i = 1..floor(pi^2/2))
initial: {x[1..N]: 1, x[1..N]': 0}
""")
    assert len(model.coordinates) == 7
    assert {s.name for s in model.potential.free_symbols} == {f"x[{i}]" for i in range(1, 5)}


def test_numbers_are_rounded_to_the_nearest_double() -> None:
    texts = [f"{k * 0.1234567890123457:.16g}" for k in range(1, 400)]
    parameters = ", ".join(f"p{k}: {text}" for k, text in enumerate(texts))
    model = load_text(f"coordinates: [x]\nT: x'^2\nparameters: {{{parameters}}}\n" + START)
    assert [p.value for p in model.parameters.values()] == list(map(float, texts))


START = "initial: {x: 1, x': 0}\n"


def test_brackets_in_quotes() -> None:
    model = load(FOUND / "hostile" / "brackets-in-quotes.yaml")
    assert [c.description for c in model.coordinates] == ["in ]0, a[", "in ]0, b["]
    single = "coordinates: {x: {description: 'in ]0, a['}, y[1]: {description: 'b] x['}}\n"
    rest = "T: x'^2 + y[1]'^2\ninitial: {x: 0, x': 0, y[1]: 0, y[1]': 0}\n"
    assert load_text(single + rest).coordinates[1].name == "y[1]"


# energy


def test_energy_of_a_given_rotation() -> None:
    """On a hoop turned at the rate w, v·p − L = T2 − T0 + V is kept, and T + V is not."""
    model = load_text("""
coordinates: [th]
parameters: {m: 1.2, R: 0.8, w: 4, g: 9.81}
T: m/2*R^2*(th'^2 + w^2*sin(th)^2)
V: -m*g*R*cos(th)
initial: {th: 0.5, th': 0}
""")
    trajectory = simulate(model, t_end=2, rtol=1e-10)
    assert np.ptp(trajectory.energy_kinetic + trajectory.energy_potential) > 1
    assert np.ptp(trajectory.energy_total) < 1e-7


def test_jumps_in_velocities_are_no_quadratic_form() -> None:
    """v·p of c v ceil(v) is the term itself: it adds nothing to the energy v·p − L."""
    model = plane("V", "x")
    plain = derive(model).energy
    text = PLANE.format(key="V", text="x").replace("T: ", "T: y'*ceil(y')/3 + ")
    at = {se.Symbol(n): se.RealDouble(0.7) for n in ("x", "y", "x'", "y'", "m")}
    found = derive(load_text(text)).energy.subs(at)
    assert math.isclose(float(found.n(53, real=True)), float(plain.subs(at).n(53, real=True)))


# rotations


def rotations(hand: bool, count: int) -> str:
    """Return a product of rotations, by functions or as matrices."""
    c, s = "cos({0})", "sin({0})"
    z = f"[[{c}, -{s}, 0], [{s}, {c}, 0], [0, 0, 1]]" if hand else "rot_z({0})"
    y = f"[[{c}, 0, {s}], [0, 1, 0], [-{s}, 0, {c}]]" if hand else "rot_y({0})"
    return "*".join((z, y)[k % 2].format(f"q[{k + 1}]") for k in range(count))


def omega(definitions: str, count: int) -> Tensor:
    model = load_text(f"""
coordinates: [q[1..{count}]]
definitions:
{definitions}
T: sum(q[i]'^2, i = 1..{count})
initial: {{"q[1..{count}]": 0, "q[1..{count}]'": 0}}
""")
    return model.definitions["w"].value


PRODUCTS = {
    "five": (f'  w: "omega({rotations(False, 5)})"', rotations(False, 5)),
    "seven": (f'  w: "omega({rotations(False, 7)})"', rotations(False, 7)),
    "matrices": (f'  w: "omega({rotations(True, 5)})"', rotations(False, 5)),
    "definitions": (
        '  A: "rot_z(q[1])*rot_y(q[2])"\n  B: "transpose(A)*rot([1, 2, 2], q[3]*t)"\n'
        '  C: "B*A*quat(cos(q[4]), sin(q[4]), 0, 0)"\n  w: omega(C*transpose(rot_x(q[1])))',
        "transpose(rot_z(q[1])*rot_y(q[2]))*rot([1, 2, 2], q[3]*t)*rot_z(q[1])*rot_y(q[2])"
        "*rot_x(2*q[4])*rot_x(-q[1])",
    ),
    # S is no rotation, the product is one
    "mirrored": (
        '  S: "[[1, 0, 0], [0, 1, 0], [0, 0, -1]]"\n  w: "omega(S*rot_x(q[1])*rot_z(q[2])*S)"',
        "rot_x(-q[1])*rot_z(q[2])",
    ),
}


@pytest.mark.parametrize("name", PRODUCTS)
def test_omega_of_products(name: str) -> None:
    """RᵀR', with R' by differences in 40 digits, is the matrix of ω."""
    definitions, product = PRODUCTS[name]
    count = 7 if name == "seven" else 5
    began = time.process_time()
    w = omega(definitions, count)
    assert time.process_time() - began < 1.0  # 0.04 s on an idle machine
    chance = np.random.default_rng(3)
    q, v, t = chance.uniform(-1, 1, count), chance.uniform(-1, 1, count), 0.7

    def matrix(s: mpmath.mpf) -> mpmath.matrix:
        at = [mpmath.mpf(x) + s * mpmath.mpf(r) for x, r in zip(q, v, strict=True)]
        names = {"rot_x": turn(0), "rot_y": turn(1), "rot_z": turn(2), "rot": about, "t": t + s}
        names["transpose"] = lambda m: m.T
        return eval(product, {**names, "q": [None, *at]})

    with mpmath.workdps(40):
        h = mpmath.mpf(10) ** -12
        spin = matrix(mpmath.mpf(0)).T * (matrix(h) - matrix(-h)) / (2 * h)
        expected = [float(spin[2, 1]), float(spin[0, 2]), float(spin[1, 0])]
    values = {se.Symbol("t"): se.RealDouble(t)}
    for i in range(count):
        values[se.Symbol(f"q[{i + 1}]")] = se.RealDouble(q[i])
        values[se.Symbol(f"q[{i + 1}]'")] = se.RealDouble(v[i])
    found = [float(x.subs(values).n(53, real=True)) for x in w.entries]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


def about(axis: list[int], angle: mpmath.mpf) -> mpmath.matrix:
    length = mpmath.sqrt(sum(x * x for x in axis))
    x, y, z = (a / length for a in axis)
    k = mpmath.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return mpmath.eye(3) + mpmath.sin(angle) * k + (1 - mpmath.cos(angle)) * k * k


def turn(axis: int) -> Callable[[mpmath.mpf], mpmath.matrix]:
    unit = [int(i == axis) for i in range(3)]
    return lambda angle: about(unit, angle)


def test_arm_of_five_joints() -> None:
    trajectory = simulate(load(FOUND / "armx5.yaml"), t_end=0.5, rtol=1e-10)
    assert trajectory.status == "completed"
    assert np.ptp(trajectory.energy_total) < 1e-7 * np.ptp(trajectory.energy_kinetic)


# messages


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("m if t < 1 else 0", "write a choice as `if(t < 1, m, 0)`"),
        ("if t < 1 then m else 2*m", "write a choice as `if(t < 1, m, 2*m)`"),
        ("x when t < 1", "write a choice as `if(condition, a, b)`"),
        ("2*(x if t < 1 else 2)", "write a choice as `if(condition, a, b)`"),
    ],
)
def test_choices_as_in_other_languages(text: str, wanted: str) -> None:
    (found,) = help_of(PLANE.format(key="Q", text=f'{{x: "{text}"}}'))
    assert found.startswith(wanted)


def test_damping_in_v_is_sent_to_d() -> None:
    (found,) = help_of(PLANE.format(key="V", text="m*x'^2/2"))
    assert "`D: c/2*x'^2` gives the force -c*x'" in found


# how long reading takes


def seconds(text: str) -> float:
    began = time.process_time()
    found = 0
    try:
        load_text(text)
    except ModelError as error:
        found = len(error.diagnostics)
    spent = time.process_time() - began
    assert found <= MAX_DIAGNOSTICS + 1
    return spent


def flow(key: str, entry: str, rest: str = "") -> Callable[[int], str]:
    """Return a model by the number of entries, all on one line."""

    def text(n: int) -> str:
        entries = ", ".join(entry.format(i) for i in range(n))
        return f"coordinates: [x]\nT: x'^2\n{START}{rest}{key}: {{{entries}}}\n"

    return text


def unknown_names(n: int) -> str:
    known = ", ".join(f"parameter_{i}: 1" for i in range(n))
    used = " + ".join(f"paramter_{i}*x" for i in range(n))
    return f"coordinates: [x]\nT: x'^2\n{START}parameters: {{{known}}}\nV: {used}\n"


LONG = {
    "unknown names": unknown_names,
    "anchors": flow("parameters", "p{0}: &a{0} 1"),
    "parameters": flow("parameters", "p{0}: {0} m"),
    "outputs": flow("outputs", "o{0}: x"),
    "definitions": flow("definitions", "d{0}: x"),
    "wrong keys": lambda n: (
        START + "T: x'^2\ncoordinates: [x]\n" + "".join(f"k{i}: 1\n" for i in range(n))
    ),
    "the same key": flow("parameters", "a: 1"),
    "commas": lambda n: f"coordinates: [x]\nT: x'^2\n{START}Q: {{x: f({', '.join('a' * n)})}}\n",
    "terms": lambda n: "coordinates: [x]\nT: x'^2\n" + START + f"V: {' + '.join(['2*x'] * n)}\n",
    "missing members": lambda n: (
        "coordinates: [x[1..9]]\nT: x[1]'^2\n"
        "initial: {x[1..9]: 1, x[1..9]': 0}\n"
        + f"V: {' + '.join(f'x[{i + 10}]' for i in range(n))}\n"
    ),
}


@pytest.mark.parametrize("name", some(LONG, 4))
def test_reading_takes_time_in_proportion(name: str) -> None:
    # eight times as long; square growth would be sixty-four
    assert_growth(lambda n: seconds(LONG[name](n)), (400, 3200), factor=20, floor=0.05)


def test_unknown_names_in_time() -> None:
    text = (FOUND / "hostile" / "unknown-names.yaml").read_text(encoding="utf-8")
    assert seconds(text) < 2.0  # 0.2 s on an idle machine


# every command


EVERY_KEY = """
name: every-key
coordinates: [x, y]
parameters: {m: 1.5 kg, n: ceil(2*pi), a: "max(abs(-0.3), cbrt(0.027), step(0) - 0.7)"}
definitions:
  d: abs(x - a) + floor(3*x)*y + cbrt(y) + sign(t - 9)*x
  e: "[max(x, y), min(x, t), hypot(x, y)]"
T: m/2*(x'^2 + y'^2) + abs(d)*x'^2/90 + max(abs(x'), 0)*y'^2/90 + dot(e', e')/90
V: abs(x*y) + floor(x) + ceil(y)*x + if(x > t, x'*y, abs(y)*x') + step(t - x)
D: abs(x')*x'^2 + max(y'^2, 0)*floor(n/2)
Q: {x: "-sign(x')*m + floor(t)", d: "min(x', y')", y: "if(t > 0.01, ceil(x), -cbrt(y'))"}
constraints:
  c: y + floor(x) + max(x, t)/5 = abs(x)*ceil(n/9)
initial: {x: "floor(1.5) + 0.4", y: {guess: "cbrt(0.008)"}, x': 1, y': {guess: 0}}
outputs:
  o: abs(x'') + floor(lambda.c) + sign(Qc.x) + d''
  p: if(x > 1 and not (t > 1), d', ceil(t))
view: {points: {A: "[floor(x) + x, max(y, t)]", O: [0, 0]}, rods: [O-A]}
simulation: {t_end: "min(0.02, 1)", samples: 5}
"""


@pytest.fixture(scope="module")
def every_key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("every") / "every.yaml"
    path.write_text(EVERY_KEY, encoding="utf-8")
    assert run(["simulate", str(path), "-o", str(path.with_suffix(".h5")), "-q"]) == 0
    return path


OPTIONS = ("--steps", "--numeric")


@pytest.mark.parametrize(
    ("form", "option"),
    [
        ("text", "--steps"),
        ("latex", "--numeric"),
        *(
            pytest.param(*rest, marks=pytest.mark.slow)
            for rest in [
                *(("text", "--numeric"), ("latex", "--steps")),
                *((form, option) for form in ("markdown", "json") for option in OPTIONS),
            ]
        ),
    ],
)
def test_every_key_is_derived(every_key: Path, form: str, option: str, capsys) -> None:
    assert run(["derive", str(every_key), "--format", form, option]) == 0
    shown = capsys.readouterr().out
    assert shown
    assert not {"Derivative", "Subs", "Piecewise", "\ufdd0"} & set(shown.replace("(", " ").split())


@pytest.mark.parametrize(
    "options",
    [["--method", "DOP853"], ["--method", "Radau"]],
    ids=" ".join,
)
def test_every_key_is_simulated_alike(every_key: Path, options: list[str], tmp_path: Path) -> None:
    csv, other = tmp_path / "a.csv", tmp_path / "b.csv"
    accurate = ["--rtol", "1e-9", "-q"]
    assert run(["simulate", str(every_key), "-o", str(csv), *accurate]) == 0
    assert run(["simulate", str(every_key), "-o", str(other), *accurate, *options]) == 0
    one, two = (np.genfromtxt(path, delimiter=",", names=True) for path in (csv, other))
    for name in ("x", "y", "x_dot", "y_dot", "lambdac", "o", "p"):
        np.testing.assert_allclose(one[name], two[name], rtol=1e-5, atol=1e-5)


def test_every_key_in_the_other_commands(every_key: Path, tmp_path: Path) -> None:
    sweep = ["sweep", str(every_key), "--vary", "m=1:2:0.5", "-o", str(tmp_path / "s.h5"), "-q"]
    assert run([*sweep, "--measure", "top=max(abs(x)) + floor(max(y))", "-j", "1"]) == 0
    assert run(["info", str(every_key.with_suffix(".h5"))]) == 0


@pytest.mark.parametrize("command", ["plot", "report"])
def test_every_key_is_shown(every_key: Path, command: str, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    ending = {"plot": ".png", "report": ".html"}[command]
    target = ["-o", str(tmp_path / f"a{ending}")]
    assert run([command, str(every_key.with_suffix(".h5")), *target]) == 0
