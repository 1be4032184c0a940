"""Measures of contacts and events: what they name, and their errors."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.errors import ModelError
from lagcli.model.measures import EventMeasure, read_measures
from lagcli.model.model import Model
from tests.support.switching_models import BALL


@pytest.fixture(scope="module")
def model() -> Model:
    return lagcli.load_text(BALL)


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        ("count(floor impacts)", EventMeasure("count", "floor", "impact")),
        ("time_of( floor  opens )", EventMeasure("time_of", "floor", "opens")),
        ("count(floor sticks)", EventMeasure("count", "floor.slip", "sticks")),
        ("time_of(floor.slip slips)", EventMeasure("time_of", "floor.slip", "slips")),
        ("impulse.floor", EventMeasure("impulse", "floor")),
        ("impulse.floor.slip", EventMeasure("impulse", "floor.slip")),
        ("impulse.wall", EventMeasure("impulse", "wall")),
        ("count(late)", EventMeasure("count", "late", "event")),
        ("time_of(late)", EventMeasure("time_of", "late", "event")),
    ],
)
def test_what_is_asked(model: Model, text: str, asked: EventMeasure) -> None:
    (measure,) = read_measures(model, [(text, text)])
    assert [r.event for r in measure.reductions] == [asked]


def test_in_expressions_with_other_measures(model: Model) -> None:
    text = "impulse.floor/(count(floor impacts)*m) + max(y) + time_of(y < 0.5)"
    (measure,) = read_measures(model, [(text, text)])
    kinds = [r.kind for r in measure.reductions]
    assert kinds == ["impulse", "count", "max", "time_of"]
    assert [r.event is None for r in measure.reductions] == [False, False, True, True]


@pytest.mark.parametrize(
    ("text", "message", "column"),
    [
        ("count(flooor impacts)", "no constraint `flooor`", 7),
        ("1 + time_of(wall opens)", "`wall` has no contact", 13),
        ("count(wall slips)", "no friction and no limit", 7),
        ("count(early)", "no event `early`", 7),
        ("2*impulse.roof", "no constraint `roof`", 11),
        ("count(floor impacts) + yy", "yy", 24),
    ],
)
def test_mistakes(model: Model, text: str, message: str, column: int) -> None:
    with pytest.raises(ModelError) as raised:
        read_measures(model, [(text, text)])
    (diagnostic,) = raised.value.diagnostics
    assert message in diagnostic.message
    assert diagnostic.location is not None
    assert diagnostic.location.column == column
