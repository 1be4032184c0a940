"""Conserved quantities: the classical integrals of known systems, none too many, no drift."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import classical_systems as systems
import numpy as np
import pytest
import symengine as se
from shipped import every_model

import lagcli
from lagcli.engine.lowering.compiler import compile_tape
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.symmetry.conserved import Conserved, Proof, conserved_quantities, generalized
from lagcli.model.model import TIME, Model

MODELS = Path(__file__).parents[2] / "models"
SHIPPED = sorted(path.stem for path in MODELS.rglob("*.yaml"))
#: Of the size of a quantity along a run with rtol 1e-12: errors add up over some thousand steps.
DRIFT = 1e-9


@cache
def derived(source: str) -> tuple[Equations, Conserved]:
    model = lagcli.load(source) if source in SHIPPED else None
    equations = lagcli.derive(model or lagcli.load_text(source))
    return equations, conserved_quantities(equations)


def values_along(
    equations: Equations, found: Conserved, model: Model | None = None, **options: float
) -> np.ndarray:
    """Return the quantities along a run, (quantities, nt)."""
    eq = equations
    run = lagcli.simulate(model or eq.model, rtol=1e-12, samples=51, **options)
    assert run.status in ("completed", "stopped-by-event"), run.message
    expressions = [q.expression for q in found.quantities]
    parameters = [se.Symbol(name) for name in eq.model.parameters]
    tape = compile_tape(expressions, [TIME, *eq.q, *eq.v], parameters)
    p = tuple((model or eq.model).parameter_values.values())
    return run_arrays(tape, [run.time, *run.q.T, *run.v.T, *p], len(run.time))


def assert_constant(equations: Equations, found: Conserved, **options: float) -> None:
    for q, values in zip(found.quantities, values_along(equations, found, **options), strict=True):
        scale = max(np.abs(values).max(), _energy_scale(equations))
        assert np.abs(values - values[0]).max() <= DRIFT * scale, q.name


def _energy_scale(equations: Equations) -> float:
    run = lagcli.simulate(equations.model, samples=11, t_end=0.1)
    return float(np.abs(run.energy_kinetic).max() + np.abs(run.energy_total).max())


def in_momenta(source: str) -> dict[str, str]:
    equations, found = derived(source)
    return {q.name: generalized(equations, q).in_momenta for q in found.quantities}


@pytest.mark.parametrize("name", every_model())
def test_what_is_found_in_shipped_models_does_not_drift(name: str) -> None:
    equations, found = derived(name)
    assert_constant(equations, found, t_end=min(1.0, equations.model.settings.t_end or 1.0))


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (systems.SPHERE, {"J_1": "x*p_y - y*p_x", "energy": "h"}),
        (
            systems.FREE_SPHERE,
            {
                "J_1": "x*p_y - y*p_x",
                "J_2": "x*p_z - z*p_x",
                "J_3": "y*p_z - z*p_y",
                "energy": "h",
            },
        ),
        ("chaplygin_sleigh", {"energy": "h"}),
        (systems.CENTRED_SLEIGH, {"p_theta": "p_theta", "energy": "h"}),
        ("knife_edge_incline", {"p_phi": "p_phi", "energy": "h"}),
        ("bead_on_rotating_hoop", {"jacobi": "h - p_phi*Omega"}),
        ("charged_pendulum", {"J_1": "x*p_y - y*p_x", "jacobi": "h"}),
        ("car_axis", {}),
        ("driven_slider_crank", {}),
    ],
)
def test_classical_integrals_and_no_others(source: str, expected: dict[str, str]) -> None:
    equations, found = derived(source)
    assert in_momenta(source) == expected
    if expected:
        assert_constant(equations, found, t_end=1.0)


def test_two_bodies_have_the_seven_of_the_groups_of_euclid_and_of_time() -> None:
    equations, found = derived(systems.TWO_BODIES)
    general = [q for q in found.quantities if generalized(equations, q).general]
    assert [q.in_momenta for q in general] == [
        *(f"p_{c}_1 + p_{c}_2" for c in "xyz"),
        *(
            f"{a}_1*p_{b}_1 + {a}_2*p_{b}_2 - {b}_1*p_{a}_1 - {b}_2*p_{a}_2"
            for a, b in ("xy", "xz", "yz")
        ),
        "h",
    ]
    # the pair turns about its centre of mass with an angular momentum
    assert len(found.quantities) == 10
    assert_constant(equations, found, t_end=2.0)


def test_the_heavy_top_has_both_angular_momenta_and_the_energy() -> None:
    equations, found = derived("heavy_top")
    vertical, spin, energy = values_along(equations, found, t_end=0.5)
    p = equations.model.parameter_values
    # at the start the axis is horizontal: the spin has no part about the vertical
    about_vertical = (p["J_t"] + p["m"] * p["a"] ** 2) * p["precession"]
    np.testing.assert_allclose(vertical, about_vertical, rtol=1e-9)
    np.testing.assert_allclose(spin, p["J_s"] * p["spin"], rtol=1e-9)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


def test_a_rolling_ball_keeps_its_moment_about_the_point_of_contact() -> None:
    equations, found = derived(systems.ROLLING_BALL)
    values = values_along(equations, found, t_end=2.0)
    # translations joined to rotations, which B ξ = μ φ alone allows; spin; body axes; energy
    moving = [q for q in found.quantities if {0, 1} & set(q.field)]
    assert len(moving) == 2
    assert np.abs(values - values[:, :1]).max() < 1e-10


def test_gauges_of_the_vector_potential_do_not_matter() -> None:
    equations, found = derived(systems.LANDAU_GAUGE)
    assert {q.in_momenta for q in found.quantities if q.kind == "momentum"} >= {"p_y"}
    # both translations and the rotation about a centre
    assert len(found.quantities) == 4
    assert_constant(equations, found, t_end=5.0)


def test_a_turning_field_leaves_jacobis_integral_of_the_turning_frame() -> None:
    equations, found = derived(systems.TURNTABLE)
    (jacobi,) = found.quantities
    assert generalized(equations, jacobi).general
    values = values_along(equations, found, t_end=3.0)[0]
    assert np.abs(values - values[0]).max() < DRIFT
    run = lagcli.simulate(equations.model, rtol=1e-12, samples=51, t_end=3.0)
    assert np.ptp(run.energy_total) > 0.1  # the energy itself is not conserved


def test_friction_destroys_what_it_acts_on_alone() -> None:
    text = systems.SPHERE.replace("constraints:", "Q: {z: -0.1*z'}\nconstraints:")
    assert in_momenta(text) == {"J_1": "x*p_y - y*p_x"}


def test_equal_moments_of_inertia_count_by_their_values() -> None:
    """What holds for these values alone is said to; with others it is not found."""
    text = """
