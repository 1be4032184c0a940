"""What follows from some parameters and initial values: the others, as expressions of them."""

from __future__ import annotations

from collections.abc import Collection

import symengine as se
from symengine import Basic

from lagcli.model.expression.building import build
from lagcli.model.expression.quantities import constant
from lagcli.model.model import Model, Written
from lagcli.model.names.scope import ModelScope
from lagcli.model.symbols import Context

_CONTEXT = Context("", coordinates=False, definitions=False, time=False)


def dependent_values(model: Model, varied: Collection[str]) -> dict[str, Basic]:
    """Return the parameters and initial values that vary with some of them.

    Parameters
    ----------
    model : Model
    varied : collection of str
        Names of parameters, coordinates and velocities (``phi'``), as the model has them; no
        structural parameter, on which the very list of names depends.

    Returns
    -------
    dict of str to expression
        In SI, by name, in symbols of the varied ones; these among them. What is not there keeps
        the model's value.
    """
    resolver = _Resolver(model, varied)
    for name in model.parameters:
        resolver.parameter(name)
    found = {name: value for name, value in resolver.known.items() if value.free_symbols}
    for table, primes in ((model.initial_positions, ""), (model.initial_velocities, "'")):
        for coordinate, entry in table.items():
            name = coordinate + primes
            if name in varied:
                found[name] = se.Symbol(name)
            elif entry.written is not None:
                value = resolver.expression(entry.written)
                if value.free_symbols:
                    found[name] = value
    return found


class _Resolver:
    """Expressions of parameters, with everything but the varied ones put in."""

    def __init__(self, model: Model, varied: Collection[str]):
        self.model = model
        self.known: dict[str, Basic] = {
            name: se.Symbol(name) for name in model.parameters if name in varied
        }

    def parameter(self, name: str) -> Basic:
        """Return a parameter's value: a number unless it depends on a varied one."""
        waiting = [name]
        while waiting:  # by hand: a chain of a thousand parameters is no recursion
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
                inserted = self.inserted(written)
                if inserted.free_symbols:
                    value = inserted
            self.known[top] = value
            waiting.pop()
        return self.known[name]

    def expression(self, written: Written) -> Basic:
        """Return the value of an expression of parameters, in SI."""
        found = self.built(written)
        for symbol in found.free_symbols:
            self.parameter(symbol.name)
        return self.inserted(found)

    def built(self, written: Written) -> Basic:
        """Return an expression in the symbols of the parameters, in SI."""
        scope = ModelScope(self.model.names, _CONTEXT, tuple(written.indices))
        scope.values.update(written.indices)
        return build(written.tree, scope).value * constant(float(written.factor))

    def inserted(self, expression: Basic) -> Basic:
        """Return an expression with what is known in place of the symbols."""
        return expression.xreplace({s: self.known[s.name] for s in expression.free_symbols})
