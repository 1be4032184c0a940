"""Exported code has the values of the engine."""

from __future__ import annotations

import io
import json
import math
import re
import shutil
import subprocess
from ctypes import c_double
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported import Point, close, compiled, exported, module, pointers, points
from modelica import ModelicaModel
from shipped import PATHS, every_model

import lagcli
from lagcli.errors import NumericalError, UsageError
from lagcli.export.c import write_c
from lagcli.export.content import content_of, independent_rows
from lagcli.export.dynamics import DynamicsFunction
from lagcli.export.formats import code, format_of
from lagcli.export.matlab import write_matlab
from lagcli.export.python import write_casadi, write_jax, write_numpy

MODELS = every_model(smooth=True)


def slopes(name: str, point: Point) -> list[Any]:
    """Return the derivatives of a and λ, which are tested by differences and by sensitivities."""
    return list(DynamicsFunction(exported(name)).derivatives(*point.state))


def alike(found: Any, expected: Any) -> bool:
    """Return whether derivatives agree: two eliminations of a matrix, with its condition."""
    found, size = np.asarray(found).reshape(expected.shape), np.abs(expected).max(initial=0.0)
    return bool(np.abs(found - expected).max(initial=0.0) <= 1e-10 * size + 1e-12)


def parts_of(jacobian: Any, nq: int) -> list[Any]:
    """Return the blocks of one matrix, in the order of `slopes`."""
    columns = np.cumsum([1, nq, nq])
    return [x for rows in np.split(jacobian, [nq]) for x in np.split(rows, columns, axis=1)]


NEEDS_CC = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
#: A choice, a minimum, arguments beyond a domain by rounding, a root of a sum, powers, a table.
FUNCTIONS = """
name: functions
coordinates: {x: m, M: m, lambda: m}
parameters: {m: 1 kg, k: 100 N/m, d: 1 m, w1: 2 1/s, f: 1 N}
inputs:
  u: {times: [0, 1, 2, 3], values: [0, 1, 0.5, 0], interpolation: cubic, extend: periodic}
T: m/2*(x'^2 + M'^2 + lambda'^2)
V: k/2*min(x, M)^2 + k*d^2*acos(x/(2*d + abs(x)))^2 + k*d^2*(2 + sin(M/d))^(x/d)
Q: {x: f*u*sin(w1*t), M: "-f*sign(M')*erf(x/d)", lambda: f*atan2(x, M)*if(x > M and x > 0, 1, 2)}
constraints: {c: x^2 + M^2 = lambda*d}
initial: {x: 0.3, M: {guess: 0.4}, lambda: 0.25, x': 0.1, M': {guess: 0}, lambda': {guess: 0}}
simulation: {t_end: 0.5, samples: 6, rtol: 1e-9}
"""


@NEEDS_CC
@pytest.mark.parametrize("name", MODELS)
def test_a_file_of_c_compiles_in_silence_and_has_the_values_of_the_engine(
    name: str, tmp_path: Path
) -> None:
    content = exported(name)
    library = compiled(write_c(content), tmp_path, "-O0")
    counts = content.system.counts
    for point in points(name):
        state = [c_double(point.t), *pointers(*map(np.ascontiguousarray, point.state[1:]))]
        expected = [point.mass, point.force, point.jacobian, point.rhs]
        found = [np.zeros(max(1, x.size)) for x in expected]
        library[f"{name}_equations"](*state, *pointers(*found))
        for x, own in zip(found, expected, strict=True):
            assert np.array_equal(x[: own.size], own.ravel())
        a, multipliers = np.zeros(counts.nq), np.zeros(counts.nc + 1)
        assert library[f"{name}_dynamics"](*state, *pointers(a, multipliers)) == 0
        assert close(a, point.a)
        assert close(multipliers[: counts.nc], point.multipliers)
        position, velocity = np.zeros(counts.nh + 1), np.zeros(counts.nc + 1)
        library[f"{name}_constraints"](*state, *pointers(position, velocity))
        assert np.array_equal(position[: counts.nh], point.position)
        assert np.array_equal(velocity[: counts.nc], point.velocity)
        out = np.zeros(len(content.columns))
        a, multipliers = point.a.copy(), np.append(point.multipliers, 0.0)
        arguments = [*state[:3], *pointers(a, multipliers), state[3], *pointers(out)]
        library[f"{name}_outputs"](*arguments)
        assert np.array_equal(out, point.outputs)
        values = np.zeros(counts.nq), np.zeros(counts.nc + 1)
        jacobian = np.zeros((counts.unknowns, 1 + 2 * counts.nq + len(point.p)))
        assert library[f"{name}_jacobian"](*state, *pointers(*values, jacobian)) == 0
        assert close(values[0], point.a)
        assert all(map(alike, parts_of(jacobian, counts.nq), slopes(name, point)))