coordinates: [x, y]
parameters: {a: 2, b: 2}
T: x'^2/2 + y'^2/2
V: a*x^2/2 + b*y^2/2
initial: {x: 1, y: 0, x': 0, y': 1}
"""
    equations, found = derived(text)
    kinds = {q.name: generalized(equations, q).general for q in found.quantities}
    assert kinds == {"J_1": False, "energy": True}
    assert in_momenta(text.replace("b: 2", "b: 3")) == {"energy": "h"}


@pytest.mark.parametrize("name", ["heavy_top", "charged_pendulum", "bead_on_rotating_hoop"])
def test_proofs_add_up_at_random_points(name: str) -> None:
    """The conditions are identities: they hold off the constraints too, for other parameters."""
    equations, found = derived(name)
    random = np.random.default_rng(1)
    for quantity in found.quantities:
        proof = Proof(equations, generalized(equations, quantity))
        sums = [se.Add(*[x * y for x, y in proof.products()], -proof.rate(quantity.gauge))]
        for beta in range(len(equations.constraints)):
            products = [x * y for x, y in proof.constraint_products(beta)]
            sums.append(se.Add(*products, -proof.multiple(beta)))
        for expression in sums:
            at = {s: random.uniform(0.5, 1.5) for s in expression.free_symbols}
            assert abs(float(expression.subs(at))) < 1e-11


@pytest.mark.parametrize(
    ("kinetic", "potential", "expected"),
    [
        ("", "if(x > 0, 1, 2)*x^2 + abs(x)", {"p_y", "energy"}),
        ("", "if(t < 0.5, 1, 2)*x^2", {"p_y"}),
        ("", "k*x^2*step(t - t_1)", {"p_y"}),
        ("", "floor(3*t)*x + k*y", set()),
        ("", "if(x > 0, x^2 + 1, x^2)", {"p_y"}),
        (" + step(x)*y'", "0", {"p_x", "jacobi"}),
        ("*if(t < 0.5, 1, 2)", "0", set()),
    ],
)
def test_what_jumps_is_not_conserved(kinetic: str, potential: str, expected: set[str]) -> None:
    """Next to a jump the symmetry holds, so that the derivatives alone show none."""
    equations, found = derived(f"""
coordinates: [x, y]
parameters: {{m: 2, k: 3, t_1: 0.7}}
T: "m/2*(x'^2 + y'^2){kinetic}"
V: "{potential}"
initial: {{x: -0.3, y: 1, x': 1, y': 0.3}}
""")
    assert {q.name for q in found.quantities} == expected
    assert_constant(equations, found, t_end=1)
