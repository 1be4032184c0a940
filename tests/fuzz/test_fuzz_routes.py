"""Random models run alike by `simulate`, as rows of a sweep, as the data of pages, and as FMUs."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmi import FmuError, Unpacked
from known_event_cases import EVENT_CASES
from known_force_cases import FORCE_CASES
from known_rest_cases import REST_CASES
from random_cases import FUZZ_COUNT
from redundant_systems import random_manifold, random_platform
from rows_alone import check_equal_alone, check_like_alone
from shipped import PATHS
from singular_motions import losing_rank
from stepped_inputs import STEPPED, as_parameter
from trees import random_constraints, random_tree
from two_routes import Route, by_page, by_simulate, difference

import lagcli
from lagcli.engine.integrate.engine import switches
from lagcli.errors import LagcliError
from lagcli.model.model import Model
from lagcli.simulations.simulation import Simulation, prepare
from lagcli.simulations.variants import Variants

METHOD = "DOP853"  # `auto` may continue with another one, pages and FMUs do not
LONGEST = 2.0
CASES = {**EVENT_CASES, **FORCE_CASES, **REST_CASES}
#: Shipped models without events of their own, apart from one with a constraint that an impulse may
#: violate, two that take long, and two whose motion is chaotic after one.
CONSTRAINED = [
    name
    for name, path in PATHS.items()
    if "constraints:" in (text := path.read_text("utf-8"))
    and "events:" not in text
    and name not in ("appell_hamel", "pendulum_chain", "car_on_road", "car_axis", "chain")
]


def tree(seed: int) -> str:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 9))
    text = random_tree(rng, n).replace("t_end: 0.3, samples: 4", "t_end: 1, samples: 21")
    if seed % 2:
        return text
    constrained = random_constraints(rng, n, int(rng.integers(1, 3)))
    initial = f"initial: {{q[1..{n}]: {{guess: 0.1}}, q[1..{n}]': {{guess: 0}}}}"
    lines = [initial if line.startswith("initial") else line for line in text.splitlines()]
    return "\n".join([*lines, constrained])


def redundant(seed: int) -> str:
    return (random_platform if seed % 3 == 0 else random_manifold)(seed)


def singular(seed: int) -> str:
    return losing_rank(np.random.default_rng(seed))[0] + "simulation: {t_end: 1.5, samples: 16}\n"


def switching(seed: int) -> str:
    kinds = list(CASES)
    case = CASES[kinds[seed % len(kinds)]](seed)
    listed = ", ".join(f"{key}: {value}" for key, value in case.options.items())
    return f"{case.text}\nsimulation: {{{listed}}}\n"


def driven(seed: int) -> str:
    chance = random.Random(seed)
    force = f"F: {chance.uniform(-30, 30):.2f} N"
    return as_parameter(chance.choice(list(STEPPED))).replace("F: 0 N", force)


def setting(seed: int) -> str:
    """Events that set values and apply impulses in a constrained mechanism."""
    chance = random.Random(seed)
    text = PATHS[chance.choice(CONSTRAINED)].read_text("utf-8")
    names = lagcli.load_text(text).coordinate_names
    lines = ["events:"]
    for k in range(chance.randint(1, 3)):
        one, other = chance.choice(names), chance.choice(names)
        actions = [
            f"set: {{{one}': {one}' + {chance.uniform(-1, 1):.3f}}}",
            f"set: {{{one}': 0}}",
            f"set: {{{one}: {one} + {chance.uniform(-0.1, 0.1):.3f}}}",
            f"set: {{{one}: {one} + {chance.uniform(-0.1, 0.1):.3f}, {other}': 0.5*{other}'}}",
            f"impulse: {{{one}: {chance.uniform(-1, 1):.3f}}}",
            f"set: {{{one}': 0.5*{one}'}}, impulse: {{{other}: {chance.uniform(-1, 1):.3f}}}",
        ]
        time = chance.choice([0.0, 0.5, chance.uniform(0, 1), LONGEST])
        lines.append(f"  e{k}: {{when: t >= {time:.3f}, {chance.choice(actions)}}}")
    return text + "\n" + "\n".join(lines) + "\n"


KINDS: dict[str, Callable[[int], str]] = {
    "trees": tree,
    "redundant": redundant,
    "singular": singular,
    "switching": switching,
    "driven": driven,
    "setting": setting,
}


def prepared(text: str) -> tuple[Model, Simulation] | None:
    """Return a model and its simulation; None where it has none."""
    model = lagcli.load_text(text)
    end = min(LONGEST, model.settings.t_end or LONGEST)
    settings = model.settings.replace(method=METHOD, t_end=end)
    model = replace(model, settings=settings)
    try:
        return model, prepare(model)
    except LagcliError:
        return None


def check_row(model: Model, run: Route, seed: int) -> None:
    """A row with the model's own values is the run, and one with others is a run of its own."""
    variants = Variants(model)
    names = [k for k, x in model.parameters.items() if x.value and variants.together([k])]
    if not names:
        return
    name = random.Random(seed).choice(names)
    value = model.parameters[name].value
    table = [[value], [1.03 * value]]
    if switches(variants.system):
        ends, _ = check_equal_alone(model, [name], table)
    else:  # eight rows at a time are added up in another order
        ends = check_like_alone(model, [name], table, 1e-6)
    assert (ends[0] in ("completed", "stopped-by-event")) == run.completed


def check_fmu(model: Model, simulation: Simulation, run: Route, folder: Path) -> None:
    start, end = simulation.request.state.t, simulation.request.settings.t_end
    fmu = Unpacked(lagcli.fmu(model, icon=False), folder)
    instance = fmu.instance()
    q = model.coordinate_names
    names = [*q, *(f"{x}_dot" for x in q)]
    found, failure = [], ""
    try:  # what happens at the end may be reported there or after it
        found.append(instance.simulate([start, end], names)[-1])
        instance.step(end, 1e-9 * (end - start))
        found.append(np.array(instance.get(*names)))
    except FmuError as error:
        failure = str(error)
    finally:
        instance.free()
    assert not failure or not run.completed or "tables of the FMU end" in failure
    if not run.completed or run.event >= 0:
        assert run.completed or len(found) < 2
        return  # the last sample precedes the end
    expected = run.samples[:, 1 : 1 + 2 * len(q)]
    largest = max(float(np.abs(expected).max()), 1e-3)
    assert min(float(np.abs(x - expected[-1]).max()) for x in found) < 1e-6 * largest


def check(kind: str, count: int, folder: Path) -> None:
    for seed in range(count):
        text = KINDS[kind](seed)
        made = prepared(text)
        if made is None:
            continue
        model, simulation = made
        run, page = by_simulate(simulation), by_page(simulation, METHOD)
        if run.completed or page.completed:
            assert difference(run, page) == "", (seed, text)
        check_row(model, run, seed)
        check_fmu(model, simulation, run, folder / str(seed))


@pytest.mark.bits
@pytest.mark.parametrize("kind", KINDS)
def test_a_few_random_models(kind: str, tmp_path: Path) -> None:
    check(kind, 2, tmp_path)


@pytest.mark.fuzz
@pytest.mark.bits
@pytest.mark.parametrize("kind", KINDS)
def test_random_models(kind: str, tmp_path: Path) -> None:
    check(kind, FUZZ_COUNT // len(KINDS) + 1, tmp_path)
