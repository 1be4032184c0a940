"""The mechanisms of the table, stated once for every program that differentiates for itself.

Each is a function of an algebra (an object with ``sin``, ``cos`` and ``sqrt``), the coordinates q
and the parameters; it returns positions of masses, potential and constraints as expressions of
that algebra. The models that lagcli reads are separate YAML files; that both mean the same
motion is seen in the errors of the table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

Expression = Any
Parameters = Mapping[str, float]


@dataclass(frozen=True)
class Inertia:
    """A mass that moves along a position, or a moment of inertia that turns by an angle.

    T = factor/2 Σ_k (d coordinates_k/dt)².
    """

    factor: float
    coordinates: tuple[Expression, ...]


@dataclass(frozen=True)
class Damper:
    """A damper between the ends of a vector: D = factor/2 (d length/dt)²."""

    factor: float
    length: Expression


@dataclass(frozen=True)
class Geometry:
    """A mechanism in the expressions of one algebra.

    ``potential`` holds the terms of V, ``forces`` the constant generalized forces by index.
    """

    inertias: Sequence[Inertia]
    potential: Sequence[Expression]
    constraints: Sequence[Expression]
    dampers: Sequence[Damper] = ()
    forces: Mapping[int, float] = field(default_factory=dict)


def pendulum(algebra: Any, q: Sequence[Expression], p: Parameters) -> Geometry:
    """``models/pendulum_cartesian.yaml``."""
    x, y = q
    return Geometry(
        inertias=[Inertia(p["m"], (x, y))],
        potential=[p["m"] * p["g"] * y],
        constraints=[x * x + y * y - p["l"] ** 2],
    )


def slider_crank(algebra: Any, q: Sequence[Expression], p: Parameters) -> Geometry:
    """``models/slider_crank.yaml``."""
    phi, psi = q
    sin, cos = algebra.sin, algebra.cos
    y_a = p["r"] * sin(phi)
    slider, y_b = p["r"] * cos(phi) + p["l"] * cos(psi), y_a - p["l"] * sin(psi)
    return Geometry(
        inertias=[Inertia(p["m"], (p["r"] * cos(phi), y_a)), Inertia(p["m"], (slider, y_b))],
        potential=[p["m"] * p["g"] * (y_a + y_b)],
        constraints=[y_b],
    )


def andrews(algebra: Any, q: Sequence[Expression], p: Parameters) -> Geometry:
    """``models/andrews_squeezer.yaml``."""
    beta, theta, gamma, phi, delta, omega, epsilon = q
    s, c = algebra.sin, algebra.cos
    bt, pd, oe = beta + theta, phi + delta, omega + epsilon
    x_a, y_a, x_b, y_b = p["x_a"], p["y_a"], p["x_b"], p["y_b"]
    u, z_t = p["u"], p["z_t"]
    e, f = p["e"] - p["e_a"], p["z_f"] - p["f_a"]
    centres = [
        (p["r_a"] * c(beta), p["r_a"] * s(beta)),
        (p["rr"] * c(beta) - p["d_a"] * c(bt), p["rr"] * s(beta) - p["d_a"] * s(bt)),
        (
            x_b + p["s_a"] * s(gamma) + p["s_b"] * c(gamma),
            y_b - p["s_a"] * c(gamma) + p["s_b"] * s(gamma),
        ),
        (x_a + z_t * c(delta) + e * s(pd), y_a + z_t * s(delta) - e * c(pd)),
        (
            x_a - p["t_a"] * s(delta) + p["t_b"] * c(delta),
            y_a + p["t_a"] * c(delta) + p["t_b"] * s(delta),
        ),
        (x_a + u * s(epsilon) + f * c(oe), y_a - u * c(epsilon) + f * s(oe)),
        (
            x_a + p["u_a"] * s(epsilon) - p["u_b"] * c(epsilon),
            y_a - p["u_a"] * c(epsilon) - p["u_b"] * s(epsilon),
        ),
    ]
    angles = [beta, bt, gamma, pd, delta, oe, epsilon]
    x_p, y_p = p["rr"] * c(beta) - p["d"] * c(bt), p["rr"] * s(beta) - p["d"] * s(bt)
    x_d = x_b + p["s_c"] * s(gamma) + p["s_d"] * c(gamma)
    y_d = y_b - p["s_c"] * c(gamma) + p["s_d"] * s(gamma)
    spring = algebra.sqrt((x_d - p["x_c"]) ** 2 + (y_d - p["y_c"]) ** 2)
    return Geometry(
        inertias=[
            *(Inertia(p[f"m_{i}"], x) for i, x in enumerate(centres, 1)),
            *(Inertia(p[f"J_{i}"], (x,)) for i, x in enumerate(angles, 1)),
        ],
        potential=[p["k"] / 2 * (spring - p["l_0"]) ** 2],
        constraints=[
            x_p - x_b - p["ss"] * s(gamma),
            y_p - y_b + p["ss"] * c(gamma),
            x_p - x_a - z_t * c(delta) - p["e"] * s(pd),
            y_p - y_a - z_t * s(delta) + p["e"] * c(pd),
            x_p - x_a - u * s(epsilon) - p["z_f"] * c(oe),
            y_p - y_a + u * c(epsilon) - p["z_f"] * s(oe),
        ],
        forces={0: p["torque"]},
    )


def chain(algebra: Any, q: Sequence[Expression], p: Parameters) -> Geometry:
    """Point masses on rods, the first one hanging from the origin; q = (x_1, y_1, x_2, y_2, …)."""
    points = list(zip(q[::2], q[1::2], strict=True))
    rods = []
    for (x, y), before in zip(points, [None, *points[:-1]], strict=True):
        x_rod, y_rod = (x, y) if before is None else (x - before[0], y - before[1])
        rods.append(x_rod * x_rod + y_rod * y_rod - p["l"] ** 2)
    return Geometry(
        inertias=[Inertia(p["m"], point) for point in points],
        potential=[p["m"] * p["g"] * y for _, y in points],
        constraints=rods,
    )


def stiff_chain(algebra: Any, q: Sequence[Expression], p: Parameters) -> Geometry:
    """A chain of which every second link is a spring with a damper: the second, the fourth, …"""
    points = list(zip(q[::2], q[1::2], strict=True))
    potential = [p["m"] * p["g"] * y for _, y in points]
    rods, dampers = [], []
    for i, ((x, y), before) in enumerate(zip(points, [None, *points[:-1]], strict=True)):
        x_link, y_link = (x, y) if before is None else (x - before[0], y - before[1])
        square = x_link * x_link + y_link * y_link
        if i % 2 == 0:
            rods.append(square - p["l"] ** 2)
        else:
            length = algebra.sqrt(square)
            potential.append(p["k"] / 2 * (length - p["l"]) ** 2)
            dampers.append(Damper(p["c"], length))
    return Geometry(
        inertias=[Inertia(p["m"], point) for point in points],
        potential=potential,
        constraints=rods,
        dampers=dampers,
    )
