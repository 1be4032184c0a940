"""A System split in two: constraints that always hold, and a layer of rows that switch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

from lagcli.engine.core.program import Program, assemble
from lagcli.engine.switching.signs import SignedLaws, with_signs
from lagcli.engine.system import JacobianTapes, Pattern, System
from lagcli.engine.tape.tape import Arithmetic, Builder, Tape


class SplitSystem:
    """A System without its switched rows, and these rows.

    Parameters
    ----------
    system : System
        With ``switching``.

    Attributes
    ----------
    rows : tuple of int
        The constraints that switch, as in ``Switching.rows``, then those that always hold and
        limit friction: they are solved for together with it.
    base : tuple of int
        The other constraints.
    """

    def __init__(self, system: System):
        assert system.switching is not None
        self.system, self.switching = system, system.switching
        switched = [row.row for row in self.switching.rows]
        limiting = {constraint for _, constraint in self.switching.limit_pattern}
        limiting |= {row.normal for row in self.switching.rows if row.normal is not None}
        self.rows = (*switched, *sorted(limiting.difference(switched)))
        left = set(range(len(system.constraints))).difference(self.rows)
        self.base = tuple(sorted(left))
        #: The parameters that are weights of constraints in M.
        self.weights = {x.row: x.weight for x in self.switching.rows if x.weight is not None}
        self._programs: dict[int, tuple[Tape, Program]] = {}

    @cached_property
    def fixed(self) -> System:
        """The System of the constraints that always hold, without reports, events and switching.

        It equals the System of a model without other constraints.
        """
        system, base = self.system, self.base
        left_out: dict[str, Any] = {
            "report": system.report.selected(()),
            "outputs": (),
            "events": None,
            "switching": None,
            "parameter_variation": None,
        }
        if len(base) == len(system.constraints):
            return replace(system, **left_out)
        pattern, dynamics = self._dynamics(base)
        number = {constraint: i for i, constraint in enumerate(base)}
        holonomic = [k for k in system.holonomic if k in number]
        variation = system.variation
        return replace(
            system,
            **left_out,
            constraints=tuple(system.constraints[k] for k in base),
            holonomic=tuple(number[k] for k in holonomic),
            jacobian_pattern=tuple(
                (number[i], j) for i, j in system.jacobian_pattern if i in number
            ),
            mass_pattern=pattern,
            dynamics=dynamics,
            constraint=self._constraint(base, holonomic),
            nonlinear=tuple(number[k] for k in system.nonlinear if k in number),
            variation=None if variation is None else lambda: self._variation(variation()),
        )

    def program(self, tape: Tape) -> Program:
        """Return the program of one of the System's tapes, which is made once for all runs."""
        if id(tape) not in self._programs:  # the tape is kept, and with it its identity
            self._programs[id(tape)] = tape, assemble(tape)
        return self._programs[id(tape)][1]

    @cached_property
    def laws(self) -> SignedLaws:
        """Limits, forces, and conditions on forces, with signs as inputs."""
        layout = self.system.sample_layout
        return with_signs(self.switching, range(layout.v.stop, layout.multipliers.stop))

    @property
    def pattern(self) -> list[tuple[int, int]]:
        """Places (row, coordinate) of the nonzero entries of the rows' B."""
        number = {constraint: i for i, constraint in enumerate(self.rows)}
        return [(number[i], j) for i, j in self.system.jacobian_pattern if i in number]

    @property
    def places(self) -> list[int]:
        """Index of the φ of `functions` for each row; −1 if it has none."""
        rows = set(self.rows)
        holonomic = (k for k in self.system.holonomic if k in rows)
        place = {k: i for i, k in enumerate(holonomic)}
        return [place.get(k, -1) for k in self.rows]

    @cached_property
    def functions(self) -> Tape:
        """(t, q, v, p) → φ, B entries, b_0, γ, the scales of ψ and of φ, of the rows."""
        system, rows = self.system, self.rows
        given = system.dynamics
        builder = Builder(given.inputs, given.parameters, functions=given.functions)
        inputs = range(builder.inputs)
        c, d = system.constraint_layout, system.dynamics_layout
        chosen = set(rows)
        positions = [n for n, k in enumerate(system.holonomic) if k in chosen]
        own = [
            *_places(c.position, positions),
            *_places(c.jacobian, self._entries(rows)),
            *_places(c.drift, rows),
        ]
        scales = [*_places(c.velocity_scale, rows), *_places(c.position_scale, positions)]
        outputs = builder.splice(system.constraint, inputs, [*own, *scales])
        accelerations = builder.splice(system.dynamics, inputs, _places(d.rhs, rows))
        return builder.finish([*outputs[: len(own)], *accelerations, *outputs[len(own) :]])

    @cached_property
    def gaps(self) -> Tape:
        """(t, q, v, p) → φ of the rows, in the order of `places`."""
        return self.functions.selected(range(sum(i >= 0 for i in self.places)))

    def _entries(self, constraints: Sequence[int]) -> list[int]:
        chosen = set(constraints)
        return [n for n, (i, _) in enumerate(self.system.jacobian_pattern) if i in chosen]

    def _dynamics(self, base: Sequence[int]) -> tuple[Pattern, Tape]:
        """Return the places of M and the tape of M, f, B, γ and the power, without the rows."""
        system = self.system
        layout, given = system.dynamics_layout, system.dynamics
        outputs = [
            *range(layout.forcing.stop),
            *_places(layout.jacobian, self._entries(base)),
            *_places(layout.rhs, base),
            layout.power.start,
        ]
        if not self.weights:
            return system.mass_pattern, given.selected(outputs)
        builder = Arithmetic(given.inputs, given.parameters, functions=given.functions)
        found = builder.splice(given, range(given.inputs))
        mass = dict(zip(system.mass_pattern, found[layout.mass_matrix], strict=True))
        forcing = found[layout.forcing]
        for row, parameter in self.weights.items():
            weight = 1 + 2 * len(system.coordinates) + parameter
            entries = [
                (j, found[layout.jacobian.start + n])
                for n, (i, j) in enumerate(system.jacobian_pattern)
                if i == row
            ]
            rhs = found[layout.rhs.start + row]
            for i, b in entries:
                weighted = builder.times(weight, b)
                forcing[i] = builder.plus(forcing[i], builder.times(weighted, rhs))
                for j, other in entries:
                    own = mass.get((i, j), builder.zero)
                    mass[i, j] = builder.plus(own, builder.times(weighted, other))
        pattern = tuple(sorted(mass))
        rest = [found[n] for n in outputs[layout.forcing.stop :]]
        tape = builder.finish([*(mass[place] for place in pattern), *forcing, *rest])
        return pattern, tape

    def _constraint(self, base: Sequence[int], holonomic: Sequence[int]) -> Tape:
        layout = self.system.constraint_layout
        positions = [self.system.holonomic.index(k) for k in holonomic]
        outputs = [
            *_places(layout.position, positions),
            *_places(layout.jacobian, self._entries(base)),
            *_places(layout.drift, base),
            *_places(layout.position_scale, positions),
            *_places(layout.velocity_scale, base),
        ]
        return self.system.constraint.selected(outputs)

    def _without_multipliers(self, tape: Tape, outputs: Sequence[int]) -> Tape:
        """Return a tape of (t, q, v, a, λ, p) at λ = 0 of the rows."""
        layout, n = self.system.sample_layout, len(self.base)
        first, parameters = layout.multipliers.start, tape.inputs - layout.multipliers.stop
        builder = Builder(first + n + parameters, tape.parameters, functions=tape.functions)
        inputs = [*range(first)] + [builder.constant(0.0)] * len(self.system.constraints)
        for i, constraint in enumerate(self.base):
            inputs[first + constraint] = first + i
        inputs += range(first + n, builder.inputs)
        return builder.finish(builder.splice(tape, inputs, outputs))

    def _variation(self, given: JacobianTapes) -> JacobianTapes:
        number = {constraint: i for i, constraint in enumerate(self.base)}
        counts, outputs, first = self.system.counts, list[int](), 0
        kept: list[tuple[tuple[int, int], ...]] = []
        for pattern, is_row in (
            (given.force_position, False),
            (given.force_velocity, False),
            (given.rhs_position, True),
            (given.rhs_velocity, True),
        ):
            wanted = [n for n, (i, _) in enumerate(pattern) if not is_row or i in number]
            kept.append(
                tuple((number[i], j) if is_row else (i, j) for i, j in (pattern[n] for n in wanted))
            )
            outputs += [first + n for n in wanted]
            first += len(pattern)
        power = len(given.power_position) + len(given.power_velocity) + counts.nq
        outputs += range(first, first + power)
        first += power
        outputs += [*(first + k for k in self.base), first + counts.nc]
        return given._replace(
            force_position=kept[0],
            force_velocity=kept[1],
            rhs_position=kept[2],
            rhs_velocity=kept[3],
            tape=self._without_multipliers(given.tape, outputs),
        )


def _places(part: slice, numbers: Sequence[int]) -> list[int]:
    return [part.start + n for n in numbers]
