"""Kinds of settings: what each takes, and how it says what is wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from lagcli.errors import UsageError
from lagcli.settings.kinds import (
    Choice,
    CompleteValues,
    Flag,
    GivenValues,
    Names,
    RealNumber,
    SettingValues,
    Times,
    Tolerances,
    WholeNumber,
    between,
    not_negative,
    plain,
    positive,
)


class Declared(SettingValues):
    step = RealNumber[float | None]("step, {unit}", 0.5, unit="s", check=positive)
    count = WholeNumber[int]("how many", 3, check=between(1, 1e8, "take 1", "take fewer"))
    method = Choice[str]("method", "Radau", choices=("Radau", "Taylor"))
    quiet = Flag("print nothing", False)
    times = Times("when")
    atol = Tolerances("tolerance", check=not_negative)
    names = Names("which")


class Given(Declared, GivenValues):
    pass


class Complete(Declared, CompleteValues):
    pass


def wrong(name: str, value: Any) -> list[str]:
    setting = Given.DECLARED[name]
    return [str(error) for error in setting.problems(setting.convert(value))]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("step", 1),
        ("step", np.float64(1e-9)),
        ("count", np.int64(4)),
        ("method", "Taylor"),
        ("quiet", True),
        ("times", [0, 1.5]),
        ("atol", {"x": 0.0, "y'": 1e-9}),
        ("names", "x"),
    ],
)
def test_values_in_range(name: str, value: Any) -> None:
    assert wrong(name, value) == []


@pytest.mark.parametrize(
    ("name", "value", "kept"),
    [
        ("step", np.float32(0.5), 0.5),
        ("step", np.array(0.5), 0.5),
        ("step", Fraction(1, 4), 0.25),
        ("step", Decimal("0.5"), 0.5),
        ("step", 2, 2),
        ("count", np.int64(3), 3),
        ("count", np.array(3), 3),
        ("atol", np.float64(1e-9), 1e-9),
        ("atol", {"x": np.float64(1e-9)}, {"x": 1e-9}),
        ("times", np.array([0, 1], dtype=np.float32), (0.0, 1.0)),
    ],
)
def test_numbers_of_other_types_are_kept_as_those_of_python(
    name: str, value: Any, kept: object
) -> None:
    found = Given(**{name: value}).__dict__[name]
    assert repr(found) == repr(kept)


@pytest.mark.parametrize(
    ("name", "value"), [("times", ["0", "1"]), ("times", "01"), ("times", 1.0), ("names", 3)]
)
def test_what_is_no_list_is_an_error(name: str, value: Any) -> None:
    with pytest.raises(UsageError, match=f"{name} must be"):
        Given(**{name: value})


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("step", 0, "step must be greater than 0, not 0"),
        ("step", True, "step must be a number, not True"),
        ("step", "1", "step must be a number, not '1'"),
        ("step", math.inf, "step must be a finite number, not inf"),
        ("step", np.array([1.0]), "step must be a number, not array([1.])"),
        ("step", 10**400, "step must be a finite number, not inf"),
        ("step", np.float32(-1), "step must be greater than 0, not -1"),
        ("count", np.array([3]), "count must be a whole number, not array([3])"),
        ("count", np.float64(3), "count must be a whole number, not np.float64(3.0)"),
        ("count", -(10**400), f"count must lie between 1 and 10^8, not -1{'0' * 400}"),
        ("method", ["Taylor"], "there is no method `['Taylor']`"),
        ("count", 1.0, "count must be a whole number, not 1.0"),
        ("count", 0, "count must lie between 1 and 10^8, not 0"),
        ("method", "taylor", "there is no method `taylor`"),
        ("quiet", 1, "quiet must be true or false, not 1"),
        ("times", [], "times must hold at least one time"),
        ("times", [1, 1], "times must increase"),
        ("times", [0, math.nan], "times must be finite numbers"),
        ("atol", {"x": 1.0, "y": -1.0}, "atol of `y` must not be negative, not -1"),
        ("names", ["x", " "], "names must be a list of names, not ['x', ' ']"),
    ],
)
def test_values_out_of_range(name: str, value: Any, message: str) -> None:
    assert wrong(name, value) == [message]


def test_help_depends_on_the_side_that_is_exceeded() -> None:
    count = Given.DECLARED["count"]
    assert [e.help for v in (0, 2 * 10**8) for e in count.problems(v)] == ["take 1", "take fewer"]
    method = Given.DECLARED["method"]
    assert [e.help for v in ("taylor", "Euler") for e in method.problems(v)] == [
        "did you mean `Taylor`?",
        "known are Radau, Taylor",
    ]


def test_defaults_are_stated_where_there_are_some() -> None:
    stated: Mapping[str, str] = {name: x.stated for name, x in Given.DECLARED.items()}
    assert stated["step"] == "0.5"
    assert stated["method"] == "Radau"
    assert stated["quiet"] == stated["times"] == ""
    assert Given.DECLARED["step"].help == "step, s"
    assert [plain(x) for x in (1e-9, 1e8, 0.25, 3, "auto")] == ["1e-9", "10^8", "0.25", "3", "auto"]


def test_given_values_are_partial_and_complete_ones_are_not() -> None:
    given = Given(step=1.0, names="x", count=None)
    assert (given.step, given.names, given.count) == (1.0, ("x",), None)
    assert "count" not in vars(given)
    assert "count" in vars(Complete(step=1.0))
    assert given.replace(step=None, count=2).count == 2
    assert given.replace(step=None).step is None
    with pytest.raises(UsageError, match="no setting `steps`; did you mean `step`"):
        Given(steps=1)
    with pytest.raises(UsageError, match="times must be numbers"):
        Given(times=["a"])
    with pytest.raises(AttributeError, match="do not change"):
        given.step = 2.0