@pytest.mark.parametrize("name", MODELS)
def test_a_module_for_numpy_has_the_values_of_the_engine(name: str) -> None:
    own = module(write_numpy(exported(name)), name)
    for point in points(name):
        found = own.equations(*point.state)
        expected = point.mass, point.force, point.jacobian, point.rhs
        assert all(map(close, found, expected))
        assert all(map(close, own.dynamics(*point.state), (point.a, point.multipliers)))
        assert all(map(close, own.constraints(*point.state), (point.position, point.velocity)))
        out = own.outputs(*point.state[:3], point.a, point.multipliers, point.p)
        assert close(out, point.outputs)
        assert all(map(alike, own.derivatives(*point.state), slopes(name, point)))


@pytest.mark.parametrize("name", MODELS)
def test_a_module_for_casadi_has_the_values_of_the_engine(name: str) -> None:
    ca = pytest.importorskip("casadi")
    own = module(write_casadi(exported(name)), name)
    dynamics, dae = own.dynamics(), own.dae()
    defect = ca.Function("defect", [dae[k] for k in ("t", "x", "z", "p")], [dae["alg"]])
    for point in points(name):
        assert all(map(close, dynamics(*point.state), (point.a, point.multipliers)))
        x, z = np.append(point.q, point.v), np.append(point.a, point.multipliers)
        size = max(1.0, np.abs(point.force).max(), np.abs(point.mass).max() * np.abs(z).max())
        assert float(ca.norm_inf(defect(point.t, x, z, point.p))) <= 1e-12 * size


@pytest.mark.parametrize(
    ("name", "by"),
    [("slider_crank", ["m", "l", "phi'"]), ("rolling_disk", ["g", "x"]), ("parallelogram", ["m"])],
)
def test_gradients_of_a_motion_by_casadi_are_the_sensitivities(name: str, by: list[str]) -> None:
    """By CVODES' forward sensitivities; the initial state changes with the parameters, too."""
    ca = pytest.importorskip("casadi")
    content, end = exported(name), 0.3
    run = lagcli.simulate(content.model, t_end=end, samples=2, sensitivity=by, rtol=1e-11)
    own = module(write_casadi(content), name)
    t, q, v, p = own.symbols()
    slope = ca.vertcat(v, own.solution(t, q, v, p)[0])
    ode = {"t": t, "x": ca.vertcat(q, v), "p": p, "ode": slope}
    options = {"abstol": 1e-12, "reltol": 1e-12}
    motion = ca.integrator("motion", "cvodes", ode, float(own.START), end, options)
    x, values = ca.MX.sym("x", 2 * own.NQ), ca.MX.sym("p", own.NP)
    final = motion(x0=x, p=values)["xf"]
    both = ca.Function("both", [x, values], [ca.jacobian(final, x), ca.jacobian(final, values)])
    start = np.concatenate([run.q[0], run.v[0]])
    by_state, by_value = map(np.array, both(start, own.values()))
    found = by_state @ np.concatenate([run.dq[0], run.dv[0]])
    names = list(own.PARAMETERS)
    for j, parameter in enumerate(by):
        if parameter in names:
            found[:, j] += by_value[:, names.index(parameter)]
    expected = np.concatenate([run.dq[-1], run.dv[-1]])
    assert np.abs(found - expected).max() <= 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("name", MODELS)
