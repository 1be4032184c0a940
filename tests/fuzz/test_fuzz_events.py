"""Many random models with known events: none missed, none found twice."""

from __future__ import annotations

import pytest
from known_event_cases import EVENT_CASES
from known_events import judge, summary
from known_force_cases import FORCE_CASES
from known_rest_cases import REST_CASES
from random_cases import FUZZ_COUNT

CASES = {**EVENT_CASES, **FORCE_CASES, **REST_CASES}
#: Ten times as many cases as other tests try: each takes a few hundredths of a second.
PER_KIND = 10 * FUZZ_COUNT // len(CASES) + 1


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", CASES)
def test_no_event_of_many_is_missed_or_found_twice(kind: str) -> None:
    judged = [(case, judge(case)) for case in map(CASES[kind], range(1000, 1000 + PER_KIND))]
    print(summary(judged))
    wrong = [(v, case) for case, v in judged if not v.right]
    shown = "\n".join(f"{v}: {case}" for v, case in wrong[:5])
    assert not wrong, f"{len(wrong)} of {len(judged)} are wrong:\n{summary(judged)}\n{shown}"
