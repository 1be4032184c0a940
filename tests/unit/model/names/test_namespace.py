"""The namespace: what names stand for, and total derivatives."""

from __future__ import annotations

import symengine as se

from lagcli.model.expression.trees import Name
from lagcli.model.names.namespace import Namespace


def table() -> Namespace:
    return Namespace(
        coordinates=dict.fromkeys(["x", "p[1]", "p[2]", "a_dot"]),
        parameters={"m": lambda: se.Symbol("m")},
        definitions={"R": lambda: None},  # type: ignore[dict-item,return-value]
        families={"p[]": {"coordinate"}, "r[].x": {"coordinate"}, "P[]": {"definition"}},
        suspects={"bad"},
    )


def resolved(text: str, primes: int = 0) -> tuple[str, int]:
    return table().resolve(Name(0, len(text), text, primes))


def test_dots_are_primes_unless_the_name_is_declared() -> None:
    assert resolved("x_dot") == ("x", 1)
    assert resolved("x_ddot", 1) == ("x", 3)
    assert resolved("a_dot") == ("a_dot", 0)
    assert resolved("a_dot_dot") == ("a_dot", 1)
    assert resolved("p_dot[]") == ("p[]", 1)
    assert resolved("r[].x_dot") == ("r[].x", 1)
    assert resolved("bad_dot") == ("bad", 1)  # its declaration is in error
    assert resolved("y_dot", 1) == ("y_dot", 1)


def test_vectors_are_definitions_or_families_of_them() -> None:
    names = table()
    assert [x for x in ("R", "P[]", "p[]", "x", "none") if names.may_be_vector(x)] == ["R", "P[]"]
    assert names.members("p") == ["p[1]", "p[2]"]
    assert names.declared("p[]")
    assert not names.declared("p")


def test_the_derivative_follows_coordinates_and_the_time() -> None:
    x, v, a, t, m = map(se.Symbol, ("x", "x'", "x''", "t", "m"))
    found = table().derivative(m * x**2 * v + se.sin(t) + m)
    assert se.expand(found - (2 * m * x * v**2 + m * x**2 * a + se.cos(t))) == 0
