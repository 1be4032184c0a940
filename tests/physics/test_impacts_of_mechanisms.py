"""Impacts of random mechanisms at one instant: momentum, laws of contacts, Coulomb's cone, energy.

All constraints are linear in the coordinates and meet in one point, where an event pushes the
bodies. With M, the rows B and the impulses Λ of the log, M (v⁺ − v⁻) = Bᵀ Λ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import lagcli
from lagcli.arrays import Array

LAWS = ("poisson", "newton", "sequential")
TOLERANCE = 1e-9


class Mechanism(NamedTuple):
    """A model, and what its impact is judged by; rows by the names of constraints."""

    text: str
    mass: Array
    rows: dict[str, Array]
    speeds: dict[str, float]
    restitution: float
    friction: float


def linear(a: Array, of: str = "") -> str:
    return " + ".join(f"({float(x)!r})*x{k}{of}" for k, x in enumerate(a))


def mechanism(seed: int) -> Mechanism:
    """Return contacts with friction, one of them inactive, guides with friction, and a drive."""
    rng = np.random.default_rng(seed)
    nq = int(rng.integers(2, 5))
    root = rng.normal(size=(nq, nq))
    mass = root @ root.T + 0.5 * np.eye(nq)
    rows: dict[str, Array] = {}
    speeds: dict[str, float] = {}
    lines = []
    e, mu = float(rng.choice([0.0, 0.5, 0.8])), float(rng.choice([0.0, 0.2, 0.6]))
    kinds = ["contact"] * int(rng.integers(1, nq)) + ["absent"]
    kinds += rng.choice(["guide", "drive", "plain", "none"], 1).tolist() if nq > 2 else []
    rng.shuffle(kinds)
    push, place = rng.normal(size=nq), rng.normal(size=nq)
    for k, kind in enumerate(kinds):
        a, name = rng.normal(size=nq), f"c{k}"
        slip = rng.normal(size=nq)
        friction = f', friction: {mu!r}, slip: "{linear(slip, chr(39))}"' if mu else ""
        if kind in ("contact", "absent"):
            away = a @ np.linalg.solve(mass, push) > 0.0
            a = -a if away else a  # the push is towards it
            active = ", active: false" if kind == "absent" else ""
            way, bounces = (
                ("=", "") if active and rng.random() < 0.5 else (">=", f", restitution: {e!r}")
            )
            expr = f"{linear(a)} {way} {float(a @ place)!r}"
            lines.append(f'  {name}: {{expr: "{expr}"{bounces}{friction}{active}}}')
        elif kind in ("guide", "drive", "plain"):
            speeds[name] = 0.3 if kind == "drive" else 0.0
            right = f"{float(a @ place)!r}" + (" + 0.3*t" if kind == "drive" else "")
            rough = friction if kind == "guide" else ""
            lines.append(f'  {name}: {{expr: "{linear(a)} = {right}"{rough}}}')
        rows[name] = a
        if friction and kind in ("contact", "guide"):
            rows[f"{name}.slip"] = slip
    energy = " + ".join(
        f"({float(mass[i, j] / 2)!r})*x{i}'*x{j}'" for i in range(nq) for j in range(nq)
    )
    start = ", ".join(
        f"x{k}: {{guess: {float(x)!r}}}, x{k}': {{guess: 0}}" for k, x in enumerate(place)
    )
    impulse = ", ".join(f"x{k}: {float(x)!r}" for k, x in enumerate(push))
    absent = f"c{kinds.index('absent')}"
    text = f"""
coordinates: [{", ".join(f"x{k}" for k in range(nq))}]
T: {energy}
constraints:
{chr(10).join(lines)}
initial: {{{start}}}
events:
  push: {{when: t >= 0.01, impulse: {{{impulse}}}}}
  later: {{when: t >= 1, engage: {absent}}}
