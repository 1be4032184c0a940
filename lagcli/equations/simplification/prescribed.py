"""Prescribed functions of time by the names of their definitions: y_b for r sin(w t)."""

from __future__ import annotations

from symengine import Basic, Integer, Mul, Number, Pow, Symbol

from lagcli.model.model import TIME, Model


class PrescribedNames:
    """Writes products that are definitions of time alone by their names.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        fixed = {TIME, *map(Symbol, model.parameters)}
        self._known: dict[Basic, Basic] = {}
        self._factors: list[tuple[Basic, dict[Basic, int]]] = []
        for name, definition in model.definitions.items():
            value = definition.value
            if not isinstance(value, Mul) or "[" in name:
                continue
            used, factors = value.free_symbols, _whole_powers(value)
            if TIME in used and used <= fixed and factors:
                self._factors.append((Symbol(name), factors))

    def __call__(self, e: Basic) -> Basic:
        """Return an expression in which such products are names."""
        if not self._factors or TIME not in e.free_symbols or isinstance(e, Symbol):
            return e
        known = self._known.get(e)
        if known is None:
            known = self._known[e] = self._named(e.func(*map(self, e.args)))
        return known

    def _named(self, e: Basic) -> Basic:
        if not isinstance(e, Mul):
            return e
        for name, factors in self._factors:
            powers = {base: int(n) for base, n in map(_power, e.args) if isinstance(n, Integer)}
            count = min(powers.get(base, 0) // n for base, n in factors.items())
            if count > 0:
                e = e * name**count / Mul(*(base ** (n * count) for base, n in factors.items()))
        return e


def _power(e: Basic) -> tuple[Basic, Basic]:
    return e.args if isinstance(e, Pow) else (e, Integer(1))


def _whole_powers(product: Mul) -> dict[Basic, int]:
    """Return the factors of a product with their exponents; none if one is not a whole power."""
    found: dict[Basic, int] = {}
    for base, n in map(_power, product.args):
        if isinstance(base, Number) or not isinstance(n, Integer) or int(n) < 1:
            return {}
        found[base] = int(n)
    return found
