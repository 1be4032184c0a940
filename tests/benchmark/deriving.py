"""How long it takes to load and derive chains, and how much longer SymPy takes.

`python tests/benchmark/deriving.py [--sympy]` prints seconds of processor time, medians.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import lagcli
from lagcli.engine.lowering.lower import lower

MODELS = Path(__file__).parents[2] / "models"


def seconds(call: Callable[[], object], repeat: int = 5) -> float:
    """Return the median processor time of a call."""
    times = []
    for _ in range(repeat):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return statistics.median(times)


def stages(name: str, n: int, repeat: int = 5) -> tuple[float, float, float]:
    """Return the seconds for loading, deriving and compiling a model of n bodies."""
    path = MODELS / f"{name}.yaml"
    model = lagcli.load(path, set={"N": n})
    equations = lagcli.derive(model)
    return (
        seconds(lambda: lagcli.load(path, set={"N": n}), repeat),
        seconds(lambda: lagcli.derive(model), repeat),
        seconds(lambda: lower(equations), repeat),
    )


def by_sympy(n: int) -> float:
    """Return the seconds for SymPy's Lagrange equations of the pendulum of n links in angles."""
    import sympy
    from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

    theta = dynamicsymbols(f"theta1:{n + 1}")
    m, g, length = sympy.symbols("m g l")
    t = dynamicsymbols._t
    x, y = sympy.Integer(0), sympy.Integer(0)
    kinetic, potential = sympy.Integer(0), sympy.Integer(0)
    for angle in theta:
        x, y = x + length * sympy.sin(angle), y - length * sympy.cos(angle)
        kinetic += m / 2 * (x.diff(t) ** 2 + y.diff(t) ** 2)
        potential += m * g * y
    began = time.process_time()
    LagrangesMethod(kinetic - potential, theta).form_lagranges_equations()
    return time.process_time() - began


def main() -> None:
    """Print the table."""
    print(f"{'model':16}{'N':>6}{'load':>9}{'derive':>9}{'compile':>9}")
    for name, counts in (("chain", (50, 500, 2000)), ("pendulum_chain", (10, 50))):
        for n in counts:
            times = "".join(f"{x:9.4f}" for x in stages(name, n, 5 if n <= 500 else 3))
            print(f"{name:16}{n:6}{times}", flush=True)
    if "--sympy" in sys.argv:
        ours, theirs = stages("pendulum_chain", 10)[1], by_sympy(10)
        print(
            f"SymPy derives the pendulum of 10 links in {theirs:.2f} s: {theirs / ours:.0f} times"
        )


if __name__ == "__main__":
    main()