def test_a_module_for_jax_has_the_values_and_derivatives_of_the_engine(name: str) -> None:
    jax = pytest.importorskip("jax")
    own = module(write_jax(exported(name)), name)
    states = [np.array(x) for x in zip(*(point.state for point in points(name)), strict=True)]
    a, multipliers = jax.jit(jax.vmap(own.dynamics))(*states)
    assert close(a, [point.a for point in points(name)])
    assert close(multipliers, [point.multipliers for point in points(name)])
    expected = DynamicsFunction(exported(name)).derivatives(*states)
    found = jax.jit(jax.vmap(jax.jacobian(own.dynamics, (0, 1, 2, 3))))(*states)
    for by, expected_by in zip([x for own_ in found for x in own_], expected, strict=True):
        size = np.abs(expected_by).max(initial=0.0)
        assert np.abs(by - expected_by).max(initial=0.0) <= 1e-9 * size + 1e-12


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("octave") is None, reason="Octave is not installed")
@pytest.mark.parametrize("name", PATHS)
def test_octave_has_the_values_of_the_engine(name: str, tmp_path: Path) -> None:
    if name not in [model.values[0] for model in MODELS]:
        pytest.skip("it switches")
    (tmp_path / f"{name}.m").write_text(write_matlab(exported(name)), "utf-8")

    def column(values: np.ndarray) -> str:
        return f"[{'; '.join(map(repr, np.asarray(values).tolist()))}]"

    lines = [f"m = {name}();"]
    for point in points(name):
        t, *rest = point.state
        lines += [
            f"t = {t!r}; q = {column(rest[0])}; v = {column(rest[1])}; p = {column(rest[2])};",
            "[a, l] = m.dynamics(t, q, v, p); o = m.outputs(t, q, v, a, l, p);",
            "[x, y] = m.residuals(t, q, v, p); d = m.derivatives(t, q, v, p);",
            "l_ = [d.multipliers_t d.multipliers_q d.multipliers_v d.multipliers_p];",
            "d = [d.a_t d.a_q d.a_v d.a_p; l_]';",
            "printf('%.17g ', [a; l; x; y; o; d(:)]); disp('');",
        ]
    (tmp_path / "drive.m").write_text("\n".join(lines), "utf-8")
    command = ["octave", "--no-gui", "--quiet", "drive.m"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    for line, point in zip(done.stdout.splitlines(), points(name), strict=True):
        parts = point.a, point.multipliers, point.position, point.velocity, point.outputs
        numbers = np.array(line.split(), dtype=float)
        for part in parts:
            own, numbers = numbers[: len(part)], numbers[len(part) :]
            assert close(own, part)
        whole = numbers.reshape(len(point.a) + len(point.multipliers), -1)
        assert all(map(alike, parts_of(whole, len(point.q)), slopes(name, point)))


@NEEDS_CC
def test_functions_and_names_of_all_kinds_are_written(tmp_path: Path) -> None:
    """Names that code uses itself, choices, powers, tables, bounded domains."""
    model = lagcli.load_text(FUNCTIONS)
    content = content_of(model)
    f = lagcli.dynamics(model)
    random = np.random.default_rng(2)
    own = module(write_numpy(content), "functions")
    library = compiled(write_c(content), tmp_path)
    for t in (0.0, 1.0, 2.5, 7.3):
        q, v = random.standard_normal((2, 3))
        a, multipliers = f(t, q, v)
        assert all(map(close, own.dynamics(np.float64(t), q, v, f.p), (a, multipliers)))
        found = np.zeros(3), np.zeros(2)
        state = [c_double(t), *pointers(q, v, f.p)]
        assert library.functions_dynamics(*state, *pointers(*found)) == 0
        assert close(found[0], a)
        assert close(found[1][:1], multipliers)
    with pytest.raises(UsageError, match="no function `erf`"):
        code(model, "modelica")
    assert "ifelse(" in code(model, "matlab")


@pytest.mark.parametrize("to", ["c", "python", "matlab", "modelica"])
def test_expm1_and_log1p_are_functions_of_the_language(to: str) -> None:
    text = code(
        lagcli.load_text(
            "coordinates: [x]\nparameters: {expm1: 2}\nT: x'^2/2\nV: log1p(x^2)\n"
            "Q: {x: -expm1*expm1(x)}\ninitial: {x: 1, x': 0}\n"
        ),
        to,
    )
    function = {"python": "np.expm1"}.get(to, "expm1")
    assert f"{function}(x)" in text
    assert "log1p(x * x)" in text
    if to == "modelica":
        assert "y := (exp(x) + 1)*tanh(x/2)" in text
        assert "y := log(1 + x)" in text
    if to != "python":
        assert "expm1_*expm1(x)" in text.replace(" ", "")


def test_a_choice_within_a_choice_is_written() -> None:
    model = lagcli.load_text(
        "coordinates: [x]\nT: x'^2/2\nV: 0\nQ: {x: 'if(x < 1, if(x > 0, 2, 3), 5)'}\n"
        "initial: {x: 1, x': 0}\n"
    )
    own = module(code(model, "python"), "own")
    forces = [own.dynamics(0.0, np.array([x]), np.zeros(1), np.zeros(0))[0] for x in (0.5, -1, 1.5)]
    assert np.array_equal(np.ravel(forces), [2.0, 3.0, 5.0])


@pytest.mark.parametrize("to", ["python", "casadi", "jax"])
def test_models_without_constraints_are_written(to: str) -> None:
    if to != "python":
        pytest.importorskip(to)
    model = lagcli.load_text(
        "coordinates: [x, y]\nT: x'^2 + y'^2/2 + x'*y'/3\nV: x^2 + y^4\n"
        "initial: {x: 1, x': 0, y: 1, y': 0}\n"
    )
    f, own = lagcli.dynamics(model), module(code(model, to), "own")
    dynamics = own.dynamics() if to == "casadi" else own.dynamics
    a, multipliers = dynamics(f.t, f.q, f.v, f.p)
    assert close(a, f(f.t, f.q, f.v).a)
    assert np.size(multipliers) == 0


@NEEDS_CC
def test_words_of_the_languages_may_be_names_of_a_model(tmp_path: Path) -> None:
    """Macros of headers, functions that the code calls, and words that end functions."""
    names = ["EOF", "M_PI", "HUGE", "memset", "stderr", "L_tmpnam", "yield", "lambda", "np", "end"]
    definitions = "".join(f"  {name}: {i + 1}\n" for i, name in enumerate(names))
    text = (
        "name: words\ncoordinates: [errno, BUFSIZ]\nparameters:\n"
        + definitions
        + "T: errno'^2/2 + BUFSIZ'^2/2\n"
        + f"V: errno*({' + '.join(f'{n}*sin({n}*errno)' for n in names)})\n"
        + "constraints: {c: errno^2 + BUFSIZ^2 = 4}\n"
        + "initial: {errno: 1, errno': 0, BUFSIZ: {guess: 1.7}, BUFSIZ': {guess: 0}}\n"
    )
    model = lagcli.load_text(text)
    f = lagcli.dynamics(model)
    expected = f(f.t, f.q, f.v)
    found = module(code(model, "python"), "own").dynamics(np.float64(f.t), f.q, f.v, f.p)
    assert all(map(close, found, expected))
    # by default compilers define more names than those of the standard
    library = compiled(code(model, "c"), tmp_path, "-std=gnu11")
    a, multipliers = np.zeros(2), np.zeros(2)
    state = [c_double(f.t), *pointers(f.q, f.v, f.p)]
    assert library.words_dynamics(*state, *pointers(a, multipliers)) == 0
    assert close(a, expected[0])
    assert close(multipliers[:1], expected[1])


@NEEDS_CC
@pytest.mark.parametrize("name", ["slider_crank", "rolling_disk", "parallelogram"])
def test_programs_simulate_as_lagcli_does(name: str, tmp_path: Path) -> None:
    """Both methods have an error near the tolerance; it grows along the motion."""
    run = lagcli.simulate(exported(name).model)
    (tmp_path / "model.c").write_text(write_c(exported(name)), "utf-8")
    command = ["cc", "-O1", "-std=c11", "model.c", "-lm", "-o", "model"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "model"], capture_output=True, text=True, check=True)
    table = np.loadtxt(io.StringIO(done.stdout), delimiter=",", skiprows=1)
    expected = np.column_stack([run.q, run.v, run.multipliers])
    found = table[:, 1 : 1 + expected.shape[1]]
    assert np.abs(found - expected).max() <= 1e-6 * np.abs(expected).max()
    assert len(done.stdout.splitlines()[0].split(",")) == table.shape[1]


