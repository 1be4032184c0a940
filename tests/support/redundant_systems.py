"""Random systems with redundant constraints, as model texts.

Quadratic constraints φ_k of n coordinates, of which one may follow time, and rows that follow from
them: multiples in other units, combinations, products with functions of position and time, squares
beside them, and their time derivatives. Platforms on cranks whose full turns make some of their
rows dependent, though not all of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.arrays import Array
from lagcli.engine.integrate.run import Integration
from lagcli.model.model import Model
from lagcli.trajectory.trajectory import Trajectory


def random_manifold(seed: int) -> str:
    """Return a model of one to three quadratic constraints and as many rows again that follow."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 7))
    m = int(rng.integers(1, min(n - 1, 4)))
    names = [f"x{i}" for i in range(n)]
    units = 10.0 ** rng.integers(-2, 3, n)  # of the coordinates
    at = rng.normal(size=n)  # where the motion starts, over the units
    root = rng.normal(size=(n, n))
    mass = (root @ root.T / n + np.eye(n)) / np.outer(units, units)
    stiffness = rng.uniform(0.2, 2.0, n) / units**2

    def number(x: float) -> str:
        return repr(float(x))

    kinetic = " + ".join(
        f"{number(mass[i, j] / 2)}*{names[i]}'*{names[j]}'" for i in range(n) for j in range(n)
    )
    potential = " + ".join(f"{number(stiffness[i] / 2)}*{names[i]}^2" for i in range(n))
    base = []
    for k in range(m):
        linear = rng.normal(size=n)
        # each constraint leans on another coordinate: far from dependent
        linear[k] += 4.0
        square = 0.3 * rng.normal(size=n)
        value = float((linear * at + square * at**2).sum())
        factors = zip(names, linear / units, square / units**2, strict=True)
        terms = [f"{number(a)}*{name} + {number(b)}*{name}^2" for name, a, b in factors]
        moving = " + 0.2*sin(2*t)" if rng.random() < 0.3 else ""
        base.append(f"{' + '.join(terms)} - {number(value)}{moving}")
    rows = [f"  c{k}: {phi} = 0" for k, phi in enumerate(base)]
    for k in range(int(rng.integers(1, m + 3))):
        unit = number(10.0 ** rng.uniform(-6, 6) * rng.choice([-1, 1]))
        one, other = (base[i] for i in rng.integers(0, m, 2))
        kind = int(rng.integers(0, 6))
        rows.append(
            f"  d{k}: "
            + [
                f"{unit}*({one}) = 0",
                f"{unit}*(({one}) - {number(rng.normal())}*({other})) = 0",
                f"{unit}*({one})*(1.5 + cos({number(1 / units[0])}*x0)) = 0",
                f"{unit}*({one})*(2 + sin(3*t)) = 0",
                f"{unit}*(({one}) + ({other})^2) = 0",
                f"{unit}*(({one}) + ({other})*({one})) = 0",
            ][kind]
        )
    order = rng.permutation(len(rows))
    values = [*zip(names, at * units, strict=True)]
    values += [(f"{x}'", v * u) for x, v, u in zip(names, rng.normal(size=n), units, strict=True)]
    guess = ", ".join(f"{name}: {{guess: {number(value)}}}" for name, value in values)
    lines = "\n".join(rows[i] for i in order)
    return f"""
coordinates: [{", ".join(names)}]
T: {kinetic}
V: {potential}
constraints:
{lines}
initial: {{{guess}}}
simulation: {{t_end: 2, samples: 41}}
"""


def random_platform(seed: int) -> str:
    """Return a platform on three to five parallel cranks that turn fully, not in one line."""
    rng = np.random.default_rng(seed)
    cranks, length = int(rng.integers(3, 6)), float(rng.uniform(0.2, 1.0))
    unit = float(10.0 ** rng.integers(-3, 4))  # of lengths
    points = rng.uniform(-1, 1, (cranks, 2))
    points[:3] += [[1.5, 0.0], [-1.0, 1.5], [-0.5, -1.5]]
    speed, angle = float(rng.uniform(6.0, 12.0) * rng.choice([-1, 1])), float(rng.uniform(-3, 3))
    rows, inertia = [], []
    for i, (a, b) in enumerate(points.tolist()):
        rows.append(f"  x{i}: {length}*u*cos(al{i}) + {a}*u = x + u*({a}*cos(be) - {b}*sin(be))")
        rows.append(f"  y{i}: {length}*u*sin(al{i}) + {b}*u = y + u*({a}*sin(be) + {b}*cos(be))")
        inertia.append(f"{rng.uniform(0.1, 1.0)}*(u*al{i}')^2/2")
    angles = ", ".join(f"al{i}: {angle}, al{i}': {speed}" for i in range(1))
    rest = ", ".join(
        f"al{i}: {{guess: {angle}}}, al{i}': {{guess: {speed}}}" for i in range(1, cranks)
    )
    x, y = length * unit * np.cos(angle), length * unit * np.sin(angle)
    return f"""
parameters: {{u: {unit}}}
coordinates: [x, y, be, {", ".join(f"al{i}" for i in range(cranks))}]
T: (x'^2 + y'^2)/2 + 0.3*(u*be')^2/2 + {" + ".join(inertia)}
V: 9.81*u*y + 0.5*u^2*be^2
constraints:
{chr(10).join(rows)}
initial: {{{angles}, {rest},
  x: {{guess: {float(x)!r}}}, y: {{guess: {float(y)!r}}}, be: {{guess: 0}},
  x': {{guess: 0}}, y': {{guess: 0}}, be': {{guess: 0}}}}
simulation: {{t_end: 2, samples: 41}}
"""


def check_like_dense(model: Model, monkeypatch: pytest.MonkeyPatch, **settings: Any) -> Trajectory:
    """Return a run, after comparing its motion, λ and forces with those of the dense solution."""
    found = lagcli.simulate(model, **{"rtol": 1e-8, **settings})
    assert found.status == "completed", found.message
    with monkeypatch.context() as patch:
        patch.setattr(Integration, "may_leave_out", False)
        exact = lagcli.simulate(model, **{**settings, "method": "DOP853", "rtol": 1e-11})
        dense = lagcli.simulate(model, **{"rtol": 1e-8, **settings, "method": "DOP853"})
    assert exact.status == "completed", exact.message
    # not the dense solution compared with itself
    assert not np.array_equal(found.q, exact.q)
    for name in ("q", "v", "multipliers", "constraint_force"):
        one, same, other = (np.asarray(getattr(run, name)) for run in (found, dense, exact))
        size: Array = np.abs(other).max(axis=0)
        # a hundred times rtol, or what the dense solution errs; what is small has rounding errors
        moves = size > (1e-3 if name == "multipliers" else 1e-9) * size.max()
        allowed = 1e-6 * size + 10 * np.abs(same - other).max(axis=0)
        assert (np.abs(one - other).max(axis=0) <= allowed)[moves].all(), name
    return found
