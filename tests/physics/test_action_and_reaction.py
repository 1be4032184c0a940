"""Forces that views draw at two points: opposite, along their line, of the size of λ."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pytest
from random_cases import FUZZ_COUNT
from trajectories import all_terms

import lagcli
from lagcli.errors import LagcliError, UsageError
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.view_evaluator import ViewEvaluator, scene_of

SAMPLES = 5


class Place(NamedTuple):
    """A point: its expressions, its coordinates, and its value and derivatives at q."""

    text: Sequence[str]
    coordinates: Sequence[str]
    at: Callable[[np.ndarray], np.ndarray]
    jacobian: Callable[[np.ndarray], np.ndarray]


def free(name: str, dimension: int, rng: np.random.Generator) -> Place:
    q = [f"{name}_{axis}" for axis in "xyz"[:dimension]]
    return Place(q, q, lambda x: x, lambda x: np.eye(dimension))


def fixed(name: str, dimension: int, rng: np.random.Generator) -> Place:
    c = rng.normal(size=dimension).round(3)
    return Place([str(x) for x in c], (), lambda x: c, lambda x: np.empty((dimension, 0)))


def slider(name: str, dimension: int, rng: np.random.Generator) -> Place:
    """A point on a straight rail: one axis moves, or all in one direction."""
    c, way = (rng.normal(size=dimension).round(3) for _ in range(2))
    if rng.random() < 0.5:
        way = np.eye(dimension)[rng.integers(dimension)]
    text = [f"({a}) + ({b})*{name}_s" if b else str(a) for a, b in zip(c, way, strict=True)]
    return Place(text, [f"{name}_s"], lambda x: c + way * x[0], lambda x: way[:, None])


def crank(name: str, dimension: int, rng: np.random.Generator) -> Place:
    """A point on a circle in the plane of x and y."""
    c, (r,) = rng.normal(size=dimension).round(3), rng.uniform(0.3, 2, 1).round(3)
    text = [f"({c[0]}) + {r}*cos({name}_w)", f"({c[1]}) + {r}*sin({name}_w)", *map(str, c[2:])]

    def at(x: np.ndarray) -> np.ndarray:
        return c + r * np.array([np.cos(x[0]), np.sin(x[0]), 0])[:dimension]

    def jacobian(x: np.ndarray) -> np.ndarray:
        return r * np.array([[-np.sin(x[0])], [np.cos(x[0])], [0]])[:dimension]

    return Place(text, [f"{name}_w"], at, jacobian)


KINDS = (free, slider, crank, fixed)
#: Functions of the square s of the distance, and their derivatives by the distance d.
FUNCTIONS: tuple[tuple[str, Callable[[float], float]], ...] = (
    ("sqrt({s}) = l", lambda d: 1.0),
    ("{s} = l^2", lambda d: 2 * d),
    ("3/2*l^2 - {s}/2 = l^2", lambda d: -d),
    ("log(({s})/l^2) = 0", lambda d: 2 / d),
    ("1/sqrt({s}) = 1/l", lambda d: -1 / d**2),
)


def arrows(
    view: str, constraint: str, names: Sequence[str], q: np.ndarray, work: np.ndarray
) -> dict:
    """Return the components of the arrows at each point, (dimension, nt)."""
    initial = ", ".join(f"{x}: 1, {x}': 0" for x in names)
    kinetic = " + ".join(f"{x}'^2" for x in names)
    text = (
        f"coordinates: [{', '.join(names)}]\nparameters: {{l: 1}}\nT: ({kinetic})/2\n"
        f"constraints: {{rod: '{constraint}'}}\ninitial: {{{initial}}}\n"
        f"view:\n{view}"
    )
    model = lagcli.load_text(text)
    count = len(q)
    columns = {"time": np.arange(float(count)), "q": q, "v": 0 * q, "constraint_force_by": work}
    scene = ViewEvaluator(model).scene(columns, all_terms(1, len(names)))
    return {
        v.at: np.stack([np.broadcast_to(x, (count,)) for x in v.components]) for v in scene.vectors
    }


def check(seed: int) -> None:
    """Check one random constraint on a distance."""
    rng = np.random.default_rng(seed)
    dimension = int(rng.integers(2, 4))
    first, second = (KINDS[i] for i in rng.integers(len(KINDS), size=2))
    a, b = first("a", dimension, rng), second("b", dimension, rng)
    names = [*a.coordinates, *b.coordinates]
    if not names:
        return
    squares = [f"(({x}) - ({y}))^2" for x, y in zip(a.text, b.text, strict=True)]
    form, slope = FUNCTIONS[rng.integers(len(FUNCTIONS))]
    q = rng.normal(size=(SAMPLES, len(names)))
    factor = rng.normal(size=SAMPLES)
    count = len(a.coordinates)
    work, expected = np.empty_like(q), np.empty((SAMPLES, dimension))
    for i, x in enumerate(q):
        way = a.at(x[:count]) - b.at(x[count:])
        d = np.linalg.norm(way)
        expected[i] = factor[i] * slope(d) * way / d
        work[i] = np.concatenate(
            (a.jacobian(x[:count]).T @ expected[i], -b.jacobian(x[count:]).T @ expected[i])
        )
    points = ", ".join(f"{name}: [{', '.join(p.text)}]" for name, p in (("A", a), ("B", b)))
    view = f"  points: {{{points}}}\n  vectors: {{f: {{at: [A, B], force: rod}}}}\n"
    constraint = form.format(s=f"({' + '.join(squares)})")
    found = arrows(view, constraint, names, q, work)
    size = np.abs(expected).max()
    np.testing.assert_allclose(found["A"], expected.T, rtol=1e-7, atol=1e-7 * size)
    np.testing.assert_allclose(found["B"], -expected.T, rtol=1e-7, atol=1e-7 * size)


def test_the_forces_of_a_rod_are_opposite_and_whole() -> None:
    for seed in range(40):
        check(seed)


@pytest.mark.fuzz
def test_the_forces_of_many_rods() -> None:
    for seed in range(40, 40 + FUZZ_COUNT):
        check(seed)


CART = """
coordinates: [u, x, w]
parameters: {m: 1 kg, l: 1 m, g: 9.81 m/s^2}
T: m/2*(u'^2 + x'^2 + w'^2)
V: m*g*w
constraints: {rod: "sqrt((u - x)^2 + w^2) = l"}
initial: {u: 0, x: 0.6, w: -0.8, u': 0, x': 0, w': 0}
view:
  points: {C: [u, 0], P: [x, w], O: [0, 0], Q: [1, 1]}
  vectors: {rod: {at: AT, force: rod}}
"""


def test_a_rod_pulls_a_cart_on_a_rail_as_it_pulls_the_bob() -> None:
    trajectory = lagcli.simulate(lagcli.load_text(CART.replace("AT", "[C, P]")), samples=21)
    scene = scene_of(RunFile(trajectory))
    assert scene is not None
    cart, bob = (np.array(v.components) for v in scene.vectors)
    np.testing.assert_allclose(cart, -bob, atol=1e-12)
    # the gradient of a distance has the length 1
    size = np.abs(trajectory.multipliers[:, 0])
    np.testing.assert_allclose(np.hypot(*cart), size, rtol=1e-6)
    assert np.abs(cart[1]).max() > 1


@pytest.mark.parametrize(
    ("at", "why"),
    [
        # the rail carries the vertical component, which lambda b does not contain
        ("C", "acts on `x`"),
        # of two fixed points, which one carries it is unknown
        ("[C, P, O, Q]", "is not unique"),
    ],
)
def test_a_force_of_which_a_part_is_unknown_is_refused(at: str, why: str) -> None:
    with pytest.raises(LagcliError, match=why):
        scene_of(RunFile(lagcli.simulate(lagcli.load_text(CART.replace("AT", at)), samples=3)))


BEAD = """
coordinates: [x]
parameters: {h: 0.8 m, l: 1 m, k: 1 kg}
T: k/2*x'^2
constraints: {rod: "sqrt(x^2 + h^2) = l"}
initial: {x: 0.6, x': 0}
view:
  points: {O: [0, h], Q: [0, 0], P: [x, 0]}
  vectors: {rod: {at: AT, force: rod}}
"""


def test_a_point_on_a_rail_needs_the_other_end_of_its_rod() -> None:
    columns = {
        "time": np.zeros(1),
        "q": np.array([[0.6]]),
        "v": np.zeros((1, 1)),
        "constraint_force_by": np.array([[3.0]]),
    }

    def forces(at: str) -> dict[str, list[float]]:
        evaluator = ViewEvaluator(lagcli.load_text(BEAD.replace("AT", at)))
        vectors = evaluator.scene(columns, all_terms(1, 1)).vectors
        return {v.at: [float(x[0]) for x in v.components] for v in vectors}

    both = forces("[O, P]")
    assert both["P"] == pytest.approx([3, -4])
    assert both["O"] == pytest.approx([-3, 4])
    with pytest.raises(UsageError, match=r"(?s)is not unique.*O, A"):
        forces("P")
    # along the rail alone: the moment about Q vanishes only without a part across
    assert forces("[Q, P]")["P"] == pytest.approx([3, 0])


def test_a_guide_is_no_pair_of_balanced_forces() -> None:
    text = CART.replace('"sqrt((u - x)^2 + w^2) = l"', "w + 0.8*l = 0").replace("AT", "[O, P]")
    with pytest.raises(UsageError, match="sum and moment are 0"):
        scene_of(RunFile(lagcli.simulate(lagcli.load_text(text), samples=3, t_end=0.1)))
