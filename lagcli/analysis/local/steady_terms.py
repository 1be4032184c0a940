"""What a steady motion holds, and the steady motion next to the initial values."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from lagcli.analysis.local.active_set import ActiveSet
from lagcli.analysis.local.contact_mode import SwitchedModel
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.relative import RelativeProblem, SymmetryField
from lagcli.analysis.local.steady import (
    Condition,
    MeasuredExpression,
    SteadyProblem,
    SteadyState,
    completed,
    none_found,
    velocity_coordinate,
)
from lagcli.arrays import Array
from lagcli.engine.constraints.initial import NoStart, consistent_state
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.symmetry.conserved import ConservedQuantity, conserved_quantities
from lagcli.equations.symmetry.units import conserved_unit
from lagcli.errors import NumericalError, UsageError
from lagcli.model.dimensions.deriving import expression_unit
from lagcli.model.expression.dimension import ENERGY, product, unit_of
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.units import read_unit
from lagcli.model.model import Model
from lagcli.model.names.expansion import expand
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.model.values import given_expression

_RATE = re.compile(r"rate\(\s*([^()\s]+)\s*\)")
_PROBES = 4  # number of states at which the rates that an expression measures are compared
_SAME = 1e-9

#: Values by text; None for a speed that is looked for.
Given = Mapping[str, float | None]


class SteadyTerms:
    """What ``--steady`` gives, read for a model.

    Parameters
    ----------
    model : Model
    given : mapping of str to float or None
        ``phi'``: a velocity; ``rate(J_1)``: the rate of a symmetry that `lagcli.check` finds;
        ``J_1``: its momentum; or an expression in q and v. None for a velocity or a rate that is
        looked for.

    Raises
    ------
    UsageError
        A name is unknown, or an expression has no value.
    ModelError
        An expression has an error.
    """

    def __init__(self, model: Model, given: Given):
        self.model = model
        self.velocities: dict[str, float | None] = {}
        self.others: dict[str, float | None] = {}
        for text, value in given.items():
            if value is not None and not np.isfinite(value):
                raise UsageError(f"--steady {text}={value}: give a finite value")
            if is_velocity(model.coordinate_names, text):
                self.velocities[velocity_coordinate(model.coordinate_names, text)] = value
            else:
                self.others[text] = value
        for text, value in self.others.items():
            if value is None and not _RATE.fullmatch(text):
                raise UsageError(
                    f'--steady `{text}` has no value; write --steady "{text}=1". Only velocities'
                    " and rates of symmetries can be looked for"
                )

    @property
    def held(self) -> dict[str, float]:
        """The velocities with values, by coordinate."""
        return {name: x for name, x in self.velocities.items() if x is not None}

    @property
    def plain(self) -> bool:
        """Whether only velocities with values are given, or none."""
        return not self.others and None not in self.velocities.values()

    @property
    def by_symmetry(self) -> bool:
        """Whether the motion is along symmetries, so that no velocity is unknown."""
        return not self.plain and None not in self.velocities.values()

    @property
    def named(self) -> dict[str, float | None]:
        """All values, by name."""
        return {**{f"{name}'": x for name, x in self.velocities.items()}, **self.others}

    def problem(self, local: LocalEquations) -> SteadyProblem:
        """Return the problem of these motions."""
        if self.plain:
            return SteadyProblem(local, self.held)
        if self.by_symmetry:
            return self.relative(local)
        rates = [text for text in self.others if _RATE.fullmatch(text)]
        if rates:
            name = next(name for name, x in self.velocities.items() if x is None)
            raise UsageError(
                f"--steady {rates[0]} is the rate of a symmetry; it cannot be combined with the"
                f' unknown velocity --steady "{name}\'"'
            )
        unknown = [name for name, x in self.velocities.items() if x is None]
        if len(unknown) > len(self.others):
            raise UsageError(
                f"--steady {unknown[0]}': to look for a velocity, give another value of the motion,"
                f" such as that of a coordinate; or give its value, as in --steady"
                f' "{unknown[0]}\'=10"'
            )
        conditions = [self._condition(local, text, value) for text, value in self.others.items()]
        return SteadyProblem(local, self.held, unknown, conditions)

    # motions along symmetries

    def relative(self, local: LocalEquations) -> RelativeProblem:
        """Return the problem of motions along the symmetries of the model.

        If each value given is that of a rate, the other rates are zero; otherwise, those without a
        value are looked for.

        Raises
        ------
        UsageError
            The model has no symmetry.
        """
        expressions = {
            **{f"{name}'": x for name, x in self.velocities.items()},
            **{text: x for text, x in self.others.items() if not _RATE.fullmatch(text)},
        }
        conditions = [
            self._condition(local, text, x) for text, x in expressions.items() if x is not None
        ]
        every = [SymmetryField.of(local, x) for x in self._quantities(local)]
        if not every:
            first = next(iter(self.named))
            raise UsageError(
                f"--steady {first}: lagcli check finds no symmetry of {self.model.name} along which"
                ' it can move steadily; give velocities of coordinates, as in --steady "phi\'=10"'
            )
        rates = {
            self._place(every, text): x for text, x in self.others.items() if _RATE.fullmatch(text)
        }
        names = [*(c.text for c in conditions), *(every[k].name for k in rates)]
        weights = None
        if None not in rates.values():
            weights = self._weights(local, every, conditions, list(rates))
        fields = list(every)
        if weights is not None:
            fields = [_combined(n, every, x) for n, x in zip(names, weights.T, strict=True)]
        conditions += [
            Condition(every[k].name, x, None, k if weights is None else len(conditions) + place)
            for place, (k, x) in enumerate(rates.items())
            if x is not None
        ]
        return RelativeProblem(local, fields, conditions, every)

    @cached_property
    def _momenta(self) -> dict[int, list[ConservedQuantity]]:
        return {}

    def _quantities(self, local: LocalEquations) -> list[ConservedQuantity]:
        key = id(local)
        if key not in self._momenta:
            conserved = conserved_quantities(local.equations).quantities
            self._momenta[key] = [x for x in conserved if x.kind == "momentum"]
        return self._momenta[key]

    def _place(self, every: Sequence[SymmetryField], text: str) -> int:
        match = _RATE.fullmatch(text)
        assert match is not None
        known = [field.name.removeprefix("rate(").removesuffix(")") for field in every]
        if match[1] not in known:
            remedy = did_you_mean(nearest(match[1], known)) or f"there are {', '.join(known)}"
            raise UsageError(
                f"--steady {text}: `{match[1]}` is not a momentum that lagcli check finds; {remedy}"
            )
        return known.index(match[1])

    def _condition(self, local: LocalEquations, text: str, value: float | None) -> Condition:
        assert value is not None
        model = self.model
        known = {*model.coordinate_names, *model.parameters, *model.definitions, *model.outputs}
        momenta = {}
        if _is_name(text) and text not in known:
            momenta = {x.name: x.expression for x in self._quantities(local)}
        if text in momenta:
            return Condition(text, value, MeasuredExpression.of(local.equations, momenta[text]))
        eq = local.equations
        expression = eq.outputs.get(text)
        if expression is None:
            expression = given_expression(self.model, "--steady", text)
        symbols = expression.free_symbols
        if not symbols.isdisjoint({*eq.a, *eq.multipliers}):
            raise UsageError(
                f"--steady {text}: it depends on accelerations or multipliers; give an expression"
                " in coordinates and velocities"
            )
        if symbols.isdisjoint({*local.equations.q, *local.equations.v}):
            raise UsageError(f"--steady {text}: it does not depend on the motion")
        return Condition(text, value, MeasuredExpression.of(local.equations, expression))

    def _weights(
        self,
        local: LocalEquations,
        every: Sequence[SymmetryField],
        conditions: Sequence[Condition],
        rates: Sequence[int],
    ) -> Array | None:
        """Return combinations of the symmetries that change one given value by 1 each.

        The spin of a top about its axis is the rate of such a symmetry.

        Returns
        -------
        (fields, conditions + rates) array or None
            None if there are none: a value does not only depend on rates.
        """
        known, count = np.eye(len(every))[list(rates)], len(conditions) + len(rates)
        rows = []
        for q in _probes(local):
            fields = np.array([field.at(q) for field in every]).T
            point = local.start_point(
                q, np.zeros(len(q)), np.zeros(len(local.system.constraints)), local.p
            )
            slopes = [c.slopes(point, np.empty(0)) for c in conditions]
            if any(np.any(by_q) for by_q, _, _ in slopes):
                return None
            measured = np.array([by_v @ fields for _, by_v, _ in slopes])
            rows.append(np.vstack([measured.reshape(-1, len(every)), known]))
        target = np.tile(np.eye(count), (len(rows), 1))
        matrix = np.vstack(rows)
        weights = np.linalg.pinv(matrix, rcond=_SAME) @ target
        exact = np.abs(matrix @ weights - target).max(initial=0.0) < _SAME
        return np.where(np.abs(weights) > _SAME, weights, 0.0) if exact else None


def steady_unit(model: Model, text: str) -> str | None:
    """Return the SI unit of an expression, a momentum or a rate; None if it is unknown."""
    try:
        unit = expression_unit(model, expand(parse(text), model.names))
    except ExpressionError:
        return None  # reported where it is built
    if unit is not None or not model.units.stated:
        return unit
    rate = _RATE.fullmatch(text)
    name = rate[1] if rate else text
    found = conserved_quantities(derive(model)).quantities
    momentum = next((x for x in found if x.name == name and x.kind == "momentum"), None)
    unit = None if momentum is None else conserved_unit(model, momentum)
    if unit is None or not rate:
        return unit
    return unit_of(product(ENERGY, read_unit(unit).dimension, -1))  # momentum · rate is an energy


def is_velocity(names: Sequence[str], text: str) -> bool:
    """Whether a text is the name of a velocity, or written as one."""
    stem = text.removesuffix("'") if text.endswith("'") else text.removesuffix("_dot")
    return stem != text and (stem in names or stem.isidentifier())


def _combined(name: str, every: Sequence[SymmetryField], weights: Array) -> SymmetryField:
    """Return the symmetry whose rate is a given value, and with it that of no other value."""
    matrix = sum(x * field.matrix for x, field in zip(weights, every, strict=True))
    shift = sum(x * field.shift for x, field in zip(weights, every, strict=True))
    return SymmetryField(name, np.asarray(matrix), np.asarray(shift))


def _is_name(text: str) -> bool:
    return re.fullmatch(r"[^\W\d][\w\[\],.]*", text) is not None


def _probes(local: LocalEquations) -> list[Array]:
    """Return random positions on the constraints."""
    random, q = np.random.default_rng(1), local.start.state.q
    free, probes = np.zeros(len(q), bool), []
    for _ in range(_PROBES):
        guess = q + 0.7 * local.lengths * random.standard_normal(len(q))
        given = local.evaluator(local.p).state(local.t, guess, np.zeros(len(q)))
        try:
            probes.append(consistent_state(local.system, given, free, free).state.q)
        except NoStart:
            continue
    return probes or [q]


def nearest_steady_state(model: Model, steady: Given) -> SteadyState:
    """Return the equilibrium, or steady motion, to which Newton's method leads from the start.

    With contacts, it is one that satisfies 0 ≤ φ ⊥ λ ≥ 0: see `ActiveSet`. If no motion with
    constant independent velocities has the given ones, it is one along symmetries.

    Raises
    ------
    UsageError
        A velocity cannot be held.
    ModelError, NumericalError
        There is no consistent start, or no equilibrium is found.
    """
    terms = SteadyTerms(model, steady)
    if model.switches:
        check_switching(model, terms)
        return ActiveSet(SwitchedModel(model), terms.held).nearest()
    local = LocalEquations(model)
    try:
        return _solved(terms.problem(local))
    except (NumericalError, UsageError) as error:
        if terms.by_symmetry or not terms.velocities:
            raise
        try:
            return _solved(terms.relative(local))
        except (NumericalError, UsageError):
            raise error from None


def _solved(problem: SteadyProblem) -> SteadyState:
    """Return the solution from the start."""
    local = problem.local
    q = local.start.state.q
    root = problem.solve(q, local.p)
    if root is None:
        raise none_found(local, problem, q)
    return completed(problem, root)


def check_switching(model: Model, terms: SteadyTerms) -> None:
    """Raise UsageError for terms that steady motions of models with contacts do not support."""
    if not terms.plain:
        name = next(n for n, x in terms.named.items() if n in terms.others or x is None)
        raise UsageError(
            f"--steady {name}: steady motions of models with contacts, friction or limits, as"
            f' {model.name}, hold velocities of coordinates, as in --steady "phi\'=10"'
        )
