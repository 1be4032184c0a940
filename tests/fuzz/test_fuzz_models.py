"""Random models: their equations against difference quotients of what they say."""

from __future__ import annotations

import random
import warnings
from typing import Any

import numpy as np
import pytest
from lowered import Lowered, lowered
from random_cases import FUZZ_COUNT
from random_models import FUNCTIONS, EveryKey, Meaning, NoValue, RandomModel, State

from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.column_expressions import REPORTED
from lagcli.errors import ModelError
from lagcli.functions import FUNCTIONS as KNOWN
from lagcli.model.loader import load_text
from lagcli.model.model import Model

#: What a random model may be rejected for: a constant part of it has no value, or all coordinates
#: of a constraint cancel.
REFUSALS = {"not-a-number", "no-unknowns"}
CLOSE = 1e-10  # relative to the value, or to 1: doubles, a few hundred operations
LARGEST = 1e8  # of values that are compared
SMALL = 1e-13  # relative change of a state, to see how much rounding can do


def found(case: Lowered, inputs: list[float], a: list[float], multipliers: list[float]) -> dict:
    """Return what the tapes of a System give at one state."""
    system, p = case
    nq, nc, nh = len(system.coordinates), len(system.constraints), len(system.holonomic)
    values = [*inputs, *p]
    dynamics = ScalarTape(system.dynamics)(values)
    constraint = ScalarTape(system.constraint)(values)
    report = ScalarTape(system.report)([*inputs, *a, *multipliers, *p])
    reported = dict(zip(REPORTED, report, strict=False))
    mass, jacobian = np.zeros((nq, nq)), np.zeros((nc, nq))
    nm, nb = len(system.mass_pattern), len(system.jacobian_pattern)
    for (i, j), x in zip(system.mass_pattern, dynamics[:nm], strict=True):
        mass[i, j] = x
    start = nm + nq
    for (i, j), x in zip(system.jacobian_pattern, dynamics[start : start + nb], strict=True):
        jacobian[i, j] = x
    drift = np.array(constraint[nh + nb : nh + nb + nc])
    return {
        "M": mass,
        "f": dynamics[nm:start],
        "B": jacobian,
        "gamma": dynamics[start + nb : start + nb + nc],
        "power": dynamics[-1],
        "phi": constraint[:nh],
        "psi": jacobian @ np.array(inputs[1 + nq :]) + drift,
        "kinetic": reported["energy_kinetic"],
        "potential": reported["energy_potential"],
        "energy": reported["energy_total"],
        "outputs": report[len(REPORTED) :],
    }


def expected(model: RandomModel, at: State) -> dict[str, Any]:
    """Return the same by difference quotients."""
    meaning = Meaning(model)
    applied = meaning.applied(at)
    velocity, rhs = meaning.constraint_rates(at)
    holonomic = [n for n, (kind, *_) in model.constraints.items() if kind == "holonomic"]
    power = sum(q * v for q, v in zip(applied, at.v, strict=True))
    return {
        "M": meaning.mass_matrix(at),
        "f": meaning.forcing(at),
        "B": meaning.jacobian(at),
        "gamma": rhs,
        "power": power - meaning.slope(meaning.lagrangian, at, "t"),
        "phi": [meaning.residual(n, at) for n in holonomic],
        "psi": velocity,
        "kinetic": meaning.value(model.kinetic, at),
        "potential": meaning.value(model.potential, at),
        "energy": meaning.energy(at),
        "outputs": [meaning.value(x, at) for x in model.outputs.values()],
    }


def array(values: Any) -> np.ndarray:
    return np.array(values, dtype=object).astype(float).ravel()


def attempt(text: str) -> tuple[Model | None, ModelError]:
    """Load a text, or return why it is rejected."""
    try:
        return load_text(text), ModelError([])
    except ModelError as error:
        return None, error


def compare(model: RandomModel, seed: int) -> str:
    """Compare a model with its meaning at one random state; say what came of it."""
    text = model.text()
    loaded, refusal = attempt(text)
    if loaded is None:
        assert {d.kind for d in refusal.diagnostics} <= REFUSALS, f"seed {seed}:\n{text}\n{refusal}"
        return "refused"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        case = lowered(loaded)
        chance = random.Random(seed)
        k, r = len(model.coordinates), len(model.constraints)
        sizes = (1, k, k, k, r)
        numbers = [[chance.uniform(-1.9, 1.9) for _ in range(n)] for n in sizes]
        (t,), q, v, a, multipliers = numbers
        given = found(case, [t, *q, *v], a, multipliers)
        try:
            wanted = expected(model, State(t, q, v, a, multipliers))
        except NoValue:
            return "no value"
        written_with_l = loaded.kinetic is None
        for key, value in wanted.items():
            if written_with_l and key in ("kinetic", "potential"):
                continue
            one, other = array(given[key]), array(value)
            assert one.shape == other.shape, f"seed {seed}, {key}"
            if not np.abs(other).max(initial=0.0) < LARGEST:
                continue
            slack = CLOSE * max(1.0, np.abs(other).max(initial=0.0))
            if not np.abs(one - other).max(initial=0.0) <= slack:
                slack += sensitivity(model, key, other, numbers)
                assert np.abs(one - other).max(initial=0.0) <= slack, (
                    f"seed {seed}, {key}:\n{one}\n{other}\nq = {q}, v = {v}, t = {t}\n{text}"
                )
    return "equal"


def sensitivity(
    model: RandomModel, key: str, value: np.ndarray, numbers: list[list[float]]
) -> float:
    """Return how much a value changes with the last digits of the state."""
    chance = random.Random(1)
    largest = 0.0
    for _ in range(4):
        near = [[x * (1 + chance.uniform(-SMALL, SMALL)) for x in xs] for xs in numbers]
        other = array(expected(model, State(near[0][0], *near[1:]))[key])
        largest = max(largest, float(np.abs(other - value).max(initial=0.0)))
    return 10 * largest


def summary(seeds: range) -> dict[str, int]:
    counts = {"equal": 0, "refused": 0, "no value": 0}
    for seed in seeds:
        counts[compare(RandomModel(seed), seed)] += 1
    return counts


@pytest.mark.parametrize("function", sorted(FUNCTIONS))
def test_every_function_in_every_key(function: str) -> None:
    assert compare(EveryKey(function), 0) == "equal"


def test_the_models_use_every_function() -> None:
    assert set(KNOWN) == FUNCTIONS
    used: set[str] = set()
    for seed in range(60):
        used |= RandomModel(seed).used
    assert used == set(KNOWN)


@pytest.mark.parametrize("part", range(2))
def test_random_models(part: int) -> None:
    counts = summary(range(8 * part, 8 * part + 8))
    assert counts["equal"] >= 6


@pytest.mark.fuzz
def test_many_random_models() -> None:
    counts = summary(range(1000, 1000 + FUZZ_COUNT))
    print(counts)
    assert counts["equal"] > 0.8 * FUZZ_COUNT
