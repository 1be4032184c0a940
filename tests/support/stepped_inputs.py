"""Models that switch, with an input F that steps: as a parameter for FMUs, or as a table."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from fmi import Unpacked

import lagcli

_BLOCK = """
coordinates: {x: m, y: m}
parameters: {m: 2 kg, g: 10 m/s^2, mu: 0.5, e: 0.5{F}}
T: m/2*(x'^2 + y'^2)
V: m*g*y
Q: {x: F, y: -F/10}
constraints:
  floor: {expr: y >= 0, friction: {static: 1.2*mu, kinetic: mu}, slip: x', restitution: e}
initial: {x: 0, y: 0, x': 0, y': 0}
simulation: {t_end: 3 s}
"""
_ONE = """
coordinates: {x: m}
parameters: {m: 2 kg, k: 20 N/m, u: 0 N, F_s: 12 N, F_k: 9 N, v_b: 0.3 m/s, s: 1{F}}
T: m/2*x'^2
V: k*x^2/2
Q: {x: %s}
%s
initial: {x: 0.1, x': 0.5}
simulation: {t_end: 3 s}
"""
#: By what they show; {F} is the parameter or nothing, F acts on all of them.
STEPPED = MappingProxyType(
    {
        "sliding, sticking and leaving the floor": _BLOCK,
        "impacts": _BLOCK.replace("y: 0, x'", "y: 0.5, x'").replace("e: 0.5", "e: 0.8"),
        "a belt that bears so much": _ONE
        % ("F", "constraints: {belt: {expr: x' = v_b, limit: {static: F_s, kinetic: F_k}}}"),
        "forces that jump": _ONE % ("F - F_k*sign(x')", ""),
        "kinks": _ONE % ("F - 3*abs(x) - 2*max(x', 0)", ""),
        "an event of the input": _ONE
        % ("s*F", "events: {turn: {when: F + 5*x >= 10, set: {s: -0.5*s}, times: 4}}"),
        "an event of a force": _BLOCK
        + "events: {weak: {when: lambda.floor >= 21, set: {mu: 0.8*mu}, times: 3}}\n",
        "a sampled controller": _ONE
        % ("F + u", "events: {sample: {every: 70 ms, set: {u: -8*x - 3*x' + 0.2*F}}}"),
        "a stop": _BLOCK.replace(
            "constraints:\n", "constraints:\n  wall: {expr: x <= 0.3, restitution: e}\n"
        ),
    }
)


def steps(seed: int) -> tuple[list[float], list[float]]:
    """Return random times from 0 on, and the values of F from each on."""
    rng = np.random.default_rng(seed)
    times = [0.0, *np.sort(rng.uniform(0.01, 2.9, int(rng.integers(1, 10)))).round(5).tolist()]
    values = rng.choice([0, 4, 11.5, 13, -15, 30, -60, 250, 8], len(times)) + rng.normal(
        size=len(times)
    )
    return times, values.round(3).tolist()


def as_parameter(kind: str) -> str:
    return STEPPED[kind].replace("{F}", ", F: 0 N")


def as_table(kind: str, times: list[float], values: list[float]) -> str:
    table = f"times: {times}, values: {values}, unit: N, interpolation: step, extend: hold"
    return f"{STEPPED[kind].replace('{F}', '')}inputs: {{F: {{{table}}}}}\n"


def difference(fmu: Unpacked, kind: str, seed: int) -> float:
    """Return the largest difference from a run with a table, next to the largest values.

    -1 if that run has failed.
    """
    times, values = steps(seed)
    run = lagcli.simulate(lagcli.load_text(as_table(kind, times, values)))
    if run.status != "completed":
        return -1.0
    instance = fmu.instance()
    instance.begin(0.0, {"F": values[0]})
    rng = np.random.default_rng(seed)
    for t, following, value in zip(times, [*times[1:], 3.0], values, strict=True):
        instance.set({"F": value})
        if rng.integers(2):
            instance.get("energy_total")  # values are asked for, or not
        middle = t + (following - t) * float(rng.random())
        instance.step(t, middle - t)
        instance.step(middle, following - middle)
    names = [f"{q}{x}" for x in ("", "_dot", "_ddot") for q in run.coordinates]
    names += [f"lambda.{c}" for c in run.constraints]
    found = np.array(instance.get(*names))
    instance.free()
    columns = [run.q, run.v, run.a, run.multipliers][: 4 if run.constraints else 3]
    expected = np.concatenate([x[-1] for x in columns])
    size = np.concatenate([np.full(x.shape[1], np.abs(x).max()) for x in columns])
    return float((np.abs(found - expected) / (size + 1e-6)).max())
