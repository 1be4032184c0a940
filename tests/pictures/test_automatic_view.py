"""Views of models that have none: points by their names, rods by their constraints."""

import numpy as np
import pytest
from symengine import Symbol

import lagcli
from lagcli.pictures.scene.automatic_view import with_view


def view(coordinates, constraints="", definitions="", more=""):
    names = coordinates.split(", ")
    energy = " + ".join(f"{q}'^2" for q in names)
    initial = "".join(f"  {q}: {{guess: 1}}\n  {q}': {{guess: 0}}\n" for q in names)
    text = (
        f"coordinates: [{coordinates}]\nparameters: {{l: 1, c: 2, w: 3}}\n{definitions}"
        f"T: {energy}\n{constraints}{more}initial:\n{initial}"
    )
    return with_view(lagcli.load_text(text)).view


def rods(found):
    return [(s.name, s.start, s.end) for s in found.segments]


def test_a_pendulum_hangs_from_the_origin():
    found = view("x, y", "constraints: {rod: x^2 + y^2 = l^2}\n")
    assert found.dimension == 2
    assert list(found.points) == ["P", "O"]
    assert rods(found) == [("rod", "O", "P")]
    assert found.grounds == ("O",)
    assert found.trails == ("P",)


def test_a_chain_of_two_and_a_moving_support():
    found = view(
        "x1, y1, x2, y2",
        "constraints:\n  a: (x1 - c*sin(w*t))^2 + y1^2 = l^2\n"
        "  b: 2*(x2 - x1)^2 + 2*(y2 - y1)^2 = 2*l^2\n",
    )
    assert rods(found) == [("a", "P1_0", "P1"), ("b", "P1", "P2")]
    assert found.points["P1_0"] == (Symbol("c") * _sin("w*t"), 0)


def _sin(text):
    from symengine import sin, sympify

    return sin(sympify(text))


def test_three_dimensions_and_names_of_points():
    found = view("x_A, y_A, z_A", "constraints: {s: x_A^2 + y_A^2 + z_A^2 = l^2}\n")
    assert (found.dimension, list(found.points)) == (3, ["A", "O"])


def test_definitions_are_points():
    found = view(
        "phi, s", definitions="definitions:\n  x_B: l*cos(phi)\n  y_B: l*sin(phi)\n  r_C: [s, l]\n"
    )
    assert list(found.points) == ["B", "C"]


def test_bodies_on_a_line():
    rail = view("x_A, x_B, phi")
    assert rail.points == {"A": (Symbol("x_A"), 0), "B": (Symbol("x_B"), 0)}
    assert view("y").points == {"P": (0, Symbol("y"))}
    assert view("z, phi").points == {"P": (0, Symbol("z"))}
    # of two heights it is not known where they are
    assert view("y_1, y_2") is None
    assert view("x, z") is None


@pytest.mark.parametrize("name", ["bouncing_ball", "newtons_cradle", "stick_slip_belt"])
def test_contact_models_on_a_line_have_a_view(name):
    text = lagcli.load(name).text
    model = lagcli.load_text(text[: text.index("\nview:")] + "\n")
    assert model.view is None
    found = with_view(model).view
    assert found.dimension == 2
    assert len(found.points) == len(model.coordinates)


@pytest.mark.parametrize(
    "constraint",
    [
        "x1^2 + 2*y1^2 = 1",  # an ellipse
        "x1 = y1",  # a line
        "(x1 + x2)^2 + (y1 + y2)^2 = 1",  # no distance
        "x1'*y1 = y1'",  # nonholonomic
    ],
)
def test_other_constraints_are_not_rods(constraint):
    found = view("x1, y1, x2, y2", f'constraints: {{c: "{constraint}"}}\n')
    assert rods(found) == []


def test_angles_and_other_units_are_not_points():
    assert view("phi, psi") is None
    model = lagcli.load_text(
        "coordinates: {x: rad, y: rad}\nT: x'^2 + y'^2\ninitial: {x: 0, y: 0, x': 0, y': 0}"
    )
    assert with_view(model).view is None


