"""Random sequences of steps, resets and restored states of an FMU, next to an uninterrupted run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from fmi import Instance, Unpacked


def restored_differently(fmu: Unpacked, times: Sequence[float], sequences: int, seed: int) -> int:
    """Return how often a value differs, in its last bit, from that of a run without interruption.

    Each sequence saves the state, maybe as bytes, and goes back to it later: in the same instance,
    after a reset, or in a new one; or goes back to any earlier state.
    """
    rng, names, count = np.random.default_rng(seed), list(fmu.variables), len(times) - 1
    straight = fmu.instance()
    expected = straight.simulate(times, names)
    straight.free()
    count = min(count, len(expected) - 1)
    one = fmu.instance()
    one.begin(times[0])
    at, different, kept = 0, 0, []

    def go_on(steps: int) -> None:
        nonlocal at, different
        for _ in range(min(steps, count - at)):
            one.step(times[at], times[at + 1] - times[at])
            at += 1
            different += not np.array_equal(one.get(*names), expected[at], equal_nan=True)

    for _ in range(sequences):
        content = _serialized(one)
        kept.append((at, content))
        state, back = one.save(), at
        how = int(rng.integers(4))
        if how == 0:
            go_on(int(rng.integers(1, 4)))
            one.restore(state)
            at = back
        elif how == 1:
            one.forget(state)
            one.free()
            one = fmu.instance()
            one.restore_from(content)
            state = one.save()
        elif how == 2:
            one.call("Reset")
            one.restore_from(content)
        else:
            at, content = kept[int(rng.integers(len(kept)))]
            one.restore_from(content)
        one.forget(state)
        different += not np.array_equal(one.get(*names), expected[at], equal_nan=True)
        go_on(int(rng.integers(4)))
    one.free()
    return different


def _serialized(one: Instance) -> bytes:
    state = one.save()
    content = one.serialize(state)
    one.forget(state)
    return content
