"""Each kind of equations gives the accelerations of the first kind, at random consistent states."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import symengine as se
from scipy.interpolate import CubicSpline
from shipped import every_model

from lagcli.engine.constraints.initial import NoConsistentState, consistent_state
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.lower import lower
from lagcli.engine.system import State
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.reduction.elimination import (
    solve_accelerations,
    solve_first_kind,
)
from lagcli.equations.reduction.second_kind import Maggi, second_kind
from lagcli.model.loader import load
from lagcli.model.model import as_symbols
from lagcli.simulations.partition import partition
from lagcli.simulations.start import find_start

MODELS = Path(__file__).parents[2] / "models"
NAMES = sorted(file.stem for file in MODELS.glob("*.yaml"))
NONHOLONOMIC = {"chaplygin_sleigh", "knife_edge_incline", "rolling_disk"}
HOLONOMIC = [name for name in NAMES if name not in NONHOLONOMIC]
#: Masses of families: the written-out expressions grow with the square of their number.
SIZES = {"chain": {"N": 4}, "pendulum_chain": {"N": 4}}
COUNT = 20

#: 1e-12 is reached but for the condition of the matrices.
TOLERANCE = 1e-10


class Case:
    """A model, random consistent states, and the engine's accelerations and multipliers there."""

    def __init__(self, name: str):
        self.model = load(MODELS / f"{name}.yaml", set=SIZES.get(name))
        self.equations = derive(self.model)
        self.partition = partition(self.equations)
        system = lower(self.equations)
        start = find_start(self.equations, system, self.model.settings.t_start or 0.0).state
        self.symbols = [se.Symbol("t"), *self.equations.q, *self.equations.v]
        self.symbols += [se.Symbol(p) for p in self.model.parameters]
        evaluator = Evaluator(system, start.p)
        random = np.random.default_rng(5)
        size = np.abs(start.q).max()
        free = np.zeros(len(start.q), bool)
        self.states, self.solutions = [], []
        while len(self.states) < COUNT:
            q = start.q + 0.05 * size * random.normal(size=len(start.q))
            v = start.v + random.normal(size=len(start.q))
            state = State(start.t + random.uniform(0, 0.05), q, v, start.p)
            if name == "parallelogram":  # redundant: its consistent states are known
                q, v = (np.array([x[0], x[0], x[0], 0.0]) for x in (q, v))
                state = State(state.t, q, v, state.p)
            else:
                try:
                    state = consistent_state(system, state, free, free).state
                except NoConsistentState:
                    continue
            self.states.append(state)
            d = evaluator.dynamics(state.t, state.q, state.v)
            zero = np.zeros((len(d.jacobian), len(d.jacobian)))
            matrix = np.block([[d.mass_matrix, -d.jacobian.T], [d.jacobian, zero]])
            # of redundant constraints the small singular values are zero except for rounding
            rcond = 1e-6 if self.partition.surplus else 1e-15
            right = np.concatenate([d.forcing, d.rhs])
            self.solutions.append(np.linalg.lstsq(matrix, right, rcond=rcond)[0])

    def values(self, expressions):
        inputs = self.equations.model.inputs.values()
        names = [se.Symbol(x.name + "'" * order) for x in inputs for order in range(3)]
        splines = [
            CubicSpline(x.data.times, x.data.values, bc_type="clamped")
            for x in inputs  # all of them splines that are held outside their tables
        ]
        known = [as_symbols(x) for x in expressions]
        function = se.Lambdify([*self.symbols, *names], known, cse=True)
        for s in self.states:
            given = [spline(s.t, order) for spline in splines for order in range(3)]
            yield np.asarray(function([s.t, *s.q, *s.v, *s.p, *given]), float).reshape(-1)

    def check_accelerations(self, mass_matrix, forcing):
        n = len(forcing)
        entries = [*(x for row in mass_matrix for x in row), *forcing]
        free = list(self.partition.independent)
        for found, expected in zip(self.values(entries), self.solutions, strict=True):
            a = np.linalg.solve(found[: n * n].reshape(n, n), found[n * n :])
            scale = max(1.0, np.abs(expected[free]).max())
            assert np.abs(a - expected[free]).max() < TOLERANCE * scale

    def check_solved(self, found):
        """Compare fractions with the engine."""
        order = {x: i for i, x in enumerate((*self.equations.a, *self.equations.multipliers))}
        places = [order[x.unknown] for x in found]
        for values, expected in zip(
            self.values(x.numerator / x.denominator for x in found), self.solutions, strict=True
        ):
            wanted = expected[places]
            assert np.abs(values - wanted).max() < TOLERANCE * max(1.0, np.abs(wanted).max())