def test_a_module_simulates_as_lagcli_does(tmp_path: Path) -> None:
    run = lagcli.simulate(exported("slider_crank").model, samples=11, t_end=0.3)
    own = module(write_numpy(exported("slider_crank")), "crank")
    q, v, a, multipliers, out = own.simulate(run.time)
    for found, expected in ((q, run.q), (v, run.v), (a, run.a), (multipliers, run.multipliers)):
        assert np.abs(found - expected).max() <= 1e-7 * np.abs(expected).max()
    assert out.shape == (11, len(own.COLUMNS))


FOUND = Path(__file__).parents[2] / "found"
AT_REST = {"xe": 0.254, "ye": 0.439}


def arm_at(x: float, y: float, first: float, second: float) -> tuple[float, float]:
    """Return the angles of an arm with two links whose tip is at a point, by the law of cosines."""
    bend = math.acos((x * x + y * y - first**2 - second**2) / (2 * first * second))
    return math.atan2(y, x) - math.atan2(
        second * math.sin(bend), first + second * math.cos(bend)
    ), bend


@NEEDS_CC
@pytest.mark.parametrize(
    ("name", "set"), [("arm_rest", AT_REST), ("arm_rest", {}), ("arm_rest2", AT_REST)]
)
def test_driven_mechanisms_come_to_rest(name: str, set: dict[str, Any], tmp_path: Path) -> None:
    """The angles follow from the constraints alone: to rounding errors, whatever the method."""
    content = content_of(lagcli.load(FOUND / f"{name}.yaml", set=set))
    (tmp_path / "arm.c").write_text(write_c(content), "utf-8")
    subprocess.run(["cc", "-std=c11", "arm.c", "-lm", "-o", "arm"], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "arm"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    table = np.loadtxt(io.StringIO(done.stdout), delimiter=",", skiprows=1)
    own = module(write_numpy(content), name)
    values = own.PARAMETERS
    expected = arm_at(*(values[x] for x in ("xe", "ye", "l1", "l2")))
    q, v, *_ = own.simulate(table[:, 0])
    for end, speed in ((table[-1, 1:3], table[-1, 3:5]), (q[-1], v[-1])):
        assert np.abs(end - expected).max() <= 1e-12
        assert np.abs(speed).max() <= 1e-11  # psi is the difference of terms of 30 m/s


@NEEDS_CC
@pytest.mark.parametrize("unit", [1.0, 1e3, 1e-6])
def test_states_at_rest_are_brought_onto_constraints(unit: float, tmp_path: Path) -> None:
    """Arms of random lengths at random points, one whose velocity is zero there."""
    content, random = content_of(lagcli.load(FOUND / "arm_rest.yaml")), np.random.default_rng(3)
    library, own = compiled(write_c(content), tmp_path), module(write_numpy(content), "arm")
    for _ in range(100):
        first, second = unit * random.uniform(0.3, 1, 2)
        r = random.uniform(1.1 * abs(first - second), 0.9 * (first + second))
        angle = random.uniform(-1, 1)
        x, y = r * math.cos(angle), r * math.sin(angle)
        start = dict(zip(("xs", "ys"), unit * random.uniform(-1, 1, 2), strict=True))
        p = own.values(l1=first, l2=second, xe=x, ye=y, **start)
        expected = np.array(arm_at(x, y, first, second))
        q, v = expected + 1e-6 * random.standard_normal(2), 1e-9 * random.standard_normal(2)
        for end, speed in (own.project(1.0, q, v, p), (q, v)):
            if end is q:
                assert library.arm_rest_project(c_double(1.0), *pointers(q, v, p)) == 0
            np.testing.assert_allclose(end, expected, 0, atol=1e-12)
            np.testing.assert_allclose(speed, 0, atol=1e-11)  # psi has terms of 30 lengths/s
        far = own.values(l1=first, l2=second, xe=3 * x, ye=3 * y + 3 * unit, **start)
        with pytest.raises(ArithmeticError, match="no state on the constraints nearby"):
            own.project(1.0, q, v, far)
        assert library.arm_rest_project(c_double(1.0), *pointers(q, v, far)) == 1


@NEEDS_CC
def test_velocities_are_brought_onto_nonlinear_constraints(tmp_path: Path) -> None:
    content = exported("appell_hamel")
    library, own = compiled(write_c(content), tmp_path), module(write_numpy(content), "appell")
    t, q, p = own.START, own.POSITION.copy(), own.values()
    v = own.VELOCITY + 0.1 * np.abs(own.VELOCITY).max() * np.arange(1, len(q) + 1)
    assert np.abs(own.constraints(t, q, v, p)[1]).max() > 1e-3
    for state in (own.project(t, q, v, p), (q, v)):
        if state[1] is v:
            assert library.appell_hamel_project(c_double(t), *pointers(q, v, p)) == 0
        assert np.abs(own.constraints(t, *state, p)[1]).max() <= 1e-14


def test_modelica_balances_unknowns_and_equations() -> None:
    """Each variable that is no parameter has one equation."""
    for name in ("slider_crank", "parallelogram", "rolling_disk"):
        text = code(exported(name).model, "modelica")
        head, _, equations = text.partition("\nequation\n")
        declared = [x for x in head.splitlines() if x.strip().startswith("Real ")]
        assert len(declared) == equations.count(" = ")


def test_models_that_switch_are_refused() -> None:
    switching = [name for name in PATHS if lagcli.load(name).switches]
    assert len(switching) > 5
    for name in switching:
        with pytest.raises(UsageError, match="code and functions of the dynamics need"):
            content_of(lagcli.load(name))


def test_too_many_unknowns_are_refused() -> None:
    with pytest.raises(UsageError, match="at most 400"):
        content_of(lagcli.load("chain", set={"N": "140"}))


@pytest.mark.parametrize(
    ("to", "path", "found"),
    [
        ("c", None, "c"),
        (None, "x.c", "c"),
        (None, "x.py", "python"),
        ("jax", "x.py", "jax"),
        (None, "x.m", "matlab"),
        (None, "x.MO", "modelica"),
    ],
)
def test_the_format_follows_from_option_and_suffix(
    to: str | None, path: str | None, found: str
) -> None:
    assert format_of(to, path).name == found


@pytest.mark.parametrize(
    ("to", "path"), [(None, None), (None, "x.txt"), ("c", "x.py"), ("rust", None)]
)
def test_an_unknown_format_is_refused(to: str | None, path: str | None) -> None:
    with pytest.raises(UsageError):
        format_of(to, path)


def test_independent_rows_span_all() -> None:
    matrix = np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 3.0], [1.0, 1.0]])
    assert independent_rows(matrix, [2, 0, 1, 3]) == (0, 2)