simulation: {{t_end: 0.02, samples: 2}}
"""
    for name in (absent, f"{absent}.slip"):
        rows[name] = 0.0 * rows.get(name, np.zeros(nq))
    return Mechanism(text, mass, rows, speeds, e, mu)


def judge(given: Mechanism, model: lagcli.Model, law: str) -> int:
    """Check the impacts of a run; return how many there are."""
    run = lagcli.simulate(model, impacts=law)  # type: ignore[arg-type]
    log = run.events
    assert log is not None
    if law == "newton" and run.status == "failed":  # with friction, it may gain energy
        assert "would gain" in run.message or "law of impacts" in run.message
    else:
        assert run.status == "completed", run.message
    names = list(run.constraints)
    b = np.array([given.rows[name] for name in names])
    impacts = np.flatnonzero([kind == "impact" for kind in log.kinds])
    begins = {float(log.before[k] @ log.before[k]): k for k in impacts[::-1]}
    contacts = [name for name in names if name + ".slip" in names or name not in given.speeds]
    contacts = [n for n in contacts if not n.endswith(".slip") and n not in given.speeds]
    for first in begins.values():
        same = [k for k in impacts if (log.before[k] == log.before[first]).all()]
        before, after, impulse = log.before[first], log.after[first], log.impulse[first]
        size, most = np.abs(before).max() * np.abs(b).max(), np.abs(impulse).max()
        np.testing.assert_allclose(
            given.mass @ (after - before), b.T @ impulse, rtol=0, atol=TOLERANCE * most
        )
        supplied = sum(u * impulse[names.index(n)] for n, u in given.speeds.items())
        assert log.supplied[same].sum() == pytest.approx(supplied, abs=TOLERANCE)
        gain = (after @ given.mass @ after - before @ given.mass @ before) / 2
        loss = log.loss[same].sum()
        assert gain == pytest.approx(supplied - loss, abs=TOLERANCE * size * most)
        assert loss >= -TOLERANCE * size * most or law == "newton"
        for name, speed in given.speeds.items():
            assert given.rows[name] @ after == pytest.approx(speed, abs=TOLERANCE * size)
        for name in [*contacts, *given.speeds]:
            normal = impulse[names.index(name)]
            approach, leaves = given.rows[name] @ before, given.rows[name] @ after
            if name in contacts:
                assert normal >= 0.0
                if not given.rows[name].any():
                    assert normal == 0.0
                gap = given.rows[name] @ (log.q[first] - run.q[0])
                if law == "poisson" and approach <= 0.0 and gap < TOLERANCE:  # it takes part
                    assert leaves >= -TOLERANCE * size
                if normal > 0.0 and given.restitution == 0.0 and law != "sequential":
                    assert leaves == pytest.approx(0.0, abs=TOLERANCE * size)
                elif (
                    normal > 0.0 and len(contacts) == 2 and (law == "newton" or not given.friction)
                ):
                    assert leaves == pytest.approx(-given.restitution * approach, abs=1e-9 * size)
            if f"{name}.slip" not in names:
                continue
            along, slip = impulse[names.index(f"{name}.slip")], given.rows[f"{name}.slip"] @ after
            bound = given.friction * abs(normal)
            once = law == "newton" or given.restitution == 0.0 or name in contacts
            assert abs(along) <= bound + TOLERANCE * most or not once  # its force may turn
            if given.restitution == 0.0 and law != "sequential" and abs(slip) > TOLERANCE * size:
                assert along == pytest.approx(-np.sign(slip) * bound, abs=TOLERANCE * most)
    if run.status == "failed":
        return len(begins)
    last = run.v[-1]
    for name in contacts:
        gap = given.rows[name] @ run.q[-1] - given.rows[name] @ run.q[0]
        assert gap >= -TOLERANCE
        assert gap > TOLERANCE or given.rows[name] @ last >= -TOLERANCE
    return len(begins)


@pytest.mark.parametrize("part", range(3))
def test_impacts_of_mechanisms(part: int) -> None:
    impacts = 0
    for seed in range(part, 15, 3):
        given = mechanism(seed)
        model = lagcli.load_text(given.text)
        impacts += sum(judge(given, model, law) for law in LAWS)
    assert impacts > 10
