"""Families in index form: one formula for all members that it holds for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.index_form import IndexForm, merged
from lagcli.equations.render import render
from lagcli.equations.typesetting.nodes import (
    IndexedSum,
    Line,
    Node,
    Number,
    Step,
    Sum,
    Symbol,
    product_of,
    sum_of,
    whole,
)
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula
from lagcli.model.loader import load, load_text

MODELS = Path(__file__).parents[4] / "models"
FORMATS = ("text", "latex", "markdown")


def chain(size: int, name: str = "chain"):
    return derive(load(MODELS / f"{name}.yaml", set={"N": size}))


FAMILY = load_text(
    """\
parameters: {N: 7, m[1..N]: 1}
coordinates: {"x[1..N]": {}}
T: sum(m[i]/2*x[i]'^2, i = 1..N)
initial: {"x[1..N]": 0, "x[1..N]'": 0}
"""
)


def member(family: str, index: int) -> Symbol:
    return Symbol(f"{family}[{index}]")


def lines(step: Step) -> list[tuple[str, str | None]]:
    return [(str(line.sides[0]), line.remark) for line in step.lines]


def test_members_that_differ_by_the_index_are_one_line() -> None:
    step = Step("", tuple(Line((member("x", k), member("x", k - 1))) for k in range(1, 8)))
    (line,) = IndexForm(FAMILY).step(step).lines
    assert line.sides == (Symbol("x[i]"), Symbol("x[i−1]"))
    assert line.remark == "i = 1, …, N"


def test_ends_that_differ_stay_by_themselves() -> None:
    made = [Line((member("x", k), whole(0) if k in (1, 7) else whole(k))) for k in range(1, 8)]
    found = IndexForm(FAMILY).step(Step("", tuple(made))).lines
    assert [line.sides[0] for line in found] == [Symbol("x[1]"), Symbol("x[i]"), Symbol("x[N]")]
    assert [line.remark for line in found] == [None, "i = 2, …, N−1", None]


def test_a_member_in_the_middle_that_differs_is_shown() -> None:
    made = [Line((member("x", k), whole(5 if k == 4 else 1))) for k in range(1, 8)]
    found = IndexForm(FAMILY).step(Step("", tuple(made))).lines
    assert [line.remark for line in found] == ["i = 1, …, 3", None, "i = N−2, …, N"]
    assert found[1].sides[0] == Symbol("x[N−3]")


def test_fixed_members_and_numbers_in_the_index() -> None:
    made = [Line((member("x", k), product_of([whole(8 - k), member("m", 2)]))) for k in range(1, 8)]
    (line,) = IndexForm(FAMILY).step(Step("", tuple(made))).lines
    assert line.sides[1] == product_of(
        [sum_of([(1, Symbol("N")), (1, whole(1)), (-1, Symbol("i"))]), Symbol("m[2]")]
    )


def test_sums() -> None:
    terms = [(1, product_of([member("m", k), member("x", k)])) for k in range(1, 8)]
    found = IndexForm(FAMILY).sums(sum_of(terms))
    assert isinstance(found, IndexedSum)
    assert found.term == product_of([Symbol("m[j]"), Symbol("x[j]")])
    assert found.first != found.last
    # a sign in between ends a sum
    terms[3] = (-1, terms[3][1])
    assert not isinstance(IndexForm(FAMILY).sums(sum_of(terms)), IndexedSum)


def test_models_without_families_are_unchanged() -> None:
    model = load(MODELS / "slider_crank.yaml")
    step = Step("", (Line((Symbol("phi"), Number(whole(1).value))),))
    assert IndexForm(model).steps([step]) == [step]


def test_letters_of_the_model_are_avoided() -> None:
    model = load_text(
        "parameters: {i: 1, N: 5}\ncoordinates: {'x[1..N]': {}}\n"
        "T: sum(i*x[k]'^2/2, k = 1..N)\ninitial: {'x[1..N]': 0, \"x[1..N]'\": 0}\n"
    )
    text = render(derive(model))
    assert "xⱼ" in text
    assert "xᵢ" not in text


@pytest.mark.parametrize("form", FORMATS)
def test_the_length_does_not_grow(form: str) -> None:
    short, long = (render(chain(n), form).splitlines() for n in (5, 40))
    assert len(short) == len(long) <= 100
    different = [(a, b) for a, b in zip(short, long, strict=True) if a != b]
    # what differs are the values of N and of the masses, and the numbers of coordinates,
    # constraints and degrees of freedom
    assert all(re.sub(r"[\d. ]+", "", a) == re.sub(r"[\d. ]+", "", b) for a, b in different)
    assert len(different) <= 5


def test_other_kinds_do_not_grow() -> None:
    from lagcli.simulations.partition import partition

    made = [chain(n) for n in (12, 14)]
    short, long = (render(e, kinds=("second", "maggi"), partition=partition(e)) for e in made)
    assert len(short.splitlines()) == len(long.splitlines()) <= 100


def test_entries_that_are_not_listed_are_not_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    from lagcli.equations.presentation import kinds
    from lagcli.equations.reduction.second_kind import SecondKind
    from lagcli.simulations.partition import partition

    def refused(*_: object) -> None:
        raise AssertionError("the entries of a chain of 30 are computed")

    # of an equation with 30 terms that contain all coordinates before, they take minutes
    monkeypatch.setattr(kinds, "abbreviate", refused)
    monkeypatch.setattr(SecondKind, "forcing", property(refused))
    e = chain(30)
    text = render(e, kinds=("second", "maggi"), partition=partition(e))
    assert "--full and --format json give them" in " ".join(text.split())


def test_each_member_is_in_json_and_in_full() -> None:
    import json

    e = chain(6)
    assert len(json.loads(render(e, "json"))["equations"]) == 12
    assert all(f"x{k}:" in render(e, full=True) for k in "₁₂₃₄₅₆")


def test_dense_sums_of_a_pendulum_chain() -> None:
    text = " ".join(render(chain(12, "pendulum_chain")).split())
    assert "Σ(j=i+1..N) (N + 1 − j) [θ̈ⱼ cos(θᵢ − θⱼ) + θ̇ⱼ² sin(θᵢ − θⱼ)]" in text
    assert "(N + 1 − i) {θ̈ᵢ + Σ(j=1..i−1) [θ̈ⱼ cos(θⱼ − θᵢ) − θ̇ⱼ² sin(θⱼ − θᵢ)]}" in text
    latex = render(chain(12, "pendulum_chain"), "latex")
    assert r"\sum_{j=i + 1}^{N} (N + 1 - j) \, \bigl[\ddot{\theta}_{j}" in latex
    # at its ends, where sums have one term or none, the formula holds too
    assert r"(i = 1, \dots, N)" in latex
    assert latex.count(r"\ddot{\theta}_{i}") == 1
    assert "θ₁" not in text


def test_the_derivation_of_a_pendulum_chain_has_an_index() -> None:
    """Definitions, energies and derivatives have one formula for all members."""
    text = " ".join(render(chain(12, "pendulum_chain"), steps=True).split())
    assert "Xᵢ = Xᵢ₋₁ + l sin(θᵢ)/N i = 1, …, N" in text
    assert "Ẋᵢ = (l/N) Σ(j=1..i) θ̇ⱼ cos(θⱼ) i = 1, …, N" in text
    assert "Σ(k=1..N−1) Σ(j=k+1..N) (N + 1 − j) θ̇ₖ θ̇ⱼ cos(θₖ − θⱼ)" in text
    for name in ("∂L/∂θᵢ =", "∂L/∂θ̇ᵢ =", "d/dt ∂L/∂θ̇ᵢ ="):
        assert name in text
    assert "θ₁" not in text
    assert "N−2" not in text


def test_a_sum_that_is_arranged_otherwise_is_that_of_the_formula() -> None:
    """At the last member but one, the sum over the members after it is one term; then none."""

    def after(k: int) -> list[tuple[int, Node]]:
        return [(1, product_of([whole(2), member("x", j)])) for j in range(k + 1, 8)]

    made = [Line((member("x", k), sum_of([*after(k), (1, whole(k))]))) for k in range(1, 8)]
    (line,) = IndexForm(FAMILY).step(Step("", tuple(made))).lines
    assert line.remark == "i = 1, …, N"
    text = TextFormula(Notation(FAMILY))
    assert text.text(line.sides[1]) == "2 Σ(j=i+1..N) xⱼ + i"
    # where the last one is another number, it stays by itself
    made[-1] = Line((member("x", 7), whole(8)))
    *_, rest = IndexForm(FAMILY).step(Step("", tuple(made))).lines
    assert rest.remark is None


def test_a_number_that_all_terms_of_a_sum_share_stands_before_it() -> None:
    terms = [(1, product_of([whole(3), member("x", k)])) for k in range(1, 8)]
    (line,) = IndexForm(FAMILY).step(Step("", (Line((sum_of(terms),)),))).lines
    (found,) = line.sides
    assert TextFormula(Notation(FAMILY)).text(found) == "3 Σ(j=1..N) xⱼ"


A, X, Y = Symbol("a"), Symbol("x[j]"), Symbol("y[j]")


def over(term: Node, last: int = 5) -> IndexedSum:
    return IndexedSum(term, "j", whole(1), whole(last))


def test_sums_over_one_range_are_joined_with_common_factors_in_front() -> None:
    terms = [(1, over(product_of([A, X]))), (-1, over(product_of([A, Y])))]
    inside = product_of([A, sum_of([(1, X), (-1, Y)])])
    assert merged(terms) == [(1, over(inside))]
    assert merged([(-s, x) for s, x in terms]) == [(-1, over(inside))]


def test_other_ranges_and_factors_stay() -> None:
    terms = [(1, over(X)), (1, over(Y, 6)), (1, product_of([A, over(Y)])), (1, A)]
    assert merged(terms) == terms


def test_a_number_stands_before_a_sum_and_a_term_that_have_it() -> None:
    three = whole(3)
    terms = [(1, product_of([three, A])), (-1, product_of([three, over(X)]))]
    ((sign, product),) = merged(terms)
    assert sign == 1
    assert product == product_of([three, Sum(((1, A), (-1, over(X))))])
    assert merged([(1, product_of([three, A])), (1, product_of([three, X]))]) == [
        (1, product_of([three, A])),
        (1, product_of([three, X])),
    ]


def test_a_sum_begins_where_its_factor_is_one() -> None:
    form = IndexForm(FAMILY)
    terms = [(1, member("x", 1))]
    terms += [(1, product_of([whole(k), member("x", k)])) for k in range(2, 8)]
    written = TextFormula(Notation(FAMILY)).text(form.sums(sum_of(terms)))
    assert written == "Σ(j=1..N) j xⱼ"
    # not before another term, and not with another sign
    others = [(-1, member("x", 1)), *terms[1:]]
    written = TextFormula(Notation(FAMILY)).text(form.sums(sum_of(others)))
    assert written == "−x₁ + Σ(j=2..N) j xⱼ"


@pytest.mark.parametrize(
    ("indices", "written"),
    [((1, 7), "x₁ + x_N"), ((2, 6), "x₂ + x₆"), ((3, 7), "x₃ + x₇"), ((5, 6), "x_(N−2) + x_(N−1)")],
)
def test_members_of_one_line_have_numbers_or_distances_from_the_last(
    indices: tuple[int, int], written: str
) -> None:
    line = Line((sum_of((1, member("x", k)) for k in indices),))
    (shown,) = IndexForm(FAMILY).step(Step("", (line,))).lines
    assert TextFormula(Notation(FAMILY)).text(shown.sides[0]) == written
