"""Models of links in trees and ropes, whose velocities are defined one after the other."""

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


def random_constraints(random: np.random.Generator, n: int, count: int) -> str:
    """Return constraints of a tree of n links, of all kinds, each of another link."""
    lines = ["constraints:"]
    for k, i in enumerate(1 + random.permutation(n)[:count]):
        j = random.integers(1, n + 1)
        a, b = random.uniform(-1, 1, size=2).round(3)
        equations = [
            f"X[{i}] = {a} + 0.1*sin(t)",
            f"2*Y[{i}] - Y[{j}]/3 = {b}*q[1]",
            f"(X[{i}] - X[0])^2 + (Y[{i}] - q[1])^2 = 1",
            f"-sin(q[{i}])*X[{i}]' + cos(q[{i}])*Y[{i}]' = 0",
            f"X[{i}]' + 0.3*q[{i}]' = {a}*t",
            f"X[{i}]*cos(q[{j}]) + Y[{i}]*sin(q[{j}]) = {b}",
            f"sqrt(X[{i}]^2 + Y[{i}]^2) = {abs(a)} + 0.5",
            f"(1 + q[1]^2)*X[{i}]' - t*Y[{j}]' + q[{j}]'*{a} = q[1]",
            f"X[{i}]'*Y[{i}]' = 0.3",
        ]
        lines.append(f"  c[{k}]: {equations[random.integers(len(equations))]}")
    return "\n".join(lines)


#: A rope of N links of mass m r^i, in angles from the horizontal, between two fixed points.
ROPE = """
coordinates: [q[1..N]]
parameters: {N: 12, L: 1 m, m: 1 kg, r: 1, g: 9.81 m/s^2, D: 0.6 m}
definitions:
  X[0]: 0
  Y[0]: 0
  X[i = 1..N]: X[i-1] + L/N*cos(q[i])
  Y[i = 1..N]: Y[i-1] + L/N*sin(q[i])
T: sum(m*r^i/N/2*(X[i]'^2 + Y[i]'^2), i = 1..N)
V: sum(m*r^i/N*g*Y[i], i = 1..N)
constraints:
  end_x: X[N] = D
  end_y: Y[N] = 0
initial:
  q[i = 1..N]: {guess: "-1 + 2*(i - 0.5)/N"}
  q[1..N]': 0 rad/s
simulation: {t_end: 0.5, samples: 11}
"""


def rope(angles: Array, rates: Array, g: float = 9.81) -> tuple[Array, Array]:
    """Return the accelerations and the multipliers of `ROPE` with r = 1, written by hand."""
    n = len(angles)
    part = 1.0 / n
    outer = part * np.minimum.outer(np.arange(n, 0, -1), np.arange(n, 0, -1))
    apart = np.subtract.outer(angles, angles)
    matrix = np.zeros((n + 2, n + 2))
    matrix[:n, :n] = outer * part**2 * np.cos(apart)
    rows = part * np.array([-np.sin(angles), np.cos(angles)])
    matrix[:n, n:], matrix[n:, :n] = -rows.T, rows
    forces = -(outer * part**2 * np.sin(apart)) @ rates**2
    forces -= np.diag(outer) * part * g * np.cos(angles)
    turning = part * np.array([np.cos(angles), np.sin(angles)]) @ rates**2
    solution = np.linalg.solve(matrix, np.concatenate([forces, turning]))
    return solution[:n], solution[n:]


def pendulum(theta: Array, rate: Array, n: int, g: float = 9.81) -> Array:
    """Return θ″ of n links: M a = f written by hand, the whole of length 1 m and mass 1 kg."""
    length, mass = 1.0 / n, 1.0 / n
    outer = mass * np.minimum.outer(np.arange(n, 0, -1), np.arange(n, 0, -1))
    apart = np.subtract.outer(theta, theta)
    matrix = outer * length**2 * np.cos(apart)
    forces = -(outer * length**2 * np.sin(apart)) @ rate**2
    forces -= np.diag(outer) * length * g * np.sin(theta)
    return np.asarray(np.linalg.solve(matrix, forces))
