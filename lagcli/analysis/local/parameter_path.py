"""All parameters of a model as functions of one of them."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array
from lagcli.errors import UsageError
from lagcli.model.model import Model
from lagcli.model.spelling import did_you_mean, nearest


class ParameterPath:
    """The parameters as functions of one of them, including those defined by it.

    Parameters
    ----------
    model : Model
    name : str
        A parameter on which the structure of the model does not depend.

    Attributes
    ----------
    followers : tuple of str
        The parameters that change, ``name`` among them.

    Raises
    ------
    UsageError
        There is no such parameter, or coordinates, constraints or sums depend on it.
    """

    def __init__(self, model: Model, name: str):
        import symengine as se

        from lagcli.engine.tape.compiler import compile_tape
        from lagcli.engine.tape.interpreter import ScalarTape
        from lagcli.model.expression.functions import derivative
        from lagcli.model.values import dependent_values

        if name not in model.parameters:
            known = list(model.parameters)
            listed = f"the parameters are {', '.join(known[:20])}" if known else "it has none"
            raise UsageError(
                f"`{name}` is not a parameter of {model.name};"
                f" {did_you_mean(nearest(name, known)) or listed}"
            )
        if model.parameters[name].structural:
            raise UsageError(
                f"`{name}` cannot be varied continuously: coordinates, constraints or sums of the"
                " model depend on it"
            )
        symbol = se.Symbol(name)
        found = dependent_values(model, [name])
        self.name = name
        self.followers = tuple(n for n in model.parameters if n in found)
        values = [found[n] for n in self.followers]
        self._places = [list(model.parameters).index(n) for n in self.followers]
        slopes = [derivative(value, symbol) for value in values]
        self._tape = ScalarTape(compile_tape([*values, *slopes], [symbol]))

    def values(self, p: tuple[float, ...], value: float) -> tuple[float, ...]:
        """Return p with another value of the parameter and the parameters that depend on it."""
        found = list(p)
        for place, x in zip(self._places, self._tape([value]), strict=False):
            found[place] = x
        return tuple(found)

    def slopes(self, value: float) -> Array:
        """Return the derivatives of the followers with respect to the parameter, (followers,)."""
        return np.array(self._tape([value])[len(self._places) :])
