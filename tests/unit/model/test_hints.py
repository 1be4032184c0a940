"""Hints on models without errors: angles in degrees, kinetic energies without 1/2."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest

from lagcli.errors import ModelError
from lagcli.model.hints import hints
from lagcli.model.loader import load, load_text

ROOT = Path(__file__).parents[3]
FOUND = ROOT / "tests" / "found"

MODEL = """
coordinates: {coordinates}
parameters: {{m: 2 kg, m1: 1 kg, m2: 1 kg, J: 1 kg*m^2, l: 1 m, g: 9.81 m/s^2, k: 5 N/m}}
{more}
initial: {{{initial}}}
"""


def model(more: str, coordinates: str = "{x: m, y: m}"):
    names = [part.split(":")[0].strip() for part in coordinates.strip("{}").split(",")]
    start = ", ".join(f"{x}: {int(x == 'r')}, {x}': 0" for x in names)
    return load_text(MODEL.format(coordinates=coordinates, more=more, initial=start))


def test_the_found_models_have_one_hint_each() -> None:
    (angle,) = hints(load(FOUND / "angle.yaml"))
    assert angle.message == (
        "`theta` starts at 30 rad, 4.8 turns; an angle in degrees is written `30 deg`"
    )
    (sloppy,) = hints(load(FOUND / "sloppy.yaml"))
    assert sloppy.message == (
        "`T` gives `m` the inertia 2 m; the kinetic energy of a mass m is m/2 times its squared"
        " velocity"
    )
    for hint, line in ((angle, "theta: 30"), (sloppy, "m*(x'^2 + y'^2)")):
        assert hint.location is not None
        assert line in hint.location.text
        assert str(hint) == f"{hint.location.with_line}: {hint.message}"


PATHS = [*sorted((ROOT / "models").rglob("*.yaml")), *sorted(FOUND.glob("*.yaml"))]


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_no_other_model_has_one(path: Path) -> None:
    if path.stem not in ("angle", "sloppy"):
        with suppress(ModelError):  # some are refused
            assert hints(load(path)) == ()


POLAR = "{r: m, phi: rad}"


@pytest.mark.parametrize(
    ("more", "coordinates"),
    [
        ("T: m*(x'^2 + y'^2)\nV: m*g*y", "{x: m, y: m}"),
        ("T: m*(x'^2 + y'^2)", "{x: m, y: m}"),
        ("T: m*x'^2 + m*y'^2\nV: k/2*x^2", "{x: m, y: m}"),
        ("T: (x'^2 + y'^2)*m", "{x: m, y: m}"),
        ("T: m*(r'^2 + r^2*phi'^2)", POLAR),
        ("T: m*(r'^2 + (r*phi')^2) + J/2*phi'^2", POLAR),
        ("T: m1*x'^2 + m2*y'^2\nV: k/2*(x - y)^2", "{x: m, y: m}"),
        ("T: m1/2*x'^2 + m2*((x' + y')^2 + y'^2)", "{x: m, y: m}"),
        ("L: m*(x'^2 + y'^2) - m*g*y", "{x: m, y: m}"),
        ("T: 2*(m*(x'^2 + y'^2)/2)", "{x: m, y: m}"),
        ("definitions: {E: m*(x'^2 + y'^2)}\nT: E\nV: m*g*y", "{x: m, y: m}"),
        ("definitions: {A: '[x, l + y]'}\nT: m*dot(A', A')", "{x: m, y: m}"),
        ("definitions: {A: '[x, l + y]'}\nT: m*norm(A')^2", "{x: m, y: m}"),
        ("definitions: {u: x', w: y' + x'}\nT: m*(u^2 + w^2)", "{x: m, y: m}"),
        ("functions: {kin(n, u, w): n*(u^2 + w^2)}\nT: kin(m, x', y')", "{x: m, y: m}"),
    ],
)
def test_an_inertia_of_2_m_that_nothing_explains(more: str, coordinates: str) -> None:
    (hint,) = hints(model(more, coordinates))
    assert "the inertia 2 m" in hint.message


@pytest.mark.parametrize(
    ("more", "coordinates"),
    [
        ("T: m/2*(x'^2 + y'^2)\nV: m*g*y", "{x: m, y: m}"),
        ("T: m*(x'^2 + y'^2)/2", "{x: m, y: m}"),
        ("T: 1/2*(m*(x'^2 + y'^2) + J*(x'/l)^2)", "{x: m, y: m}"),
        ("T: (x'^2 + y'^2)*m*0.5", "{x: m, y: m}"),
        ("definitions: {E: m*(x'^2 + y'^2)}\nT: E/2", "{x: m, y: m}"),
        # two equal masses that move together, and a dumbbell
        ("T: m*(x'^2 + y'^2)\nV: 2*m*g*y", "{x: m, y: m}"),
        ("T: m*(x'^2 + y'^2)\nV: (m + m)*g*y - m*g*y*2", "{x: m, y: m}"),
        ("T: m*(r'^2 + r^2*phi'^2) + m*l^2/4*phi'^2", POLAR),
        ("L: m*(x'^2 + y'^2) - 2*m*g*y", "{x: m, y: m}"),
        # a hoop that rolls down, a hoop on a nail, a block that another one pulls
        ("T: m*x'^2\nV: -m*g*x*sin(0.3)", "{x: m}"),
        ("T: m*l^2*phi'^2\nV: -m*g*l*cos(phi)", "{phi: rad}"),
        ("T: m*x'^2 + m2/2*y'^2\nV: -m*g*x", "{x: m, y: m}"),
        # rolling discs, a slider-crank and a double pendulum as textbooks shorten them
        ("T: 3/4*m*x'^2 + 3/4*m*y'^2", "{x: m, y: m}"),
        ("T: m*l^2*(x'^2/l^2 + y'^2/(2*l^2) - x'*y'/l^2*cos(x/l + y/l))", "{x: m, y: m}"),
        ("T: m*l^2*(x'^2 + y'^2/2 + x'*y'*cos((x - y)/l))/l^2", "{x: m, y: m}"),
        # moments of inertia, other parameters, and parts of a mass
        ("T: J*(x'^2 + y'^2)/l^2", "{x: m, y: m}"),
        ("T: k*l^2/g*(x'^2 + y'^2)/l", "{x: m, y: m}"),
        ("T: m/2*(x'^2 + y'^2) + m*x'*y'*0", "{x: m, y: m}"),
        ("T: m1/2*x'^2 + m2*y'^2", "{x: m, y: m}"),
    ],
)
def test_no_hint_where_the_inertia_is_right_or_explained(more: str, coordinates: str) -> None:
    assert hints(model(more, coordinates)) == ()


def test_a_mass_that_is_half_of_another_explains_it() -> None:
    text = """
