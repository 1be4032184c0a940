"""Named tuples behave as those of `typing`, whatever their fields, defaults and members."""

from __future__ import annotations

import copy
import pickle
import typing
from typing import Annotated, get_type_hints

import pytest

from lagcli import named_tuples


class Fields(named_tuples.NamedTuple):
    """A record."""

    first: int
    second: str | None
    third: Annotated[float, "m"] = 2.0
    fourth: tuple[int, ...] = ()

    @property
    def total(self) -> float:
        """A property."""
        return self.first + self.third

    @classmethod
    def of(cls, text: str) -> Fields:
        """Another constructor."""
        return cls(1, text)

    def __bool__(self) -> bool:
        return bool(self.first)


class Standard(typing.NamedTuple):
    """A record."""

    first: int
    second: str | None
    third: Annotated[float, "m"] = 2.0
    fourth: tuple[int, ...] = ()


class Empty(named_tuples.NamedTuple):
    """Nothing."""


class TestNamedTuple:
    @pytest.mark.parametrize(
        "values",
        [
            ((1, "a"), {}),
            ((1,), {"second": None}),
            ((), {"first": 3, "second": "b", "fourth": (1, 2)}),
            ((1, "a", 3.0, (4,)), {}),
        ],
    )
    def test_is_the_tuple_that_typing_makes(self, values):
        positional, named = values
        ours, theirs = Fields(*positional, **named), Standard(*positional, **named)
        assert tuple(ours) == tuple(theirs)
        assert repr(ours) == repr(theirs).replace("Standard", "Fields")
        assert ours._asdict() == theirs._asdict()
        assert ours._replace(first=9) == theirs._replace(first=9)
        assert (ours.first, ours.second, ours.third, ours.fourth) == tuple(ours)

    @pytest.mark.parametrize(
        "values", [((), {}), ((1,), {}), ((1, 2, 3, 4, 5), {}), ((1, 2), {"x": 1})]
    )
    def test_refuses_what_typing_refuses(self, values):
        positional, named = values
        for cls in (Fields, Standard):
            with pytest.raises(TypeError):
                cls(*positional, **named)

    def test_describes_itself_as_typing_does(self):
        for name in (
            "_fields",
            "_field_defaults",
            "__doc__",
            "__match_args__",
            "__module__",
            "__slots__",
        ):
            assert getattr(Fields, name) == getattr(Standard, name), name
        assert Fields.__qualname__ == Fields.__name__ == "Fields"
        ours, theirs = (get_type_hints(cls, include_extras=True) for cls in (Fields, Standard))
        assert ours == theirs

    def test_has_members_and_no_further_attributes(self):
        record = Fields.of("x")
        assert (record.total, bool(record), bool(record._replace(first=0))) == (3.0, True, False)
        assert not Empty()
        with pytest.raises(AttributeError):
            record.first = 2  # type: ignore[misc]
        with pytest.raises(AttributeError):
            record.other = 2  # type: ignore[attr-defined]

    def test_is_copied_and_pickled(self):
        record = Fields(1, "a", fourth=(1, 2))
        assert copy.deepcopy(record) == record
        again = pickle.loads(pickle.dumps(record))
        assert type(again) is Fields
        assert again == record
