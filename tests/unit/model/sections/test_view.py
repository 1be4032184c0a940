"""What a view says, read from a model."""

from __future__ import annotations

import pytest
import symengine as se

import lagcli
from lagcli.errors import ModelError
from lagcli.model.model import Disc, Model, Segment, View

HEAD = """
coordinates: [x, y, phi]
parameters: {m: 1, l: 1, N: 2, A: 3}
definitions:
  r: [x, y]
  w[i = 1..N]: [i*x, y]
T: m/2*(x'^2 + y'^2) + m/2*phi'^2
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: 1, y: 0, phi: 0, x': 0, y': 1, phi': 0}
"""


def view(text: str, **options: object) -> View:
    found = model(text, **options).view
    assert found is not None
    return found


def model(text: str, **options: object) -> Model:
    return lagcli.load_text(HEAD + text, "m.yaml", **options)


def test_a_model_without_a_view_has_none() -> None:
    assert model("").view is None
    assert model("view:\n").view is None


def test_points_are_expressions_or_vectors() -> None:
    found = view("view: {points: {O: [0, 0], A: [A*x, y'], P: r, Q: '2*r - [1, 0]'}}")
    x, y = se.symbols("x y")
    assert found.dimension == 2
    assert found.points == {
        "O": (0, 0),
        "A": (se.Symbol("A") * x, se.Symbol("y'")),  # no name of a point hides a parameter
        "P": (x, y),
        "Q": (2 * x - 1, 2 * y),
    }


def test_trees_are_kept_as_written() -> None:
    trees = model("view: {points: {P: [x, 2*y]}}").trees
    assert "view.points.P" in trees


def test_three_dimensions() -> None:
    assert view("view: {points: {P: [x, y, phi]}}").dimension == 3


@pytest.mark.parametrize(
    "rods",
    ["[O-P, P-Q]", "[O-P-Q]", "[[O, P], [P, Q]]", "[[O, P, Q]]", "O-P-Q", "[ O - P-Q ]"],
)
def test_rods_can_be_written_in_many_ways(rods: str) -> None:
    found = view(f"view:\n  points: {{O: [0, 0], P: [x, y], Q: [1, x]}}\n  rods: {rods}")
    assert [(s.start, s.end) for s in found.segments] == [("O", "P"), ("P", "Q")]


def test_kinds_and_names_of_lines() -> None:
    found = view(
        "view:\n  points: {O: [0, 0], P: [x, y]}\n  springs: {k: O-P}\n"
        "  rods: [O-P]\n  guides: {g: [O, P]}\n  edges: {e: O-P-O}"
    )
    assert found.segments == (
        Segment("rod", "O-P", "O", "P"),
        Segment("spring", "k", "O", "P"),
        Segment("guide", "g", "O", "P"),
        Segment("edge", "e", "O", "P"),
        Segment("edge", "e", "P", "O"),
    )


def test_every_kind_of_line_is_read_alike() -> None:
    keys = {"ropes": "rope", "dampers": "damper", "belts": "belt", "walls": "wall"}
    for key, kind in keys.items():
        found = view(f"view: {{points: {{O: [0, 0], P: [x, y]}}, {key}: {{a: O-P}}}}")
        assert [tuple(s) for s in found.segments] == [(kind, "a", "O", "P")]


def test_plates_are_outlines_closed_or_not() -> None:
    points = "{O: [0, 0], P: [x, y], Q: [1, 0]}"
    closed = view(f"view: {{points: {points}, plates: {{a: O-P-Q-O}}}}")
    assert [tuple(p) for p in closed.plates] == [("a", ("O", "P", "Q"))]
    assert view(f"view: {{points: {points}, plates: [O-P-Q]}}").plates[0].points == ("O", "P", "Q")


def test_masses_are_listed_or_left_to_the_energy() -> None:
    assert view("view: {points: {P: [x, y]}}").masses is None
    assert view("view: {points: {P: [x, y]}, masses: []}").masses == ()
    found = view("view: {points: {P: [x, y]}, masses: [P], sliders: P}")
    assert (found.masses, found.sliders) == (("P",), ("P",))