@pytest.mark.parametrize("method", ["auto", "DOP853"])
def test_a_singular_start_is_not_exported(method: str) -> None:
    """The constraint has no gradient there; it counted as redundant, and was left out for good."""
    model = lagcli.load_text(f"""
coordinates: [a, b]
T: (a'^2 + b'^2)/2
constraints: {{bar: cos(a) = cos(b)}}
initial: {{a: 0, b: 0, a': 1, b': {{guess: 1}}}}
simulation: {{t_end: 1, method: {method}}}
""")
    exports = [partial(lagcli.code, model, to) for to in ("c", "python", "matlab")]
    for export in (*exports, partial(lagcli.fmu, model), partial(lagcli.dynamics, model)):
        with pytest.raises(NumericalError, match=r"the start is a singular configuration: .*`bar`"):
            export()


LANGUAGES = ("python", "casadi", "jax")
#: A table whose rows begin at t = 0.05 and 0.6, apart from rounding errors of its periods.
PERIODIC = """
name: periodic
coordinates: [x]
inputs:
  u: {times: [-2.7, -2.15, -1.6], values: [1, 2, 1], interpolation: step, extend: periodic}
T: x'^2/2
Q: {x: u}
initial: {x: 0, x': 0}
simulation: {t_end: 0.5}
"""