coordinates: [x, y]
parameters: {M: 3, m: M/2, F: 3}
T: m*(x'^2 + y'^2)
initial: {x: 0, y: 0, x': 0, y': 0}
"""
    assert hints(load_text(text)) == ()
    assert hints(load_text(text.replace("m: M/2", "m: 1.5"))) != ()
    assert hints(load_text(text.replace("m*(x", "F*(x"))) == ()  # no name of a mass


def test_members_of_a_family() -> None:
    text = """
coordinates: {"x[1..3]": m}
parameters: {N: 3, "m[1..3]": 1 kg, k: 5 N/m}
T: sum(m[i]/2*x[i]'^2, i = 1..N)
V: sum(k/2*x[i]^2, i = 1..N)
initial: {"x[1..3]": 1, "x[1..3]'": 0}
"""
    assert hints(load_text(text)) == ()
    (hint,) = hints(load_text(text.replace("m[i]/2*x", "m[i]*x")))
    assert "gives `m` the inertia 2 m" in hint.message


PENDULUM = """
coordinates: {coordinates}
parameters: {{m: 1 kg, l: 1 m, g: 9.81 m/s^2, c: {{value: 0.1, unit: "N*m/rad"}}, th0: {start}}}
T: m*l^2/2*th'^2
V: {potential}
{more}
initial: {{th: {given}, th': 0}}
"""


def angles(
    given: str = "30",
    potential: str = "-m*g*l*cos(th)",
    coordinates: str = "[th]",
    more: str = "",
    start: str = "40",
) -> int:
    text = PENDULUM.format(
        given=given, potential=potential, coordinates=coordinates, more=more, start=start
    )
    return len(hints(load_text(text)))


def test_angles_that_are_probably_in_degrees() -> None:
    assert angles() == angles("-90") == angles("{guess: 45}") == angles("th0") == 1
    assert angles(coordinates="{th: rad}") == angles(coordinates="{th: {unit: rad}}") == 1
    assert angles(potential="-m*g*l*(cos(th) + sin(2*th))") == 1
    assert angles(more="constraints: {s: l*sin(th) = l*sin(30)}") == 1


def test_angles_that_are_not() -> None:
    assert angles("30 deg") == angles("30 rad") == angles("0.5") == angles("6.28") == 0
    assert angles("20*pi") == angles("th0", start="40 rad") == 0
    # the angle itself matters: a spring, a thread that unwinds, a wheel that rolls
    assert angles(potential="c/2*th^2 - m*g*l*cos(th)") == 0
    assert angles(more="Q: {th: -c*th}") == 0
    assert angles(more="constraints: {c: l*sin(th) = l*(th - 30)}") == 0
    assert angles(potential="0") == 0  # it stands nowhere
    assert angles(potential="m*g*l*cos(th/l)") == angles(potential="m*cos(c*th + l)") == 0
    assert angles(potential="m*g*l*cos(2*th + l)") == 1
    assert angles(potential="m*g*l*cos(th/l)", coordinates="{th: m}") == 0  # a length


def test_one_hint_for_the_members_of_an_entry() -> None:
    text = """
coordinates: ["th[1..4]"]
parameters: {N: 4, m: 1, l: 1, g: 9.81}
T: sum(m*l^2/2*th[i]'^2, i = 1..N)
V: -sum(m*g*l*cos(th[i]), i = 1..N)
initial: {"th[1..4]": 45, "th[1..4]'": 0}
"""
    assert len(hints(load_text(text))) == 1
    assert len(hints(load_text(text, set_initial={"th[2]": "90"}))) == 2
