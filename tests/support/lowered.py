"""A model's System with the values of its parameters."""

from __future__ import annotations

from typing import NamedTuple

from lagcli.engine.lowering.lower import lower
from lagcli.engine.system import System
from lagcli.equations.derivation.lagrange import derive
from lagcli.model.model import Model


class Lowered(NamedTuple):
    """A System and the values of its parameters."""

    system: System
    p: tuple[float, ...]


def lowered(model: Model) -> Lowered:
    """Derive a model and lower its equations."""
    return Lowered(lower(derive(model)), tuple(model.parameter_values.values()))
