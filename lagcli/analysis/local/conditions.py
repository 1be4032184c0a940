"""Conditions on a steady motion: expressions that have given values."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lagcli.analysis.local.gradients import Gradients, Point
from lagcli.arrays import Array
from lagcli.engine.tape.interpreter import ScalarTape

if TYPE_CHECKING:
    from symengine import Basic

    from lagcli.analysis.local.local_equations import LocalEquations
    from lagcli.equations.derivation.lagrange import Equations


class MeasuredExpression(NamedTuple):
    """An expression in q, v, t and the parameters with its derivatives.

    Parameters
    ----------
    value : ScalarTape
    by_position, by_velocity : Gradients
    expression : expression
    """

    value: ScalarTape
    by_position: Gradients
    by_velocity: Gradients
    expression: Basic

    @classmethod
    def of(cls, eq: Equations, expression: Basic) -> MeasuredExpression:
        """Compile an expression."""
        import symengine as se

        from lagcli.engine.inputs.tables import input_functions
        from lagcli.engine.tape.compiler import compile_tape
        from lagcli.model.model import TIME

        tape = compile_tape(
            [expression],
            [TIME, *eq.q, *eq.v, *eq.a, *eq.multipliers],
            [se.Symbol(name) for name in eq.model.parameters],
            input_functions(eq.model),
        )
        by_q, by_v = (Gradients.of(eq, [expression], symbols) for symbols in (eq.q, eq.v))
        return cls(ScalarTape(tape), by_q, by_v, expression)


class Condition(NamedTuple):
    """An expression, or the rate of a symmetry, that has a given value.

    Parameters
    ----------
    text : str
        As given: ``omega(e).z``, ``theta``, ``rate(J_1)``.
    target : float
        The value, SI.
    measured : MeasuredExpression or None
        The expression; None for a rate.
    rate : int
        The place of the rate among the unknown speeds.
    """

    text: str
    target: float
    measured: MeasuredExpression | None
    rate: int = -1

    def residual(self, point: Point, speeds: Array, local: LocalEquations) -> tuple[float, float]:
        """Return the difference from the given value, and the scale of its rounding errors."""
        if self.measured is None:
            return float(speeds[self.rate]) - self.target, abs(self.target) or local.rate
        value = float(self.measured.value(point.inputs())[0])
        by_q, by_v, _ = self.slopes(point, speeds)
        terms = np.abs(by_q) @ local.lengths + np.abs(by_v) @ (local.rate * local.lengths)
        return value - self.target, max(abs(self.target), abs(value), float(terms)) or 1.0

    def slopes(self, point: Point, speeds: Array) -> tuple[Array, Array, Array]:
        """Return the derivatives with respect to q, v and s at given q and v."""
        by_speed = np.zeros(len(speeds))
        if self.measured is None:
            by_speed[self.rate] = 1.0
            return np.zeros(len(point.q)), np.zeros(len(point.q)), by_speed
        by_q = self.measured.by_position.at(point)[0]
        return by_q, self.measured.by_velocity.at(point)[0], by_speed
