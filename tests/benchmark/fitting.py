"""Fit the slider-crank with lagcli, and with SymPy's lambdify, solve_ivp and finite differences.

``python tests/benchmark/fitting.py`` prints the CPU time of both and their ratio, from the same
data and the same start, in turns within one run. The other side is what one writes without lagcli:
the equations of the first kind by SymPy, M, f, B and γ by lambdify, accelerations and λ by
`numpy.linalg.solve`, runs by `scipy.integrate.solve_ivp` and least squares by
`scipy.optimize.least_squares` with its finite differences. Equations, lambdify and what lagcli
compiles are outside of the time.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

import lagcli

MODEL = Path(__file__).parents[2] / "models" / "slider_crank.yaml"
TRUTH = {"m": 1.1, "c": 0.05}
START = np.array([1.0, 0.02, 11.8])  # m, c, phi'
SIGMA = np.array([1e-3, 0.1])  # of phi and lambda
RTOL = 1e-9
BLOCK = """
fit:
  data: {file: run.csv}
  observe: {phi: {sigma: 1e-3}, lambda.guide: {sigma: 0.1}}
  parameters: {m: {min: 0.1 kg}, c: {min: 0}, phi': {}}
"""


def data(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,) and measured phi and λ (n, 2), with noise."""
    run = lagcli.simulate(lagcli.load(MODEL, set=TRUTH), t_end=10.0, samples=501)
    values = np.stack([run.q[:, 0], run.multipliers[:, 0]], axis=1)
    return run.time, values + SIGMA * np.random.default_rng(seed).normal(size=values.shape)


def by_hand(times: np.ndarray, measured: np.ndarray) -> Callable[[], np.ndarray]:
    """Return the fit by SymPy, solve_ivp and finite differences."""
    t, m, c = sp.symbols("t m c")
    q = sp.Matrix([sp.Function("phi")(t), sp.Function("psi")(t)])
    v = q.diff(t)
    r, length, g = sp.Rational(1, 10), sp.Rational(3, 10), sp.Rational(981, 100)
    xa, ya = r * sp.cos(q[0]), r * sp.sin(q[0])
    xb, yb = xa + length * sp.cos(q[1]), ya - length * sp.sin(q[1])
    kinetic = m / 2 * (xa.diff(t) ** 2 + ya.diff(t) ** 2 + xb.diff(t) ** 2)
    lagrangian = kinetic - m * g * (ya + yb)
    force = sp.Matrix([-c * xb.diff(t) * xb.diff(x) for x in q])
    momenta = sp.Matrix([lagrangian.diff(x) for x in v])
    mass = momenta.jacobian(v)
    a = v.diff(t)
    forcing = sp.Matrix([lagrangian.diff(x) for x in q]) + force - (momenta.diff(t) - mass * a)
    constraint = sp.Matrix([yb])
    jacobian = constraint.jacobian(q)
    rhs = -(jacobian.diff(t) * v)
    symbols = sp.symbols("p_0 p_1 u_0 u_1")
    plain = dict(zip([*v, *q], [symbols[2], symbols[3], symbols[0], symbols[1]], strict=True))
    parts = [sp.simplify(sp.expand(x)).subs(plain) for x in (mass, forcing, jacobian, rhs)]
    compiled = sp.lambdify((*symbols, m, c), parts, modules="numpy", cse=True)

    def solve(y: np.ndarray, m: float, c: float) -> np.ndarray:
        mass, forcing, jacobian, rhs = compiled(*y, m, c)
        matrix = np.zeros((3, 3))
        matrix[:2, :2], matrix[:2, 2:], matrix[2:, :2] = mass, -jacobian.T, jacobian
        return np.linalg.solve(matrix, np.concatenate([forcing[:, 0], rhs[:, 0]]))

    def residuals(values: np.ndarray) -> np.ndarray:
        m, c, rate = values
        phi = 0.5
        psi = np.arcsin(np.sin(phi) / 3)
        y0 = [phi, psi, rate, rate * np.cos(phi) / (3 * np.cos(psi))]
        run = solve_ivp(
            lambda t, y: [y[2], y[3], *solve(y, m, c)[:2]],
            (0.0, times[-1]),
            y0,
            method="DOP853",
            rtol=RTOL,
            atol=1e-10,
            t_eval=times,
        )
        force = [solve(y, m, c)[2] for y in run.y.T]
        return ((np.stack([run.y[0], force], axis=1) - measured) / SIGMA).ravel()

    bounds = ([0.1, 0.0, -np.inf], np.inf)
    return lambda: least_squares(residuals, START, bounds=bounds, x_scale="jac").x


def by_lagcli(folder: Path, times: np.ndarray, measured: np.ndarray) -> Callable[[], np.ndarray]:
    """Return the search of `lagcli.fit`, prepared."""
    from lagcli.analysis.fit.fit import prepared

    rows = [",".join(map(repr, x)) for x in np.column_stack([times, measured]).tolist()]
    (folder / "run.csv").write_text("t,phi,lambda.guide\n" + "\n".join(rows) + "\n")
    (folder / "model.yaml").write_text(MODEL.read_text() + BLOCK)
    values = {"m": START[0], "c": START[1]}
    model = lagcli.load(folder / "model.yaml", values, {"phi'": START[2]})
    problem, _ = prepared(model)
    problem.search(START)

    def search() -> np.ndarray:
        return problem.search(START).values

    return search


def seconds(action: Callable[[], Any]) -> float:
    """Return the CPU time of an action."""
    began = time.process_time()
    action()
    return time.process_time() - began


def main() -> None:
    """Print the times and the ratio."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--turns", type=int, default=3)
    turns = parser.parse_args().turns
    times, measured = data()
    with tempfile.TemporaryDirectory() as folder:
        peer, own = by_hand(times, measured), by_lagcli(Path(folder), times, measured)
        a, b = peer(), own()
        print(f"values by hand  {a}\nvalues lagcli   {b}")
        assert np.allclose(a, b, rtol=1e-4)
        pairs = [(seconds(peer), min(seconds(own) for _ in range(3))) for _ in range(turns)]
    print(f"by hand  {statistics.median(x for x, _ in pairs):.3f} s")
    print(f"lagcli   {statistics.median(y for _, y in pairs):.4f} s")
    print(f"ratio    {statistics.median(x / y for x, y in pairs):.0f}")


if __name__ == "__main__":
    main()
