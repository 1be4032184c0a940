"""Signs of functions of forces, fixed within a step.

Limits of friction, forces, and conditions on forces have kinks where functions of multipliers or
accelerations vanish, as |λ| of a guide at λ = 0. In their tapes, the sign of such a function is an
input, so that they are smooth within a step; the engine monitors the function, and changes the sign
where it vanishes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from lagcli.engine.switching.kinks import RELATIONS, in_order
from lagcli.engine.switching.partial import PartialFunctions
from lagcli.engine.switching.switching import Switching
from lagcli.engine.tape.operations import ARITY
from lagcli.engine.tape.tape import Arithmetic, Builder, Tape


class SignedLaws(NamedTuple):
    """Tapes that take signs, and the functions with these signs.

    All tapes take (t, q, v, a, λ, signs, parameters).

    Parameters
    ----------
    signs : int
        Number of signs.
    functions : Tape
        → the functions, then their sizes: the sums of the magnitudes of the compared terms. A
        function depends only on signs of earlier ones.
    limits : Tape
    forces, force_conditions : Tape or None
        Those of Switching.
    """

    signs: int
    functions: Tape
    limits: Tape
    forces: Tape | None
    force_conditions: Tape | None


def with_signs(switching: Switching, forces: range) -> SignedLaws:
    """Return tapes with the signs of functions of forces as inputs.

    A comparison is not replaced if a root, a power or a logarithm may be undefined with the other
    sign, where trial steps may evaluate it.

    Parameters
    ----------
    switching : Switching
    forces : range
        The places of a and λ among the inputs of its tapes.
    """
    signs = _Signs(switching.limits, forces)
    given = switching.limits, switching.forces, switching.force_conditions
    laws = [tape for tape in given if tape is not None]
    for tape in laws:
        signs.compare(tape)
    signs.number()
    replaced = [None if tape is None else signs.replaced(tape) for tape in given[1:]]
    return SignedLaws(
        len(signs.numbers), signs.functions(laws), signs.replaced(switching.limits), *replaced
    )


class _Signs:
    """The comparisons of functions of forces in some tapes with the same inputs."""

    def __init__(self, tape: Tape, forces: range):
        self.forces, self.first = forces, forces.stop
        self.builder = Builder(tape.inputs, tape.parameters, functions=tape.functions)
        self.comparisons: dict[tuple[int, int], int] = {}
        self.needs: list[frozenset[int]] = []  # for each comparison, the inputs that change
        self.places: dict[int, dict[int, tuple[int, bool]]] = {}  # by tape: result → comparison
        self.excluded: frozenset[int] = frozenset()
        self.numbers: dict[int, int] = {}  # comparison → sign

    def compare(self, tape: Tape) -> None:
        """Find the comparisons of a tape."""
        builder, found = self.builder, self.places.setdefault(id(tape), {})
        place = {i: i for i in range(tape.inputs)}
        place |= {i: builder.constant(x) for i, x in enumerate(tape.constants, tape.inputs)}
        needs = {i: frozenset((i,)) for i in range(self.first)}
        partial = PartialFunctions(self.needs, tape, self.first)
        nothing: frozenset[int] = frozenset()
        for op, to, *rest in tape.code:
            operands = rest[: ARITY[op]]
            values = [place[x] for x in operands]
            needed = nothing.union(*(needs.get(x, nothing) for x in operands))
            if needed:
                needs[to] = needed
            if op in RELATIONS and any(x in self.forces for x in needed):
                a, b, flipped = in_order(builder, *values)
                which = self.comparisons.setdefault((a, b), len(self.comparisons))
                if which == len(self.needs):
                    self.needs.append(needed)
                found[to] = which, flipped
                partial.comparison(to, which)
            place[to] = builder.new((op, *values))
            partial.operation(op, to, operands, needed)
        self.excluded |= partial.excluded

    def number(self) -> None:
        """Number the signs of the comparisons that are replaced."""
        kept = [which for which in self.comparisons.values() if which not in self.excluded]
        self.numbers = {which: i for i, which in enumerate(kept)}

    def replaced(self, tape: Tape) -> Tape:
        """Return a tape in which signs replace the functions compared."""
        if not self.numbers:
            return tape
        builder = self.with_inputs(tape)
        place = self.spliced(builder, tape)
        return builder.finish([place[x] for x in tape.outputs])

    def functions(self, laws: Sequence[Tape]) -> Tape:
        """Return the tape of the functions and their sizes."""
        if not self.numbers:
            return laws[0].selected(())
        builder = self.with_inputs(laws[0])
        functions: dict[int, int] = {}
        sizes: dict[int, int] = {}
        for tape in laws:
            place = self.spliced(builder, tape)
            for _, to, a, b, _ in tape.code:
                which, flipped = self.places[id(tape)].get(to, (-1, False))
                number = self.numbers.get(which)
                if number is not None and number not in functions:
                    a, b = place[a], place[b]
                    functions[number] = builder.minus(b, a) if flipped else builder.minus(a, b)
                    sizes[number] = builder.plus(builder.magnitude(a), builder.magnitude(b))
        outputs = [*functions.values(), *sizes.values()]
        return builder.finish(outputs).selected(range(len(outputs)))

    def with_inputs(self, tape: Tape) -> Arithmetic:
        """Return a builder with inputs for the signs."""
        count = len(self.numbers)
        return Arithmetic(tape.inputs + count, tape.parameters, functions=tape.functions)

    def spliced(self, builder: Builder, tape: Tape) -> dict[int, int]:
        """Append the operations of a tape, with signs; return the places of its registers."""
        count, found = len(self.numbers), self.places[id(tape)]
        zero = builder.constant(0.0)
        place = {i: i if i < self.first else i + count for i in range(tape.inputs)}
        place |= {i: builder.constant(x) for i, x in enumerate(tape.constants, tape.inputs)}
        for op, to, *rest in tape.code:
            which, flipped = found.get(to, (-1, False))
            operands = [place[x] for x in rest[: ARITY[op]]]
            if which in self.numbers:
                sign = self.first + self.numbers[which]
                operands = [zero, sign] if flipped else [sign, zero]
            place[to] = builder.new((op, *operands))
        return place
