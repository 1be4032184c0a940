"""Named tuples that are defined quickly.

`typing.NamedTuple` compiles the annotation of each field and the constructor of each class, which
takes ten times as long as the rest of the definition, at every start. Here, annotations are left as
they are, and constructors are compiled once for each number of fields.
"""

from __future__ import annotations

from functools import cache
from types import FunctionType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typing import NamedTuple as NamedTuple
else:
    from collections import _tuplegetter, namedtuple

    class _NamedFields(tuple):
        """The methods of named tuples, as `collections.namedtuple` defines them."""

        __slots__ = ()

        @classmethod
        def _make(cls, values):
            made = tuple.__new__(cls, values)
            if len(made) != len(cls._fields):
                raise TypeError(f"Expected {len(cls._fields)} arguments, got {len(made)}")
            return made

        def _replace(self, /, **changes):
            made = self._make(map(changes.pop, self._fields, self))
            if changes:
                raise ValueError(f"Got unexpected field names: {list(changes)!r}")
            return made

        def _asdict(self):
            return dict(zip(self._fields, self, strict=True))

        def __repr__(self):
            fields = zip(self._fields, self, strict=True)
            return f"{type(self).__name__}({', '.join(f'{name}={x!r}' for name, x in fields)})"

        def __getnewargs__(self):
            return tuple(self)

    @cache
    def _constructor(count: int) -> FunctionType:
        """Return the constructor of tuples of some number of fields."""
        return namedtuple("_", [f"field{i}" for i in range(count)]).__new__

    class _Definition(type):
        """Makes a named tuple of a class; fields with defaults are the last, which mypy checks."""

        def __new__(cls, name: str, bases: tuple[type, ...], body: dict[str, Any]) -> type:
            fields = tuple(body.get("__annotations__", ()))
            defaults = {field: body[field] for field in fields if field in body}
            like = _constructor(len(fields))
            code = like.__code__.replace(
                co_name="__new__", co_qualname=f"{name}.__new__", co_varnames=("_cls", *fields)
            )
            body |= {field: _tuplegetter(i, None) for i, field in enumerate(fields)}
            body["__new__"] = FunctionType(code, like.__globals__, None, tuple(defaults.values()))
            body["__slots__"] = ()
            body["__match_args__"] = body["_fields"] = fields
            body["_field_defaults"] = defaults
            return type(name, (_NamedFields,), body)

    NamedTuple = type.__new__(_Definition, "NamedTuple", (), {})
