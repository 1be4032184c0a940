"""Models of links in trees, whose velocities are defined one after the other."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array


def random_tree(random: np.random.Generator, n: int) -> str:
    """Return a model of n links in a tree, with springs, a moving support and other terms."""
    before = [int(random.integers(max(0, i - 3), i)) for i in range(1, n + 1)]
    lines = ["X[0]: 0.1*sin(2*t)", "Y[0]: 0"]
    for i, k in enumerate(before, 1):
        angle = f"q[{i}] + {random.uniform(-1, 1):.3f}"
        length = f"{random.uniform(0.2, 1):.3f}"
        if i % 5 == 0:  # a slider whose length changes with another coordinate
            length = f"({length} + 0.1*q[{max(1, i - 1)}])"
        lines.append(f"X[{i}]: X[{k}] + {length}*sin({angle})")
        lines.append(f"Y[{i}]: Y[{k}] - {length}*cos({angle})")
    masses = random.uniform(0.1, 2, size=n)
    kinetic = [f"{m:.3f}/2*(X[{i}]'^2 + Y[{i}]'^2)" for i, m in enumerate(masses, 1)]
    kinetic += [f"0.05*q[{i}]'^2" for i in range(1, n + 1)]
    kinetic.append("0.1*(1 + q[1]^2)*(q[1]' + cos(q[2])*q[2]')^2")  # varying factor
    kinetic.append("0.2*(cos(q[1])*q[2]' + q[3]')^2")  # not the rate of a position
    kinetic.append("0.1*q[1]'*q[3]'*cos(q[2]) + 0.3*q[2]'")
    potential = [f"{m:.3f}*9.81*Y[{i}]" for i, m in enumerate(masses, 1)]
    potential.append("q[1]^2 + 0.3*q[2]*q[3]")
    return "\n".join(
        [
            f"coordinates: [q[1..{n}]]",
            "definitions:",
            *(f"  {line}" for line in lines),
            "T: " + " + ".join(kinetic),
            "V: " + " + ".join(potential),
            f"Q: {{q[1]: -0.1*q[1]' + sin(t), X[{n}]: 0.5, Y[1]: -q[2]'}}",
            "initial: " + f"{{q[1..{n}]: 0.1, q[1..{n}]': 0}}",
            "simulation: {t_end: 0.3, samples: 4}",
        ]
    )


def pendulum(theta: Array, rate: Array, n: int, g: float = 9.81) -> Array:
    """Return θ″ of n links: M a = f written by hand, the whole of length 1 m and mass 1 kg."""
    length, mass = 1.0 / n, 1.0 / n
    outer = mass * np.minimum.outer(np.arange(n, 0, -1), np.arange(n, 0, -1))
    apart = np.subtract.outer(theta, theta)
    matrix = outer * length**2 * np.cos(apart)
    forces = -(outer * length**2 * np.sin(apart)) @ rate**2
    forces -= np.diag(outer) * length * g * np.sin(theta)
    return np.asarray(np.linalg.solve(matrix, forces))
