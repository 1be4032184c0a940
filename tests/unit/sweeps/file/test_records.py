"""Results of rows as bytes."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.sweeps.file.journal import decode, encode
from lagcli.sweeps.row_results import MISSING, Results


def results() -> Results:
    return Results(
        numbers=np.array([4, 2]),
        status=np.array([0, 1], dtype=np.int8),
        messages=["", "it failed: ‖φ‖"],
        counts=np.arange(6).reshape(2, 3),
        measures=np.array([[0.1], [np.nan]]),
        kept=np.arange(12.0).reshape(2, 3, 2),
    )


def test_records_read_as_they_were_written() -> None:
    found = decode(encode(results()), rows=5, measures=1)
    for before, after in zip(results(), found, strict=True):
        np.testing.assert_array_equal(before, after)


@pytest.mark.parametrize(
    "changed",
    [
        {"numbers": np.array([5, 2])},  # of five rows, there is none of this number
        {"numbers": np.array([-1, 2])},
        {"status": np.array([0, MISSING], dtype=np.int8)},
    ],
)
def test_rows_and_statuses_must_be_known(changed: dict[str, np.ndarray]) -> None:
    with pytest.raises(ValueError, match=r"rows that|unknown status"):
        decode(encode(results()._replace(**changed)), rows=5, measures=1)


def test_records_of_another_size_are_rejected() -> None:
    whole = encode(results())
    for record, rows, measures in (
        (whole, 5, 2),  # other measures
        (whole, 1, 1),  # fewer rows
        (whole + b"\0", 5, 1),
        (whole[:-1], 5, 1),
        (whole[:4], 5, 1),
        (b"", 5, 1),
    ):
        with pytest.raises(ValueError):  # noqa: PT011 - NumPy says some of them
            decode(record, rows, measures)
