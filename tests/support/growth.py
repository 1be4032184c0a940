"""How processor time grows with the size of what is done."""

from __future__ import annotations

from collections.abc import Callable


def assert_growth(
    seconds: Callable[[int], float], sizes: tuple[int, int], factor: float, floor: float = 0.0
) -> None:
    """Assert that the larger of two sizes takes less than a multiple of the time of the smaller.

    Parameters
    ----------
    seconds : callable
        Returns the processor time of a size, s. What else the machine does adds to it now and
        then: the least of three counts, and the larger size is measured until it is short enough.
    sizes : tuple of int
    factor : float
    floor : float
        Seconds that are allowed in addition.
    """
    small, large = sizes
    allowed = factor * min(seconds(small) for _ in range(3)) + floor
    found: list[float] = []
    while len(found) < 3:
        found.append(seconds(large))
        if found[-1] < allowed:
            return
    raise AssertionError(f"{min(found)} s for {large}, allowed are {allowed} s")
