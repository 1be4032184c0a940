"""Tapes: flat lists of operations, and their builder.

A tape is data: a list of operations on numbered registers, in an order in which every operand is
ready. Equal operations are merged (hash-consing). A tape contains no code.

`Arithmetic` emits operations with simplification of zeros, ones and signs; results are unchanged.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from lagcli.engine.tape.inputs import NO_FUNCTIONS, InputFunctions
from lagcli.engine.tape.operations import ARITY, Op


class Tape(NamedTuple):
    """Operations on a register file: inputs first, then constants, then results.

    Parameters
    ----------
    inputs : int
        Number of input registers.
    constants : tuple of float
        Values of the registers after the inputs.
    code : tuple of (op, destination, a, b, c)
        `op` is the number of an `Op`; unused operands are 0.
    outputs : tuple of int
        The registers of the outputs.
    parameters : int
        Number of inputs that are constant along a run: the last ones, except the following:
    rhs_inputs : int
        Number of inputs at the end that only deferred outputs depend on.
    deferred : tuple of int
        Indices of outputs, the last ones, that are computed separately from the others and from
        each other: only when needed.
    output_subsets : tuple of tuples of int
        Sets of outputs that can also be computed without the rest.
    isomorphic : tuple of tuples of int
        Sets of results that are likely used in the same way, such as one of each body.
    functions : InputFunctions
        Known functions of time, whose pieces are the last of the constant inputs. The interpreters
        determine them from t, the first input.
    """

    inputs: int
    constants: tuple[float, ...]
    code: tuple[tuple[int, int, int, int, int], ...]
    outputs: tuple[int, ...]
    parameters: int = 0
    rhs_inputs: int = 0
    deferred: tuple[int, ...] = ()
    output_subsets: tuple[tuple[int, ...], ...] = ()
    isomorphic: tuple[tuple[int, ...], ...] = ()
    functions: InputFunctions = NO_FUNCTIONS

    @property
    def registers(self) -> int:
        """Size of the register file."""
        return self.inputs + len(self.constants) + len(self.code)

    def selected(self, outputs: Iterable[int]) -> Tape:
        """Return a tape of some outputs, with only the operations that these need.

        Unless these are all outputs in their order, none is deferred, and there are no subsets.
        """
        wanted = [self.outputs[i] for i in outputs]
        if wanted == list(self.outputs):
            return self
        if not wanted:
            return Tape(self.inputs, (), (), (), self.parameters, functions=self.functions)
        code, fixed = _needed(self, wanted), self.inputs + len(self.constants)
        if len(code) == len(self.code):
            return self._replace(
                outputs=tuple(wanted), rhs_inputs=0, deferred=(), output_subsets=()
            )
        place = [*range(self.registers)]
        for to, line in enumerate(code, fixed):
            place[line[1]] = to
        return Tape(
            self.inputs,
            self.constants,
            tuple([(op, place[to], place[a], place[b], place[c]) for op, to, a, b, c in code]),
            tuple([place[x] for x in wanted]),
            self.parameters,
            functions=self.functions,
        )

    @property
    def read(self) -> set[int]:
        """The inputs on which the outputs depend."""
        registers = set(self.outputs)
        for op, _, *operands in _needed(self, self.outputs):
            registers.update(operands[: ARITY[op]])
        return {i for i in registers if i < self.inputs}


def _needed(tape: Tape, registers: Iterable[int]) -> list[tuple[int, int, int, int, int]]:
    """Return the operations of a tape on which some of its registers depend."""
    needed, code = set(registers), []
    for line in reversed(tape.code):
        if line[1] in needed:
            needed.update(line[2 : 2 + ARITY[line[0]]])
            code.append(line)
    return code[::-1]


_UNUSED = ((), (), (0, 0), (0,), ())  # operands, by the number of used ones plus one
COMMUTATIVE = {Op.ADD, Op.MUL, Op.EQ, Op.NE, Op.AND, Op.OR}


class Builder:
    """Builder of tapes; merges equal operations.

    Until the end, registers are numbered as inputs, then −1 − constant, then inputs + operation.

    Parameters
    ----------
    inputs : int
    parameters, rhs_inputs : int
        Numbers of constant inputs, and of those after them; see Tape.
    functions : InputFunctions, optional
        See Tape.
    """

    def __init__(
        self,
        inputs: int,
        parameters: int = 0,
        rhs_inputs: int = 0,
        functions: InputFunctions = NO_FUNCTIONS,
    ):
        self.inputs, self.parameters, self.rhs_inputs = inputs, parameters, rhs_inputs
        self.functions = functions
        self.constants: dict[float, int] = {}
        self.operations: dict[tuple[int, ...], int] = {}
        self.invariant = set(range(inputs - rhs_inputs - parameters, inputs - rhs_inputs))

    def extend(self, tape: Tape) -> list[int]:
        """Append a tape's operations, with its inputs as the first ones here; return its
        outputs."""
        if not self.operations:
            first = self.inputs
            place = [*range(tape.inputs), *map(self.constant, tape.constants)]
            place += range(first, first + len(tape.code))
            keys = [
                (op, place[a], place[b], place[c])[: 1 + ARITY[op]] for op, _, a, b, c in tape.code
            ]
            operations = dict(zip(keys, range(first, first + len(keys)), strict=True))
            if len(operations) == len(keys):  # none is equal to another
                self.operations = operations
                for key, register in operations.items():
                    self.note(key[0], register, key[1:])
                return [place[x] for x in tape.outputs]
        return self._splice(tape, range(tape.inputs), tape.code, tape.outputs)

    def splice(
        self, tape: Tape, inputs: Sequence[int], outputs: Iterable[int] | None = None
    ) -> list[int]:
        """Append the operations on which outputs of a tape depend.

        Parameters
        ----------
        tape : Tape
        inputs : sequence of int
            The registers here that replace the tape's inputs; trailing ones may be omitted if the
            outputs do not depend on them.
        outputs : iterable of int, optional
            Indices of the outputs; all by default.

        Returns
        -------
        list of int
            Their registers here.
        """
        wanted = tape.outputs if outputs is None else [tape.outputs[i] for i in outputs]
        return self._splice(tape, inputs, _needed(tape, wanted), wanted)

    def _splice(
        self,
        tape: Tape,
        inputs: Sequence[int],
        code: Iterable[tuple[int, int, int, int, int]],
        outputs: Iterable[int],
    ) -> list[int]:
        place = dict(enumerate(inputs))
        place |= {i: self.constant(x) for i, x in enumerate(tape.constants, tape.inputs)}
        for op, to, a, b, c in code:
            operands = tuple([place[x] for x in (a, b, c)[: ARITY[op]]])
            place[to] = self.new((op, *operands))
        return [place[x] for x in outputs]

    def constant(self, value: float) -> int:
        """Return the register of a number."""
        # 0.0 and -0.0 are equal keys: a model does not distinguish them
        return -1 - self.constants.setdefault(float(value), len(self.constants))

    def emit(self, op: int, *operands: int) -> int:
        """Return the register of an operation's result."""
        if op in COMMUTATIVE and self.order(operands[0]) > self.order(operands[1]):
            operands = operands[::-1]
        return self.new((op, *operands))

    def new(self, key: tuple[int, ...]) -> int:
        """Return the register of an operation on ordered operands."""
        register = self.operations.get(key)
        if register is None:
            register = self.operations[key] = self.inputs + len(self.operations)
            self.note(key[0], register, key[1:])
        return register

    def note(self, op: int, register: int, operands: tuple[int, ...]) -> None:
        """Record the properties of a new register."""
        for x in operands:
            if x >= 0 and x not in self.invariant:
                return
        self.invariant.add(register)

    def order(self, register: int) -> tuple[Any, ...]:
        """Return the sort key of the operands of commutative operations."""
        return (register,)

    def finish(
        self,
        outputs: Iterable[int],
        deferred: tuple[int, ...] = (),
        output_subsets: tuple[tuple[int, ...], ...] = (),
        isomorphic: Iterable[Iterable[int]] = (),
    ) -> Tape:
        """Return the tape."""
        first, shift = self.inputs, len(self.constants)
        place = [*range(first), *range(first + shift, first + shift + len(self.operations))]
        place += range(first + shift - 1, first - 1, -1)  # constants are numbered from the end
        code = [
            (int(key[0]), to, *[place[x] for x in key[1:]], *_UNUSED[len(key)])
            for to, key in enumerate(self.operations, first + shift)
        ]
        return Tape(
            first,
            tuple(self.constants),
            tuple(code),
            tuple([place[x] for x in outputs]),
            self.parameters,
            self.rhs_inputs,
            deferred,
            output_subsets,
            tuple([tuple([place[x] for x in some]) for some in isomorphic]),
            self.functions,
        )


