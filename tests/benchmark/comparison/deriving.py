"""Derivation: lagcli compared with sympy.physics.mechanics, and its growth with the model."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from comparison import models
from comparison.cases import MODELS, chain
from comparison.peers import ours

LINKS = 10
#: Lengths of the chains whose costs are compared.
LENGTHS = (20, 50, 100, 200, 500)
#: Steps of DOP853, of twelve right-hand sides each, from which the cost of one is taken.
_STEPS = 20
#: Seconds that they may take before longer chains are left out.
_LONGEST = 2.0


@dataclass(frozen=True)
class Derivation:
    """Seconds to derive the pendulum of ten links; None where there was no result in time."""

    lagcli: float
    sympy: float | None


@dataclass(frozen=True)
class Growth:
    """Costs of a chain: s to load and derive it, s to compile it, s per right-hand side."""

    bodies: int
    load_and_derive: float
    compile: float
    evaluation: float


def median(run: Callable[[], object], times: int) -> float:
    """Return the median wall time of a function, s."""
    seconds = []
    for _ in range(times):
        began = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - began)
    return statistics.median(seconds)


def derive_by_lagcli() -> float:
    """Load and derive the pendulum of ten links; s."""
    import lagcli

    text = models.pendulum_of_links(LINKS)
    return median(lambda: lagcli.derive(lagcli.load_text(text)), 5)


def derive_by_sympy(connection: multiprocessing.connection.Connection) -> None:
    """Derive the same with SymPy's LagrangesMethod; send the seconds."""
    import sympy as sp
    from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

    q = dynamicsymbols(f"q_1:{LINKS + 1}")
    g = sp.Symbol("g")
    masses, lengths = sp.symbols(f"m_1:{LINKS + 1}"), sp.symbols(f"l_1:{LINKS + 1}")
    t = dynamicsymbols._t
    began = time.perf_counter()
    x = y = lagrangian = sp.S.Zero
    for angle, mass, length in zip(q, masses, lengths, strict=True):
        x, y = x + length * sp.sin(angle), y - length * sp.cos(angle)
        lagrangian += mass / 2 * (x.diff(t) ** 2 + y.diff(t) ** 2) - mass * g * y
    LagrangesMethod(lagrangian, q).form_lagranges_equations()
    connection.send(time.perf_counter() - began)


def derivation(timeout: float) -> Derivation:
    """Measure both."""
    own = derive_by_lagcli()
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=derive_by_sympy, args=(sender,), daemon=True)
    process.start()
    sender.close()
    seconds = None
    try:
        if receiver.poll(timeout):
            seconds = receiver.recv()
    except EOFError:
        pass
    process.kill()
    process.join()
    return Derivation(own, seconds)


def growth(lengths: Sequence[int] = LENGTHS) -> list[Growth]:
    """Measure chains of growing length, some steps each; interleaved, medians of three.

    Where one takes longer than the measurement may, it is the last.
    """
    import lagcli
    from lagcli.engine.lowering.lower import lower

    cases = {n: chain(n, 1.0) for n in lengths}
    runs = {}
    seconds: dict[int, list[tuple[float, float, float]]] = {n: [] for n in lengths}
    for round_ in range(3):
        for n, case in cases.items():
            if round_ and n not in runs:
                break
            began = time.perf_counter()
            equations = lagcli.derive(lagcli.load(MODELS / "chain.yaml", {"N": n}))
            derived = time.perf_counter()
            lower(equations)
            compiled = time.perf_counter()
            if n not in runs:
                runs[n] = ours.Ours(case, "DOP853").at(1e-9, max_steps=_STEPS)
            runs[n].make_ready()
            start = time.perf_counter()
            result, _ = runs[n]()
            ran = time.perf_counter() - start
            seconds[n].append((derived - began, compiled - derived, ran / result.evaluations))
            if ran > _LONGEST:
                break
    found = {n: [statistics.median(x) for x in zip(*seconds[n], strict=True)] for n in runs}
    return [Growth(n, *medians) for n, medians in found.items()]
