"""Derivatives of names other than coordinates: of parameters, the time, π and inputs."""

from __future__ import annotations

from collections.abc import Mapping

from lagcli.model.expression.tokens import error_at
from lagcli.model.expression.trees import Name

#: The highest derivative of an input in an expression.
_HIGHEST = 2


def check_derivative(inputs: Mapping[str, int], name: Name, text: str, primes: int) -> None:
    """Raise ExpressionError for a derivative that does not exist.

    Parameters
    ----------
    inputs : mapping of str to int
        The inputs, and the number of times each can be differentiated.
    name : Name
    text, primes : str, int
        The name of an input, of a parameter, ``t`` or ``pi``, and the order of the derivative.
    """
    if primes <= min(inputs.get(text, 0), _HIGHEST):
        return
    shown = text + "'" * primes
    if text in ("t", "pi"):
        raise error_at("constant", f"`{text}` has no time derivative", name)
    if text not in inputs:
        message = f"`{text}` is a parameter: its time derivative is zero"
        raise error_at("constant", message, name)
    if primes > _HIGHEST:
        message = f"the highest derivative of an input is `{text}''`"
        raise error_at("too-many-primes", message, name)
    kind = "linear between its rows" if primes == _HIGHEST else "a step function"
    raise error_at(
        "not-smooth",
        f"`{text}` is {kind}: it has no derivative `{shown}`",
        name,
        f"give `{text}` the interpolation `cubic`",
    )
