"""Consistent starts of many runs against those of single ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.engine.constraints.initial import NoConsistentState, consistent_state
from lagcli.engine.constraints.initial_batch import StartSearch
from lagcli.engine.system import State
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare
from lagcli.simulations.variants import Variants

MODELS = sorted((Path(__file__).parents[4] / "models").glob("*.yaml"))


def rows(model, count, size, seed=0):
    """Return a System and values near a model's own: parameters and guesses moved by a part."""
    simulation = prepare(model, SettingsOverrides(t_end=1))
    values = Variants(model).values([], np.empty((count, 0)))
    random = np.random.default_rng(seed)

    def moved(array, free):
        part = size * random.standard_normal(array.shape)
        return array + np.where(free, part * (np.abs(array) + 0.1), 0.0)

    return (
        simulation.system,
        simulation.settings.t_start,
        moved(values.parameters, True),
        moved(values.q, ~values.fixed_q),
        moved(values.v, ~values.fixed_v),
        values.fixed_q,
        values.fixed_v,
    )


def searched(system, *arguments):
    """Return what the search for many starts finds."""
    return StartSearch(system)(*arguments)


def alone(system, t, parameters, q, v, fixed_q, fixed_v):
    """Yield what the search for one start finds for each row; None where it finds nothing."""
    for values, q0, v0 in zip(parameters, q, v, strict=True):
        try:
            yield consistent_state(
                system, State(t, q0, v0, tuple(values.tolist())), fixed_q, fixed_v
            )
        except NoConsistentState:
            yield None


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_the_model_itself_starts_as_it_does_alone(path):
    arguments = rows(lagcli.load(path), 3, 0.0)
    starts = searched(*arguments)
    [expected, *_] = alone(*arguments)
    # what is redundant or singular is not ordinary
    assert list(starts.found) == [path.stem != "parallelogram"] * 3
    np.testing.assert_allclose(starts.q, [expected.state.q] * 3, rtol=0, atol=1e-14)
    np.testing.assert_allclose(starts.v, [expected.state.v] * 3, rtol=0, atol=1e-12)


@pytest.mark.parametrize("size", [0.0, 0.02, 0.3])
def test_redundant_constraints_start_as_they_do_alone(size):
    """Three parallel cranks: rows of rank 3, found if that is the common one."""
    path = next(p for p in MODELS if p.stem == "parallelogram")
    arguments = rows(lagcli.load(path), 12, size)
    starts = StartSearch(arguments[0], 3)(*arguments[1:])
    assert starts.found.all()
    for row, expected in enumerate(alone(*arguments)):
        assert expected.rank == 3
        np.testing.assert_allclose(starts.q[row], expected.state.q, rtol=0, atol=1e-12)
        np.testing.assert_allclose(starts.v[row], expected.state.v, rtol=0, atol=1e-11)
    assert not StartSearch(arguments[0], 2)(*arguments[1:]).found.any()


@pytest.mark.parametrize(
    ("name", "size"),
    [("slider_crank", 0.3), ("four_bar", 0.02), ("four_bar", 0.2), ("andrews_squeezer", 0.02)],
)
def test_other_values_start_as_they_do_alone(name, size):
    """Far from the model's own, too: on the same branch, or nowhere."""
    [path] = [p for p in MODELS if p.stem == name]
    arguments = rows(lagcli.load(path), 12, size)
    starts = searched(*arguments)
    assert starts.found.any()
    for row, expected in enumerate(alone(*arguments)):
        if starts.found[row]:
            scale = 1 + np.abs(expected.state.v).max()
            np.testing.assert_allclose(starts.q[row], expected.state.q, rtol=0, atol=1e-12)
            np.testing.assert_allclose(starts.v[row], expected.state.v, rtol=0, atol=1e-11 * scale)


@pytest.mark.parametrize("name", ["slider_crank", "andrews_squeezer", "rolling_disk"])
def test_a_start_does_not_depend_on_its_company(name):
    [path] = [p for p in MODELS if p.stem == name]
    system, t, *values, fixed_q, fixed_v = rows(lagcli.load(path), 9, 0.1)
    together = StartSearch(system)(t, *values, fixed_q, fixed_v)
    for some in ([0], [5], [8, 2, 3]):
        apart = StartSearch(system)(t, *(x[some] for x in values), fixed_q, fixed_v)
        for one, other in zip(apart, together, strict=True):
            np.testing.assert_array_equal(one, other[some])


def test_what_is_not_ordinary_is_not_found():
    model = lagcli.load_text("""
parameters: {l: 1, m: 1, s: 1}
coordinates: [x, y]
T: m/2*(x'^2 + y'^2)
V: sqrt(s)*y
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: 0.5, y: {guess: 1}, x': 0, y': {guess: 0}}
""")
    variants = Variants(model)
    table = np.array([[1, 1, 1], [0.4, 1, 1], [np.nan, 1, 1], [1, 0, 1], [1, 1, -1]])
    values = variants.values(["l", "m", "s"], table.astype(float))
    starts = StartSearch(variants.system)(0.0, *values)
    # x = 0.5 is beyond a rod of 0.4, nothing resists a motion without mass, and −1 has no root
    assert list(starts.found) == [True, False, False, False, False]
    assert starts.q[0] == pytest.approx([0.5, np.sqrt(0.75)])


def test_no_rows_are_none():
    variants = Variants(lagcli.load(MODELS[0]))
    starts = StartSearch(variants.system)(0.0, *variants.values([], np.empty((0, 0))))
    assert len(starts.q) == len(starts.found) == 0
