"""Lever arms: what a multiplier is multiplied by to give the force that an arrow shows."""

from __future__ import annotations

import re
from fractions import Fraction

from lagcli.model.dimensions.deriving import text_of
from lagcli.model.expression.units import read_unit
from lagcli.model.model import Model
from lagcli.pictures.page import unit


def arm_units(model: Model) -> dict[str, str]:
    """Return the unit of F/λ of each constraint whose force is drawn alone; "" if it is unknown.

    It is 1 where λ is a force, a length where λ is a force per length, as of x² + y² = l², and the
    reciprocal of a length where λ is a moment.
    """
    if model.view is None:
        return {}
    forces = [arrow for arrow in model.view.vectors if arrow.quantity == "force"]
    return {a.parts[0]: _arm(model, a.parts[0]) for a in forces if len(a.parts) == 1}


def _arm(model: Model, constraint: str) -> str:
    stated = model.units.of_multiplier(constraint) if model.units.stated else None
    if stated is None:
        return ""
    found = read_unit("N").times(read_unit(stated).power(Fraction(-1)))
    text = text_of(found.dimension) or ""
    return unit(re.sub(r"^1/(\w+)$", r"\1^-1", text))
