"""Conserved quantities of a model, evaluated along a run."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import symengine as se

from lagcli.arrays import Array
from lagcli.columns import ColumnName
from lagcli.engine.contract import Block
from lagcli.engine.inputs.tables import input_functions
from lagcli.engine.tape.compiler import compile_tape
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.symmetry.conserved import monitored_quantities
from lagcli.model.model import TIME


class Monitor(NamedTuple):
    """Evaluates conserved quantities.

    Parameters
    ----------
    formulas : mapping of str to str
        The quantities in terms of momenta and Jacobi's integral, by name.
    tape : Tape, optional
        (t, q, v, parameters) → the quantities.
    units : mapping of str to str
        Units of their columns, if known.
    """

    formulas: Mapping[str, str] = MappingProxyType({})
    tape: Tape | None = None
    units: Mapping[str, str] = MappingProxyType({})

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the quantities."""
        return tuple(self.formulas)

    def __call__(self, block: Block, p: tuple[float, ...]) -> Array:
        """Return the values at the samples of a block, (nt, ni)."""
        count = len(block.time)
        if self.tape is None:
            return np.empty((count, 0))
        values = run_arrays(self.tape, [block.time, *block.q.T, *block.v.T, *p], count)
        return np.ascontiguousarray(values.T)


#: A monitor without quantities.
NO_MONITOR = Monitor()


def monitor_of(equations: Equations) -> Monitor:
    """Return a monitor of the conserved quantities of a model other than its energy.

    The energy balance already shows the drift of the energy. Finding the quantities takes a few per
    cent of the time before the first step; in a large model only coordinates that do not occur are
    considered.
    """
    eq = equations
    quantities = monitored_quantities(eq)
    if not quantities:
        return NO_MONITOR
    from lagcli.model.dimensions.deriving import symbolic_unit

    parameters = [se.Symbol(name) for name in eq.model.parameters]
    tape = compile_tape(
        [q.expression for q in quantities],
        [TIME, *eq.q, *eq.v],
        parameters,
        input_functions(eq.model),
    )
    units = {
        str(ColumnName("conserved", conserved=q.name)): unit
        for q in quantities
        if (unit := symbolic_unit(eq.model, q.expression)) is not None
    }
    return Monitor({q.name: q.in_momenta for q in quantities}, tape, units)
