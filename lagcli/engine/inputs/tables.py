"""Inputs of a model as known functions of time."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from lagcli.engine.inputs.functions import InputFunctions, interpolated

if TYPE_CHECKING:
    from lagcli.model.model import Model


@lru_cache(maxsize=4)
def input_functions(model: Model) -> InputFunctions:
    """Return the known functions of time of a model's inputs.

    Parameters
    ----------
    model : Model

    Returns
    -------
    InputFunctions
        In the model's order.
    """
    return InputFunctions(
        tuple(
            interpolated(
                name,
                np.array(x.data.times),
                np.array(x.data.values),
                x.interpolation,
                x.extend,
            )
            for name, x in model.inputs.items()
        )
    )