def test_a_view_of_the_file_is_kept():
    model = lagcli.load("slider_crank")
    assert with_view(model) is model


def test_it_is_drawn_and_reported(tmp_path):
    text = (
        "coordinates: [x, y]\nparameters: {l: 1}\nT: x'^2 + y'^2\nV: y\n"
        "constraints: {rod: x^2 + y^2 = l^2}\ninitial: {x: 1, y: 0, x': 0, y': 0}\n"
    )
    run = lagcli.simulate(lagcli.load_text(text), t_end=1)
    made = lagcli.animate(run, tmp_path / "a.html")
    assert made.notes == (
        "the model has no view; the points recognized by their names are drawn: P, O",
    )
    assert lagcli.report(run, tmp_path / "r.html").size > 100_000


BODY = """
coordinates: {r: point, e: quaternion}
parameters: {m: 20 kg, w: 0.8 m, h: 2 m, c: 0.1 m}
definitions:
  J: diag(m*h^2/12, m*(w^2 + h^2)/12, m*w^2/12)
  A: r - e*[w/2, 0, c]
  B: r + [c, 0, 0]
T: body(m, J, r, e)
initial: {r: [0, 0, 0], r': 0, e: 1, e': [0, 0, 1]}
"""


def at_start(found):
    """Return the points with the body upright at the origin."""
    values = {"m": 20, "w": 0.8, "h": 2, "c": 0.1, "e.0": 1}
    values |= dict.fromkeys(("e.1", "e.2", "e.3", "r.x", "r.y", "r.z"), 0)
    values = {Symbol(name): x for name, x in values.items()}
    return {name: [float(x.subs(values)) for x in place] for name, place in found.points.items()}


def test_a_rigid_body_is_the_box_of_its_inertia():
    """A door of width w and height h, m h²/12 and m w²/12, is flat: one face with four sides."""
    found = with_view(lagcli.load_text(BODY)).view
    places = at_start(found)
    corners = {name: place for name, place in places.items() if "corner" in name}
    assert sorted(map(tuple, corners.values())) == [
        pytest.approx((x, 0, z)) for x in (-0.4, 0.4) for z in (-1, 1)
    ]
    (face,) = found.plates
    sides = zip(face.points, (*face.points[1:], face.points[0]), strict=True)
    lengths = [
        sum((a - b) ** 2 for a, b in zip(places[p], places[q], strict=True)) for p, q in sides
    ]
    assert sorted(lengths) == pytest.approx([0.64, 0.64, 4, 4])
    assert not any("corner" in name for name in (*found.labels, *found.trails))


def test_points_that_are_fixed_in_a_body_are_joined_to_it():
    """A moves with the body, B along with its centre of mass alone."""
    found = with_view(lagcli.load_text(BODY)).view
    assert rods(found)[:1] == [("P", "P", "A")]
    assert "B" not in found.points


def test_a_body_with_six_faces_has_twelve_edges():
    found = with_view(lagcli.load_text(BODY.replace("m*w^2/12)", "m*w^2/8)"))).view
    assert len(found.plates) == 6
    sides = [
        frozenset(side)
        for face in found.plates
        for side in zip(face.points, (*face.points[1:], face.points[0]), strict=True)
    ]
    assert {sides.count(side) for side in sides} == {2}  # each is a side of two faces
    assert len(set(sides)) == 12


@pytest.mark.parametrize(
    "inertia",
    [
        "[[m*h^2, m*c^2, 0], [m*c^2, m*h^2, 0], [0, 0, m*h^2]]",  # not along principal axes
        "diag(m*c^2, m*c^2, 9*m*h^2)",  # of no body
    ],
)
def test_a_body_without_a_box(inertia):
    text = BODY.replace("diag(m*h^2/12, m*(w^2 + h^2)/12, m*w^2/12)", f'"{inertia}"')
    found = with_view(lagcli.load_text(text)).view
    assert list(found.points) == ["P", "A"]


