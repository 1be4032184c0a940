"""Derivatives of expressions along the motion."""

from __future__ import annotations

import symengine as se

from lagcli.equations.derivation.motion import Motion, addends

X, Y, U, V, A, B, T, M = map(se.Symbol, ("x", "y", "x'", "y'", "x''", "y''", "t", "m"))
MOTION = Motion((X, Y), (U, V), (A, B), smooth=True)


def test_a_row_has_the_nonzero_derivatives_by_columns() -> None:
    columns = {Y: 0, M: 3, X: 1, A: 2}
    found = MOTION.row([M * X**2 - X * U, se.sin(Y), X * U, T], columns)
    assert found == {0: se.cos(Y), 1: 2 * M * X, 3: X**2}
    assert list(found) == sorted(found)


def test_slopes_are_those_by_coordinates_and_time() -> None:
    found = MOTION.slopes(M * X**2 * U + T * Y)
    assert found.by_position == {0: 2 * M * X * U, 1: T}
    assert found.by_time == Y
    assert MOTION.slopes(M * U) == ({}, 0)


def test_the_convective_derivative_leaves_out_accelerations() -> None:
    found = MOTION.convective(X * Y + T**2 * U)
    assert se.expand(found - (U * Y + X * V + 2 * T * U)) == 0


def test_occurrences_are_numbers_of_coordinates_and_velocities() -> None:
    found = MOTION.occurring(Y * U + M)
    assert found == ((1,), (0,), False)
    assert not found.is_constant
    assert MOTION.occurring(M * A).is_constant
    assert MOTION.occurring(se.sin(T)).timed


def test_addends_open_a_bracket_of_several_terms() -> None:
    assert set(addends(M * (X + Y + T))) == {M * X, M * Y, M * T}
    assert addends(M * (X + Y)) == (M * (X + Y),)  # two are not worth it
    assert addends(X * Y) == (X * Y,)
