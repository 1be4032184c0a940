"""Values of options that several commands have."""

from __future__ import annotations

from pathlib import Path

import pytest

from lagcli.cli.options import assignments, refuse_same_file
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


def test_a_model_is_not_overwritten_by_its_result(tmp_path: Path) -> None:
    model = tmp_path / "model.yaml"
    model.write_text("T: 0")
    (tmp_path / "link.h5").symlink_to(model)
    with pytest.raises(UsageError, match="is the model itself"):
        refuse_same_file(str(model), str(tmp_path / "link.h5"))
    for output in (None, "-", str(tmp_path / "other.h5")):
        refuse_same_file(str(model), output)
