"""Expressions and values that are given beside a model file, on the command line."""

from __future__ import annotations

import symengine as se
from symengine import Basic

from lagcli.model.diagnostics import Diagnostics
from lagcli.model.draft import Draft
from lagcli.model.expression.quantities import evaluate, formula_of, read_quantity
from lagcli.model.model import Model
from lagcli.model.sections.parameters import override_node
from lagcli.model.symbols import Context
from lagcli.model.yaml.source import Mapping, Scalar, Source


def given_expression(model: Model, option: str, text: str) -> Basic:
    """Return an expression in t, q, v and the parameters, with the names of the model.

    Parameters
    ----------
    model : Model
    option : str
        The option, for messages.
    text : str

    Raises
    ------
    ModelError
        It has an error.
    """
    source, what = Source(text, f"{option} {text}", numbered=False), f"`{text}`"
    node = Scalar(source, (0, 0), (0, len(text)), text)
    draft = _draft(model, source)
    parsed = draft.parse(node, what)
    found = None if parsed is None else draft.scalar(parsed, Context(what))
    draft.report.finish()
    assert found is not None
    return found


def given_value(model: Model, option: str, name: str, text: str) -> float:
    """Return the value of a number with a unit, or of an expression of parameters, SI.

    Raises
    ------
    ModelError
        It has an error, or depends on more than parameters.
    """
    node, what = override_node(option, name, text), f"the value of `{name}`"
    draft = _draft(model, node.source)
    quantity = read_quantity(draft, node, what, draft.names)
    found: float | None = None
    if quantity is not None:
        context = Context(what, coordinates=False, definitions=False, time=False)
        formula = formula_of(draft, quantity, context, draft.names)
        expression = None if formula is None else formula.scalar()
        if expression is not None:
            values = {se.Symbol(n): x for n, x in model.parameter_values.items()}
            found = float(expression.subs(values)) * float(quantity.factor)
        elif formula is None:
            found = evaluate(draft, quantity, None, what)
    draft.report.finish()
    assert found is not None
    return found


def _draft(model: Model, source: Source) -> Draft:
    """Return a draft with the names of a loaded model."""
    return Draft(source, Mapping(source, (0, 0), (0, 0), {}), Diagnostics([]), names=model.names)
