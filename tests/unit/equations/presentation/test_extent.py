"""Lines of text that steps take, lists that are cut to fit, and long sums with dots."""

from __future__ import annotations

import pytest
from formula_values import MODELS

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.assembly import Contents, shown_steps
from lagcli.equations.presentation.extent import (
    Extent,
    abridged,
    accelerations_are_large,
    is_large,
    items_of,
)
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.render import render
from lagcli.equations.typesetting.nodes import Line, Product, Sign, Step, Sum, Symbol, whole
from lagcli.model.loader import load

SHIPPED = {path.stem: path for path in MODELS}


@pytest.fixture(scope="module")
def formulas() -> Formulas:
    return Formulas(derive(load(SHIPPED["slider_crank"])))


def test_size_is_the_number_of_lines_printed(formulas) -> None:
    printed = render(formulas.equations, "text", steps=True).splitlines()
    description = printed.index("")
    # the title of each step and the blank line before it belong to the step
    assert (
        Extent(formulas).size(shown_steps(formulas, Contents(steps=True)))
        == len(printed) - description
    )


def test_steps_are_cut_to_the_space_and_report_it(formulas) -> None:
    extent = Extent(formulas)
    lines = tuple(Line((Symbol("phi"), whole(n)), f"rod[{n}]") for n in range(50))
    short = Step("Short", lines[:3])
    found = extent.shortened([Step("Long", lines), short], 30)
    assert found[1] == short
    assert found[0].lines == lines[: len(found[0].lines)]
    assert 15 <= len(found[0].lines) <= 25
    assert found[0].remark is not None
    assert "of 50; --full" in found[0].remark
    assert extent.size(found) <= 31  # the remark takes a line
    assert extent.shortened([short], 30) == [short]


def test_lines_below_a_label_belong_to_it() -> None:
    first, below, second = Line((whole(1),), "a"), Line((whole(2),)), Line((whole(3),), "b")
    assert items_of([first, below, second]) == [[first, below], [second]]
    assert items_of([below, below]) == [[below], [below]]


def test_long_sums_keep_their_ends() -> None:
    terms = tuple((1, Symbol(f"x[{n}]")) for n in range(20))
    found = abridged(Product((whole(2), Sum(terms))))
    assert isinstance(found, Product)
    inner = found.factors[1]
    assert isinstance(inner, Sum)
    dots = Sign("⋯ (20 terms)", r"\cdots_{\text{20 terms}}")
    assert inner.terms == (*terms[:5], (1, dots), terms[-1])
    assert abridged(Sum(terms[:8])) == Sum(terms[:8])


def test_operations_decide_what_takes_long(formulas, monkeypatch) -> None:
    equations = formulas.equations
    assert not is_large(equations)
    assert not accelerations_are_large(equations)
    monkeypatch.setattr("lagcli.equations.presentation.extent._OPERATIONS", 5)
    assert is_large(equations)
    assert accelerations_are_large(equations)
    text = render(equations, "text", steps=True, full=True)
    assert "They are long; --full writes them out." not in text
