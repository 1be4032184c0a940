"""The reference of a case: an independent program at its tightest, checked by lagcli's own."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from comparison import mechanisms
from comparison.cases import Case
from comparison.measure import Failure, Worker

Array = NDArray[np.float64]
#: Seconds that lagcli's own tight run may take.
_LONGEST = 30.0


@dataclass(frozen=True)
class Reference:
    """q at the sample times; where it comes from, and how far lagcli's is from it."""

    positions: Array
    source: str


def reference(case: Case) -> Reference:
    """Compute a case's reference."""
    from comparison.peers import ours

    positions, source = _independent(case)
    worker = Worker(ours.METHODS[0], case)
    try:
        worker.ask("prepare", 1e-4, timeout=_LONGEST)
        _, own = worker.ask("run", 1e-13, True, timeout=_LONGEST)
    except Failure as failure:
        return Reference(positions, f"{source}; lagcli at 1e-13: {failure}")
    finally:
        worker.close()
    difference = np.abs(own - positions).max()
    return Reference(positions, f"{source}; lagcli at 1e-13 differs from it by {difference:.1e}")


def _independent(case: Case) -> tuple[Array, str]:
    if find_spec("heyoka"):
        from comparison.peers.heyoka import Taylor, unfit

        if not unfit(case):
            solver = Taylor(case, compact=True)
            # stiff: many steps, and errors that are damped; double precision does
            number, tolerance = (np.float64, 1e-16) if case.stiff else (np.longdouble, 1e-19)
            positions = solver.positions(solver.at(tolerance, number)())
            kind = "double" if case.stiff else "extended"
            return positions.astype(float), f"heyoka, {kind} precision, tolerance {tolerance:g}"
    if case.geometry is mechanisms.chain and find_spec("numba"):
        from comparison import chain_loops

        fill = chain_loops.rate(case.start.parameters)

        def rate(t: float, y: Array) -> Array:
            out = np.empty_like(y)
            fill(t, y, out)
            return out

        name = "the chain written by hand"
    else:
        from comparison.peers import by_hand

        rate, name = by_hand.rate(case), "lambdify"
    from comparison.peers.by_hand import SolveIvp

    solver = SolveIvp(case, "DOP853", lambda case: rate)
    return solver.positions(solver.at(1e-13)()), f"SciPy's DOP853, {name}, tolerance 1e-13"