@cache
def case(name: str) -> Case:
    return Case(name)


@pytest.mark.parametrize("name", every_model(smooth=True))
def test_maggi(name: str) -> None:
    c = case(name)
    if c.partition.independent:
        maggi = Maggi(c.partition)
        c.check_accelerations(maggi.mass_matrix, maggi.forcing)


@pytest.mark.parametrize("name", NAMES)
def test_the_equations_of_maggi_vanish_along_the_motion(name: str) -> None:
    c = case(name)
    maggi = Maggi(c.partition)
    if not c.partition.independent:
        return
    left = maggi.equations_of_motion
    function = se.Lambdify([*c.symbols, *c.equations.a], [*left, *maggi.forcing], cse=True)
    for s, solution in zip(c.states, c.solutions, strict=True):
        inputs = [s.t, *s.q, *s.v, *s.p, *solution[: len(s.q)]]
        values = np.asarray(function(inputs), float).reshape(2, -1)
        scale = max(1.0, np.abs(values[1]).max())
        assert np.abs(values[0]).max() < 100 * TOLERANCE * scale


@pytest.mark.parametrize("name", HOLONOMIC)
def test_second_kind(name: str) -> None:
    c = case(name)
    if c.partition.independent:
        second = second_kind(c.partition)
        c.check_accelerations(second.mass_matrix, second.forcing)


WRITTEN_OUT = [name for name in HOLONOMIC if name not in ("andrews_squeezer", "chain")]


@pytest.mark.parametrize("name", WRITTEN_OUT)
def test_second_kind_written_out(name: str) -> None:
    c = case(name)
    if c.partition.independent and name != "parallelogram":  # on two branches at β = 0
        second = second_kind(c.partition, written_out=True)
        c.check_accelerations(second.mass_matrix, second.forcing)


@pytest.mark.parametrize("name", HOLONOMIC)
def test_dependent_coordinates_and_velocities(name: str) -> None:
    c = case(name)
    second = second_kind(c.partition)
    solutions = [x for block in second.blocks for x in block.solutions]
    assert len(solutions) == len(c.partition.dependent)  # all shipped models have closed forms
    place = {x: i for i, x in enumerate(c.equations.q)}
    checked = [c.equations.q[place[x.unknown]] - x.value for x in solutions]
    checked += [c.equations.v[i] - x for i, x in second.rates.items()]
    if not checked:
        return
    for found, state in zip(c.values(checked), c.states, strict=True):
        scale = max(1.0, np.abs(state.q).max(), np.abs(state.v).max())
        assert np.abs(found).max() < 1e-11 * scale


@pytest.mark.parametrize("name", every_model(smooth=True))
def test_closed_forms(name: str) -> None:
    c = case(name)
    found = [solve_first_kind(c.partition), solve_accelerations(Maggi(c.partition))]
    if name in HOLONOMIC:
        found.append(solve_accelerations(second_kind(c.partition)))
    for solved in found:
        if solved:
            c.check_solved(solved)


def test_the_closed_form_exists_for_small_systems() -> None:
    pendulum = case("pendulum_cartesian")
    assert [x.unknown.name for x in solve_first_kind(pendulum.partition)] == [
        "lambda.rod",
        "x''",
        "y''",
    ]
    assert not solve_first_kind(case("four_bar").partition)  # five unknowns
    assert not solve_first_kind(case("parallelogram").partition)  # λ is not unique
