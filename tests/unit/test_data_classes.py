"""Data classes behave as those of `dataclasses`, as far as they are used."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from functools import cached_property
from types import ModuleType

import pytest

from lagcli import data_classes


def classes(module: ModuleType) -> tuple[type, type, type]:
    """Return the same classes as a module defines them."""

    @module.dataclass(frozen=True, eq=False, repr=False)
    class Plain:
        """A class."""

        first: int
        second: list[int]
        third: str = "c"
        fourth: dict[str, int] = module.field(default_factory=dict, metadata={"unit": "m"})

        @cached_property
        def total(self) -> int:
            return self.first + sum(self.second)

    @module.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
    class Named:
        zeroth: float = 0.0
        fifth: float

    @module.dataclass(kw_only=True, eq=False, repr=False)
    class Changing:
        last: int = 7
        other: set[int] = module.field(default_factory=set)

    return Plain, Named, Changing


OURS, THEIRS = classes(data_classes), classes(dataclasses)


@data_classes.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Base:
    a: int
    b: int = 2


@data_classes.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Other:
    c: int


@data_classes.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Joined(Other, Base):
    b: int = 3
    d: int


class TestDataclass:
    @pytest.mark.parametrize(
        ("place", "values", "named"),
        [
            (0, (1, [2]), {}),
            (0, (1,), {"second": [3], "fourth": {"x": 1}}),
            (0, (1, [2], "d", {}), {}),
            (0, (), {"third": "e", "second": [], "first": 5}),
            (1, (), {"fifth": 1.0}),
            (2, (), {}),
            (2, (), {"last": 1}),
        ],
    )
    def test_objects_have_the_values_that_dataclasses_gives_them(self, place, values, named):
        ours, theirs = (cls[place](*values, **named) for cls in (OURS, THEIRS))
        assert list(vars(ours).items()) == list(vars(theirs).items())

    @pytest.mark.parametrize(
        ("place", "values", "named"),
        [
            (0, (1,), {}),
            (0, (), {}),
            (0, (1, [2], "c", {}, 5), {}),
            (0, (1, [2]), {"first": 1}),
            (0, (1, [2]), {"fifth": 1}),
            (1, (1.0, 2.0), {}),
            (1, (), {"zeroth": 1.0}),
        ],
    )
    def test_refuses_the_arguments_that_dataclasses_refuses(self, place, values, named):
        for cls in (OURS, THEIRS):
            with pytest.raises(TypeError):
                cls[place](*values, **named)

    def test_frozen_objects_cannot_be_changed(self):
        for cls in (OURS, THEIRS):
            record = cls[0](1, [2])
            with pytest.raises(dataclasses.FrozenInstanceError):
                record.first = 2
            with pytest.raises(dataclasses.FrozenInstanceError):
                del record.first
            assert (record.first, record.total) == (1, 3)
            changing = cls[2]()
            changing.last = 1
            assert changing.last == 1

    def test_defaults_are_made_for_each_object(self):
        one, other = OURS[2](), OURS[2]()
        one.other.add(1)
        assert other.other == set()

    def test_is_compared_as_an_object(self):
        record = OURS[0](1, [2])
        assert record == record != OURS[0](1, [2])
        assert len({record, copy.copy(record)}) == 2

    def test_inherits_fields_as_dataclasses_do(self):
        assert [x.name for x in data_classes.fields(Joined)] == ["a", "b", "c", "d"]
        assert vars(Joined(a=1, c=4, d=5)) == {"a": 1, "b": 3, "c": 4, "d": 5}
        assert vars(Base(a=1)) == {"a": 1, "b": 2}

    def test_is_copied_and_pickled(self):
        record = Joined(a=[1], c=2, d=3)
        for again in (copy.deepcopy(record), pickle.loads(pickle.dumps(record))):
            assert type(again) is Joined
            assert vars(again) == vars(record)
            assert again.a is not record.a

    @pytest.mark.parametrize("options", [{"repr": False}, {"eq": False}])
    def test_says_what_it_does_not_do(self, options):
        with pytest.raises(AssertionError):
            data_classes.dataclass(**options)


class TestReplace:
    @pytest.mark.parametrize("module", [data_classes, dataclasses])
    def test_changes_some_fields(self, module):
        record = OURS[0](1, [2], fourth={"x": 1})
        assert record.total == 3
        again = module.replace(record, first=4)
        assert vars(again) == {"first": 4, "second": [2], "third": "c", "fourth": {"x": 1}}
        assert again.total == 6
        with pytest.raises(TypeError):
            module.replace(record, fifth=4)


class TestFields:
    def test_are_those_of_dataclasses(self):
        for theirs, described in zip(THEIRS, OURS, strict=True):
            expected = [(x.name, x.type, dict(x.metadata)) for x in dataclasses.fields(theirs)]
            for module in (data_classes, dataclasses):
                found = module.fields(described)
                assert [(x.name, x.type, dict(x.metadata or {})) for x in found] == expected
        assert dataclasses.is_dataclass(OURS[0])
