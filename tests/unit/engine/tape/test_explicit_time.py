"""Which functions of time a tape depends on."""

from __future__ import annotations

import math

from lagcli.engine.tape.explicit_time import explicit_functions
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Builder, Tape


def tape_of(parameters: int = 1) -> Builder:
    """A tape of t, q, v, and parameters."""
    return Builder(3 + parameters, parameters)


def test_nonlinear_functions_of_time_and_of_time_and_state() -> None:
    builder = tape_of()
    angle = builder.emit(Op.MUL, 3, 0)  # w t
    force = builder.emit(Op.MUL, 1, builder.emit(Op.SIN, angle))  # q sin(w t)
    other = builder.emit(Op.COS, builder.emit(Op.SUB, 1, angle))
    found = explicit_functions([builder.finish([force, other])], 2)
    assert found is not None
    assert found.inputs == 4
    assert ScalarTape(found)((0.5, 2.0, 0.0, 3.0))[:2] == [
        math.sin(1.5),
        math.cos(0.5),
    ]


def test_functions_of_the_state_alone_and_linear_ones_of_time_are_left_out() -> None:
    builder = tape_of()
    sine = builder.emit(Op.SIN, 1)
    slope = builder.emit(Op.DIV, builder.emit(Op.MUL, 3, 0), 3)  # linear in t
    tape = builder.finish([builder.emit(Op.ADD, sine, slope)])
    assert explicit_functions([tape], 2) is None
    assert explicit_functions([Tape(4, (), (), ())], 2) is None


def test_operations_on_accelerations_are_left_out_of_other_tapes() -> None:
    builder = Builder(5, 1)  # t, q, v, a, p
    of_force = builder.emit(Op.SIN, builder.emit(Op.MUL, 3, 0))
    of_time = builder.emit(Op.EXP, builder.emit(Op.MUL, 4, 0))
    found = explicit_functions([builder.finish([of_force, of_time])], 2)
    assert found is not None
    assert len(found.outputs) == 1
