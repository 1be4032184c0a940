"""A flat tape of operations, and what collects them.

A tape is data: a list of operations on numbered registers, in an order in which every operand is
ready. Equal operations are one (hash-consing). Nothing in a tape is code.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from lagcli.engine.inputs.functions import NO_FUNCTIONS, InputFunctions
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
        The registers to read at the end.
    parameters : int
        Number of inputs that stay the same along a run: the last ones, but for these:
    rhs_inputs : int
        Number of inputs at the end that only outputs requested apart depend on.
    deferred : tuple of int
        Numbers of outputs, the last ones, that are requested apart from the others and from each
        other: only when they are needed.
    output_subsets : tuple of tuples of int
        Sets of outputs that are also requested without the rest.
    isomorphic : tuple of tuples of int
        Sets of results that are likely used alike, such as one of each body.
    functions : InputFunctions
        Known functions of time, whose pieces are the last of the inputs that stay the same. The
        interpreters find them from t, the first input, and are not given them.
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
        """Return the tape of some outputs alone, with no operation that these do not need."""
        wanted = [self.outputs[i] for i in outputs]
        code, fixed = _needed(self, wanted), self.inputs + len(self.constants)
        if len(code) == len(self.code):
            return self._replace(outputs=tuple(wanted))
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


def _needed(tape: Tape, registers: Iterable[int]) -> list[tuple[int, int, int, int, int]]:
    """Return the operations of a tape that some of its registers depend on."""
    needed, code = set(registers), []
    for line in reversed(tape.code):
        if line[1] in needed:
            needed.update(line[2 : 2 + ARITY[line[0]]])
            code.append(line)
    return code[::-1]


_UNUSED = ((), (), (0, 0), (0,), ())  # operands, by the number of used ones and one
_COMMUTATIVE = {Op.ADD, Op.MUL, Op.EQ, Op.NE, Op.AND, Op.OR}


class Builder:
    """Collects operations; equal ones are one.

    Registers are counted as inputs, then −1 − constant, then inputs + operation until the end.

    Parameters
    ----------
    inputs : int
    parameters, rhs_inputs : int
        Numbers of inputs that stay the same along a run, and of those after them; see Tape.
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
        """Take over a tape's operations, its inputs being the first here; return its outputs."""
        return self._splice(tape, range(tape.inputs), tape.code, tape.outputs)

    def splice(
        self, tape: Tape, inputs: Sequence[int], outputs: Iterable[int] | None = None
    ) -> list[int]:
        """Take over the operations that outputs of a tape depend on.

        Parameters
        ----------
        tape : Tape
        inputs : sequence of int
            The registers here that stand for the tape's inputs; those that the outputs do not
            depend on may be left out at the end.
        outputs : iterable of int, optional
            Numbers of the outputs; all of them without.

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
        # 0.0 and -0.0 are equal keys: the sign of a zero constant has no meaning in a model
        return -1 - self.constants.setdefault(float(value), len(self.constants))

    def emit(self, op: Op, *operands: int) -> int:
        """Return the register of an operation's result."""
        if op in _COMMUTATIVE and self.order(operands[0]) > self.order(operands[1]):
            operands = operands[::-1]
        return self.new((op, *operands))

    def new(self, key: tuple[int, ...]) -> int:
        """Return the register of an operation on operands, which are in order."""
        register = self.operations.get(key)
        if register is None:
            register = self.operations[key] = self.inputs + len(self.operations)
            self.note(key[0], register, key[1:])
        return register

    def note(self, op: int, register: int, operands: tuple[int, ...]) -> None:
        """Note what a new register depends on."""
        if all(x < 0 or x in self.invariant for x in operands):
            self.invariant.add(register)

    def order(self, register: int) -> tuple[int, ...]:
        """Return what the operands of commutative operations are ordered by."""
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
        place += range(first + shift - 1, first - 1, -1)  # constants are counted from the end
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
