"""Units of conserved quantities."""

from __future__ import annotations

from lagcli.equations.symmetry.conserved import ConservedQuantity
from lagcli.model.dimensions.deriving import symbolic_unit
from lagcli.model.expression.dimension import ENERGY, Dimension, product, same, unit_of
from lagcli.model.expression.units import read_unit
from lagcli.model.model import Model, velocity


def conserved_unit(model: Model, quantity: ConservedQuantity) -> str | None:
    """Return the SI unit of a conserved quantity; None if it is unknown.

    A quantity that is conserved for the values of the parameters may contain these as numbers
    without units. Its unit is then that of h, or of its terms ∂L/∂q̇_i ξ_i if they have the same.
    """
    unit = symbolic_unit(model, quantity.expression)
    if unit is None or quantity.general:
        return unit
    if quantity.time != 0:
        return unit_of(ENERGY)
    parts = []
    for i, component in quantity.field.items():
        rate = symbolic_unit(model, velocity(model.coordinate_names[i]))
        shift = symbolic_unit(model, component)
        if rate is None or shift is None:
            return None
        momentum = product(ENERGY, read_unit(rate).dimension, -1)
        parts.append(product(momentum, read_unit(shift).dimension))
    whole, *others = parts
    if not isinstance(whole, Dimension):
        return None
    if not all(isinstance(x, Dimension) and same(x, whole) for x in others):
        return None
    return unit if same(whole, read_unit(unit).dimension) else unit_of(whole._replace(rad=0))
