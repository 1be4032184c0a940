"""Times of contact events are as exact as the tolerance requires."""

from __future__ import annotations

import numpy as np

from tests.benchmark.contact_convergence import EVENTS, draw, errors


def test_errors_of_event_times_follow_the_tolerance(tmp_path) -> None:
    tolerances = np.array([1e-5, 1e-8, 1e-11])
    found = errors(tolerances, lambda text: None)
    assert np.isfinite(found).all()
    # the tolerance is that of one step; all these times are of the order of 1 s
    assert (found < np.maximum(100 * tolerances, 1e-13)[:, None]).all(), found
    # what is not exact at once gains two digits of three
    rough = found[0] > 1e-10
    assert rough.sum() > len(EVENTS) // 2
    assert (found[2, rough] < 1e-4 * found[0, rough]).all(), found
    draw(np.full((11, len(EVENTS)), 1e-9), tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000
