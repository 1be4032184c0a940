"""The core of runs that switch, kept for the next run with other values.

To create a core takes longer than a short run: its rules, programs and arrays are copied from
Python. A kept one goes back to its state before the start and takes the next run's values; its
results are those of a new core, to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from lagcli.engine.core.switching import SwitchingIntegrator
    from lagcli.engine.integrate.prepared import Prepared

#: Fields of a problem that may differ between runs of a core.
_OWN = ("parameters", "y", "sizes", "lengths", "plain_lengths")


class _Ready(NamedTuple):
    """A core before its start, and what it was made of."""

    core: SwitchingIntegrator
    saved: bytes
    prepared: Prepared
    problem: dict[str, Any]
    clocks: Sequence[Any]


class KeptCore:
    """The core of the last run, if there is one that a next run may use."""

    def __init__(self) -> None:
        self._ready: _Ready | None = None

    def take(
        self, prepared: Prepared, problem: dict[str, Any], clocks: Sequence[Any]
    ) -> SwitchingIntegrator | None:
        """Return the core for another run; None if that needs one of its own.

        Parameters
        ----------
        prepared : Prepared
            Its programs.
        problem : dict
            As for `Integrator`.
        clocks : sequence
            As for `SwitchingIntegrator`.
        """
        ready = self._ready
        if ready is None or ready.prepared is not prepared or ready.clocks != clocks:
            return None
        if not all(
            _same(x, ready.problem[name]) for name, x in problem.items() if name not in _OWN
        ):
            return None
        try:
            ready.core.begin_again(ready.saved, problem)
        except ValueError:  # it was given other equations, or another method, on its way
            self._ready = None
            return None
        return ready.core

    def keep(
        self,
        core: SwitchingIntegrator,
        prepared: Prepared,
        problem: dict[str, Any],
        clocks: Sequence[Any],
    ) -> None:
        """Keep a core that has not started; the parameters as in `take`."""
        self._ready = _Ready(core, core.save(), prepared, problem, clocks)


def _same(one: Any, other: Any) -> bool:
    return one is other or np.array_equal(one, other)
