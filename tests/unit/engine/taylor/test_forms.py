"""Sums and products of multiples of series, as operations on coefficients."""

from __future__ import annotations

from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.series_operations import SeriesOp
from lagcli.engine.tape.tape import Arithmetic
from lagcli.engine.taylor.forms import Form, SeriesForms
from lagcli.engine.taylor.series_nodes import ZERO, Delayed

#: Registers: series that begin with 2, 3, 5, and the numbers 7, 11, 13.
X, Y, Z, S, T, U = range(6)
VALUES = (2.0, 3.0, 5.0, 7.0, 11.0, 13.0)


def new() -> SeriesForms:
    return SeriesForms(Arithmetic(6, 3))


def value(forms: SeriesForms, x: int) -> float:
    """Return what a register, or a series, begins with."""
    return ScalarTape(forms.builder.finish([forms.begin(x)]))(VALUES)[0]


def test_sums_take_each_series_once() -> None:
    forms = new()
    number, name = forms.add([(S, X), (T, Y), (U, X), (forms.zero, Z), (S, ZERO)])
    assert number == forms.one
    op, _, (s, x, t, y) = forms.nodes[name]
    assert (op, x, t, y) == (SeriesOp.SUM, X, T, Y)
    assert value(forms, s) == 20.0
    assert forms.add([(S, X)]) == (S, X)
    assert forms.add([(S, X)], name) == (forms.one, name)
    assert forms.nodes[name] == (SeriesOp.SCALE, (name,), (S, X))
    assert forms.add([]) == (forms.one, ZERO)


def test_brackets_are_the_same_except_for_numbers_and_signs() -> None:
    forms = new()
    negative = forms.builder.negative

    def bracket(*terms: Form) -> tuple[float, int]:
        number, name = forms.bracket(terms, list)
        return value(forms, number), name

    number, name = bracket((S, X), (negative(S), Y))
    assert (number, value(forms, name)) == (7.0, -1.0)
    assert bracket((negative(T), X), (T, Y)) == (-11.0, name)
    number, name = bracket((negative(S), X), (negative(T), Y))
    assert (number, value(forms, name)) == (-1.0, 7.0 * 2.0 + 11.0 * 3.0)
    assert bracket((S, X), (T, Y)) == (1.0, name)


def test_products_are_made_once() -> None:
    forms = new()
    name = forms.multiply(X, Y)
    assert forms.multiply(X, Y) == name
    assert value(forms, name) == 6.0
    assert value(forms, forms.multiply(name, Z)) == 30.0
    tail = forms.multiply(X, Y, tail=True)
    assert forms.nodes[tail] == (SeriesOp.MUL_TAIL, (tail,), (X, Delayed(Y)))
    assert value(forms, tail) == 0.0


def test_multiples_keep_what_counts_beyond_the_first_coefficient() -> None:
    forms = new()
    forms.tails[Y] = S, X  # y = s x + a number
    forms.scaled(Z, lambda s: forms.builder.times(T, s), Y)
    assert forms.form(Z) == (T, Y)
    number, base = forms.tail(Z)
    assert (value(forms, number), base) == (77.0, X)