@pytest.mark.parametrize("to", LANGUAGES)
def test_rows_of_a_periodic_table_hold_from_their_time_on(to: str) -> None:
    if to != "python":
        pytest.importorskip(to)
    own = module(code(lagcli.load_text(PERIODIC), to), "own")
    solution = own.dynamics() if to == "casadi" else own.dynamics
    state = np.zeros(1), np.zeros(1), np.zeros(0)
    for t, value in ((0.0, 1.0), (0.05, 2.0), (0.3, 2.0), (0.6, 1.0)):
        assert float(solution(t, *state)[0][0]) == value


@NEEDS_CC
def test_rows_of_a_periodic_table_hold_from_their_time_on_in_c(tmp_path: Path) -> None:
    library = compiled(code(lagcli.load_text(PERIODIC), "c"), tmp_path)
    a, none = np.zeros(1), np.zeros(1)
    for t, value in ((0.0, 1.0), (0.05, 2.0), (0.3, 2.0), (0.6, 1.0)):
        state = [c_double(t), *pointers(none, none, none)]
        assert library.periodic_dynamics(*state, *pointers(a, none)) == 0
        assert a[0] == value


@pytest.mark.parametrize("to", LANGUAGES)
def test_models_without_inertia_are_solved(to: str) -> None:
    """M = 0: c x' = −k x, so that c x'' = −k x'."""
    if to != "python":
        pytest.importorskip(to)
    model = lagcli.load_text(
        "coordinates: [x]\nparameters: {k: 2, c: 3}\nT: 0\nV: k/2*x^2\nD: c/2*x'^2\n"
        "initial: {x: 1, x': {guess: 0}}\nsimulation: {t_end: 0.1}\n"
    )
    own, q, v = module(code(model, to), "own"), np.array([1.0]), np.array([-2 / 3])
    solution = own.dynamics() if to == "casadi" else own.dynamics
    a, multipliers = solution(0.0, q, v, np.array([2.0, 3.0]))
    assert close(a, [4 / 9])
    assert close(multipliers, [0.0])
    slopes = lagcli.dynamics(model).derivatives(0.0, q, v)
    assert close(slopes.a_v, [[-2 / 3]])


