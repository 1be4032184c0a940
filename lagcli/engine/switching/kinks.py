"""Kinks: a System with branches as inputs, fixed within a step.

The tapes of a System are not smooth at comparisons, `floor` or `ceil` of the state. In the frozen
System each of these has an input that states the side of zero (or the integers between which) its
function is, so that the integrated functions are smooth; the engine monitors the function, and
changes the side where it vanishes.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from lagcli.engine.switching.partial import PartialFunctions
from lagcli.engine.switching.switching import Switching
from lagcli.engine.system import JacobianTapes, State, System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import ARITY, Op
from lagcli.engine.tape.tape import Builder, Tape

#: Comparisons.
RELATIONS = (Op.LT, Op.LE)
_WHOLE: dict[int, int] = {Op.FLOOR: 1, Op.CEIL: -1}
_NOTHING: frozenset[int] = frozenset()


class Kink(NamedTuple):
    """A function whose sign, or integer part, is a branch.

    Parameters
    ----------
    whole : int
        0: the branch is the sign of the function, 1 or −1; 1: it is its `floor`; −1: its `ceil`.
    timed : bool
        Whether it depends only on t and parameters.
    names : tuple of str
        The coordinates, and velocities (x'), on which it depends.
    """

    whole: int
    timed: bool
    names: tuple[str, ...]


class FrozenSystem(NamedTuple):
    """A System whose last parameters are branches, and the functions that determine them.

    Parameters
    ----------
    system : System
    kinks : tuple of Kink
        The branches follow the parameters of the original System in this order; a function depends
        only on branches of earlier ones.
    functions : Tape
        (t, q, v, parameters) → the functions, then their sizes: the sums of the magnitudes of the
        compared terms.
    report : Tape
        The report tape of the System, with the same branches; its inputs are those of the dynamics
        with a and λ after the velocities.
    """

    system: System
    kinks: tuple[Kink, ...]
    functions: Tape
    report: Tape

    def __hash__(self) -> int:
        """Return the System's: tapes with tables of inputs have none."""
        return hash(self.system)

    def frozen(self, state: State) -> State:
        """Return a state with its branches added to the parameters; zero counts as positive."""
        values, sides = ScalarTape(self.functions), [1.0] * len(self.kinks)
        for _ in range(len(self.kinks) + 1):
            inputs = (state.t, *state.q.tolist(), *state.v.tolist(), *state.p, *sides)
            arguments = values(inputs)
            before, sides = (
                sides,
                [side_of(k, x) for k, x in zip(self.kinks, arguments, strict=False)],
            )
            if sides == before:
                break
        return state._replace(p=(*state.p, *sides))


def side_of(kink: Kink, value: float) -> float:
    """Return the branch of a kink for a value of its function; zero counts as positive."""
    if kink.whole and abs(value) < float("inf"):
        whole = value // 1
        return float(whole if kink.whole > 0 or whole == value else whole + 1)
    return -1.0 if value < 0 else 1.0


@lru_cache(maxsize=4)
def frozen_of(system: System) -> FrozenSystem | None:
    """Return the result of `freeze`, cached for many runs."""
    return freeze(system) if system.has_kinks else None


def freeze(system: System) -> FrozenSystem | None:
    """Return a System with its branches as inputs; None if no branch depends on the state.

    A branch is not frozen if a root, a power or a logarithm may be undefined beyond its kink, or a
    divisor vanishes at it: trial steps may evaluate both.

    Parameters
    ----------
    system : System
    """
    branch_count, excluded = 0, _NOTHING
    while True:
        freezer = _Freezer(system, branch_count, excluded)
        frozen = freezer.system()
        if freezer.partial <= excluded and len(freezer.numbers) == branch_count:
            break
        excluded |= freezer.partial
        branch_count = len(freezer.numbers.keys() - excluded)
    if not branch_count:
        return None
    return FrozenSystem(frozen, freezer.kinks(), freezer.functions(), freezer.report())


class _Freezer:
    """Replaces the comparisons in a System's tapes, up to a maximum number of branches.

    Comparisons are numbered in order, whether frozen or not: ``excluded`` are some of them.
    """

    def __init__(self, system: System, branch_count: int, excluded: frozenset[int]):
        self.original, self.branch_count, self.excluded = system, branch_count, excluded
        self.nq, self.inputs = len(system.coordinates), system.dynamics.inputs
        self.first = self.inputs - system.functions.size  # where branches are inserted
        self.builder = Builder(
            self.inputs + branch_count, system.held + branch_count, 0, system.functions
        )
        self.comparisons: dict[tuple[int, int, int], int] = {}
        self.needs: list[frozenset[int]] = []  # for each comparison, the inputs in its state
        self.numbers: dict[int, int] = {}  # comparison → branch
        self.partial: frozenset[int] = _NOTHING
        self.complete = False

    def system(self) -> System:
        """Return the System with frozen tapes."""
        s = self.original
        return replace(
            s,
            parameters=(*s.parameters, *(f"branch {k}" for k in range(self.branch_count))),
            dynamics=self.tape(s.dynamics),
            constraint=self.tape(s.constraint),
            report=self.tape(s.report, freeze=False),
            events=None if s.events is None else self.tape(s.events, freeze=False),
            switching=self.switching(s.switching or no_switching(s)),
            variation=None if s.variation is None else self.variation,
            parameter_variation=None,
            recursive_form=None if s.recursive_form is None else self.recursive_form,
        )

    def switching(self, s: Switching) -> Switching:
        return replace(
            s,
            limits=self.tape(s.limits),
            impact=self.tape(s.impact, freeze=False),
            forces=None if s.forces is None else self.tape(s.forces),
            force_conditions=None if s.force_conditions is None else self.tape(s.force_conditions),
            actions=None if s.actions is None else self.tape(s.actions, freeze=False),
        )

    def variation(self) -> JacobianTapes:
        """Return the derivatives, with the branches of the System."""
        assert self.original.variation is not None
        given = self.original.variation()
        self.complete = True
        return given._replace(tape=self.tape(given.tape))

    def recursive_form(self) -> System:
        """Return the recursive form, with the branches of the System."""
        assert self.original.recursive is not None
        given = self.original.recursive
        self.complete = True
        return replace(given, dynamics=self.tape(given.dynamics))

    def report(self) -> Tape:
        """Return the report tape with the branches of the System as inputs."""
        self.complete = True
        return self.tape(self.original.report)

    def tape(self, tape: Tape, freeze: bool = True) -> Tape:
        """Return a tape in which comparisons of the state are replaced by branches."""
        branch_count, extra = self.branch_count, tape.inputs - self.inputs  # a and λ
        moving_inputs = 1 + 2 * self.nq
        first = tape.inputs - (self.inputs - self.first)
        new = Builder(
            tape.inputs + branch_count,
            tape.parameters + branch_count,
            tape.rhs_inputs,
            tape.functions,
        )
        place = {i: i if i < first else i + branch_count for i in range(tape.inputs)}
        watch: dict[int, int | None] = {i: i for i in range(moving_inputs)}
        watch |= dict.fromkeys(range(moving_inputs, moving_inputs + extra))
        for i in range(moving_inputs + extra, tape.inputs):
            watch[i] = i - extra if i < first else i - extra + branch_count
        state = {i: frozenset((i,)) for i in range(moving_inputs + extra)}
        for i, x in enumerate(tape.constants, tape.inputs):
            place[i], watch[i] = new.constant(x), self.builder.constant(x)
        partial = PartialFunctions(self.needs, tape, moving_inputs + extra)
        for op, to, *rest in tape.code:
            operands = rest[: ARITY[op]]
            needs = _NOTHING.union(*(state.get(x, _NOTHING) for x in operands))
            watched = [watch[x] for x in operands]
            known = [x for x in watched if x is not None]
            frozen = None
            if freeze and needs and len(known) == len(watched):
                frozen = self.branch(op, known, needs, to, partial)
            if frozen is not None:
                k, flipped = frozen
                if op in _WHOLE:
                    place[to], watch[to] = first + k, self.first + k
                else:
                    for builder, side, out in (
                        (new, first + k, place),
                        (self.builder, self.first + k, watch),
                    ):
                        pair = (side, builder.constant(0.0))
                        out[to] = builder.new((op, *(pair[::-1] if flipped else pair)))
                continue
            if needs:
                state[to] = needs
            place[to] = new.new((op, *[place[x] for x in operands]))
            watch[to] = self.builder.new((op, *known)) if len(known) == len(watched) else None
            partial.operation(op, to, operands, needs)
        if not self.complete:
            self.partial |= partial.excluded
        return new.finish([place[x] for x in tape.outputs], tape.deferred, tape.output_subsets)

    def branch(
        self,
        op: int,
        operands: list[int],
        needs: frozenset[int],
        to: int,
        partial: PartialFunctions,
    ) -> tuple[int, bool] | None:
        """Return the branch that an operation follows, and whether its sign is reversed."""
        if op in _WHOLE:
            a, b, flipped = operands[0], self.builder.constant(0.0), False
        elif op in RELATIONS:
            a, b, flipped = in_order(self.builder, *operands)
        else:
            return None
        key = a, b, _WHOLE.get(op, 0)
        if key not in self.comparisons:
            if self.complete:
                return None
            self.comparisons[key] = len(self.comparisons)
            self.needs.append(needs)
        which = self.comparisons[key]
        partial.comparison(to, which)
        if which in self.excluded:
            return None
        number = self.numbers.setdefault(which, len(self.numbers))
        return (number, flipped) if number < self.branch_count else None

    def kinks(self) -> tuple[Kink, ...]:
        """Return the kinks of the branches."""
        names = (*self.original.coordinates, *(f"{x}'" for x in self.original.coordinates))
        kinks = []
        for (_, _, whole), which in self.comparisons.items():
            if which in self.numbers:
                of = sorted(self.needs[which] - {0})
                kinks.append(Kink(whole, not of, tuple(names[i - 1] for i in of)))
        return tuple(kinks)

    def functions(self) -> Tape:
        """Return the tape of the functions and their sizes."""
        builder, zero = self.builder, self.builder.constant(0.0)
        values, sizes = [], []
        for (a, b, _), which in self.comparisons.items():
            if which not in self.numbers:
                continue
            values.append(a if b == zero else builder.emit(Op.SUB, a, b))
            parts = [builder.emit(Op.ABS, x) for x in (a, b) if x != zero]
            sizes.append(parts[0] if len(parts) == 1 else builder.emit(Op.ADD, *parts))
        outputs = [*values, *sizes]
        return builder.finish(outputs).selected(range(len(outputs)))


def in_order(builder: Builder, a: int, b: int) -> tuple[int, int, bool]:
    """Return the operands of a comparison in a canonical order, and whether they were exchanged:
    the same surface then has one branch.
    """
    zero, flipped = builder.constant(0.0), False
    if a == zero:
        a, b, flipped = b, a, True
    if b == zero:
        if a >= builder.inputs:
            op, *operands = list(builder.operations)[a - builder.inputs]
            if op == Op.NEG:
                a, flipped = operands[0], not flipped
        return a, b, flipped
    return (a, b, flipped) if a > b else (b, a, not flipped)


def no_switching(system: System) -> Switching:
    """Return the Switching of a System without switching."""
    extra = len(system.coordinates) + len(system.constraints)
    held = system.dynamics.parameters
    state = system.dynamics
    empty = Tape(state.inputs + extra, (), (), (), held, functions=state.functions)
    return Switching((), empty, Tape(state.inputs, (), (), (), held, functions=state.functions))
