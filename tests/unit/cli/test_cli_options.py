"""Values of options that several commands have."""

from __future__ import annotations

import pytest

from lagcli.cli.options import assignments
from lagcli.errors import UsageError


def test_assignments_are_split_at_the_first_equals_sign() -> None:
    assert assignments("--set", [" m = 2 kg", "c=if(a == b, 1, 2)"]) == {
        "m": "2 kg",
        "c": "if(a == b, 1, 2)",
    }
    assert assignments("--set", None) == {}


@pytest.mark.parametrize("item", ["m", "m=", "=2", " = "])
def test_an_assignment_needs_a_name_and_a_value(item: str) -> None:
    with pytest.raises(UsageError, match=r"--set .* is not of the form NAME=VALUE"):
        assignments("--set", [item])


def test_a_name_is_given_once() -> None:
    with pytest.raises(UsageError, match="--set gives `m` twice: 1 and 2"):
        assignments("--set", ["m=1", "m=2"])