@NEEDS_CC
def test_texts_of_several_lines_stay_in_comments(tmp_path: Path) -> None:
    title = "Two lines\nx = 1; */ /* \\"
    text = (
        f"name: own\ntitle: {json.dumps(title)}\n"
        f"coordinates: {{x: {{description: {json.dumps(title)}}}}}\n"
        f"parameters: {{m: {{value: 1, description: {json.dumps(title)}}}}}\n"
        "T: m*x'^2/2\ninitial: {x: 0, x': 0}\nsimulation: {t_end: 0.1}\n"
    )
    model = lagcli.load_text(text)
    for to in ("python", "casadi", "jax"):
        compile(code(model, to), "own.py", "exec")
    compiled(code(model, "c"), tmp_path)
    assert [*ModelicaModel(code(model, "modelica")).parameters] == ["stabilization", "m"]
    matlab = code(model, "matlab").splitlines()
    head = matlab[1 : matlab.index("  model.coordinates = {'x'};")]
    assert all(line.startswith("%") for line in head)


@NEEDS_CC
def test_names_of_helpers_and_tables_may_be_names_of_a_model(tmp_path: Path) -> None:
    names = ["bounded_acos", "bounded_asin", "clipped", "table_0", "TABLE_0", "table_0_pieces"]
    values = ", ".join(f"{name}: {i + 1}" for i, name in enumerate(names))
    model = lagcli.load_text(
        f"name: own\ncoordinates: [x]\nparameters: {{{values}}}\n"
        "inputs: {u: {times: [0, 1], values: [1, 2], interpolation: cubic, extend: hold}}\n"
        f"T: x'^2/2\nQ: {{x: u*acos(x/2) + asin(x/3) + sqrt(1 - x) + {' + '.join(names)}}}\n"
        "initial: {x: 0.2, x': 0}\nsimulation: {t_end: 0.1}\n"
    )
    f = lagcli.dynamics(model)
    t, q, v = 0.6, np.array([0.3]), np.zeros(1)
    expected = f(t, q, v).a
    own = module(code(model, "python"), "own")
    assert close(own.dynamics(np.float64(t), q, v, f.p)[0], expected)
    library, a = compiled(code(model, "c"), tmp_path), np.zeros(1)
    state = [c_double(t), *pointers(q, v, f.p)]
    assert library.own_dynamics(*state, *pointers(a, np.zeros(1))) == 0
    assert close(a, expected)
    modelica = ModelicaModel(code(model, "modelica"))
    found = modelica.solution(t, dict(zip(modelica.start, [0.3, 0.0], strict=True)), {})
    assert close(found["der(x_dot)"], expected)