@pytest.mark.parametrize(
    "turn",
    [
        "rot_z(a)*rot_x(b)*rot_z(c)",
        "rot_z(a)*rot_y(b)*rot_x(c)",
        "rot([1, 1, 0], a)*rot_x(b)*rot_z(c)",
    ],
)
def test_a_body_given_by_three_angles_is_the_same_box(turn):
    """The box of the door above, in its own frame; the frame turns by Euler or Cardan angles."""
    text = f"""
coordinates: {{r: point, a: rad, b: rad, c: rad}}
parameters: {{m: 20 kg, w: 0.8 m, h: 2 m, d: 0.1 m}}
definitions:
  R: {turn}
  J: diag(m*h^2/12, m*(w^2 + h^2)/12, m*w^2/12)
  A: r - R*[w/2, 0, d]
  B: r + [d, 0, 0]
T: m/2*dot(r', r') + dot(omega(R), J*omega(R))/2
initial: {{r: [0, 0, 0], r': 0, a: 0.3, b: 0.5, c: 0.7, a': 0, b': 0, c': 1}}
"""
    model = lagcli.load_text(text)
    found = with_view(model).view
    assert [len(face.points) for face in found.plates] == [4]
    assert rods(found)[:1] == [("P", "P", "A")]
    state = {"a": 0.3, "b": 0.5, "c": 0.7, "m": 20, "w": 0.8, "h": 2, "d": 0.1}
    state |= dict.fromkeys(("r.x", "r.y", "r.z"), 0)
    values = {Symbol(name): x for name, x in state.items()}
    matrix = np.array([float(x.subs(values)) for x in model.definitions["R"].value.entries])
    own = [
        np.array([float(x.subs(values)) for x in place]) @ matrix.reshape(3, 3)
        for name, place in found.points.items()
        if "corner" in name
    ]
    assert sorted(np.round(own, 12).tolist()) == [
        pytest.approx([x, 0, z], abs=1e-12) for x in (-0.4, 0.4) for z in (-1, 1)
    ]


def test_angles_that_do_not_determine_the_inertia_give_no_box():
    """Two angles leave the third moment of inertia open."""
    text = """
coordinates: {r: point, a: rad, b: rad}
parameters: {m: 2 kg, J: 1 kg*m^2}
definitions: {R: rot_z(a)*rot_x(b)}
T: m/2*dot(r', r') + J/2*dot(omega(R), omega(R))
initial: {r: [0, 0, 0], r': 0, a: 0.3, b: 0.5, a': 0, b': 1}
"""
    assert list(with_view(lagcli.load_text(text)).view.points) == ["P"]


OWN_NAMES = """
coordinates: {pos: point, ori: quaternion}
parameters: {m: 2 kg, a: 1 kg*m^2, b: 2 kg*m^2, c: 2.5 kg*m^2, l: 0.5 m}
definitions: {hook: "pos + ori*[l, 0, 0]"}
T: "body(m, diag(a, b, c), pos, ori)"
initial: {pos: [0, 0, 0], pos': [0, 0, 0], ori: 1, ori': [0, 0, 0]}
"""


def test_a_body_is_known_by_the_vectors_of_its_energy():
    found = with_view(lagcli.load_text(OWN_NAMES)).view
    assert rods(found) == [("pos", "pos", "hook")]
    assert len(found.plates) == 6
    assert found.masses == ("pos",)


def test_a_vector_whose_rate_is_in_the_energy_is_a_mass():
    text = """
coordinates: [phi, s]
parameters: {m: 2 kg, l: 0.5 m}
definitions: {bob: "[s + l*sin(phi), -l*cos(phi)]", r_A: "[s, l]"}
T: "m/2*dot(bob', bob')"
initial: {phi: 1, phi': 0, s: 0 m, s': 0 m/s}
"""
    found = with_view(lagcli.load_text(text)).view
    assert list(found.points) == ["bob", "A"]
    assert found.masses == ("bob",)


@pytest.mark.parametrize(("relation", "kinds"), [("<=", ["rope"]), (">=", [])])
def test_a_largest_distance_is_a_rope_and_a_least_one_nothing(relation, kinds):
    rope = f"constraints: {{c: {{expr: x^2 + y^2 {relation} l^2, restitution: 0}}}}\n"
    found = view("x, y", rope)
    assert [s.kind for s in found.segments] == kinds
