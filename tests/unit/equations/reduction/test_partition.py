"""Independent coordinates: the default, the choice, and what cannot be chosen."""

from __future__ import annotations

import math
import random
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.derivation.motion import ZERO
from lagcli.equations.reduction.partition import number, triangular_blocks
from lagcli.errors import UsageError
from lagcli.model.loader import load, load_text
from lagcli.simulations.partition import partition

MODELS = Path(__file__).parents[4] / "models"


def names(found, indices):
    return [found.equations.model.coordinate_names[i] for i in indices]


def shipped(name: str, **options):
    return derive(load(MODELS / f"{name}.yaml", **options))


@pytest.mark.parametrize(
    ("name", "independent"),
    [
        ("slider_crank", ["phi"]),  # the one with fixed initial values
        ("four_bar", ["theta_1"]),
        ("andrews_squeezer", ["theta"]),
        ("rolling_disk", ["psi", "theta", "phi"]),
        ("bead_on_rotating_hoop", ["theta"]),
        ("driven_slider_crank", []),
    ],
)
def test_default(name: str, independent: list[str]) -> None:
    found = partition(shipped(name))
    assert names(found, found.independent) == independent
    assert set(found.independent) | set(found.dependent) == set(range(len(found.equations.q)))


def test_choice() -> None:
    found = partition(shipped("four_bar"), ["theta_3"])
    assert names(found, found.independent) == ["theta_3"]
    assert [str(d) for d in found.determinants]


def test_redundant_constraints_are_left_out() -> None:
    found = partition(shipped("parallelogram"))
    assert len(found.independent) == 1
    assert len(found.surplus) == 1
    assert len(found.constraints) == len(found.dependent) == 3


def test_the_null_space_and_the_drift_solve_the_velocity_constraints() -> None:
    found = partition(shipped("rolling_disk"))
    for c in found.equations.constraints:
        for k in range(len(found.independent)):
            total = sum(b * found.null_space[j].get(k, 0) for j, b in c.row.items())
            assert total.expand() == 0
        assert (sum(b * found.drift[j] for j, b in c.row.items()) + c.drift).expand() == 0


@pytest.mark.parametrize(
    ("independent", "said"),
    [
        (["chi"], "no coordinate `chi`; the coordinates are `phi`, `psi`"),
        (["phi", "phi"], "names `phi` twice"),
        (["phi", "psi"], "names 2 coordinates: `phi`, `psi`; the model has 1 degree of freedom"),
        ([], "names no coordinates"),
    ],
)
def test_wrong_names(independent: list[str], said: str) -> None:
    with pytest.raises(UsageError) as error:
        partition(shipped("slider_crank"), independent)
    assert said in str(error.value)


def test_a_singular_choice_names_another() -> None:
    hanging = shipped("pendulum_cartesian", set={"theta_0": "0"})
    with pytest.raises(UsageError) as error:
        partition(hanging, ["y"])
    assert "do not determine `x`" in str(error.value)
    assert "use for instance --independent x" in str(error.value)
    assert names(partition(hanging), [partition(hanging).independent[0]]) == ["x"]


def test_without_constraints_all_coordinates_are_independent() -> None:
    free = derive(load_text("coordinates: [x]\nT: x'^2/2\ninitial: {x: 1, x': 0}\n"))
    assert partition(free).independent == (0,)
    assert partition(free).rates == ()


def test_a_triangular_system_has_blocks_of_one() -> None:
    blocks = triangular_blocks([{0, 1}, {0}, {0, 1, 2}])
    assert [(b.rows, b.columns) for b in blocks] == [((1,), (0,)), ((0,), (1,)), ((2,), (2,))]


def test_a_loop_is_one_block() -> None:
    blocks = triangular_blocks([{0, 1}, {1, 2}, {2, 0}, {3, 1}])
    assert [set(b.columns) for b in blocks] == [{0, 1, 2}, {3}]


@pytest.mark.parametrize("seed", range(20))
def test_random_systems(seed: int) -> None:
    source = random.Random(seed)
    size = source.randrange(1, 9)
    order = list(range(size))
    source.shuffle(order)
    # a permuted diagonal makes it structurally regular
    rows = [{order[i], *(source.sample(range(size), source.randrange(2)))} for i in range(size)]
    known: set[int] = set()
    for block in triangular_blocks(rows):
        assert len(block.rows) == len(block.columns)
        needed = set().union(*(rows[i] for i in block.rows))
        assert needed <= known | set(block.columns)
        known |= set(block.columns)
    assert known == set(range(size))


def test_a_singular_structure_is_rejected() -> None:
    with pytest.raises(ValueError, match="singular"):
        triangular_blocks([{0}, {0}])


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_the_determinants_have_the_sign_of_the_dependent_columns(order: tuple[int, ...]) -> None:
    constraints = ["one: x = 2*a", "two: y + x*a = 3*a", "three: z = 5*a*y"]
    text = "coordinates: [a, z, x, y]\nT: (a'^2 + x'^2 + y'^2 + z'^2)/2\nconstraints:\n"
    text += "".join(f"  {constraints[i]}\n" for i in order)
    text += "initial: {a: 1, a': 1, x: {guess: 2}, y: {guess: 1}, z: {guess: 5}, x': {guess: 0},"
    text += " y': {guess: 0}, z': {guess: 0}}\n"
    found = partition(derive(load_text(text)), ["a"])
    values = {s: float(i + 2) for i, s in enumerate(found.equations.q)}
    rows = [
        [number(c.row.get(j, ZERO), values) for j in found.dependent]
        for c in found.equations.constraints
    ]
    product = math.prod(number(x, values) for x in found.determinants)
    assert product == pytest.approx(np.linalg.det(np.array(rows)), rel=1e-12)
