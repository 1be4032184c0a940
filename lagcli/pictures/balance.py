"""The terms of the equations of motion along a run: the balance that pages show with them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from html import escape
from typing import Any

from symengine import Basic

from lagcli.arrays import Array
from lagcli.columns import BY_NAME
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.terms import EquationTerm, equation_terms, term_expressions
from lagcli.equations.typesetting.mathml import MathmlFormula, equation
from lagcli.equations.typesetting.nodes import IndexedSum, Line, Node, children
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula
from lagcli.equations.typesetting.writer import written_decimals
from lagcli.pictures.column_evaluator import ColumnEvaluator
from lagcli.pictures.page import unit
from lagcli.trajectory.samples import Terms

#: Number of characters of a formula beyond which a label is cut.
_LABEL = 30


class Balance:
    """The terms of equations of motion, and their values along a run.

    As JSON (`to_json`)::

        [{"coordinate": NAME, "label": TEXT, "unit": "N m",
          "terms": [{"side": 0 | 1, "kind": KIND, "constraint": NAME | null, "label": TEXT,
                     "values": […]}]}]

    Values include the sign of the term. At each sample, those of side 0 and of side 1 have the same
    sum.

    Parameters
    ----------
    formulas : Formulas
    lines : mapping of int to Line
        The printed equations, by the index of their coordinates; those in index form, and those
        with parameters that events set, are omitted.

    Attributes
    ----------
    model : Model
    terms : dict of int to tuple of EquationTerm
        The terms of the remaining equations.
    expressions : list of expressions
        Their values, in order.
    """

    def __init__(self, formulas: Formulas, lines: Mapping[int, Line]):
        model = self.model = formulas.model
        # their values along the run are not in the result
        changed = model.changing_parameters
        self.terms: dict[int, tuple[EquationTerm, ...]] = {}
        self.expressions: list[Basic] = []
        for i, line in lines.items():
            if line.span is not None or any(map(_indexed, line.sides)):
                continue
            terms = equation_terms(line)
            values = term_expressions(terms, model)
            if terms and not any(changed & {s.name for s in x.free_symbols} for x in values):
                self.terms[i] = terms
                self.expressions += values
        self._text = TextFormula(Notation(model), written_decimals(model))

    @cached_property
    def _evaluator(self) -> ColumnEvaluator:
        return ColumnEvaluator(self.model, self.expressions)

    @property
    def needs(self) -> tuple[str, ...]:
        """The fields of `Samples` that `to_json` needs."""
        return self._evaluator.needs

    def to_json(
        self,
        columns: Mapping[str, Array],
        terms: Terms,
        parameters: Mapping[str, float],
        units: Mapping[str, str],
        numbers: Callable[[Array], Any],
    ) -> list[dict[str, Any]]:
        """Return the equations with the values of their terms as JSON values.

        Parameters
        ----------
        columns : mapping of str to arrays
            The fields of `Samples` in ``needs``.
        terms : Terms
            Terms of ``constraint_force_by``.
        parameters : mapping of str to float
            Values in SI.
        units : mapping of str to str
            SI units, by name.
        numbers : callable
            Function that converts an array, (nt,), or (1,) if constant.
        """
        values = self._evaluator.values(columns, terms, parameters)
        return self.described(units, map(numbers, values))

    def described(self, units: Mapping[str, str], values: Iterable[Any]) -> list[dict[str, Any]]:
        """Return the equations as JSON values.

        Parameters
        ----------
        units : mapping of str to str
            SI units, by name.
        values : iterable of JSON values
            The values of ``expressions``.
        """
        values = iter(values)
        names = self.model.coordinate_names
        force = BY_NAME["constraint_force"]
        return [
            {
                "coordinate": names[i],
                "label": self._text.names.text(names[i]),
                "unit": unit(force.unit_at(units.get(names[i]))),
                "terms": [
                    {
                        "side": term.side,
                        "kind": term.kind,
                        "constraint": term.constraints[0] if len(term.constraints) == 1 else None,
                        "label": self._label(term),
                        "values": next(values),
                    }
                    for term in each
                ],
            }
            for i, each in self.terms.items()
        ]

    def _label(self, term: EquationTerm) -> str:
        """Return the term with its sign as text, cut if it is long."""
        text = ("−" if term.sign < 0 else "") + self._text.text(term.node)
        return text if len(text) <= _LABEL else f"{text[: _LABEL - 1].rstrip()}…"


def live_equation(
    i: int, line: Line, balance: Balance, formula: MathmlFormula, text: TextFormula
) -> str:
    """Return an equation of motion in HTML, and the place of its balance if it has one.

    Parameters
    ----------
    i : int
        Index of its coordinate.
    line : Line
    balance : Balance
    formula, text
        See `lagcli.equations.typesetting.mathml.equation`.
    """
    if i not in balance.terms:
        return equation(line, formula, text)
    name = escape(balance.model.coordinate_names[i])
    shown = equation(line, formula, text, terms=True)
    return f'<div class="live" data-coordinate="{name}">{shown}</div>'


def _indexed(node: Node) -> bool:
    """Whether a formula contains a sum over an index."""
    return isinstance(node, IndexedSum) or any(map(_indexed, children(node)))
