"""Values of expressions in the names of a loaded model: given beside it, or dependent on others."""

from __future__ import annotations

from collections.abc import Callable, Collection

import symengine as se
from symengine import Basic

from lagcli.model.diagnostics import Diagnostics
from lagcli.model.dimensions.deriving import expression_unit
from lagcli.model.expression.constants import constant
from lagcli.model.expression.units import commensurable, remedy
from lagcli.model.model import Model, Written
from lagcli.model.names.building import build
from lagcli.model.names.draft import Draft, QuantityValue, read_quantity
from lagcli.model.names.namespace import Allowed
from lagcli.model.names.scope import Scope
from lagcli.model.sections.parameters import override_node
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
    draft = draft_of(model, source)
    parsed = draft.parse(node, what)
    expression = None if parsed is None else draft.scalar(parsed, what)
    draft.report.finish()
    assert expression is not None
    return expression


def given_value(
    model: Model, option: str, name: str, text: str, unit_of: Callable[[Model, str], str | None]
) -> float:
    """Return the value of a number with a unit, or of an expression of parameters, SI.

    Parameters
    ----------
    model : Model
    option, name, text : str
        The option, what it gives a value, and the value.
    unit_of : callable
        Function of the model and the name: the SI unit of what has the value, None if it is
        unknown.

    Raises
    ------
    ModelError
        It has an error, another dimension than what it is for, or depends on more than parameters.
    """
    node, what = override_node(option, name, text), f"the value of `{name}`"
    draft = draft_of(model, node.source)
    quantity = read_quantity(draft, node, what)
    number: float | None = None
    if quantity is not None:
        value = QuantityValue(draft, quantity, what, Allowed.PARAMETERS)
        stated = quantity.unit
        if stated is None and quantity.number is None:
            stated = expression_unit(model, quantity.parsed.tree)
        unit = unit_of(model, name) if stated is not None else None
        if stated and unit and not commensurable(stated, unit):
            draft.report.add(
                "units",
                f"`{name}` is in {unit}, and its value in {stated}",
                node.location,
                remedy(unit, stated),
            )
        if quantity.number is not None:
            number = value.number()
        elif (expression := value.expression()) is not None:
            values = {se.Symbol(n): x for n, x in model.parameter_values.items()}
            number = float(expression.subs(values))
    draft.report.finish()
    assert number is not None
    return number


def draft_of(model: Model, source: Source | None = None) -> Draft:
    """Return a draft with the names of a loaded model, for a text, or without one."""
    source = source or Source("", model.path, numbered=False)
    return Draft(source, Mapping(source, (0, 0), (0, 0), {}), Diagnostics([]), names=model.names)


def dependent_values(model: Model, varied: Collection[str]) -> dict[str, Basic]:
    """Return the parameters and initial values that depend on varied ones.

    Parameters
    ----------
    model : Model
    varied : collection of str
        Names of parameters, coordinates and velocities (``phi'``) of the model. Structural
        parameters are not allowed: the list of names itself depends on them.

    Returns
    -------
    dict of str to expression
        Values in SI by name, in symbols of the varied quantities, which are included. All other
        quantities keep the model's values.
    """
    resolver = _Resolver(model, varied)
    for name in model.parameters:
        resolver.parameter(name)
    values = {name: value for name, value in resolver.known.items() if value.free_symbols}
    for table, primes in ((model.initial_positions, ""), (model.initial_velocities, "'")):
        for coordinate, entry in table.items():
            name = coordinate + primes
            if name in varied:
                values[name] = se.Symbol(name)
            elif entry.written is not None:
                value = resolver.expression(entry.written)
                if value.free_symbols:
                    values[name] = value
    return values


def independent_parameters(model: Model) -> list[str]:
    """Return the declared, not structural parameters whose values do not depend on others."""
    resolver, declared = _Resolver(model, ()), model.declared_values
    return [
        name
        for name, parameter in model.parameters.items()
        if name in declared
        and not parameter.structural
        and (parameter.written is None or not resolver.built(parameter.written).free_symbols)
    ]


class _Resolver:
    """Evaluates expressions of parameters, leaving only the varied ones as symbols."""

    def __init__(self, model: Model, varied: Collection[str]):
        self.model = model
        self.known: dict[str, Basic] = {
            name: se.Symbol(name) for name in model.parameters if name in varied
        }

    def parameter(self, name: str) -> Basic:
        """Return a parameter's value: a number unless it depends on a varied one."""
        waiting = [name]
        while waiting:  # iterative: chains may have thousands of parameters
            top = waiting[-1]
            if top in self.known:
                waiting.pop()
                continue
            parameter = self.model.parameters[top]
            value = constant(parameter.value)
            if parameter.written is not None:
                written = self.built(parameter.written)
                missing = [s.name for s in written.free_symbols if s.name not in self.known]
                if missing:
                    waiting += missing
                    continue
                substituted = self.substituted(written)
                if substituted.free_symbols:
                    value = substituted
            self.known[top] = value
            waiting.pop()
        return self.known[name]

    def expression(self, written: Written) -> Basic:
        """Return the value of an expression of parameters, in SI."""
        expression = self.built(written)
        for symbol in expression.free_symbols:
            self.parameter(symbol.name)
        return self.substituted(expression)

    def built(self, written: Written) -> Basic:
        """Build an expression in the symbols of the parameters, in SI."""
        scope = Scope(self.model.names, "", Allowed.PARAMETERS, written.indices)
        scope.values.update(written.indices)
        return build(written.tree, scope).value * constant(float(written.factor))

    def substituted(self, expression: Basic) -> Basic:
        """Substitute known values for symbols."""
        return expression.xreplace({s: self.known[s.name] for s in expression.free_symbols})