def test_families() -> None:
    text = (
        "view:\n  points: {'P[i = 0..N]': [i*x, y]}\n"
        "  rods: ['P[i-1]-P[i] for i = 1..N']\n  springs: {'s[i = 1..N]': 'P[0]-P[i]'}\n"
        "  grounds: ['P[0]']\n  trails: ['P[i] for i = 1..N']\n"
        "  discs: {'d[i = 1..N]': {center: 'P[i]', radius: i*l}}\n"
        "  vectors: {'v[i = 1..N]': {velocity: 'P[i]'}}"
    )
    found = view(text, set={"N": 3})
    assert list(found.points) == [f"P[{i}]" for i in range(4)]
    assert found.segments[1] == Segment("rod", "P[1]-P[2]", "P[1]", "P[2]")
    assert found.segments[-1] == Segment("spring", "s[3]", "P[0]", "P[3]")
    assert found.trails == ("P[1]", "P[2]", "P[3]")
    assert found.discs[2] == Disc("d[3]", "P[3]", 3 * se.Symbol("l"))
    assert found.vectors[2].components == (3 * se.Symbol("x'"), se.Symbol("y'"))
    assert model(text).structural_parameters == ("N",)


def test_a_definition_may_denote_a_point() -> None:
    found = view("view:\n  points: {O: [0, 0]}\n  rods: [O-r, O-w[2]]\n  trails: [r]")
    assert found.points["r"] == se.symbols("x y")
    assert [s.end for s in found.segments] == ["r", "w[2]"]


def test_labels_are_short_names_by_default() -> None:
    points = "points: {O: [0, 0], P_1: [x, y], x_A: r, Crank: r, Q12: r, 'G[1..N]': r}"
    assert list(view(f"view: {{{points}}}").labels) == ["O", "P_1", "x_A"]
    assert view(f"view: {{{points}, labels: []}}").labels == {}
    assert view(f"view: {{{points}, labels: [Crank, 'G[1]']}}").labels == {
        "Crank": None,
        "G[1]": None,
    }
    labelled = view(f"view: {{{points}, labels: {{O: the pivot, 'G[2]': two}}}}").labels
    assert labelled == {"O": "the pivot", "G[2]": "two"}


def test_a_label_without_a_point_is_an_error() -> None:
    with pytest.raises(ModelError, match=r"no point `G\[3\]`"):
        view("view: {points: {'G[1..2]': r}, labels: {'G[1..3]': g}}")


def test_vectors() -> None:
    found = view(
        "view:\n  points: {O: [0, 0], P: [x, y]}\n  vectors:\n"
        "    v: {velocity: P}\n    w: {velocity: P, at: O}\n    f: {at: P, force: rod}\n"
        "    a: {at: P, components: [x'', lambda.rod + Qc.rod.x]}\n"
        "    b: {at: P, components: '[m, 0]', unit: N}"
    )
    v, w, f, a, b = found.vectors
    assert v.points == ("P",)
    assert w.points == ("O",)
    assert v.components == w.components == se.symbols("x' y'")
    assert (f.quantity, f.points, f.constraint) == ("force", ("P",), "rod")
    assert a.quantity == "vector"
    assert a.components[0] == se.Symbol("x''")
    assert {s.name for s in a.components[1].free_symbols} == {"lambda.rod", "Qc.rod.x"}
    assert (b.quantity, b.unit) == ("force", "N")


def test_errors_elsewhere_in_the_model_are_not_reported_twice() -> None:
    with pytest.raises(ModelError) as caught:
        lagcli.load_text(
            HEAD.replace("[x, y]\n", "[x, yy]\n")
            + "view:\n  points: {O: [0, 0], P: r}\n  rods: [O-P, O-r]\n"
            "  vectors: {v: {velocity: P}, f: {at: P, force: rod}}"
        )
    assert len(caught.value.diagnostics) == 1
