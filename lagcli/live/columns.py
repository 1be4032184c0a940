"""The numbers of a sample in a page: columns of the core, and expressions that the page draws."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import symengine as se
from symengine import Basic

from lagcli.columns import ColumnName, read_column_name, read_dotted_name
from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.column_expressions import FROM_ENTRIES, REPORTED, column_expression
from lagcli.model.model import TIME, acceleration, coordinate, multiplier, velocity
from lagcli.simulations.resources import DerivedTape
from lagcli.simulations.simulation import Simulation

#: Scalar columns that the engine does not report, but for the energy balance.
_COMPUTED = tuple(name for name in FROM_ENTRIES if name != "energy_balance")
#: Columns that forces with jumps change on the surfaces of these: `simulations.surfaces`.
_OF_SURFACES = ("power_applied", "power_constraint", "power_friction", "residual_equation")


class LiveColumns:
    """Places of columns in the samples of a page: t, q, v, a, λ, the derived values, W.

    Parameters
    ----------
    simulation : Simulation

    Attributes
    ----------
    named : dict of str to int
        Places of the columns of results, by their names.
    """

    def __init__(self, simulation: Simulation):
        self.model, self.equations = simulation.model, simulation.equations
        system = self.system = simulation.system
        self._tape = DerivedTape(system)
        self._outputs: list[int] = []
        self.named = self._of_state()
        if system.constraints:
            names = [str(ColumnName("constraint_force", coordinate=q)) for q in system.coordinates]
            self.named |= zip(names, self.add(self._tape.forces), strict=True)
        reported = [*REPORTED, *system.outputs]
        self.named |= zip(reported, self.add(self._tape.reported), strict=True)
        expressions = [column_expression(self.equations, name) for name in _COMPUTED]
        self.named |= zip(_COMPUTED, self.evaluate(expressions), strict=True)
        self.named |= self._residuals()
        if system.has_kinks:
            for name in _OF_SURFACES:
                del self.named[name]

    def _of_state(self) -> dict[str, int]:
        system, names = self.system, ["t"]
        for quantity in ("q", "v", "a"):
            names += [str(ColumnName(quantity, coordinate=q)) for q in system.coordinates]
        names += [str(ColumnName("multipliers", c)) for c in system.constraints]
        return {name: place for place, name in enumerate(names)}

    def _residuals(self) -> dict[str, int]:
        """Return the places of φ and ψ; without rows with limits, which may slip."""
        system = self.system
        rows = () if system.switching is None else system.switching.rows
        limited = {row.row for row in rows if row.limit is not None}
        eq = self.equations
        named: dict[str, Basic] = {}
        for i, c in enumerate(eq.constraints):
            if i in limited:
                continue
            if i in system.holonomic:
                named[str(ColumnName("residual_position", c.constraint.name))] = c.position
            named[str(ColumnName("residual_velocity", c.constraint.name))] = c.velocity
        return dict(zip(named, self.evaluate(named.values()), strict=True))

    def add(self, registers: Iterable[int]) -> list[int]:
        """Add registers of the tape to the derived values; return their places in samples."""
        first = self._tape.unknowns + len(self._outputs)
        added = [*registers]
        self._outputs += added
        return [*range(first, first + len(added))]

    def force(self, constraint: int, at: int) -> int:
        """Return the register of λ b of a constraint on a coordinate."""
        return self._tape.force_terms.get((constraint, at), self._tape.builder.zero)

    def total(self, registers: Sequence[int]) -> int:
        """Return the register of a sum."""
        total = self._tape.builder.zero
        for register in registers:
            total = self._tape.builder.plus(total, register)
        return total

    def evaluate(self, expressions: Iterable[Basic]) -> list[int]:
        """Add expressions in t, q, v, a, λ, constraint forces and parameters."""
        expressions = list(expressions)
        if not expressions:
            return []
        model, names = self.model, self.model.coordinate_names
        state = [TIME, *map(coordinate, names), *map(velocity, names), *map(acceleration, names)]
        state += map(multiplier, model.constraint_names)
        free: set[Basic] = set().union(*(x.free_symbols for x in expressions))
        forces = sorted(
            (s for s in free - {*state} if read_dotted_name(s.name) is not None), key=str
        )
        functions = input_functions(model)
        parameters = [se.Symbol(name) for name in model.parameters]
        tape = compile_tape(expressions, [*state, *forces], parameters, functions)
        builder, first = self._tape.builder, self._tape.unknowns
        inputs = [
            *range(first),
            *map(self._force_named, forces),
            *range(first, first + len(parameters)),
            *range(builder.inputs - functions.size, builder.inputs),
        ]
        return self.add(builder.splice(tape, inputs))

    def _force_named(self, symbol: Basic) -> int:
        """Return the register of the constraint force of a symbol."""
        coordinates, constraints = self.model.coordinate_names, self.model.constraint_names
        named = read_column_name(symbol.name, coordinates, constraints)
        assert named is not None
        at = coordinates.index(named.coordinate)
        if named.constraint:
            return self.force(constraints.index(named.constraint), at)
        return self.total([self.force(i, at) for i in range(len(constraints))])

    def tape(self) -> Tape:
        """Return the tape of the derived values."""
        return self._tape.builder.finish(self._outputs)
