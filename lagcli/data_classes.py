"""Data classes that are defined quickly.

`dataclasses.dataclass` writes and compiles the source of a constructor for each class, at every
start. Here, all classes share one constructor, which takes a few microseconds longer to call.
Equality is that of objects, and there is no representation, because the classes contain arrays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
    from dataclasses import field as field
    from dataclasses import fields as fields
    from dataclasses import replace as replace
else:

    class field:
        """A field; its default may be made for each object."""

        def __init__(self, *, default_factory=None, metadata=None):
            self.name, self.type = "", ""
            self.default_factory, self.metadata = default_factory, metadata

    class _StandardFields:
        """The fields of a class as the functions of `dataclasses` need them, made on demand."""

        def __get__(self, record, cls):
            from dataclasses import field, make_dataclass

            given = [(x.name, x.type, field(metadata=x.metadata)) for x in cls._fields.values()]
            cls.__dataclass_fields__ = make_dataclass(cls.__name__, given).__dataclass_fields__
            return cls.__dataclass_fields__

    def dataclass(*, frozen=False, kw_only=False, eq=True, repr=True):
        """Return the decorator of data classes; see `dataclasses.dataclass`."""
        assert not eq, "these classes are compared as objects"
        assert not repr, "these classes have no representation"

        def decorate(cls):
            cls._fields = {}
            for base in reversed(cls.__bases__):
                cls._fields |= getattr(base, "_fields", {})
            for name, annotation in cls.__annotations__.items():
                declared = vars(cls).get(name)
                if isinstance(declared, field):
                    delattr(cls, name)
                else:
                    declared = field()
                declared.name, declared.type = name, annotation
                cls._fields[name] = declared
            cls._positional = () if kw_only else tuple(cls._fields)
            cls.__init__ = _initialize
            cls.__dataclass_fields__ = _StandardFields()
            if frozen:
                cls.__setattr__ = cls.__delattr__ = _refuse
            return cls

        return decorate

    def _initialize(self, *values, **named):
        """Set the fields of an object."""
        cls = type(self)
        if len(values) > len(cls._positional):
            raise TypeError(f"{cls.__name__} takes at most {len(cls._positional)} values in order")
        for name, value in zip(cls._positional, values, strict=False):
            if name in named:
                raise TypeError(f"{cls.__name__} got two values of {name}")
            named[name] = value
        own = vars(self)
        for name, declared in cls._fields.items():
            if name in named:
                own[name] = named.pop(name)
            elif declared.default_factory is not None:
                own[name] = declared.default_factory()
            elif hasattr(cls, name):
                own[name] = getattr(cls, name)
            else:
                raise TypeError(f"{cls.__name__} got no value of {name}")
        if named:
            raise TypeError(f"{cls.__name__} has no field {next(iter(named))}")

    def _refuse(self, name, *_):
        """Raise the error of frozen data classes."""
        from dataclasses import FrozenInstanceError

        raise FrozenInstanceError(f"cannot change {name} of a {type(self).__name__}")

    def fields(cls):
        """Return the fields of a data class."""
        return tuple(cls._fields.values())

    def replace(record, **changes):
        """Return a copy of a data class with other values of some fields."""
        return type(record)(**{name: getattr(record, name) for name in record._fields} | changes)
