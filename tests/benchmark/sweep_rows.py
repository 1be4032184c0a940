"""Rows of a sweep per second and processor, compared with single runs and hand-written code.

    python tests/benchmark/sweep_rows.py [ROWS]

The slider-crank, 10 s, rtol 1e-8, 1001 samples, measures only. CPU time of one process each; the
three take turns, so that what else the machine does falls on all alike. The promises are 3 times
the rows of single runs, and 300 times those of a loop of lambdify and solve_ivp.

Then models that need more than lanes: large and spatial ones, redundant constraints, contacts; 201
samples, their own duration, beside single runs whose programs are prepared.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
from comparison.cases import CASES
from comparison.peers.by_hand import rate
from scipy.integrate import solve_ivp

import lagcli
from lagcli.engine.integrate.engine import integrate
from lagcli.settings.settings import SettingsOverrides
from lagcli.sweeps.plan.plan import Spec, make_plan
from lagcli.sweeps.row_results import COMPLETED
from lagcli.sweeps.rows.rows import Runner

CASE = CASES["slider_crank"]
T_END, SAMPLES, RTOL = 10.0, 1001, 1e-8
TURNS = 5
SINGLE, BY_HAND = 40, 2  # rows per turn
ROOT = Path(__file__).parents[2]
#: Files of models, and what is varied.
OTHERS = {
    "tests/found/stewart.yaml": ["m=40..60 kg", "w=2..4 rad/s"],
    "tests/found/whipple_bicycle.yaml": ["mB=80..90 kg", "mH=3..5 kg"],
    "tests/found/bennett.yaml": ["m=0.5..2 kg", "g=9..11 m/s^2"],
    "models/parallelogram.yaml": ["m=0.5..2 kg", "l=0.4..0.6 m"],
    "tests/found/door_two_hinges.yaml": ["m=10..30 kg", "gx=1..2 m/s^2"],
    "models/contact/bouncing_ball.yaml": ["e=0.6..0.8", "m=1..3 kg"],
    "models/contact/sliding_ladder.yaml": ["m=0.5..2 kg"],
}
OTHER_ROWS, OTHER_SINGLE = 200, 10


def runner(rows: int) -> Runner:
    """Return what runs rows over mass, length and start."""
    model = CASE.load()
    vary = ["m=0.5..2", "l=0.25..0.35", "phi'=11..13"]
    texts = ("max(abs(lambda.guide))", "final(phi)", "rms(phi')")
    settings = SettingsOverrides(t_end=T_END, samples=SAMPLES, rtol=RTOL)
    plan = make_plan(model, vary, f"random:{rows}", 1)
    return Runner(
        Spec(model.text, "", {}, {}, settings, plan, tuple((x, x) for x in texts), "measures")
    )


def seconds(work: Callable[[], object]) -> float:
    """Return the CPU time of some work."""
    began = time.process_time()
    work()
    return time.process_time() - began


def compare(file: str, vary: list[str]) -> tuple[float, float]:
    """Return the CPU time of a row of a sweep and of a single run, s."""
    text = (ROOT / file).read_text(encoding="utf-8")
    model = lagcli.load_text(text, ROOT / file)
    plan = make_plan(model, vary, f"random:{OTHER_ROWS}", 1)
    measures = tuple((x, x) for x in (f"final({model.coordinate_names[0]})",))
    settings = SettingsOverrides(samples=201)
    sweep = Runner(Spec(text, str(ROOT / file), {}, {}, settings, plan, measures, "measures"))
    group, table = sweep.group(()), plan.rows(np.arange(OTHER_SINGLE))
    values = group.variants.values(group.columns, table)

    def together() -> None:
        sweep.run(np.arange(OTHER_ROWS), lambda: None)

    def singly() -> None:
        for place in range(OTHER_SINGLE):
            simulation = group._simulation(place, table[place], values)
            integrate(simulation.system, simulation.request, lambda block: None)

    sweep.run(np.arange(8), lambda: None)  # makes all ready
    singly()
    taken = [(seconds(together) / OTHER_ROWS, seconds(singly) / OTHER_SINGLE) for _ in range(TURNS)]
    lanes, single = (min(x) for x in zip(*taken, strict=True))
    return lanes, single


def main() -> None:
    """Print seconds per row and ratios."""
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    sweep = runner(rows)
    group = sweep.group(())
    function, start = rate(CASE), CASE.start
    times, begin = np.linspace(0, T_END, SAMPLES), np.concatenate([start.q, start.v])

    def check_cancelled() -> None:
        pass

    def together() -> None:
        results = sweep.run(np.arange(rows), check_cancelled)
        assert (results.status == COMPLETED).all()

    def singly() -> None:
        table = sweep.spec.plan.rows(np.arange(SINGLE))
        values = group.variants.values(group.columns, table)
        for place in range(SINGLE):
            group.measured(group.single(place, table[place], values, check_cancelled))

    def by_hand() -> None:
        for _ in range(BY_HAND):
            found = solve_ivp(function, (0, T_END), begin, "DOP853", times, rtol=RTOL, atol=RTOL)
            assert found.success
            np.abs(found.y).max()

    sweep.run(np.arange(8), check_cancelled)  # makes all ready
    taken = [
        [
            seconds(work) / count
            for work, count in ((together, rows), (singly, SINGLE), (by_hand, BY_HAND))
        ]
        for _ in range(TURNS)
    ]
    lanes, single, hand = (median(x) for x in zip(*taken, strict=True))
    print(
        f"sweep of the slider-crank, {rows} rows: {1e3 * lanes:.3f} ms per row and processor"
        f" ({1 / lanes:.0f} rows/s); single runs {1e3 * single:.2f} ms: ratio"
        f" {single / lanes:.1f} (promised 3); lambdify + solve_ivp {1e3 * hand:.0f} ms: ratio"
        f" {hand / lanes:.0f} (promised 300)"
    )
    for file, vary in OTHERS.items():
        lanes, single = compare(file, vary)
        print(
            f"sweep of {Path(file).stem}: {1e3 * lanes:.2f} ms per row; single runs"
            f" {1e3 * single:.2f} ms: ratio {single / lanes:.1f} (promised 3)"
        )


if __name__ == "__main__":
    main()