NEEDS_OCTAVE = pytest.mark.skipif(shutil.which("octave") is None, reason="Octave is not installed")


def octave(text: str, *lines: str, folder: Path) -> list[np.ndarray]:
    """Return the numbers that lines print after `m` is the model of a text."""
    name = text[: text.index("(")].rpartition(" ")[2]
    (folder / f"{name}.m").write_text(text, "utf-8")
    (folder / "drive.m").write_text("\n".join([f"m = {name}();", *lines]), "utf-8")
    command = ["octave", "--no-gui", "--quiet", "drive.m"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return [np.array(line.split(), dtype=float) for line in done.stdout.splitlines()]


PARTIAL = """
name: partial
coordinates: [x]
parameters: {n: 0.5}
T: x'^2/2
V: x^2
initial: {x: 0.5, x': 0}
outputs:
  a: acos(x)^2
  b: asin(x)^2
  c: log(-x)^2
  d: (sqrt(-x) - 1)^2*(sqrt(-x) + 1)^2
  e: ((-x)^n - 1)^2*((-x)^n + 1)^2
  f: acosh(-x)^2
  g: atanh(2*x)^2
  h: if(x > 0, x, sqrt(x))
simulation: {t_end: 0.1, samples: 2}
"""


@NEEDS_OCTAVE
def test_values_that_are_not_real_are_undefined_in_octave(tmp_path: Path) -> None:
    """MATLAB computes on with complex numbers, whose squares are real."""
    model = lagcli.load_text(PARTIAL)
    line = "printf('%.17g ', m.outputs(0, 2, 0, 0, [], m.p)(6:13)); disp('');"
    [found] = octave(code(model, "matlab"), line, folder=tmp_path)
    outputs = lagcli.dynamics(model).outputs(0.0, np.array([2.0]), np.zeros(1))
    expected = [float(outputs[name]) for name in model.outputs]
    assert np.array_equal(found, expected, equal_nan=True)
    assert np.isnan(expected[:7]).all()


@NEEDS_OCTAVE
def test_octave_simulates_to_the_last_of_two_times(tmp_path: Path) -> None:
    """Of two times, `ode45` returns all steps that it takes."""
    run = lagcli.simulate(exported("slider_crank").model, samples=2, t_end=0.3)
    lines = [
        "[q, v, a, l, o] = m.simulate([0 0.3], m.q, m.v, m.p);",
        "disp(size(q)); disp(size(v)); printf('%.17g ', [q(2, :) v(2, :) a(2, :) l(2)]);",
    ]
    found = octave(write_matlab(exported("slider_crank")), *lines, folder=tmp_path)
    assert [*map(list, found[:2])] == [[2, 2], [2, 2]]
    expected = np.concatenate([x[-1] for x in (run.q, run.v, run.a, run.multipliers)])
    assert np.abs(found[2] - expected).max() <= 1e-5 * np.abs(expected).max()


def test_times_that_do_not_increase_are_refused() -> None:
    own = module(write_numpy(exported("slider_crank")), "crank")
    for times in ([0.0, 0.2, 0.1], [0.3, 0.0], [0.0, 0.0, 0.1]):
        with pytest.raises(ValueError, match="must increase"):
            own.simulate(times)


def test_parameters_that_the_model_computes_are_named() -> None:
    model = lagcli.load_text(
        "coordinates: [x[1..N]]\n"
        "parameters: {N: 2, m: 2, k: 3*m, c: 2*pi, J: k + 1, 'e[i = 1..2]': i*2, L: 3*N}\n"
        "T: sum(m*x[i]'^2, i = 1..N)\nV: k*x[1]^2\ninitial: {x[1..N]: 0, x[1..N]': 0}\n"
        "simulation: {t_end: 0.1}\n"
    )
    for to in ("c", "python", "matlab", "modelica"):
        text = re.sub(r"\n[ */%]*", " ", code(model, to))
        assert "keep their values when the others change: k, J." in text
    assert "computes these" not in code(lagcli.load("slider_crank"), "c")