class Arithmetic(Builder):
    """A builder that omits operations without effect, and propagates signs as far as possible.

    Sums absorb the signs of their terms, so negations remain only where nothing is added.
    """

    def __init__(
        self,
        inputs: int,
        parameters: int = 0,
        other: int = 0,
        functions: InputFunctions = NO_FUNCTIONS,
    ):
        super().__init__(inputs, parameters, other, functions)
        self.zero, self.one = self.constant(0.0), self.constant(1.0)
        self.opposite: dict[int, int] = {}  # operand of a negation

    def note(self, op: int, register: int, operands: tuple[int, ...]) -> None:
        """Record the properties of a new register."""
        super().note(op, register, operands)
        if op == Op.NEG:
            self.opposite[register] = operands[0]

    def negative(self, a: int) -> int:
        """Return −a."""
        if a == self.zero:
            return a
        return self.opposite[a] if a in self.opposite else self.emit(Op.NEG, a)

    def plus(self, a: int, b: int) -> int:
        """Return a + b."""
        if a == self.zero:
            return b
        if b == self.zero:
            return a
        if b in self.opposite:
            return self.minus(a, self.opposite[b])
        if a in self.opposite:
            return self.emit(Op.SUB, b, self.opposite[a])
        return self.emit(Op.ADD, a, b)

    def minus(self, a: int, b: int) -> int:
        """Return a − b."""
        if b == self.zero:
            return a
        if a == self.zero:
            return self.negative(b)
        if b in self.opposite:
            return self.plus(a, self.opposite[b])
        if a in self.opposite:
            return self.negative(self.plus(self.opposite[a], b))
        return self.emit(Op.SUB, a, b)

    def times(self, a: int, b: int) -> int:
        """Return a b."""
        if self.zero in (a, b):
            return self.zero
        if a == self.one:
            return b
        if b == self.one:
            return a
        if a in self.opposite:
            return self.negative(self.times(self.opposite[a], b))
        if b in self.opposite:
            return self.negative(self.times(a, self.opposite[b]))
        return self.emit(Op.MUL, a, b)

    def inverse(self, a: int) -> int:
        """Return 1 / a."""
        if a in self.opposite:
            return self.negative(self.inverse(self.opposite[a]))
        return a if a == self.one else self.emit(Op.DIV, self.one, a)

    def magnitude(self, a: int) -> int:
        """Return |a|."""
        a = self.opposite.get(a, a)
        return a if a in (self.zero, self.one) else self.emit(Op.ABS, a)
